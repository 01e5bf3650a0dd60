/* The line Fusion(scan, rigidICP) of Figure 2: whether all of the frame or half of it is fused, and room in a full
 * pool. */
#ifndef FATHOM_FUSING_H
#define FATHOM_FUSING_H

#include "map/eviction.h"

typedef struct {
    const fathom_config *config;
    device *device;
    depth_maps *maps;
    volume *volume;
    integrator *integrator;
    caller_store *store;
    pose last; /* of the last frame that was fused */
} fusing;

void fusing_init(fusing *f, device *d, const fathom_config *config, depth_maps *maps, volume *v,
                 integrator *g, caller_store *s);

/* Whether the camera has hardly moved since the last fused frame: then half of this frame is fused, and the other half
 * of the blocks with the next one. */
bool fusing_is_calm(const fusing *f, const pose *at);

/* Fuses the frame in the maps into the surface at a pose, and reports it: fused, pool_full, blocks_*, ms_fuse. */
void fuse(fusing *f, const pose *at, fathom_result *r);

#endif
