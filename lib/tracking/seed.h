/* The line d = InertialEstimate(t_i-1, t_i) of Figure 2, and M * d. */
#ifndef FATHOM_SEED_H
#define FATHOM_SEED_H

#include "align/align.h"
#include "inertial/inertial.h"

/* The camera's motion since the last frame: from the caller's hook, from inertia or, without either, none. covariance:
 * of the last frame's pose. */
inertial_motion inertial_seed(inertial *n, const double covariance[36], int64_t from_ns, int64_t to_ns);

/* M * d, as the prior of the frame's alignment. */
align_prior seed_at(const pose *last, const inertial_motion *d);

#endif
