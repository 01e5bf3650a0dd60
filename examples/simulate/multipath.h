/* Light that takes a detour to a time-of-flight camera's pixels. */
#ifndef FATHOM_MULTIPATH_H
#define FATHOM_MULTIPATH_H

#include <stdbool.h>

#include "simulate/render.h"

/* How much too far each pixel reads, metres along its ray, since light also comes by way of one other surface that the
 * camera sees. depth, cosine: as render_depth gives them. False when out of memory. */
bool multipath_bias(const struct render_camera *camera, const float *depth, const float *cosine, float *bias);

#endif
