/* Checks of the samples alone: stuck or saturated axes, the unit of specific force, the rate of the stamps. */
#include "inertial/health/evidence.h"

#include <math.h>
#include <string.h>

#define PACE_SECONDS 1.5    /* an interval for comparing the clocks' rates */
#define PACES 3             /* number of consecutive odd ones */
#define STUCK_TURN (8 * DEGREE)        /* a constant gyroscope axis while the camera turns about it */
#define STUCK_FORCE_TURN (30 * DEGREE) /* a constant accelerometer axis while the camera turns at all */
#define STAY 4                         /* consecutive samples at the largest value: a stay at the limit */
#define STAYS 3                        /* number of stays that make a limit */
#define COARSE 0.01f     /* readings with larger steps, relative to their maximum, stay there by chance */
#define LIMIT_GYRO 0.3   /* rad/s, and */
#define LIMIT_ACCEL 14.0 /* m/s^2: minimum range of sensors */

void profile_add(plausibility_profile *q, int64_t timestamp_ns, double speed) {
    int64_t bin = timestamp_ns / BIN_NS;
    if (q->newest == 0 || bin > q->newest + PLAUSIBILITY_BINS || bin + PLAUSIBILITY_BINS <= q->newest) {
        memset(q->count, 0, sizeof q->count);
        q->newest = bin;
    }
    while (q->newest < bin) q->count[(uint64_t)++q->newest % PLAUSIBILITY_BINS] = 0;
    unsigned i = (unsigned)((uint64_t)bin % PLAUSIBILITY_BINS);
    q->speed[i] = (float)((q->speed[i] * q->count[i] + speed) / (q->count[i] + 1));
    q->count[i]++;
}

static bool at_limit(const plausibility_axis *a, double least) {
    return fabsf(a->value) == a->most && a->most > least;
}

static void stay_at_limit(plausibility *p, int which, int times) {
    plausibility_finding *f = which < 3 ? &p->gyro : &p->accel;
    plausibility_axis *a = &p->axis[which];
    a->stays += times;
    if (a->stays < STAYS || f->health > FATHOM_IMU_SATURATED) return;
    if (f->health < FATHOM_IMU_SATURATED) found(f, FATHOM_IMU_SATURATED, a->most, 0);
    f->axes |= 1 << which % 3;
}

static void watch_axis(plausibility *p, int which, int64_t timestamp_ns, float value) {
    plausibility_axis *a = &p->axis[which];
    float magnitude = fabsf(value);
    if (a->run > 0 && value == a->value) {
        a->run += a->run < 1000000;
        return;
    }
    if (a->run > 0 && (a->step == 0 || fabsf(value - a->value) < a->step)) a->step = fabsf(value - a->value);
    if (a->run >= STAY && magnitude < a->most && at_limit(a, which < 3 ? LIMIT_GYRO : LIMIT_ACCEL) &&
        a->step < COARSE * a->most)
        stay_at_limit(p, which, 1);
    if (magnitude > a->most) {
        a->most = magnitude;
        a->stays = 0;
    }
    a->value = value;
    a->since_ns = timestamp_ns;
    a->run = 1;
    a->turned = 0;
}

/* The length of specific force is gravity's, on the average of a second. */
static void judge_units(plausibility *p) {
    double ratio = p->force_length / p->force_seconds / p->gravity;
    static const double usual[] = {1 / 9.80665, 100, 1000}; /* g; milli-g or cm/s^2; mm/s^2 */
    bool sure = p->force_seconds > 1;
    for (size_t i = 0; i < sizeof usual / sizeof *usual; i++)
        sure = sure || fabs(log(ratio / usual[i])) < 0.2;
    if (p->force_seconds < 0.25 || !sure || (ratio > 0.5 && ratio < 2)) return;
    found(&p->accel, FATHOM_IMU_UNITS, ratio, 7);
}

