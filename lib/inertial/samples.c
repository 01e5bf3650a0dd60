#include "inertial/samples.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/stamps.h"

/* after this many consecutive ones out of order, these are right and the one before them was wrong */
#define LATE_SAMPLES 50
#define MAX_RATE 100.0     /* rad/s: beyond the range of inertial sensors */
#define MAX_FORCE 2000.0   /* m/s^2, the same */
#define SUDDEN_RATE 5.0    /* rad/s from one sample to the next and back: a glitch, not hand-held motion */
#define SUDDEN_FORCE 100.0 /* m/s^2, the same */

static unsigned ring_capacity(const fathom_config *c) {
    unsigned n = 64, wanted = c->max_imu_samples > 0 ? (unsigned)c->max_imu_samples : 4096;
    while (n < wanted) n *= 2;
    return n;
}

void samples_init(imu_samples *s, arena *a, const fathom_config *config) {
    unsigned capacity = ring_capacity(config);
    fathom_imu_sample *ring = arena_take(a, capacity * sizeof *ring);
    inertial_sample *history = arena_take(a, capacity * sizeof *history);
    if (!ring || !history) return;
    memset(s, 0, sizeof *s);
    s->config = config;
    s->ring = ring;
    s->history = history;
    s->capacity = capacity;
    samples_reset(s);
}

void samples_reset(imu_samples *s) {
    s->first = s->count = 0;
    s->period_ns = 0;
    s->doubtful = false;
    s->clocks = (clock_watch){0};
    for (int i = 0; i < 9; i++) s->rotation[i] = s->config->imu_to_camera_rotation[i];
    s->refined_ns = 0;
    stillness_reset(&s->still, s->config->gyro_bias_sigma_rad_s);
}

/* ---- the pushing thread's ---------------------------------------------------------------------------------------- */

/* Whether a value is impossible. False for NaN, which may stand for a missing accelerometer. */
static bool absurd(const fathom_imu_sample *s) {
    for (int i = 0; i < 3; i++)
        if (fabsf(s->gyro[i]) > MAX_RATE || fabsf(s->accel[i]) > MAX_FORCE) return true;
    return false;
}

int samples_push(imu_samples *s, const fathom_imu_sample *sample) {
    const float *g = sample->gyro, *a = sample->accel;
    bool gyro = isfinite(g[0]) && isfinite(g[1]) && isfinite(g[2]);
    bool accel = isfinite(a[0]) && isfinite(a[1]) && isfinite(a[2]);
    bool no_accel = isnan(a[0]) && isnan(a[1]) && isnan(a[2]);
    int64_t t = sample->timestamp_ns; /* checked first, so that the sum doesn't overflow */
    bool stamp = stamp_valid(t) && stamp_valid(t + s->config->imu_clock_offset_ns);
    if (!gyro || !(accel || no_accel) || !stamp) {
        atomic_fetch_add_explicit(&s->not_finite, 1, memory_order_relaxed);
        return FATHOM_ERROR_ARGUMENT;
    }
    if (absurd(sample)) {
        atomic_fetch_add_explicit(&s->absurd, 1, memory_order_relaxed);
        return FATHOM_ERROR_ARGUMENT;
    }
    unsigned head = atomic_load_explicit(&s->head, memory_order_relaxed);
    if (head - atomic_load_explicit(&s->tail, memory_order_acquire) == s->capacity) {
        atomic_fetch_add_explicit(&s->overrun, 1, memory_order_relaxed);
        return FATHOM_ERROR_FULL;
    }
    s->ring[head & (s->capacity - 1)] = *sample;
    atomic_store_explicit(&s->head, head + 1, memory_order_release);
    return FATHOM_OK;
}

/* ---- into the history -------------------------------------------------------------------------------------------- */

unsigned samples_waiting(const imu_samples *s) {
    return atomic_load_explicit(&s->head, memory_order_acquire) -
           atomic_load_explicit(&s->tail, memory_order_relaxed);
}

bool samples_pop(imu_samples *s, fathom_imu_sample *raw) {
    unsigned tail = atomic_load_explicit(&s->tail, memory_order_relaxed);
    *raw = s->ring[tail & (s->capacity - 1)];
    atomic_store_explicit(&s->tail, tail + 1, memory_order_release);
    raw->timestamp_ns += s->config->imu_clock_offset_ns + s->refined_ns + s->shift_ns;
    bool valid = stamp_valid(raw->timestamp_ns);
    s->implausible += !valid;
    return valid;
}

