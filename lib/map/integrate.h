/* A frame enters the surface: which blocks it needs, their places, fusion (Curless and Levoy 1996). */
#ifndef FATHOM_INTEGRATE_H
#define FATHOM_INTEGRATE_H

#include "frame/depth_maps.h"
#include "map/blocks.h"

typedef struct {
    float max_weight;
    int frames;      /* fused since the last clearing */
    int64_t before;  /* and until then */
    int settled;     /* the first so many blocks have been fused into for SETTLING frames or more */
    int settling;    /* the next to be so */
    int64_t refused; /* blocks that found the pool full */
    bool full;       /* some were refused by the last allocation */

    /* of the frame that goes in */
    int tiles;              /* of the finest maps */
    device_buffer requests; /* TILE_SLOTS keys a tile */
    device_buffer counts;   /* of them: an int a tile */
    device_buffer farthest; /* largest depth of each tile */
    device_buffer planes;   /* what each pixel stands for: 8 bytes */
    cl_kernel request, mark_seen, clear, pack_planes, fuse;
} integrator;

void integrator_init(integrator *g, device *d, arena *a, const fathom_config *config, const depth_maps *maps);
void integrator_close(integrator *g);

/* Forgets the frames so far. */
void integrator_clear(integrator *g);

/* The number of frames that were ever fused: what a block's stamp in `seen` counts from is `before`. */
int64_t integrator_generation(const integrator *g);

/* Finds out which blocks the frame's surface needs and lacks; returns how many at most (neighbouring tiles may ask for
 * the same). calm: the camera has hardly moved since the frame before, and half of the frame will do, the other half
 * with the next one. */
int integrator_request(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world,
                       bool calm);

/* Queues the stamping of the blocks that the frame asked for last has in view: they aren't to make room for it. */
void integrator_mark_seen(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world);

/* Gives them places as far as there are any, from the returned one on; they are new: nothing seen. */
int integrator_allocate(integrator *g, device *d, volume *v);

/* Queues the clearing of blocks: nothing seen. */
void integrator_clear_blocks(integrator *g, device *d, volume *v, int first, int count);

/* Queues the fusion of the frame. calm: the camera has hardly moved since the frame before, and of the blocks that
 * aren't new half will do, the other half with the next frame. */
void integrator_fuse(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world,
                     bool calm);

#endif
