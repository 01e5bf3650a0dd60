/* What the surface says that a camera should see, on the coarsest maps that still tell enough: for the verdict and for
 * the search. */
#ifndef FATHOM_MODEL_VIEW_H
#define FATHOM_MODEL_VIEW_H

#include "map/raycast.h"

typedef struct {
    device_buffer map;  /* normal and depth, row by row */
    int level;          /* of the maps */
    kernel_camera same; /* that level's camera */
    kernel_camera wide; /* the same with half a width and height more on each side */
    float near_m, far_m;
} model_view;

/* A frame held against the surface as it should look from a pose: sums over the pixels of the view's level, each
 * counting by the root of its confidence (that of alignment), one at most, so that a noisy background doesn't outvote
 * what is near. */
typedef struct {
    float visible; /* where the surface should be seen, and the frame sees something */
    float agree;   /* of these: within the tolerance of each other, across the surface */
    float through; /* the frame sees further: through what should be there */
} comparison;

void model_view_init(model_view *w, device *d, arena *a, const fathom_config *config, const depth_maps *maps);
void model_view_close(model_view *w);

/* Waits for the device. tolerance_m: beside three sigma of the depth. */
void model_view_compare(model_view *w, device *d, depth_maps *maps, raycaster *r, const pose *camera_to_world,
                        float tolerance_m, comparison *out);

/* Queues the ray-cast of what the camera should see from there. */
void model_view_cast(model_view *w, device *d, raycaster *r, const pose *camera_to_world);

/* The part of its pixels in which the camera should see some surface from there. Waits for the device. */
double model_view_part(model_view *w, device *d, raycaster *r, const pose *camera_to_world);

/* Queues the wide map as seen from a pose. */
void model_view_cast_wide(model_view *w, device *d, raycaster *r, const pose *camera_to_world);

#endif
