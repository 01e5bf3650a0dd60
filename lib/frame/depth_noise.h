/* The sensor's depth noise, estimated from the frames: how the second difference of depth along a row grows with the depth.
 * Planes have none, so that its 90th percentile is the sensor's own (steps of disparity, ranging noise), as long as few
 * pixels lie at edges. */
#ifndef FATHOM_DEPTH_NOISE_H
#define FATHOM_DEPTH_NOISE_H

#include "cl/kernel_types.h"

#define DEPTH_NOISE_RANGES 20 /* of depth, two per octave */
#define DEPTH_NOISE_SIZES 64  /* of second difference, four per octave */

typedef struct {
    kernel_noise given; /* the settings': where nothing was seen, the noise has this shape */
    bool refine;
    int frames; /* looked at */
    float depth[DEPTH_NOISE_RANGES]; /* sums, m */
    float count[DEPTH_NOISE_RANGES];
    float sizes[DEPTH_NOISE_RANGES][DEPTH_NOISE_SIZES]; /* pixels, old ones fading */
} depth_noise;

void depth_noise_init(depth_noise *n, const fathom_config *config);

/* Forgets what was seen. */
void depth_noise_reset(depth_noise *n);

/* Looks at a frame: every frame at first, later some. Returns true when *noise is a new estimate. */
bool depth_noise_look(depth_noise *n, const fathom_config *config, const fathom_depth_frame *frame, kernel_noise *noise);

/* The a, b, c >= 0 of a + b z + c z^2 that come nearest to the values, by relative errors squared with weights. */
kernel_noise depth_noise_fit(const double *z, const double *values, const double *weights, int count);

#endif
