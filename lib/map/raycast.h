/* Model maps of the surface by ray-casting (Newcombe et al. 2011, Section 3.3). */
#ifndef FATHOM_RAYCAST_H
#define FATHOM_RAYCAST_H

#include "frame/depth_maps.h"
#include "map/blocks.h"

typedef struct {
    const volume *from;   /* the volume to ray-cast */
    int tiles;            /* room in ranges */
    device_buffer ranges; /* two ints per tile: the depths where its rays begin and end */
    cl_kernel clear_ranges, range_blocks, raycast, raycast_near, halve_map;
} raycaster;

/* most_tiles: of the largest view that will be cast. */
void raycaster_init(raycaster *r, device *d, arena *a, const volume *from, int most_tiles);
void raycaster_close(raycaster *r);

/* Queues the ray-cast of a model map (normal and depth, row by row) as camera sees it. */
void raycast_view(raycaster *r, device *d, const kernel_camera *camera, const pose *camera_to_world,
                  float near_m, float far_m, device_buffer *model);

/* The same at the scan's pose, limited to surface within reach_m of the scan's depth, as alignment needs it. marched:
 * also where it is further from the scan than the truncation. */
void raycast_near(raycaster *r, device *d, depth_maps *maps, const pose *camera_to_world,
                  float reach_m, bool marched, device_buffer *model);

/* Queues the coarser levels of a model map. */
void raycast_halve(raycaster *r, device *d, const kernel_camera *cameras, device_buffer model[FATHOM_LEVELS],
                   int coarsest);

#endif
