/* The effects of motion during the exposure on a depth image: blur, and the shear of a rolling shutter. */
#ifndef FATHOM_EXPOSURE_H
#define FATHOM_EXPOSURE_H

#include <stdint.h>

#include "simulate/camera_path.h"

struct exposure {
    double exposure_s; /* how long a row gathers light; 0: an instant */
    double rolling_s;  /* from the first row's exposure to the last row's; 0: all rows at once */
};

/* Renders the image with stamp t, the middle of the middle row's exposure. depth: a pixel's mean over its exposure
 * where it sees a single surface, else its value at the middle of it; lost: pixels that don't see a single surface.
 * cosine: at the middle of the exposure; may be NULL. All of width x height. shadow: the projector's shadow counts, too
 * (as in kinect_measure). The rest as for render_depth; without motion the image is equal to render_depth's to the last
 * bit. False when out of memory. */
bool exposure_render(const struct exposure *exposure, const struct scene *scene,
                     const struct render_camera *camera, const struct camera_path *path, double t,
                     double far_m, int threads, bool shadow, float *depth, float *cosine, uint8_t *lost);

#endif
