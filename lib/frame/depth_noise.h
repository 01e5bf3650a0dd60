/* How the sensor's depth noise grows with the depth, estimated from the frames by the second difference of depth
 * along a row. Planes have none, so that its 90th percentile is the sensor's own (steps of disparity, ranging noise),
 * as long as few pixels lie at edges. Its scale stays that of the settings: filtered depth is smoother than it is
 * exact. */
#ifndef FATHOM_DEPTH_NOISE_H
#define FATHOM_DEPTH_NOISE_H

#include "frame/depth_maps.h"

#define DEPTH_NOISE_RANGES 20 /* of depth, two per octave */
#define DEPTH_NOISE_SIZES 64  /* of second difference, four per octave */

typedef struct {
    const fathom_config *config;
    kernel_noise given;              /* the settings': where nothing was seen, the noise has this shape */
    int frames;                      /* looked at */
    float depth[DEPTH_NOISE_RANGES]; /* sums, m */
    float count[DEPTH_NOISE_RANGES];
    float sizes[DEPTH_NOISE_RANGES][DEPTH_NOISE_SIZES]; /* pixels, old ones fading */
} depth_noise;

void depth_noise_init(depth_noise *n, const fathom_config *config);

/* Forgets what was seen. */
void depth_noise_reset(depth_noise *n);

/* Looks at a frame (a checked one) before its maps are made, and gives them the new estimate: every frame at first,
 * later some. With refine_depth_noise false it does nothing. */
void depth_noise_look(depth_noise *n, depth_maps *maps, const fathom_depth_frame *frame);

/* The a, b, c >= 0 of a + b z + c z^2 that come nearest to the values, by relative errors squared with weights. */
kernel_noise depth_noise_fit(const double *z, const double *values, const double *weights, int count);

#endif
