#include "inertial/inertial.h"

#include <math.h>
#include <string.h>

#include "base/covariance.h"
#include "base/log.h"
#include "base/stamps.h"

#define STILL_WINDOW 0.05       /* s */
#define STILL_SECONDS 0.4       /* as long as this without motion is a still start */
#define STILL_GYRO 0.06         /* rad/s: a bias at most; a hand turns more */
#define STILL_GYRO_CHANGE 0.03  /* rad/s away from the mean of the stillness so far */
#define STILL_ACCEL_CHANGE 0.25 /* m/s^2, the same */
#define STILL_VELOCITY 0.005    /* m/s: what a hand that holds still, or a tripod, moves at */
#define STILL_SPEED 0.05
#define STILL_WAY 0.005 /* m and rad between poses: no motion */
#define STILL_ANGLE 0.005
#define STILL_WATCHED_NS 150000000 /* as long as this */
#define STILL_TURN 0.002           /* rad/s over a second */
#define BIAS_WALK 2e-4             /* rad/s/sqrt(s): how fast a known gyro bias gets old */
#define ACCEL_WALK 2e-3            /* m/s^2/sqrt(s), the same of the accelerometer's */
#define MAP_TURN_WALK 2e-3         /* rad/sqrt(s): how fast poses and the map drift from the truth together */
#define MAP_WALK 1e-3              /* m/sqrt(s), the same */
#define MISMATCH_LEAST 0.05        /* sigmas that the settings give, times this, are those of a good sensor */
#define MISMATCH_GYRO 0.1          /* the same of a gyroscope, whose noise poses hardly show */
#define MISMATCH_SEED 0.2 /* a seed's floor shrinks no further: clock and mounting are never quite right */
#define MISMATCH_MOST 3
#define MISMATCH_RATE 0.1  /* a pose's part in the mismatch's logarithm */
#define MISMATCH_JUMP 4    /* squared misfit that makes it grow at once */
#define COAST_SECONDS 0.5  /* a hand that isn't measured keeps its velocity and turn for about so long */
#define MOST_BLIND 10.0    /* seconds without samples: trust falls no further */
#define LATE_SAMPLES 50    /* so many out of order in a row are right and the one before them was wrong */
#define HAND_SECONDS 0.2   /* how long a hand's acceleration lasts */
#define MOST_RATE 100.0    /* rad/s: no sensor for a hand reads more */
#define MOST_FORCE 2000.0  /* m/s^2, the same */
#define SUDDEN_RATE 5.0    /* rad/s from one sample to the next and back: a glitch, no hand */
#define SUDDEN_FORCE 100.0 /* m/s^2, the same */
#define DOUBT_RAD                                                                                            \
    0.012 /* a turn between accepted poses that the gyroscope gets more wrong is a contradiction */
#define DOUBT_SECONDS 1.0 /* poses further apart say little */
#define EXACT 1e12        /* information, 1/rad^2 and 1/m^2, of an exact pose */

static unsigned ring_capacity(const fathom_config *c) {
    unsigned n = 64, wanted = c->imu_capacity > 0 ? (unsigned)c->imu_capacity : 4096;
    while (n < wanted) n *= 2;
    return n;
}

static void end_stillness(inertial *n) {
    memset(&n->stillness, 0, sizeof n->stillness);
}

static double still_seconds(const inertial *n) {
    return 1e-9 * (double)n->period_ns * n->stillness.samples;
}

void inertial_init(inertial *n, arena *a, const fathom_config *config) {
    unsigned capacity = ring_capacity(config);
    fathom_imu_sample *ring = arena_take(a, capacity * sizeof *ring);
    inertial_sample *history = arena_take(a, capacity * sizeof *history);
    if (!ring || !history) return;
    memset(n, 0, sizeof *n);
    n->config = config;
    n->ring = ring;
    n->history = history;
    n->capacity = capacity;
    for (int i = 0; i < 3; i++) n->lever[i] = config->imu_to_camera_translation[i];
    inertial_reset(n);
}

