/* What motion during the exposure makes of a depth picture: blur, and the shear of a rolling shutter. */
#ifndef FATHOM_EXPOSURE_H
#define FATHOM_EXPOSURE_H

#include <stdint.h>

#include "simulate/camera_path.h"

struct exposure {
    double exposure_s; /* how long a row gathers light; 0: an instant */
    double rolling_s;  /* from the first row's exposure to the last row's; 0: all rows at once */
};

/* The picture whose stamp is t: t is the middle of the middle row's exposure. Depth is what the pixel sees on
 * average over its exposure where that is one surface, else what it sees in the middle of it, and lost says
 * which pixels saw no one surface. cosine belongs to the middle of the exposure; NULL when it isn't wanted. All
 * of width x height. shadow: the projector's shadow counts, too (as in sensor_measure). The rest as for
 * render_depth, and without motion the picture is render_depth's to the last bit. False when out of memory. */
bool exposure_render(const struct exposure *exposure, const struct scene *scene,
                     const struct render_camera *camera, const struct camera_path *path, double t,
                     double far_m, int threads, bool shadow, float *depth, float *cosine, uint8_t *lost);

#endif
