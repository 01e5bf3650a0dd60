#include "inertial/strapdown.h"

#include <math.h>
#include <string.h>

#include "base/covariance.h"

#define BIAS_WALK 2e-4     /* rad/s/sqrt(s): random walk of a known gyro bias */
#define ACCEL_WALK 2e-3            /* m/s^2/sqrt(s), the same of the accelerometer's */
#define MAP_TURN_WALK 2e-3         /* rad/sqrt(s): common drift of poses and the map */
#define MAP_WALK 1e-3              /* m/sqrt(s), the same */
#define MISMATCH_GYRO 0.1  /* minimum mismatch of a gyroscope, whose noise is hardly visible in poses */
#define MISMATCH_SEED 0.2  /* minimum factor of a seed's floor: clock and mounting are never exact */
#define COAST_SECONDS 0.5  /* unmeasured hand-held motion keeps its velocity and rate for about this time */
#define MAX_BLIND 10.0       /* seconds without samples after which the uncertainty stops growing */
#define HAND_SECONDS 0.2   /* duration of a hand's acceleration */

/* One interval between neighbouring samples, or without any: i is samples_find(early). forward: from early to late. */
static void stretch(inertial *n, navigator *s, int64_t early, int64_t late, int i, bool forward) {
    const fathom_config *c = n->config;
    bool imu = n->usable && n->samples.count > 1 && !n->now.doubted;
    double dt = 1e-9 * ((double)late - (double)early), period = 1e-9 * (double)n->samples.period_ns;
    double w0[3], w1[3], a0[3], a1[3], gyro[3], accel[3];
    navigator_noise noise = {c->gyro_noise_rad_s_sqrthz,
                             sqrt(fmax(pow(c->motion_sigma_m_s2, 2) * HAND_SECONDS, n->now.unsteady[1])),
                             BIAS_WALK,
                             ACCEL_WALK,
                             0,
                             MAP_TURN_WALK,
                             MAP_WALK};
    bool inside = imu && i >= 0 && i + 1 < (int)n->samples.count;
    bool gap = inside && (double)(sample_at(&n->samples, (unsigned)(i + 1))->timestamp_ns -
                                  sample_at(&n->samples, (unsigned)i)->timestamp_ns) > 5e9 * period;
    bool near = false; /* just before the first sample or after the last */
    if (imu && i < 0) near = (double)sample_at(&n->samples, 0)->timestamp_ns - (double)early < 1.5e9 * period;
    if (imu && i + 1 == (int)n->samples.count)
        near = (double)late - (double)sample_at(&n->samples, n->samples.count - 1)->timestamp_ns <
               1.5e9 * period;
    bool covered = (inside && !gap) || near;
    if (!covered) dt = fmin(dt, MAX_BLIND);
    /* the latest source of the rate: a sample, or the motion between the last two poses */
    int64_t sampled = imu && i >= 0 ? sample_at(&n->samples, (unsigned)i)->timestamp_ns : INT64_MIN;
    bool by_poses = !imu || (!covered && n->now.corrected_ns > sampled && n->now.corrected_ns <= early);
    if (!by_poses) {
        samples_between(&n->samples, early, i, w0, a0);
        samples_between(&n->samples, late, i, w1, a1);
        for (int k = 0; k < 3; k++) {
            gyro[k] = 0.5 * (w0[k] + w1[k]);
            accel[k] = 0.5 * (a0[k] + a1[k]);
        }
    } else {
        for (int k = 0; k < 3; k++) gyro[k] = n->now.turning[k] + s->gyro_bias[k];
    }
    double coast = dt;
    /* the angle grows as motion_sigma_rad_s2 T^2 with the time T since the rate was known, independent of the steps */
    if (!covered) {
        int64_t known = by_poses ? n->now.corrected_ns : sampled == INT64_MIN ? early : sampled;
        double age = known == INT64_MIN ? 0 : fmin(1e-9 * fabs((double)early - (double)known), MAX_BLIND);
        noise.turn = sqrt(fmax(pow(c->motion_sigma_rad_s2, 2), n->now.unsteady[0]) * (pow(age + dt, 4) - pow(age, 4)));
        if (n->running) coast = fmin(dt, fmax(COAST_SECONDS - age, 0));
    }
    bool force = covered && n->force_usable && isfinite(accel[0] + accel[1] + accel[2]) && n->running;
    if (covered) noise.gyro *= fmax(n->now.mismatch, MISMATCH_GYRO);
    if (force) noise.accel = c->accel_noise_m_s2_sqrthz * n->now.mismatch;
    navigator ahead = *s;
    if (coast < dt) navigator_step(&ahead, forward ? coast : -coast, gyro, NULL, &noise);
    navigator_step(s, forward ? dt : -dt, gyro, force ? accel : NULL, &noise);
    if (coast < dt) { /* at rest from there on, with the same uncertainty */
        memcpy(s->r, ahead.r, sizeof s->r);
        memcpy(s->p, ahead.p, sizeof s->p);
    }
}