void inertial_reset(inertial *n) {
    n->first = n->count = 0;
    n->period_ns = 0;
    n->gyro_bias_sigma = n->config->gyro_bias_sigma;
    memset(n->gyro_bias, 0, sizeof n->gyro_bias);
    memset(n->turning, 0, sizeof n->turning);
    n->running = false;
    n->mismatch = 1;
    memset(&n->state, 0, sizeof n->state);
    n->corrected_ns = INT64_MIN;
    n->corrected = pose_identity();
    end_stillness(n);
    n->doubtful = n->doubted = false;
    n->gyro_error = n->turn_error = 0;
    n->against = 0;
    n->clocks = (clock_watch){0};
    inertial_rig_reset(n);
    inertial_check_reset(n);
}

/* No sensor's value. False for NaN, which may be an accelerometer that isn't there. */
static bool absurd(const fathom_imu_sample *s) {
    for (int i = 0; i < 3; i++)
        if (fabsf(s->gyro[i]) > MOST_RATE || fabsf(s->accel[i]) > MOST_FORCE) return true;
    return false;
}

int inertial_push(inertial *n, const fathom_imu_sample *s) {
    bool gyro = isfinite(s->gyro[0]) && isfinite(s->gyro[1]) && isfinite(s->gyro[2]);
    bool accel = isfinite(s->accel[0]) && isfinite(s->accel[1]) && isfinite(s->accel[2]);
    bool no_accel = isnan(s->accel[0]) && isnan(s->accel[1]) && isnan(s->accel[2]);
    int64_t t = s->timestamp_ns; /* checked twice, so that the sum doesn't overflow */
    bool stamp = t >= -STAMP_MAX && t <= STAMP_MAX;
    if (stamp) t += n->config->imu_clock_offset_ns;
    stamp = stamp && t >= -STAMP_MAX && t <= STAMP_MAX;
    if (!gyro || !(accel || no_accel) || !stamp) {
        atomic_fetch_add_explicit(&n->not_finite, 1, memory_order_relaxed);
        return FATHOM_ERROR_ARGUMENT;
    }
    if (absurd(s)) {
        atomic_fetch_add_explicit(&n->absurd, 1, memory_order_relaxed);
        return FATHOM_ERROR_ARGUMENT;
    }
    unsigned head = atomic_load_explicit(&n->head, memory_order_relaxed);
    if (head - atomic_load_explicit(&n->tail, memory_order_acquire) == n->capacity) {
        atomic_fetch_add_explicit(&n->overrun, 1, memory_order_relaxed);
        return FATHOM_OK;
    }
    n->ring[head & (n->capacity - 1)] = *s;
    atomic_store_explicit(&n->head, head + 1, memory_order_release);
    return FATHOM_OK;
}

static inertial_sample *sample_at(inertial *n, unsigned i) {
    return &n->history[(n->first + i) & (n->capacity - 1)];
}

/* Stillness: over windows, so that white noise averages out, the gyroscope reads its bias and nothing else. Its mean is
 * taken over as long as the stillness lasts. */
static void watch_stillness(inertial *n, const inertial_sample *s) {
    inertial_stillness *w = &n->stillness;
    double period = 1e-9 * (double)n->period_ns, most = w->samples;
    if (w->window_samples == 0 || w->window_samples * period > 10 * STILL_WINDOW) { /* or a gap */
        memset(w->window_gyro, 0, sizeof w->window_gyro);
        memset(w->window_accel, 0, sizeof w->window_accel);
        w->window_samples = 0;
    }
    w->window_samples++;
    for (int i = 0; i < 3; i++) {
        w->window_gyro[i] += s->gyro[i];
        w->window_accel[i] += s->accel[i];
    }
    if (w->window_samples * period < STILL_WINDOW) return;
    bool still = true;
    for (int i = 0; i < 3; i++) {
        double gyro = w->window_gyro[i] / w->window_samples, accel = w->window_accel[i] / w->window_samples;
        still = still && fabs(gyro) < STILL_GYRO;
        if (most > 0 && fabs(gyro - w->gyro[i] / most) > STILL_GYRO_CHANGE) still = false;
        if (most > 0 && fabs(accel - w->accel[i] / most) > STILL_ACCEL_CHANGE) still = false;
    }
    if (!still) {
        end_stillness(n);
        return;
    }
    for (int i = 0; i < 3; i++) {
        w->gyro[i] += w->window_gyro[i];
        w->accel[i] += w->window_accel[i];
    }
    w->samples += w->window_samples;
    w->window_samples = 0;
    double seconds = period * w->samples;
    if (seconds < STILL_SECONDS) return;
    double sigma = n->config->gyro_noise / sqrt(seconds) + 1e-4;
    if (sigma > n->gyro_bias_sigma) return; /* what is known is better */
    for (int i = 0; i < 3; i++) n->gyro_bias[i] = w->gyro[i] / w->samples;
    n->gyro_bias_sigma = sigma;
}

