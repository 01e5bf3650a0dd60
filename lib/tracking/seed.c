#include "tracking/seed.h"

#include <math.h>
#include <string.h>

#include "base/covariance.h"
#include "base/stamps.h"

#define UNKNOWN_VARIANCE 1e6 /* m^2 and rad^2: maximum variance, for unknown directions */

/* The covariance of pose * motion: the old error seen from the new camera, and the motion's own. */
static void propagate(const double old[36], const inertial_motion *d, double out[36]) {
    pose inverse = pose_inverse(&d->motion);
    double adjoint[36];
    pose_adjoint(&inverse, adjoint);
    covariance_transport(adjoint, old, out);
    for (int i = 0; i < 36; i++) out[i] += d->covariance[i];
}

static bool ask_hook(const fathom_config *c, int64_t from_ns, int64_t to_ns, inertial_motion *d) {
    fathom_motion given = FATHOM_STRUCT(fathom_motion);
    if (!c->inertial_hook || c->inertial_hook(c->inertial_user, from_ns, to_ns, &given) != FATHOM_OK ||
        !pose_take(&given.motion, &d->motion))
        return false;
    for (int i = 0; i < 36; i++) {
        d->covariance[i] = given.covariance[i];
        if (!isfinite(d->covariance[i]) || (i % 7 == 0 && d->covariance[i] < 0)) return false;
    }
    return true;
}

inertial_motion inertial_seed(inertial *n, const double covariance[36], int64_t from_ns, int64_t to_ns) {
    inertial_motion d;
    if (!ask_hook(n->config, from_ns, to_ns, &d)) {
        if (inertial_estimate(n, from_ns, to_ns, &d) == FATHOM_OK) return d;
        double dt = seconds_between(from_ns, to_ns);
        d.motion = pose_identity();
        memset(d.covariance, 0, sizeof d.covariance);
        for (int i = 0; i < 3; i++) {
            d.covariance[7 * i] = fmin(dt * dt, UNKNOWN_VARIANCE);
            d.covariance[7 * (i + 3)] = fmin(0.25 * dt * dt, UNKNOWN_VARIANCE);
        }
    }
    propagate(covariance, &d, d.pose_covariance);
    return d;
}

align_prior seed_at(const pose *last, const inertial_motion *d) {
    align_prior seed = {.mean = pose_multiply(last, &d->motion)};
    memcpy(seed.covariance, d->pose_covariance, sizeof seed.covariance);
    return seed;
}
