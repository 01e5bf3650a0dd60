#include "inertial.h"

#include <math.h>
#include <string.h>

#include "config.h"

#define STILL_SECONDS 0.4       /* as long as this without motion is a still start */
#define STILL_GYRO 0.06         /* rad/s: a bias at most; a hand turns more */
#define STILL_GYRO_CHANGE 0.03  /* rad/s away from the mean of the stillness so far */
#define STILL_ACCEL_CHANGE 0.25 /* m/s^2, the same */
#define BIAS_WALK 2e-4          /* rad/s/sqrt(s): how fast a known gyro bias gets old */
#define ACCEL_WALK 2e-3         /* m/s^2/sqrt(s), the same of the accelerometer's */
#define COAST_SECONDS 10.0      /* without samples: no hand keeps its velocity and turn for longer */
#define LATE_SAMPLES 50  /* so many out of order in a row are right and the one before them was wrong */
#define HAND_SECONDS 0.2 /* how long a hand's acceleration lasts */
#define EXACT 1e12       /* information, 1/rad^2 and 1/m^2, of an exact pose */

static unsigned ring_capacity(const fathom_config *c) {
    unsigned n = 64, wanted = c->imu_capacity > 0 ? (unsigned)c->imu_capacity : 4096;
    while (n < wanted) n *= 2;
    return n;
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
    for (int i = 0; i < 9; i++) n->rotation[i] = config->imu_to_camera_rotation[i];
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
    memset(&n->state, 0, sizeof n->state);
    n->corrected_ns = INT64_MIN;
    n->corrected = pose_identity();
    n->still_samples = 0;
    inertial_check_reset(n);
}