/* A sample takes its place in the history, or is dropped as out of order. */
static void append(inertial *n, const inertial_sample *s) {
    if (n->count > 0) {
        int64_t last = sample_at(n, n->count - 1)->timestamp_ns, step = s->timestamp_ns - last;
        if (step <= 0) {
            n->counters.imu_out_of_order++;
            if (n->late == 0) n->late_ns = s->timestamp_ns;
            if (++n->late < LATE_SAMPLES) return;
            n->count =
                0; /* not stragglers: the clock was set back, or one stamp lay far ahead. Start anew from here */
            n->period_ns = 0;
            step = 0;
            clock_watch_samples(&n->clocks, last, n->late_ns);
        }
        n->late = 0;
        if (n->count == 0) {
            end_stillness(n);
        } else if (n->period_ns > 0 && step > 5 * n->period_ns) {
            n->counters.imu_gaps++;
            end_stillness(n);
            clock_watch_samples(&n->clocks, last, s->timestamp_ns);
        } else {
            n->period_ns = n->period_ns == 0 ? step : n->period_ns + (step - n->period_ns) / 16;
            n->gyro_bias_sigma =
                sqrt(n->gyro_bias_sigma * n->gyro_bias_sigma + BIAS_WALK * BIAS_WALK * 1e-9 * (double)step);
        }
    }
    if (n->count == n->capacity) {
        n->first++;
        n->count--;
    }
    n->count++;
    *sample_at(n, n->count - 1) = *s;
    n->counters.imu_accepted++;
    watch_stillness(n, s);
}

static bool sudden(const inertial_sample *a, const inertial_sample *b) {
    for (int i = 0; i < 3; i++)
        if (fabs(a->gyro[i] - b->gyro[i]) > SUDDEN_RATE || fabs(a->accel[i] - b->accel[i]) > SUDDEN_FORCE)
            return true;
    return false;
}

/* Onto the depth clock and into camera axes. A sudden change waits for the next sample: a glitch ends with it. */
static void take(inertial *n, const fathom_imu_sample *raw) {
    inertial_sample s = {.timestamp_ns =
                             raw->timestamp_ns + n->config->imu_clock_offset_ns + n->refined_ns +
                                        n->clock_shift_ns};
    if (s.timestamp_ns < -STAMP_MAX || s.timestamp_ns > STAMP_MAX) {
        n->counters.imu_implausible++;
        return;
    }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            s.gyro[i] += n->rotation[3 * i + j] * raw->gyro[j];
            s.accel[i] += n->rotation[3 * i + j] * raw->accel[j];
        }
    plausibility_sample(&n->check, s.timestamp_ns, raw->gyro, raw->accel);
    if (n->doubtful) {
        n->doubtful = false;
        if (sudden(&n->doubt, &s))
            n->counters.imu_implausible++;
        else
            append(n, &n->doubt);
    }
    n->doubtful = n->count > 0 && sudden(sample_at(n, n->count - 1), &s);
    if (n->doubtful)
        n->doubt = s;
    else
        append(n, &s);
}

void inertial_drain(inertial *n) {
    unsigned tail = atomic_load_explicit(&n->tail, memory_order_relaxed);
    unsigned head = atomic_load_explicit(&n->head, memory_order_acquire);
    for (; tail != head; tail++) {
        take(n, &n->ring[tail & (n->capacity - 1)]);
        atomic_store_explicit(&n->tail, tail + 1, memory_order_release);
    }
}

