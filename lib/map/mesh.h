/* The surface's triangles by marching cubes (Lorensen and Cline 1987). */
#ifndef FATHOM_MESH_H
#define FATHOM_MESH_H

#include "map/blocks.h"

#define MESH_BATCH 256       /* blocks whose triangles are counted together */
#define MESH_TRIANGLES 16384 /* maximum that is made together */

typedef struct {
    device_buffer cases; /* marching cubes' table */
    device_buffer counts, offsets;
    device_buffer vertices; /* 18 floats per triangle */
    cl_kernel count, emit;
} mesher;

void mesher_init(mesher *m, device *d, arena *a);
void mesher_close(mesher *m);

/* A walk along the blocks of a volume, a number of whole ones at a time. */
typedef struct {
    volume *volume;
    kernel_surface surface;
    int next, end;     /* places */
    int from, counted; /* places whose triangles have been counted */
    cl_int counts[MESH_BATCH];
} mesh_walk;

/* Starts at a place. min_weight: as in fathom_extract_mesh. */
void mesh_walk_start(mesh_walk *w, volume *v, float min_weight, int next);

/* Passes the triangles of the next blocks to the callback, up to `capacity`. Returns their number; 0 at the end, or
 * when the next block has more (see w->next); or an error. */
int mesh_walk_next(mesh_walk *w, mesher *m, device *d, int64_t capacity, fathom_triangles triangles,
                   void *user);

/* Runs both kernels on the first block. */
void mesh_warm_up(mesher *m, device *d, volume *v);

/* Marching cubes' table: for each of 256 cases up to five triangles as edges, then CASE_END; see opencl/mesh.cl. */
void mesh_cases(uint8_t table[256 * CASE_SIZE]);

#endif