/* Adds a sample to the history, or drops it as out of order. */
static void append(imu_samples *s, const inertial_sample *fresh) {
    if (s->count > 0) {
        int64_t last = sample_at(s, s->count - 1)->timestamp_ns, step = fresh->timestamp_ns - last;
        if (step <= 0) {
            s->out_of_order++;
            if (s->late == 0) s->late_ns = fresh->timestamp_ns;
            if (++s->late < LATE_SAMPLES) return;
            /* not late ones: the clock was set back, or one stamp was far ahead; start anew from here */
            s->count = 0;
            s->period_ns = 0;
            step = 0;
            clock_watch_samples(&s->clocks, last, s->late_ns);
        }
        s->late = 0;
        if (s->count == 0) {
            stillness_end(&s->still);
        } else if (s->period_ns > 0 && step > 5 * s->period_ns) {
            s->gaps++;
            stillness_end(&s->still);
            clock_watch_samples(&s->clocks, last, fresh->timestamp_ns);
        } else {
            s->period_ns = s->period_ns == 0 ? step : s->period_ns + (step - s->period_ns) / 16;
            stillness_age(&s->still, 1e-9 * (double)step);
        }
    }
    if (s->count == s->capacity) {
        s->first++;
        s->count--;
    }
    s->count++;
    *sample_at(s, s->count - 1) = *fresh;
    s->accepted++;
    stillness_add(&s->still, fresh->gyro, fresh->accel, 1e-9 * (double)s->period_ns,
                  s->config->gyro_noise_rad_s_sqrthz);
}

static bool sudden(const inertial_sample *a, const inertial_sample *b) {
    for (int i = 0; i < 3; i++)
        if (fabs(a->gyro[i] - b->gyro[i]) > SUDDEN_RATE || fabs(a->accel[i] - b->accel[i]) > SUDDEN_FORCE)
            return true;
    return false;
}

/* A sudden change waits for the next sample: a glitch ends with it. */
void samples_take(imu_samples *s, const fathom_imu_sample *raw) {
    inertial_sample fresh = {.timestamp_ns = raw->timestamp_ns};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            fresh.gyro[i] += s->rotation[3 * i + j] * raw->gyro[j];
            fresh.accel[i] += s->rotation[3 * i + j] * raw->accel[j];
        }
    if (s->doubtful) {
        s->doubtful = false;
        if (sudden(&s->doubt, &fresh))
            s->implausible++;
        else
            append(s, &s->doubt);
    }
    s->doubtful = s->count > 0 && sudden(sample_at(s, s->count - 1), &fresh);
    if (s->doubtful)
        s->doubt = fresh;
    else
        append(s, &fresh);
}

/* ---- clock and mounting ------------------------------------------------------------------------------------------ */

void samples_follow_clock(imu_samples *s, int64_t frame_ns) {
    if (s->count == 0 || s->accepted == s->watched) return;
    s->watched = s->accepted;
    int64_t newest = sample_at(s, s->count - 1)->timestamp_ns, from = newest;
    int64_t add = clock_watch_frame(&s->clocks, frame_ns, newest, s->period_ns, &from);
    if (add == 0 || fabs((double)s->shift_ns + (double)add) > STAMP_MAX) return;
    s->shift_ns += add;
    s->clock_leaps++;
    for (unsigned i = s->count; i > 0 && sample_at(s, i - 1)->timestamp_ns >= from; i--)
        sample_at(s, i - 1)->timestamp_ns += add;
    s->doubt.timestamp_ns += add;
    log_write(s->config, FATHOM_LOG_WARNING,
              "the clocks of IMU and depth camera leapt apart by %.3f s; the IMU's stamps are moved back",
              -1e-9 * (double)add);
}

static void change(inertial_sample *s, const double r[9], int64_t later_ns) {
    so3_apply(r, s->gyro, s->gyro);
    so3_apply(r, s->accel, s->accel);
    s->timestamp_ns += later_ns;
}

void samples_remount(imu_samples *s, const double mounting[3], int64_t later_ns) {
    double r[9];
    pose turned = pose_identity();
    so3_exp(mounting, r);
    so3_multiply(r, s->rotation, turned.r);
    pose_normalise(&turned);
    memcpy(s->rotation, turned.r, sizeof s->rotation);
    s->refined_ns += later_ns;
    for (unsigned i = 0; i < s->count; i++) change(sample_at(s, i), r, later_ns);
    change(&s->doubt, r, later_ns);
    so3_apply(r, s->still.gyro_bias, s->still.gyro_bias);
    stillness_end(&s->still);
}

/* ---- looking back ------------------------------------------------------------------------------------------------ */

int samples_find(const imu_samples *s, int64_t t) {
    int low = -1, high = (int)s->count;
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (sample_at(s, (unsigned)middle)->timestamp_ns <= t)
            low = middle;
        else
            high = middle;
    }
    return low;
}

void samples_between(const imu_samples *s, int64_t t, int i, double gyro[3], double accel[3]) {
    int last = (int)s->count - 1;
    const inertial_sample *a = sample_at(s, (unsigned)(i < 0 ? 0 : i)),
                          *b = sample_at(s, (unsigned)(i < last ? i + 1 : last));
    double f = 0;
    if (b->timestamp_ns > a->timestamp_ns && i >= 0)
        f = (double)(t - a->timestamp_ns) / (double)(b->timestamp_ns - a->timestamp_ns);
    for (int k = 0; k < 3; k++) {
        gyro[k] = (1 - f) * a->gyro[k] + f * b->gyro[k];
        accel[k] = (1 - f) * a->accel[k] + f * b->accel[k];
    }
}
