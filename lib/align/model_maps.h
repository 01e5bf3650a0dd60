/* The model that a scan is aligned with, as maps seen from one pose: ray-cast from the surface and kept for the next
 * frames while they hold, or taken from the last accepted frame. */
#ifndef FATHOM_MODEL_MAPS_H
#define FATHOM_MODEL_MAPS_H

#include "frame/depth_maps.h"

typedef struct {
    device_buffer level[FATHOM_LEVELS]; /* normal and depth, in the axes of the camera that sees them */
    const fathom_config *config;
    pose seen_from; /* that camera to world */
    int coarsest;   /* coarsest level that was cast; FATHOM_LEVELS: there are none to be used again */
    int pairs;      /* that alignment found when they were new */
    bool fresh;     /* no alignment has used them yet */
} model_maps;

void model_maps_init(model_maps *m, device *d, arena *a, const fathom_config *config, const depth_maps *maps);
void model_maps_close(model_maps *m);

/* There are none to be used again. */
void model_maps_forget(model_maps *m);

/* Those at hand will do for a scan from there, down to that level: they were seen from close by. */
bool model_maps_hold(const model_maps *m, const pose *from, int coarsest);

/* They have been cast anew from the surface, down to that level. */
void model_maps_renew(model_maps *m, const pose *from, int coarsest);

/* Takes the frame's own maps, as seen from there. */
void model_maps_take_frame(model_maps *m, device *d, depth_maps *maps, const pose *at);

/* An alignment with them has found so many pairs, and how well conditioned they were: they serve no further frame once
 * a tenth of the pairs is gone, or where what they show barely holds the pose. */
void model_maps_used(model_maps *m, int pairs, double condition);

#endif
