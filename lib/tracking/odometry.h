/* The pose that never jumps: the product of the motions from frame to frame, alignment's where a frame and its
 * predecessor were tracked, else inertia's. Corrections by relocalisation are left out. */
#ifndef FATHOM_ODOMETRY_H
#define FATHOM_ODOMETRY_H

#include <stdbool.h>

#include "base/se3.h"

/* Drift of aligned poses together with the map; the covariance of a pose in the map doesn't include it. */
#define DRIFT_RAD 2e-3 /* rad/sqrt(s) */
#define DRIFT_M 1e-3   /* m/sqrt(s) */

typedef struct {
    pose at;               /* camera to world */
    double covariance[36]; /* at * exp(error), against the true world: the drift of the map counts too */
    double behind[36];     /* the part of it from before the current frame */
    /* the last frame: its pose in the map, that pose's covariance, whether it was tracked, and whether its motion is
     * alignment's */
    pose in_map;
    double in_map_covariance[36];
    bool tracked, by_alignment;
} odometry;

/* The first frame's pose, which is exact. */
void odometry_start(odometry *o, const pose *first);

/* The next frame, `seconds` later. motion: inertia's, from the previous frame, with its covariance; in_map and its
 * covariance: the frame's pose in the map; tracked: by alignment. */
void odometry_advance(odometry *o, const pose *motion, const double motion_covariance[36], const pose *in_map,
                      const double in_map_covariance[36], bool tracked, double seconds);

#endif
