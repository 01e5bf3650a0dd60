/* The surface for the caller: triangles (Lorensen and Cline 1987) and views of it. */
#ifndef FATHOM_SURFACE_H
#define FATHOM_SURFACE_H

#include "map/volume.h"

#define SURFACE_BATCH 256       /* blocks whose triangles are counted together */
#define SURFACE_TRIANGLES 16384 /* triangles in a batch to the callback; a block makes 2560 at most */

typedef struct {
    device_buffer cases; /* marching cubes' table */
    device_buffer counts, offsets;
    device_buffer vertices; /* 18 floats a triangle */
    device_buffer view;     /* normal and depth of a part of a view */
    int view_width, view_height;
    cl_kernel count, emit;
} surface_output;

void surface_init(surface_output *s, device *d, arena *a, const depth_maps *maps);
void surface_close(surface_output *s);

int64_t surface_extract(surface_output *s, device *d, volume *v, float min_weight, fathom_triangles triangles,
                        void *user);

/* Runs both kernels on the first block. */
void surface_warm_up(surface_output *s, device *d, volume *v);

/* Each of depth and normals may be NULL. */
int surface_view(surface_output *s, device *d, volume *v, const fathom_view *view,
                 const pose *camera_to_world, float *depth, float *normals);

/* Marching cubes' table: for each of 256 cases up to five triangles as edges, then 255; see opencl/surface.cl. */
void surface_cases(uint8_t table[256 * 16]);

#endif
