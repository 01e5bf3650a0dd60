/* The predicted view: the surface ray-cast from a pose, on the coarsest maps that are fine enough, for the verdict and
 * for the search. */
#ifndef FATHOM_MODEL_VIEW_H
#define FATHOM_MODEL_VIEW_H

#include "map/raycast.h"

typedef struct {
    device_buffer map;  /* normals and depths, row by row */
    int level;          /* of the maps */
    kernel_camera same; /* that level's camera */
    kernel_camera wide; /* the same, extended by half its width and height on each side */
    float near_m, far_m;
} model_view;

/* Comparison of a frame with the predicted view at a pose: sums over the pixels of the view's level, each weighted by
 * the root of its confidence in alignment, maximum 1, so that a noisy background doesn't outweigh near surfaces. */
typedef struct {
    float visible; /* the view shows surface and the frame has depth */
    float agree;   /* of these: within the tolerance, across the surface */
    float through; /* of these: the frame sees further, through the surface */
} comparison;

void model_view_init(model_view *w, device *d, arena *a, const fathom_config *config, const depth_maps *maps);
void model_view_close(model_view *w);

/* Waits for the device. tolerance_m: in addition to three sigma of the depth. */
void model_view_compare(model_view *w, device *d, depth_maps *maps, raycaster *r, const pose *camera_to_world,
                        float tolerance_m, comparison *out);

/* Queues the ray-cast of the predicted view at a pose. */
void model_view_cast(model_view *w, device *d, raycaster *r, const pose *camera_to_world);

/* The fraction of pixels of the predicted view at a pose that show surface. Waits for the device. */
double model_view_part(model_view *w, device *d, raycaster *r, const pose *camera_to_world);

/* Queues the wide map as seen from a pose. */
void model_view_cast_wide(model_view *w, device *d, raycaster *r, const pose *camera_to_world);

#endif
