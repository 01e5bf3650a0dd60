/* The line Fusion(scan, rigidICP) of Figure 2: whether the whole frame or half of it goes into the surface, and room at
 * the pool's bound. */
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

/* The camera has hardly moved since the last frame that was fused: half of this one will do, the other half with the
 * next. */
bool fusing_is_calm(const fusing *f, const pose *at);

/* Puts the frame in the maps into the surface, as seen from there, and reports it: fused, pool_full, blocks_*,
 * ms_fuse. */
void fuse(fusing *f, const pose *at, fathom_result *r);

#endif
