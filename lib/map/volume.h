/* The surface: truncated signed distance in hashed blocks from a fixed pool; allocation, fusion and ray-casting
 * (Curless and Levoy 1996; Newcombe et al. 2011; Niessner et al. 2013). */
#ifndef FATHOM_VOLUME_H
#define FATHOM_VOLUME_H

#include "frame/depth_maps.h"

typedef struct {
    int capacity;              /* blocks in the pool */
    int count;                 /* in use: places 0..count-1, in the order in which they were made */
    int64_t refused;           /* blocks that found the pool full */
    int settled;               /* the first so many blocks have been fused into for SETTLING frames or more */
    int settling;              /* the next to be so */
    int frames;                /* fused */
    int64_t dropped, restored; /* blocks, at the pool's bound */
    bool full;                 /* some were refused by the last allocation */
    kernel_surface surface;
    float max_weight;
    int tiles;            /* of the finest maps */
    device_buffer voxels; /* BLOCK_BYTES a block */
    device_buffer table;  /* the hash: an int4 an entry */
    device_buffer blocks; /* coordinates of each place: an int4 */
    device_buffer seen;   /* the last frame that fused into it: an int */
    device_buffer requests, counts;
    device_buffer farthest; /* largest depth of each tile of the frame that was allocated for last */
    device_buffer ranges;
    device_buffer planes; /* what each pixel of the frame that is fused stands for: 8 bytes */
    cl_kernel request, clear, pack_planes, fuse, clear_ranges, range_blocks, raycast, raycast_near, halve_map;
} volume;

/* Bytes that each block of the pool costs, without the pool's fixed part. */
size_t volume_block_cost(void);

void volume_init(volume *v, device *d, arena *a, const fathom_config *config, const depth_maps *maps,
                 int blocks);
void volume_close(volume *v);

/* Forgets the surface. */
void volume_clear(volume *v, device *d);

/* The entry of block b in the table, or the free one where it belongs. */
cl_int4 *volume_entry(cl_int4 *table, cl_uint mask, const cl_int4 *b);

/* Block b in place `place` of the mapped voxels, as callers see it. */
fathom_block volume_block(const volume *v, const cl_int4 *b, cl_short *voxels, int place);

/* Finds out which blocks the frame's surface needs and lacks; returns how many at most (neighbouring tiles may ask for the
 * same). calm: the camera has hardly moved since the frame before, and half of the frame will do, the other half with the
 * next one. */
int volume_request(volume *v, device *d, depth_maps *maps, const pose *camera_to_world, bool calm);

/* Gives them places as far as there are any, from the returned one on; they are new: nothing seen. */
int volume_allocate(volume *v, device *d);

/* Queues the clearing of blocks: nothing seen. */
void volume_clear_blocks(volume *v, device *d, int first, int count);

/* Queues the fusion of the frame. calm: the camera has hardly moved since the frame before, and of the blocks that aren't
 * new half will do, the other half with the next frame. */
void volume_fuse(volume *v, device *d, depth_maps *maps, const pose *camera_to_world, bool calm);

/* Queues the ray-cast of a model map (normal and depth, row by row) as camera sees it; its tiles must not outnumber the
 * finest maps'. */
void volume_raycast(volume *v, device *d, const kernel_camera *camera, const pose *camera_to_world,
                    float near_m, float far_m, device_buffer *model);

/* The same from where the scan was taken, as far as it lies within reach_m of the scan: all that alignment needs.
 * marched: also where it is further from the scan than the truncation. */
void volume_raycast_near(volume *v, device *d, depth_maps *maps, const pose *camera_to_world, float reach_m,
                         bool marched, device_buffer *model);

/* Queues the coarser levels of a model map. */
void volume_halve_maps(volume *v, device *d, const kernel_camera *cameras, device_buffer model[FATHOM_LEVELS],
                       int coarsest);

#endif