void inertial_follow_clock(inertial *n, int64_t frame_ns) {
    if (n->count == 0 || n->counters.imu_accepted == n->watched) return;
    n->watched = n->counters.imu_accepted;
    int64_t newest = sample_at(n, n->count - 1)->timestamp_ns, from = newest;
    int64_t add = clock_watch_frame(&n->clocks, frame_ns, newest, n->period_ns, &from);
    if (add == 0 || fabs((double)n->clock_shift_ns + (double)add) > STAMP_MAX) return;
    n->clock_shift_ns += add;
    n->counters.imu_clock_leaps++;
    for (unsigned i = n->count; i > 0 && sample_at(n, i - 1)->timestamp_ns >= from; i--)
        sample_at(n, i - 1)->timestamp_ns += add;
    n->doubt.timestamp_ns += add;
    log_write(n->config, FATHOM_LOG_WARNING,
              "the clocks of IMU and depth camera leapt apart by %.3f s; the IMU's stamps are moved back",
              -1e-9 * (double)add);
}

/* Index of the last sample at or before t, or -1. */
static int find_sample(inertial *n, int64_t t) {
    int low = -1, high = (int)n->count;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (sample_at(n, (unsigned)middle)->timestamp_ns <= t)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Rate and specific force at t, interpolated; held before the first and after the last sample. i: find_sample(t). */
static void sample_between(inertial *n, int64_t t, int i, double gyro[3], double accel[3]) {
    int last = (int)n->count - 1;
    const inertial_sample *a = sample_at(n, (unsigned)(i < 0 ? 0 : i)),
                          *b = sample_at(n, (unsigned)(i < last ? i + 1 : last));
    double f = 0;
    if (b->timestamp_ns > a->timestamp_ns && i >= 0)
        f = (double)(t - a->timestamp_ns) / (double)(b->timestamp_ns - a->timestamp_ns);
    for (int k = 0; k < 3; k++) {
        gyro[k] = (1 - f) * a->gyro[k] + f * b->gyro[k];
        accel[k] = (1 - f) * a->accel[k] + f * b->accel[k];
    }
}

/* One stretch between neighbouring samples, or without any: i is find_sample(early). forward: from early to late. */
static void stretch(inertial *n, navigator *s, int64_t early, int64_t late, int i, bool forward) {
    const fathom_config *c = n->config;
    bool imu = n->usable && n->count > 1 && !n->doubted;
    double dt = 1e-9 * ((double)late - (double)early), period = 1e-9 * (double)n->period_ns;
    double w0[3], w1[3], a0[3], a1[3], gyro[3], accel[3];
    navigator_noise noise = {
        c->gyro_noise, c->motion_accel_sigma * sqrt(HAND_SECONDS), BIAS_WALK, ACCEL_WALK, 0, MAP_TURN_WALK,
        MAP_WALK};
    bool inside = imu && i >= 0 && i + 1 < (int)n->count;
    bool gap = inside && (double)(sample_at(n, (unsigned)(i + 1))->timestamp_ns -
                                  sample_at(n, (unsigned)i)->timestamp_ns) > 5e9 * period;
    bool near = false; /* just before the first sample or after the last */
    if (imu && i < 0) near = (double)sample_at(n, 0)->timestamp_ns - (double)early < 1.5e9 * period;
    if (imu && i + 1 == (int)n->count)
        near = (double)late - (double)sample_at(n, n->count - 1)->timestamp_ns < 1.5e9 * period;
    bool covered = (inside && !gap) || near;
    if (!covered) dt = fmin(dt, MOST_BLIND);
    /* the latest that is known of the rate: a sample, or the way between the last two poses */
    int64_t sampled = imu && i >= 0 ? sample_at(n, (unsigned)i)->timestamp_ns : INT64_MIN;
    bool by_poses = !imu || (!covered && n->corrected_ns > sampled && n->corrected_ns <= early);
    if (!by_poses) {
        sample_between(n, early, i, w0, a0);
        sample_between(n, late, i, w1, a1);
        for (int k = 0; k < 3; k++) {
            gyro[k] = 0.5 * (w0[k] + w1[k]);
            accel[k] = 0.5 * (a0[k] + a1[k]);
        }
    } else {
        for (int k = 0; k < 3; k++) gyro[k] = n->turning[k] + s->gyro_bias[k];
    }
    double coast = dt;
    if (!covered) { /* the angle grows as motion_turn_sigma T^2 with the time T since the rate was known, however it is cut */
        int64_t known = by_poses ? n->corrected_ns : sampled == INT64_MIN ? early : sampled;
        double age = known == INT64_MIN ? 0 : fmin(1e-9 * fabs((double)early - (double)known), MOST_BLIND);
        noise.turn = c->motion_turn_sigma * sqrt(pow(age + dt, 4) - pow(age, 4));
        if (n->running) coast = fmin(dt, fmax(COAST_SECONDS - age, 0));
    }
    bool force = covered && n->force_usable && isfinite(accel[0] + accel[1] + accel[2]) && n->running;
    if (covered) noise.gyro *= fmax(n->mismatch, MISMATCH_GYRO);
    if (force) noise.accel = c->accel_noise * n->mismatch;
    navigator ahead = *s;
    if (coast < dt) navigator_step(&ahead, forward ? coast : -coast, gyro, NULL, &noise);
    navigator_step(s, forward ? dt : -dt, gyro, force ? accel : NULL, &noise);
    if (coast < dt) { /* at rest from there on, but no surer of it */
        memcpy(s->r, ahead.r, sizeof s->r);
        memcpy(s->p, ahead.p, sizeof s->p);
    }
}

/* Takes a state forward or back to another time, stretch by stretch. */
static void travel(inertial *n, navigator *s, int64_t to) {
    int64_t t = s->timestamp_ns;
    int i = find_sample(n, t);
    while (t < to) {
        int64_t next = i + 1 < (int)n->count ? sample_at(n, (unsigned)(i + 1))->timestamp_ns : to;
        if (next > to) next = to;
        if (next > t) stretch(n, s, t, next, i, true);
        t = next;
        i++;
    }
    while (t > to) {
        int64_t next = i >= 0 ? sample_at(n, (unsigned)i)->timestamp_ns : to;
        if (next < to) next = to;
        if (next < t) stretch(n, s, next, t, i, false);
        t = next;
        i--;
    }
    s->timestamp_ns = to;
}

/* A state for when there is none: at rest somewhere, to be integrated from. */
static void rest(inertial *n, navigator *s, int64_t timestamp_ns) {
    pose origin = pose_identity();
    const double none[3] = {0, 0, 0};
    s->timestamp_ns = timestamp_ns;
    navigator_start(s, &origin, none, 0.5, n->gyro_bias_sigma, n->config->accel_bias_sigma, 1);
    memcpy(s->gyro_bias, n->gyro_bias, sizeof s->gyro_bias);
}

int inertial_estimate(inertial *n, int64_t from_ns, int64_t to_ns, inertial_motion *out) {
    const fathom_config *c = n->config;
    if (!n->running && !(n->usable && n->count > 1)) return FATHOM_ERROR_NO_DATA;
    int64_t early = from_ns < to_ns ? from_ns : to_ns, late = from_ns < to_ns ? to_ns : from_ns;
    navigator whole, s;
    if (n->running)
        whole = n->state;
    else
        rest(n, &whole, early);
    travel(n, &whole, early);
    s = whole;
    navigator_forget_pose_error(&s);
    pose before = navigator_camera(&s, n->lever);
    travel(n, &s, late);
    pose after = navigator_camera(&s, n->lever);
    out->motion = pose_between(&before, &after);
    navigator_camera_covariance(&s, n->lever, out->covariance);
    travel(n, &whole, late);
    navigator_camera_covariance(&whole, n->lever, out->pose_covariance);
    if (from_ns > to_ns) { /* the error of the inverse, in the earlier camera's axes */
        double adjoint[36];
        pose_adjoint(&out->motion, adjoint);
        covariance_transport(adjoint, out->covariance, out->covariance);
        out->motion = pose_inverse(&out->motion);
    }
    for (int i = 0; i < 6; i++) {
        double floor = fmax(n->mismatch, MISMATCH_SEED) * (i < 3 ? c->seed_floor_rad : c->seed_floor_m);
        out->covariance[7 * i] += floor * floor;
        out->pose_covariance[7 * i] += floor * floor;
    }
    return FATHOM_OK;
}

/* Detected stillness corrects the navigator, with or without a pose. */
static void stand_still(inertial *n) {
    inertial_stillness *w = &n->stillness;
    double mean[3], seconds = 1e-9 * (double)n->period_ns * (w->samples - w->used);
    if (still_seconds(n) < STILL_SECONDS || w->samples == w->used) return;
    /* a slide or a slow pan at an even rate feels the same: the poses and the velocity must agree */
    if (!w->anchored) {
        w->anchored = true;
        w->anchor = n->corrected;
        w->anchor_ns = n->corrected_ns;
    }
    pose way = pose_between(&w->anchor, &n->corrected);
    const double *v = n->state.v;
    bool moved = pose_distance(&way) > STILL_WAY || pose_angle(&way) > STILL_ANGLE ||
                 v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > STILL_SPEED * STILL_SPEED;
    if (moved) end_stillness(n);
    if (moved || n->corrected_ns - w->anchor_ns < STILL_WATCHED_NS) return;
    for (int i = 0; i < 3; i++) {
        mean[i] = (w->gyro[i] - w->used_gyro[i]) / (w->samples - w->used);
        w->used_gyro[i] = w->gyro[i];
    }
    w->used = w->samples;
    navigator_still(&n->state, STILL_VELOCITY, mean, STILL_TURN / sqrt(seconds));
}

void inertial_advance(inertial *n, int64_t timestamp_ns) {
    if (!n->running) return;
    travel(n, &n->state, timestamp_ns);
    stand_still(n);
}

/* Gravity, from the specific force of the last quarter of a second, as if that had been without acceleration. */
static void start(inertial *n, const pose *accepted, int64_t timestamp_ns) {
    const fathom_config *c = n->config;
    navigator s;
    rest(n, &s, timestamp_ns);
    double force[3] = {0, 0, 0}, length = 0, gravity[3] = {0, 0, 0};
    int used = 0;
    for (int i = find_sample(n, timestamp_ns); i >= 0; i--) {
        const inertial_sample *a = sample_at(n, (unsigned)i);
        if (timestamp_ns - a->timestamp_ns > 250000000 || !isfinite(a->accel[0] + a->accel[1] + a->accel[2]))
            break;
        travel(n, &s, a->timestamp_ns); /* R(first)^T R(sample) */
        for (int j = 0; j < 3; j++)
            force[j] +=
                s.r[3 * j] * a->accel[0] + s.r[3 * j + 1] * a->accel[1] + s.r[3 * j + 2] * a->accel[2];
        used++;
    }
    for (int j = 0; j < 3; j++) length += force[j] * force[j];
    length = sqrt(length);
    if (used > 0 && length > 1e-6)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) gravity[j] -= accepted->r[3 * j + k] * force[k] / length * c->gravity;
    bool still = still_seconds(n) > 0.1;
    pose lever = pose_identity();
    memcpy(lever.t, n->lever, sizeof lever.t);
    pose imu = pose_multiply(accepted, &lever);
    n->state.timestamp_ns = timestamp_ns;
    navigator_start(&n->state, &imu, gravity, still ? 0.03 : 0.5, n->gyro_bias_sigma, c->accel_bias_sigma,
                    used == 0 ? 10
                    : still   ? 0.03
                              : 1);
    memcpy(n->state.gyro_bias, n->gyro_bias, sizeof n->gyro_bias);
    n->running = true;
}

