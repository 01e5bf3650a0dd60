#include "inertial.h"

#include <math.h>
#include <string.h>

#include "config.h"

#define STILL_SECONDS 0.4       /* as long as this without motion is a still start */
#define STILL_GYRO 0.06         /* rad/s: a bias at most; a hand turns more */
#define STILL_GYRO_CHANGE 0.03  /* rad/s away from the mean of the stillness so far */
#define STILL_ACCEL_CHANGE 0.25 /* m/s^2, the same */
#define BIAS_WALK 2e-4          /* rad/s/sqrt(s): how fast a known gyro bias gets old */
#define SIGMA_MOST 1e3          /* rad and m: nothing is known */
#define COAST_SECONDS 10.0      /* no hand keeps its velocity for longer */

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
    inertial_reset(n);
}

void inertial_reset(inertial *n) {
    n->first = n->count = 0;
    n->period_ns = 0;
    n->gyro_bias_sigma = n->config->gyro_bias_sigma;
    memset(n->gyro_bias, 0, sizeof n->gyro_bias);
    memset(n->velocity, 0, sizeof n->velocity);
    memset(n->turning, 0, sizeof n->turning);
    n->velocity_sigma = 0.5;
    n->corrected_ns = INT64_MIN;
    n->corrected = pose_identity();
    n->still_samples = 0;
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
            return;
        }
        if (n->period_ns > 0 && step > 5 * n->period_ns) {
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

/* The bias-free rate at t, interpolated; held before the first and after the last sample. */
static void rate_at(inertial *n, int64_t t, int i, double w[3]) {
    int last = (int)n->count - 1;
    const inertial_sample *a = sample_at(n, (unsigned)(i < 0 ? 0 : i)),
                          *b = sample_at(n, (unsigned)(i < last ? i + 1 : last));
    double f = 0;
    if (b->timestamp_ns > a->timestamp_ns && i >= 0)
        f = (double)(t - a->timestamp_ns) / (double)(b->timestamp_ns - a->timestamp_ns);
    for (int k = 0; k < 3; k++) w[k] = (1 - f) * a->gyro[k] + f * b->gyro[k] - n->gyro_bias[k];
}

/* Rotation from the camera at `to` to the camera at `from` (from < to), interval by interval at the mean of its ends'
 * rates. Returns the seconds that no sample covers. */
static double integrate_rotation(inertial *n, int64_t from, int64_t to, double r[9]) {
    pose p = pose_identity();
    int i = find_sample(n, from);
    int64_t t = from;
    double uncovered = 0;
    while (t < to) {
        int64_t next = i + 1 < (int)n->count ? sample_at(n, (unsigned)(i + 1))->timestamp_ns : to;
        if (next > to) next = to;
        double dt = 1e-9 * (double)(next - t), a[3], b[3], w[3], step[9];
        rate_at(n, t, i, a);
        rate_at(n, next, i, b);
        for (int k = 0; k < 3; k++) w[k] = 0.5 * (a[k] + b[k]) * dt;
        so3_exp(w, step);
        so3_multiply(p.r, step, p.r);
        bool covered = i >= 0 && i + 1 < (int)n->count && dt < 1e-9 * 5 * (double)n->period_ns;
        if (!covered && dt > 1e-9 * 1.5 * (double)n->period_ns) uncovered += dt;
        t = next;
        i++;
    }
    pose_normalise(&p);
    memcpy(r, p.r, sizeof p.r);
    return uncovered;
}

int inertial_estimate(inertial *n, const pose *at, int64_t from_ns, int64_t to_ns, inertial_motion *out) {
    const fathom_config *c = n->config;
    bool gyro = c->imu && n->count > 1;
    if (!gyro && n->corrected_ns == INT64_MIN) return FATHOM_ERROR_NO_DATA;
    int64_t early = from_ns < to_ns ? from_ns : to_ns, late = from_ns < to_ns ? to_ns : from_ns;
    double dt = 1e-9 * (double)(late - early),
           coasting = copysign(fmin(dt, COAST_SECONDS), from_ns < to_ns ? 1 : -1);

    pose m = pose_identity();
    double sigma_r, uncovered = dt;
    if (gyro) {
        uncovered = integrate_rotation(n, early, late, m.r);
        sigma_r = c->gyro_noise * sqrt(dt) + n->gyro_bias_sigma * dt;
    } else {
        double w[3];
        for (int k = 0; k < 3; k++) w[k] = n->turning[k] * dt;
        so3_exp(w, m.r);
        sigma_r = 0;
    }
    sigma_r += c->motion_turn_sigma * uncovered * uncovered + c->seed_floor_rad;
    sigma_r = fmin(sigma_r, SIGMA_MOST); /* a clock that jumps by years must not end in infinity */
    if (from_ns > to_ns) m = pose_inverse(&m);

    /* constant velocity; how far a hand's acceleration leads away from it */
    double age = n->corrected_ns == INT64_MIN ? 0 : 1e-9 * fabs((double)(early - n->corrected_ns));
    double sigma_t = n->velocity_sigma * dt + c->motion_accel_sigma * dt * (0.5 * dt + age) + c->seed_floor_m;
    sigma_t = fmin(sigma_t, SIGMA_MOST);
    for (int i = 0; i < 3 && c->imu_translation;
         i++) /* world velocity in the axes of the camera at from_ns */
        for (int j = 0; j < 3; j++) m.t[i] += at->r[3 * j + i] * n->velocity[j] * coasting;

    out->motion = m;
    memset(out->covariance, 0, sizeof out->covariance);
    for (int i = 0; i < 3; i++) {
        out->covariance[7 * i] = sigma_r * sigma_r;
        out->covariance[7 * (i + 3)] = sigma_t * sigma_t;
    }
    return FATHOM_OK;
}

void inertial_correct(inertial *n, const pose *accepted, int64_t timestamp_ns) {
    if (n->corrected_ns != INT64_MIN && timestamp_ns > n->corrected_ns) {
        double dt = 1e-9 * (double)(timestamp_ns - n->corrected_ns), w[3];
        pose way = pose_between(&n->corrected, accepted);
        so3_log(way.r, w);
        for (int i = 0; i < 3; i++) {
            n->velocity[i] = (accepted->t[i] - n->corrected.t[i]) / dt;
            n->turning[i] = w[i] / dt;
        }
        /* the mean velocity of the interval is that of its middle */
        n->velocity_sigma = n->config->motion_accel_sigma * 0.5 * dt + 0.003 / dt;
    }
    n->corrected = *accepted;
    n->corrected_ns = timestamp_ns;
}
