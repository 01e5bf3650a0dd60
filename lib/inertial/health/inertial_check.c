/* Feeds inertial/health/plausibility.c with the motion by samples and by alignment over the same intervals, and acts on
 * its findings. */
#include <math.h>
#include <string.h>

#include "base/covariance.h"
#include "base/log.h"
#include "inertial/inertial.h"
#include "inertial/start.h"

#define INTERVAL_NS 150000000 /* minimum interval for evidence, so that alignment's noise counts less */
#define INTERVAL_MOST_NS 700000000
#define INTERVAL_TURN 1.0  /* rad: maximum; beyond it the integral of the rate differs from the rotation vector */
#define GUESS_NS 300000000 /* maximum time that a hand's velocity predicts */
#define START_TURN 1.0     /* rad/s and m/s: sigma of a hand's motion at the first frame */
#define START_SPEED 0.5
#define SMOOTH_SECONDS 0.01 /* smoothing of the rate at an interval's end, against white noise */
#define SAME_RAD 0.003      /* seeds that agree within these lead alignment to the same pose */
#define SAME_M 0.002

void inertial_check_reset(inertial *n) {
    n->usable = n->config->imu;
    n->force_usable = n->config->imu_translation;
    plausibility_start(&n->check, n->samples.rotation, n->config->gravity_m_s2);
    n->told[0] = n->told[1] = FATHOM_IMU_UNCHECKED;
    n->base_ns = n->accepted_ns = INT64_MIN;
    n->moving = false;
}

static void turn_back(const double r[9], const double v[3], double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = r[i] * v[0] + r[3 + i] * v[1] + r[6 + i] * v[2];
}

/* Integrates by dt at a rate, bias included: turned is the rotation so far, by_bias its Jacobian by the bias. */
static void turn_on(const inertial *n, const double rate[3], double dt, bool first, rig_interval *w) {
    double v[3], step[9], smooth = exp(-dt / SMOOTH_SECONDS);
    for (int k = 0; k < 3; k++) {
        double here = rate[k] - n->refiner.bias[k];
        if (first) w->rate_from[k] = w->rate_to[k] = n->refiner.started ? n->refiner.rate[k] : here;
        w->rate_to[k] = here + smooth * (w->rate_to[k] - here);
        v[k] = dt * here;
    }
    so3_exp(v, step);
    so3_multiply(w->turned, step, w->turned);
    so3_transpose_multiply(step, w->by_bias, w->by_bias);
    for (int k = 0; k < 3; k++) w->by_bias[4 * k] += dt;
}

/* Integrates samples over [e->from_ns, e->to_ns], with the camera turning uniformly by `turn` from r on. w: the
 * gyroscope's rotation alone. False where samples are missing. */
static bool integrate(const inertial *n, const double r[9], const double turn[3], plausibility_interval *e,
                      rig_interval *w) {
    double rate[3] = {0, 0, 0}, force[3] = {0, 0, 0}, whole = (double)(e->to_ns - e->from_ns);
    int64_t longest = 5 * n->samples.period_ns;
    unsigned i = n->samples.count;
    while (i > 0 && sample_at(&n->samples, i - 1)->timestamp_ns > e->from_ns) i--;
    if (i == 0 || n->samples.count < 2) return false;
    e->has_force = true;
    for (int64_t t = e->from_ns; t < e->to_ns; i++) {
        const inertial_sample *a = sample_at(&n->samples, i - 1),
                              *b = i < n->samples.count ? sample_at(&n->samples, i) : NULL;
        int64_t next = b && b->timestamp_ns < e->to_ns ? b->timestamp_ns : e->to_ns;
        if ((b ? b->timestamp_ns : next) - a->timestamp_ns > (b ? longest : 2 * n->samples.period_ns))
            return false;
        double dt = 1e-9 * (double)(next - t),
               middle = 0.5 * ((double)(t - e->from_ns) + (double)(next - e->from_ns));
        double f = b ? (middle - (double)(a->timestamp_ns - e->from_ns)) /
                           (double)(b->timestamp_ns - a->timestamp_ns)
                     : 0;
        double part[9], amid[9], here[3], here_rate[3], v[3];
        if (!b) b = a;
        for (int k = 0; k < 3; k++) {
            v[k] = turn[k] * middle / whole;
            here_rate[k] = (1 - f) * a->gyro[k] + f * b->gyro[k];
            rate[k] += dt * here_rate[k];
            here[k] = (1 - f) * a->accel[k] + f * b->accel[k];
        }
        if (!isfinite(here[0] + here[1] + here[2])) e->has_force = false;
        turn_on(n, here_rate, dt, t == e->from_ns, w);
        so3_exp(v, part);
        so3_multiply(r, part, amid);
        for (int k = 0; k < 3; k++) {
            double up = amid[3 * k] * here[0] + amid[3 * k + 1] * here[1] + amid[3 * k + 2] * here[2];
            force[k] += dt * here[k] / (1e-9 * whole);
            e->gone[k] += e->speed_up[k] * dt + 0.5 * dt * dt * up;
            e->speed_up[k] += dt * up;
        }
        t = next;
    }
    turn_back(n->samples.rotation, rate, e->gyro);
    turn_back(n->samples.rotation, force, e->force);
    return true;
}