/* The angle between the poses' way and what is foretold of it, squared; by the samples or without. */
static double foretold_wrongly(inertial *n, bool without, const pose *way, int64_t from_ns, int64_t to_ns) {
    inertial_motion m;
    bool doubted = n->doubted;
    n->doubted = without;
    int e = inertial_estimate(n, from_ns, to_ns, &m);
    n->doubted = doubted;
    if (e != FATHOM_OK) return 0;
    pose rest = pose_between(&m.motion, way);
    return fmin(pow(pose_angle(&rest), 2), 1);
}

/* Do the samples still tell of this camera's turning? A clock that leapt unseen, or a loose IMU, shows here. */
static void doubt(inertial *n, const pose *accepted, int64_t timestamp_ns) {
    double dt = 1e-9 * ((double)timestamp_ns - (double)n->corrected_ns);
    int last = find_sample(n, timestamp_ns), first = find_sample(n, n->corrected_ns);
    if (!n->config->imu || n->count < 2 || first < 0 || dt > DOUBT_SECONDS) return;
    double samples = last - first, wanted = 1e9 * dt / (double)n->period_ns;
    if (samples < 0.5 * wanted || samples < 1) return; /* a gap */
    pose way = pose_between(&n->corrected, accepted);
    double gyro = foretold_wrongly(n, false, &way, n->corrected_ns, timestamp_ns);
    double turn = foretold_wrongly(n, true, &way, n->corrected_ns, timestamp_ns);
    n->gyro_error += (gyro - n->gyro_error) / 4;
    n->turn_error += (turn - n->turn_error) / 4;
    double much = DOUBT_RAD * DOUBT_RAD;
    bool was = n->doubted;
    n->against = gyro > fmax(much, turn) ? n->against + 1 : 0; /* one interval may be the poses' fault */
    n->doubted = was ? n->gyro_error > fmax(much / 4, n->turn_error / 2)
                     : n->against > 1 && n->gyro_error > fmax(much, 4 * n->turn_error);
    if (n->doubted == was) return;
    n->counters.imu_doubts += n->doubted;
    log_write(n->config, FATHOM_LOG_INFO,
              n->doubted
                  ? "the gyroscope contradicts the poses: the scan goes on without the IMU until they agree"
                  : "gyroscope and poses agree again");
}