void plausibility_sample(plausibility *p, int64_t timestamp_ns, const float gyro[3], const float accel[3]) {
    double dt = 1e-9 * (double)(timestamp_ns - p->last_ns);
    bool force = isfinite(accel[0] + accel[1] + accel[2]);
    for (int i = 0; i < 3; i++) {
        watch_axis(p, i, timestamp_ns, gyro[i]);
        if (force) watch_axis(p, 3 + i, timestamp_ns, accel[i]);
    }
    profile_add(&p->read, timestamp_ns,
                sqrt((double)gyro[0] * gyro[0] + (double)gyro[1] * gyro[1] + (double)gyro[2] * gyro[2]));
    if (force && p->samples > 0 && dt > 0 && dt < 0.1 && p->gravity > 1 &&
        p->accel.health < FATHOM_IMU_UNITS) {
        p->force_seconds += dt;
        p->force_length += dt * sqrt((double)accel[0] * accel[0] + (double)accel[1] * accel[1] +
                                     (double)accel[2] * accel[2]);
        judge_units(p);
        if (p->force_seconds > 4) {
            p->force_seconds /= 2;
            p->force_length /= 2;
        }
    }
    if (p->samples++ == 0) p->first_ns = timestamp_ns;
    p->last_ns = timestamp_ns;
}

/* Compares the rates of both clocks, which are the same whatever the samples' delay. One odd interval is a jump, or
 * delivery in bursts; several consecutive ones are a wrong rate. */
void plausibility_frame(plausibility *p, int64_t timestamp_ns) {
    if (p->samples == 0) return;
    bool none = p->samples == p->samples_then; /* no samples: nothing to compare */
    double frames = 1e-9 * (double)(timestamp_ns - p->pace_frame_ns);
    double samples = 1e-9 * (double)(p->last_ns - p->pace_sample_ns);
    bool begun = p->samples_then > 0 && !none;
    p->samples_then = p->samples;
    if (begun && frames < PACE_SECONDS) return;
    p->odd_paces = begun && fabs(log(fmax(samples, 1e-6) / frames)) > 0.35 ? p->odd_paces + 1 : 0;
    if (p->odd_paces >= PACES) found(&p->gyro, FATHOM_IMU_CLOCK, samples / frames, 7);
    p->pace_frame_ns = timestamp_ns;
    p->pace_sample_ns = p->last_ns;
}

/* Finds an axis that is constant while the camera turns: stuck, or at its limit; unless the rotation itself is
 * constant. */
void judge_constant(plausibility *p, const plausibility_interval *e) {
    double seconds = 1e-9 * (double)(e->to_ns - e->from_ns), f = 0;
    for (int i = 0; i < 3; i++) f += e->force[i] * e->force[i];
    f = sqrt(f);
    for (int i = 0; i < 6; i++) {
        plausibility_axis *a = &p->axis[i];
        int j = (i + 1) % 3, k = (i + 2) % 3;
        if (a->run < CONSTANT || a->since_ns > e->from_ns) continue;
        if (i < 3) {
            double turn = e->turn[i] * (a->value < 0 ? -1 : 1), read = fabsf(a->value) * seconds;
            if (fabs(turn - read) < 0.3 * fabs(turn)) continue;
            if (turn > 1.15 * read + 2 * TURN_NOISE && at_limit(a, LIMIT_GYRO)) {
                stay_at_limit(p, i, STAYS);
                continue;
            }
            a->turned += fmax(0, fabs(turn) - TURN_NOISE);
            if (a->turned > STUCK_TURN) found(&p->gyro, FATHOM_IMU_STUCK, a->value, 1 << i);
        } else if (e->has_force && f > 0) { /* change of gravity in the IMU's axes: -turn x force */
            a->turned += fabs(e->turn[j] * e->force[k] - e->turn[k] * e->force[j]) / f;
            if (a->turned > STUCK_FORCE_TURN) found(&p->accel, FATHOM_IMU_STUCK, a->value, 1 << i % 3);
        }
    }
}
