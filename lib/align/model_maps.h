/* The model that a scan is aligned with, as maps seen from one pose: ray-cast from the surface and kept for the next
 * frames while they hold, or taken from the last accepted frame. */
#ifndef FATHOM_MODEL_MAPS_H
#define FATHOM_MODEL_MAPS_H

#include "frame/depth_maps.h"

typedef struct {
    device_buffer level[FATHOM_LEVELS]; /* normal and depth, in the axes of the camera that sees them */
    const fathom_config *config;
    pose seen_from; /* that camera's pose */
    int coarsest;   /* coarsest level that was cast; FATHOM_LEVELS: none to be reused */
    int pairs;      /* of the first alignment with them */
    bool fresh;     /* no alignment has used them yet */
} model_maps;

void model_maps_init(model_maps *m, device *d, arena *a, const fathom_config *config, const depth_maps *maps);
void model_maps_close(model_maps *m);

/* Invalidates them. */
void model_maps_forget(model_maps *m);

/* Whether they are close enough to serve a scan from that pose, down to that level. */
bool model_maps_hold(const model_maps *m, const pose *from, int coarsest);

/* Notes that they have been cast anew from the surface, down to that level. */
void model_maps_renew(model_maps *m, const pose *from, int coarsest);

/* Takes the frame's own maps, as seen from that pose. */
void model_maps_take_frame(model_maps *m, device *d, depth_maps *maps, const pose *at);

/* Notes the pairs and the condition number of an alignment with them. They serve no further frame once a tenth of the
 * pairs is gone, or when the geometry that they show barely constrains the pose. */
void model_maps_used(model_maps *m, int pairs, double condition);

#endif
