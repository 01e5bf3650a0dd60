/* Fusion of a frame (Curless and Levoy 1996): the blocks that it needs, their places, and the weighted mean. */
#ifndef FATHOM_INTEGRATE_H
#define FATHOM_INTEGRATE_H

#include "frame/depth_maps.h"
#include "map/blocks.h"

typedef struct {
    float max_weight;
    int frames;      /* fused since the last clearing */
    int64_t before;  /* fused before it */
    int settled;     /* number of blocks, from place 0 on, that have been fused into for SETTLING frames or more */
    int settling;    /* that number after the next turn */
    int64_t refused; /* blocks that found the pool full */
    bool full;       /* some were refused by the last allocation */

    /* of the frame being fused */
    int tiles;              /* of the finest maps */
    device_buffer requests; /* TILE_SLOTS keys per tile */
    device_buffer counts;   /* number of keys: an int per tile */
    device_buffer farthest; /* largest depth of each tile */
    device_buffer planes;   /* each pixel's plane: 8 bytes */
    cl_kernel request, mark_seen, clear, pack_planes, fuse;
} integrator;

void integrator_init(integrator *g, device *d, arena *a, const fathom_config *config, const depth_maps *maps);
void integrator_close(integrator *g);

/* Forgets the frames so far. */
void integrator_clear(integrator *g);

/* The number of frames ever fused; a block's stamp in `seen` is relative to `before`. */
int64_t integrator_generation(const integrator *g);

/* Finds the blocks that the frame's surface needs and that are missing; returns their maximum number (neighbouring
 * tiles may request the same). calm: the camera has hardly moved since the previous frame; half of the frame is used,
 * the other half with the next one. */
int integrator_request(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world,
                       bool calm);

/* Queues the stamping of the blocks in view of the last requested frame, so that they don't make room for it. */
void integrator_mark_seen(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world);

/* Gives the requested blocks places, as far as there are any, from the returned one on; their voxels were never
 * seen. */
int integrator_allocate(integrator *g, device *d, volume *v);

/* Queues the clearing of blocks to never seen. */
void integrator_clear_blocks(integrator *g, device *d, volume *v, int first, int count);

/* Queues the fusion of the frame. calm: the camera has hardly moved since the previous frame; of the blocks that aren't
 * new half are fused into, the other half with the next frame. */
void integrator_fuse(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world,
                     bool calm);

#endif
