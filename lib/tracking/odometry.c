#include "tracking/odometry.h"

#include <math.h>
#include <string.h>

#include "base/covariance.h"

static void add(double sum[36], const double more[36]) {
    for (int i = 0; i < 36; i++) sum[i] += more[i];
}

void odometry_start(odometry *o, const pose *first) {
    memset(o, 0, sizeof *o);
    o->at = o->in_map = *first;
    o->tracked = true;
}

/* Motions between aligned poses multiply to the motion from the first of them to the last, and only the errors of these
 * two remain: each is added to `behind` where motions change from inertia's to alignment's or back. */
void odometry_advance(odometry *o, const pose *motion, const double motion_covariance[36], const pose *in_map,
                      const double in_map_covariance[36], bool tracked, double seconds) {
    bool by_alignment = tracked && o->tracked;
    pose way = by_alignment ? pose_between(&o->in_map, in_map) : *motion, back = pose_inverse(&way);
    double adjoint[36];
    if (by_alignment != o->by_alignment) add(o->behind, o->in_map_covariance);
    pose_adjoint(&back, adjoint);
    covariance_transport(adjoint, o->behind, o->behind);
    if (!by_alignment) add(o->behind, motion_covariance);
    for (int i = 0; i < 6; i++)
        o->behind[7 * i] += fmax(seconds, 0) * (i < 3 ? DRIFT_RAD * DRIFT_RAD : DRIFT_M * DRIFT_M);
    memcpy(o->covariance, o->behind, sizeof o->covariance);
    if (by_alignment) add(o->covariance, in_map_covariance);
    o->at = pose_multiply(&o->at, &way);
    pose_normalise(&o->at);
    o->in_map = *in_map;
    memcpy(o->in_map_covariance, in_map_covariance, sizeof o->in_map_covariance);
    o->tracked = tracked;
    o->by_alignment = by_alignment;
}