/* The motion from one frame to another by alignment, gyroscope and accelerometer. False where they can't be
 * compared. */
static bool compare(const inertial *n, const pose *base, const pose *aligned, plausibility_interval *e,
                    rig_interval *w) {
    pose way = pose_between(base, aligned), from = inertial_imu_pose(n, base),
         to = inertial_imu_pose(n, aligned);
    double turn[3], half[3], part[9];
    if (e->to_ns - e->from_ns >= INTERVAL_MOST_NS || pose_angle(&way) >= INTERVAL_TURN) return false;
    so3_log(way.r, turn);
    if (!integrate(n, base->r, turn, e, w)) return false;
    for (int k = 0; k < 3; k++) {
        half[k] = 0.5 * turn[k];
        e->moved[k] = to.t[k] - from.t[k];
    }
    turn_back(n->samples.rotation, turn, e->turn);
    so3_exp(half, part);
    so3_multiply(base->r, part, e->imu_to_world);
    so3_multiply(e->imu_to_world, n->samples.rotation, e->imu_to_world);
    e->has_force = e->has_force && n->force_usable;
    memcpy(w->from, base->r, sizeof w->from);
    memcpy(w->to, aligned->r, sizeof w->to);
    return true;
}

static void add_evidence(inertial *n, const pose *aligned, int64_t timestamp_ns) {
    int64_t length = n->base_ns == INT64_MIN ? INT64_MAX : timestamp_ns - n->base_ns;
    if (length < INTERVAL_NS) return;
    plausibility_interval e = {.from_ns = n->base_ns, .to_ns = timestamp_ns};
    rig_interval w = {.turned = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    if (n->base_ns != INT64_MIN && compare(n, &n->base, aligned, &e, &w)) plausibility_add(&n->check, &e);
    n->base = *aligned;
    n->base_ns = timestamp_ns;
}

/* The awaited pose, once the samples reach it. */
static void use_awaited(inertial *n) {
    if (!n->awaiting || n->samples.count == 0 ||
        sample_at(&n->samples, n->samples.count - 1)->timestamp_ns < n->awaited_ns)
        return;
    plausibility_interval e = {.from_ns = n->refined_at_ns, .to_ns = n->awaited_ns};
    rig_interval w = {.turned = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    bool good = e.from_ns != INT64_MIN && compare(n, &n->refined_at, &n->awaited, &e, &w);
    n->awaiting = false;
    inertial_rig_add(n, good ? &w : NULL, &n->awaited, n->awaited_ns);
}

/* Samples may end before the frame's stamp, especially with a wrong clock offset: its pose waits for them. */
static void add_rig_evidence(inertial *n, const pose *aligned, int64_t timestamp_ns) {
    use_awaited(n);
    if (n->awaiting && timestamp_ns - n->awaited_ns < INTERVAL_MOST_NS) return;
    n->awaited = *aligned;
    n->awaited_ns = timestamp_ns;
    n->awaiting = true;
    use_awaited(n);
}

static void tell(inertial *n, bool gyro) {
    const plausibility_finding *f = gyro ? &n->check.gyro : &n->check.accel;
    fathom_imu_health *told = &n->told[gyro ? 0 : 1];
    char text[400];
    if (f->health == *told) return;
    *told = f->health;
    if (f->health < FATHOM_IMU_SATURATED || (!gyro && !n->usable)) return;
    plausibility_describe(&n->check, gyro, text, sizeof text);
    log_write(n->config, FATHOM_LOG_WARNING, "%s. The scan goes on %s", text,
              !plausibility_bad(f) ? "with it"
              : gyro               ? "without the IMU"
                                   : "with the IMU's rotation only");
}

void inertial_check(inertial *n, const pose *aligned, bool accepted, int64_t timestamp_ns) {
    const fathom_config *c = n->config;
    if (!(c->imu_check || c->refine_rig) || !n->usable) return;
    if (c->imu_check) plausibility_frame(&n->check, timestamp_ns);
    if (aligned && c->refine_rig) add_rig_evidence(n, aligned, timestamp_ns);
    if (!c->imu_check) return;
    if (aligned) add_evidence(n, aligned, timestamp_ns);
    if (accepted) {
        pose now = n->now.corrected;
        n->moving = n->accepted_ns != INT64_MIN;
        double dt = n->moving ? 1e-9 * (double)(timestamp_ns - n->accepted_ns) : 1;
        for (int k = 0; k < 3; k++) n->velocity[k] = (now.t[k] - n->accepted.t[k]) / dt;
        n->accepted = now;
        n->accepted_ns = timestamp_ns;
    }
    bool gyro = plausibility_bad(&n->check.gyro), force = plausibility_bad(&n->check.accel);
    if (accepted && (gyro || (force && n->force_usable))) {
        n->usable = !gyro;
        n->force_usable = n->force_usable && !force;
        inertial_start_again(n);
    }
    tell(n, true);
    if (n->config->imu_translation) tell(n, false);
}

bool inertial_second_guess(inertial *n, const pose *seed, int64_t timestamp_ns, pose *guess,
                           double covariance[36]) {
    const fathom_config *c = n->config;
    if (!c->imu_check || !n->usable || n->samples.count < 2 || n->accepted_ns == INT64_MIN ||
        c->inertial_hook)
        return false;
    if (!plausibility_doubtful(
            &n->check, n->force_usable && isfinite(sample_at(&n->samples, n->samples.count - 1)->accel[0])) ||
        timestamp_ns - n->accepted_ns > GUESS_NS)
        return false;
    double dt = 1e-9 * (double)(timestamp_ns - n->accepted_ns), twist[6] = {0};
    for (int k = 0; n->moving && k < 3; k++) twist[k] = n->now.turning[k] * dt;
    pose turned = pose_exp(twist);
    *guess = pose_multiply(&n->accepted, &turned);
    for (int k = 0; n->moving && k < 3; k++) guess->t[k] += n->velocity[k] * dt;
    pose apart = pose_between(seed, guess);
    if (pose_angle(&apart) < SAME_RAD && pose_distance(&apart) < SAME_M) return false;
    double turning = n->moving ? c->motion_sigma_rad_s2 * dt : START_TURN; /* sigma of the rates */
    double speed = n->moving ? c->motion_sigma_m_s2 * dt : START_SPEED;
    const pose back = pose_between(guess, &n->accepted); /* the accepted pose's own error, seen from here */
    double adjoint[36], own[36];
    navigator_camera_covariance(&n->now.state, n->lever, own);
    pose_adjoint(&back, adjoint);
    covariance_transport(adjoint, own, covariance);
    for (int k = 0; k < 6; k++)
        covariance[7 * k] += k < 3 ? pow(c->seed_noise_rad, 2) + pow(turning * dt, 2)
                                   : pow(c->seed_noise_m, 2) + pow(speed * dt, 2);
    return true;
}