/* Propagates a state forward or back to another time, interval by interval. */
void navigate(inertial *n, navigator *s, int64_t to) {
    int64_t t = s->timestamp_ns;
    int i = samples_find(&n->samples, t);
    while (t < to) {
        int64_t next =
            i + 1 < (int)n->samples.count ? sample_at(&n->samples, (unsigned)(i + 1))->timestamp_ns : to;
        if (next > to) next = to;
        if (next > t) stretch(n, s, t, next, i, true);
        t = next;
        i++;
    }
    while (t > to) {
        int64_t next = i >= 0 ? sample_at(&n->samples, (unsigned)i)->timestamp_ns : to;
        if (next < to) next = to;
        if (next < t) stretch(n, s, next, t, i, false);
        t = next;
        i--;
    }
    s->timestamp_ns = to;
}

void navigator_rest(inertial *n, navigator *s, int64_t timestamp_ns) {
    pose origin = pose_identity();
    const double none[3] = {0, 0, 0};
    s->timestamp_ns = timestamp_ns;
    navigator_start(s, &origin, none, 0.5, n->samples.still.gyro_bias_sigma, n->config->accel_bias_sigma_m_s2,
                    1);
    memcpy(s->gyro_bias, n->samples.still.gyro_bias, sizeof s->gyro_bias);
}

int inertial_estimate(inertial *n, int64_t from_ns, int64_t to_ns, inertial_motion *out) {
    const fathom_config *c = n->config;
    if (!n->running && !(n->usable && n->samples.count > 1)) return FATHOM_ERROR_NO_DATA;
    int64_t early = from_ns < to_ns ? from_ns : to_ns, late = from_ns < to_ns ? to_ns : from_ns;
    navigator whole, s;
    if (n->running)
        whole = n->now.state;
    else
        navigator_rest(n, &whole, early);
    navigate(n, &whole, early);
    s = whole;
    navigator_forget_pose_error(&s);
    pose before = navigator_camera(&s, n->lever);
    navigate(n, &s, late);
    pose after = navigator_camera(&s, n->lever);
    out->motion = pose_between(&before, &after);
    navigator_camera_covariance(&s, n->lever, out->covariance);
    navigate(n, &whole, late);
    navigator_camera_covariance(&whole, n->lever, out->pose_covariance);
    if (from_ns > to_ns) { /* the error of the inverse, in the earlier camera's axes */
        double adjoint[36];
        pose_adjoint(&out->motion, adjoint);
        covariance_transport(adjoint, out->covariance, out->covariance);
        out->motion = pose_inverse(&out->motion);
    }
    for (int i = 0; i < 6; i++) {
        double floor = fmax(n->now.mismatch, MISMATCH_SEED) * (i < 3 ? c->seed_noise_rad : c->seed_noise_m);
        out->covariance[7 * i] += floor * floor;
        out->pose_covariance[7 * i] += floor * floor;
    }
    return FATHOM_OK;
}