int inertial_push(inertial *n, const fathom_imu_sample *s) {
    bool gyro = isfinite(s->gyro[0]) && isfinite(s->gyro[1]) && isfinite(s->gyro[2]);
    bool accel = isfinite(s->accel[0]) && isfinite(s->accel[1]) && isfinite(s->accel[2]);
    bool no_accel = isnan(s->accel[0]) && isnan(s->accel[1]) && isnan(s->accel[2]);
    int64_t t = s->timestamp_ns; /* checked twice, so that the sum doesn't overflow */
    bool stamp = t >= -STAMP_MOST && t <= STAMP_MOST;
    if (stamp) t += n->config->imu_clock_offset_ns;
    stamp = stamp && t >= -STAMP_MOST && t <= STAMP_MOST;
    if (!gyro || !(accel || no_accel) || !stamp) {
        atomic_fetch_add_explicit(&n->not_finite, 1, memory_order_relaxed);
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

/* Stillness: the gyroscope reads its bias and nothing else. Its mean is taken over as long as the stillness lasts. */
static void watch_stillness(inertial *n, const inertial_sample *s) {
    double k = n->still_samples, seconds = 1e-9 * (double)n->period_ns * k;
    bool still = true;
    for (int i = 0; i < 3; i++) {
        still = still && fabs(s->gyro[i]) < STILL_GYRO;
        if (k > 0 && fabs(s->gyro[i] - n->still_sum[i] / k) > STILL_GYRO_CHANGE) still = false;
        if (k > 0 && fabs(s->accel[i] - n->still_accel[i] / k) > STILL_ACCEL_CHANGE) still = false;
    }
    if (!still || k == 0) {
        n->still_samples = still ? 1 : 0;
        memcpy(n->still_sum, s->gyro, sizeof n->still_sum);
        memcpy(n->still_accel, s->accel, sizeof n->still_accel);
        return;
    }
    n->still_samples++;
    for (int i = 0; i < 3; i++) {
        n->still_sum[i] += s->gyro[i];
        n->still_accel[i] += s->accel[i];
    }
    if (seconds < STILL_SECONDS) return;
    double sigma = n->config->gyro_noise / sqrt(seconds) + 1e-4;
    if (sigma > n->gyro_bias_sigma) return; /* what is known is better */
    for (int i = 0; i < 3; i++) n->gyro_bias[i] = n->still_sum[i] / (k + 1);
    n->gyro_bias_sigma = sigma;
}

static void append(inertial *n, const fathom_imu_sample *raw) {
    inertial_sample s = {.timestamp_ns = raw->timestamp_ns + n->config->imu_clock_offset_ns};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            s.gyro[i] += n->rotation[3 * i + j] * raw->gyro[j];
            s.accel[i] += n->rotation[3 * i + j] * raw->accel[j];
        }
    if (n->count > 0) {
        int64_t step = s.timestamp_ns - sample_at(n, n->count - 1)->timestamp_ns;
        if (step <= 0) {
            n->counters.imu_out_of_order++;
            if (++n->late < LATE_SAMPLES) return;
            n->count =
                0; /* not stragglers: the clock was set back, or one stamp lay far ahead. Start anew from here */
            n->period_ns = 0;
            step = 0;
        }
        n->late = 0;
        if (n->count == 0) {
            n->still_samples = 0;
        } else if (n->period_ns > 0 && step > 5 * n->period_ns) {
            n->counters.imu_gaps++;
            n->still_samples = 0;
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
    *sample_at(n, n->count - 1) = s;
    n->counters.imu_accepted++;
    watch_stillness(n, &s);
    plausibility_sample(&n->check, s.timestamp_ns, raw->gyro, raw->accel);
}

void inertial_drain(inertial *n) {
    unsigned tail = atomic_load_explicit(&n->tail, memory_order_relaxed);
    unsigned head = atomic_load_explicit(&n->head, memory_order_acquire);
    for (; tail != head; tail++) {
        append(n, &n->ring[tail & (n->capacity - 1)]);
        atomic_store_explicit(&n->tail, tail + 1, memory_order_release);
    }
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
    bool imu = n->usable && n->count > 1;
    double dt = 1e-9 * ((double)late - (double)early), period = 1e-9 * (double)n->period_ns;
    double w0[3], w1[3], a0[3], a1[3], gyro[3], accel[3];
    navigator_noise noise = {c->gyro_noise, c->motion_accel_sigma * sqrt(HAND_SECONDS), BIAS_WALK, ACCEL_WALK,
                             0};
    bool inside = imu && i >= 0 && i + 1 < (int)n->count;
    bool gap = inside && (double)(sample_at(n, (unsigned)(i + 1))->timestamp_ns -
                                  sample_at(n, (unsigned)i)->timestamp_ns) > 5e9 * period;
    bool near = false; /* just before the first sample or after the last */
    if (imu && i < 0) near = (double)sample_at(n, 0)->timestamp_ns - (double)early < 1.5e9 * period;
    if (imu && i + 1 == (int)n->count)
        near = (double)late - (double)sample_at(n, n->count - 1)->timestamp_ns < 1.5e9 * period;
    bool covered = (inside && !gap) || near;
    if (!covered) dt = fmin(dt, COAST_SECONDS);
    if (imu) {
        sample_between(n, early, i, w0, a0);
        sample_between(n, late, i, w1, a1);
        for (int k = 0; k < 3; k++) {
            gyro[k] = 0.5 * (w0[k] + w1[k]);
            accel[k] = 0.5 * (a0[k] + a1[k]);
        }
    } else {
        for (int k = 0; k < 3; k++) gyro[k] = n->turning[k] + s->gyro_bias[k];
    }
    if (!covered) { /* the angle grows as motion_turn_sigma T^2 with the time T since the rate was known, however it is cut */
        int64_t known = imu && i >= 0 ? sample_at(n, (unsigned)i)->timestamp_ns
                        : imu         ? early
                                      : n->corrected_ns;
        double age = known == INT64_MIN ? 0 : fmin(1e-9 * fabs((double)early - (double)known), COAST_SECONDS);
        noise.turn = c->motion_turn_sigma * sqrt(pow(age + dt, 4) - pow(age, 4));
    }
    bool force = covered && n->force_usable && isfinite(accel[0] + accel[1] + accel[2]) && n->running;
    if (force) noise.accel = c->accel_noise;
    navigator_step(s, forward ? dt : -dt, gyro, force ? accel : NULL, &noise);
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
        double floor = i < 3 ? c->seed_floor_rad : c->seed_floor_m;
        out->covariance[7 * i] += floor * floor;
        out->pose_covariance[7 * i] += floor * floor;
    }
    return FATHOM_OK;
}

void inertial_advance(inertial *n, int64_t timestamp_ns) {
    if (n->running) travel(n, &n->state, timestamp_ns);
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
    bool still = 1e-9 * (double)n->period_ns * n->still_samples > 0.1;
    pose lever = pose_identity();
    memcpy(lever.t, n->lever, sizeof lever.t);
    pose imu = pose_multiply(accepted, &lever);
    n->state.timestamp_ns = timestamp_ns;
    navigator_start(&n->state, &imu, gravity, still ? 0.03 : 0.5, n->gyro_bias_sigma, c->accel_bias_sigma,
                    used == 0 ? 10
                    : still   ? 0.2
                              : 1);
    memcpy(n->state.gyro_bias, n->gyro_bias, sizeof n->gyro_bias);
    n->running = true;
}

void inertial_correct(inertial *n, const pose *accepted, const double information[36], int64_t timestamp_ns) {
    const fathom_config *c = n->config;
    if (n->corrected_ns != INT64_MIN && timestamp_ns > n->corrected_ns) {
        double dt = 1e-9 * ((double)timestamp_ns - (double)n->corrected_ns), w[3];
        pose way = pose_between(&n->corrected, accepted);
        so3_log(way.r, w);
        for (int i = 0; i < 3; i++) n->turning[i] = w[i] / dt;
    }
    if (!n->running) {
        start(n, accepted, timestamp_ns);
    } else {
        double exact[36] = {0};
        for (int i = 0; i < 6; i++) exact[7 * i] = EXACT;
        travel(n, &n->state, timestamp_ns);
        navigator_correct(&n->state, n->lever, accepted, information ? information : exact, c->pose_noise_rad,
                          c->pose_noise_m);
    }
    n->corrected = *accepted;
    n->corrected_ns = timestamp_ns;
}