/* The settings' noise is that of a poor sensor on a loose mount. How much better this rig is shows in how far poses lie from
 * where inertia put them; a sudden misfit widens the stretch that it happened in. */
static void correct(inertial *n, const pose *accepted, const double information[36], const double pull[6],
                    int64_t timestamp_ns) {
    const fathom_config *c = n->config;
    double floor_rad = c->pose_noise_rad * n->mismatch, floor_m = c->pose_noise_m * n->mismatch;
    navigator before = n->state;
    travel(n, &n->state, timestamp_ns);
    double misfit = navigator_misfit(&n->state, n->lever, accepted, information, pull, floor_rad, floor_m);
    if (misfit >= 0 && n->usable && n->count > 1) {
        double factor = misfit > MISMATCH_JUMP ? sqrt(misfit / 2) : exp(0.5 * MISMATCH_RATE * (misfit - 1));
        n->mismatch = fmin(fmax(n->mismatch * factor, MISMATCH_LEAST), MISMATCH_MOST);
        if (misfit > MISMATCH_JUMP) {
            n->state = before;
            travel(n, &n->state, timestamp_ns);
            floor_rad = c->pose_noise_rad * n->mismatch;
            floor_m = c->pose_noise_m * n->mismatch;
        }
    }
    navigator_correct(&n->state, n->lever, accepted, information, pull, floor_rad, floor_m);
}

void inertial_correct(inertial *n, const pose *accepted, const double information[36], const double pull[6],
                      int64_t timestamp_ns) {
    if (n->corrected_ns != INT64_MIN && timestamp_ns > n->corrected_ns) {
        double dt = 1e-9 * ((double)timestamp_ns - (double)n->corrected_ns), w[3];
        if (n->running) doubt(n, accepted, timestamp_ns);
        pose way = pose_between(&n->corrected, accepted);
        so3_log(way.r, w);
        for (int i = 0; i < 3; i++) n->turning[i] = w[i] / dt;
    }
    if (!n->running) {
        start(n, accepted, timestamp_ns);
    } else {
        double exact[36] = {0};
        for (int i = 0; i < 6; i++) exact[7 * i] = EXACT;
        correct(n, accepted, information ? information : exact, pull, timestamp_ns);
        stand_still(n);
    }
    n->corrected = *accepted;
    n->corrected_ns = timestamp_ns;
}
