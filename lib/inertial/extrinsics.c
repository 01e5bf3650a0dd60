#include "inertial/extrinsics.h"

#include <math.h>
#include <string.h>

#include "base/se3.h"

#define N RIG_STATES
#define POSE_NOISE 0.002  /* rad: usual error of alignment's orientation */
#define TURN_NOISE 0.008  /* rad/sqrt(rad) of rotation: scale and skew of the gyroscope, the lens */
#define GYRO_NOISE 0.0015 /* rad/sqrt(s), including alignment's drift */
#define NOISE_LEAST 0.1   /* of their squares: minimum, for a better camera and gyroscope than usual */
#define NOISE_MOST 25     /* worse ones */
#define NOISE_RATE 0.02   /* weight of an interval in its logarithm */
#define ODD 4             /* squared misfit beyond which an interval counts less */
#define KNOCKED 1.7       /* squared misfit over MISFIT_INTERVALS: the rig has changed */
#define MISFIT_INTERVALS 16
#define QUIET_RATE 0.03     /* rad/s: slower rotation may be noise, and is ignored */
#define MOUNTING_WALK 1e-3  /* rad/sqrt(s): random walk of the mounting */
#define OFFSET_WALK 3e-4    /* s/sqrt(s): random walk of the offset; clocks 100 ppm apart diverge by 1 ms in 10 s */
#define BIAS_WALK 2e-4      /* rad/s/sqrt(s) */
#define STANDS_OUT 2.0      /* sigmas */
#define LEAST_ROTATION 1e-4 /* rad and s: minimum correction worth changing the history */
#define LEAST_OFFSET 5e-5

enum { ORIENTATION = 0, MOUNTING = 3, OFFSET = 6, BIAS = 7 };

/* Resets the rig's uncertainty to its start. */
static void forget(rig_refiner *r) {
    memset(r->covariance, 0, sizeof r->covariance);
    for (int k = 0; k < N; k++) r->covariance[(N + 1) * k] = r->start[k] * r->start[k];
    r->started = false;
    r->noise = r->misfit = 1;
}

void rig_refiner_start(rig_refiner *r, double rotation_sigma, double offset_sigma, double bias_sigma) {
    memset(r, 0, sizeof *r);
    for (int k = MOUNTING; k < N; k++)
        r->start[k] = k < OFFSET ? rotation_sigma : k < BIAS ? offset_sigma : bias_sigma;
    forget(r);
}

static void start_orientation(rig_refiner *r, const double from[9]) {
    memcpy(r->carried, from, sizeof r->carried);
    for (int k = 0; k < MOUNTING; k++) {
        for (int j = 0; j < N; j++) r->covariance[N * k + j] = r->covariance[N * j + k] = 0;
        r->covariance[(N + 1) * k] = r->noise * POSE_NOISE * POSE_NOISE;
    }
    r->started = true;
}

/* The part of a rate that isn't noise, 0 to 1. Otherwise noise at rest would count as evidence. */
static double loudness(const double rate[3]) {
    double square = rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2];
    return square > QUIET_RATE * QUIET_RATE ? 1 - QUIET_RATE * QUIET_RATE / square : 0;
}

/* Jacobian of the orientation's error after an interval by the errors before it. The camera's turn is exp(m) G exp(-m),
 * where G is the gyroscope's between stamps that are earlier by the offset t: exp(rate_from t) turned exp(-rate_to
 * t). */
static void linearise(const rig_interval *i, double seconds, double f[3][N]) {
    double turn[3], rates[3];
    so3_log(i->turned, turn);
    for (int k = 0; k < 3; k++) rates[k] = turn[k] / seconds;
    double turning = loudness(rates), before = loudness(i->rate_from), after = loudness(i->rate_to);
    for (int row = 0; row < 3; row++) {
        f[row][OFFSET] = -after * i->rate_to[row];
        for (int k = 0; k < 3; k++) {
            double turned = i->turned[3 * k + row]; /* transposed */
            f[row][ORIENTATION + k] = turned;
            f[row][MOUNTING + k] = turning * (turned - (row == k));
            f[row][OFFSET] += before * turned * i->rate_from[k];
            f[row][BIAS + k] = -i->by_bias[3 * row + k];
        }
    }
}

static double multiply_row(const double row[N], const double *column, int stride) {
    double sum = 0;
    for (int k = 0; k < N; k++) sum += row[k] * column[stride * k];
    return sum;
}

/* Propagates orientation and errors over an interval; error: their means, that of the orientation zero before. */
static void predict(rig_refiner *r, const rig_interval *i, double seconds, double error[N]) {
    const double walks[N] = {0,           0,         0,         MOUNTING_WALK, MOUNTING_WALK, MOUNTING_WALK,
                             OFFSET_WALK, BIAS_WALK, BIAS_WALK, BIAS_WALK};
    double f[3][N], fc[3][N], turn[3], *c = r->covariance;
    linearise(i, seconds, f);
    for (int row = 0; row < 3; row++) error[row] = multiply_row(f[row], error, 1);
    for (int row = 0; row < 3; row++)
        for (int k = 0; k < N; k++) fc[row][k] = multiply_row(f[row], c + k, N);
    for (int row = 0; row < 3; row++) {
        for (int k = MOUNTING; k < N; k++) c[N * row + k] = c[N * k + row] = fc[row][k];
        for (int k = 0; k < 3; k++) c[N * row + k] = multiply_row(fc[row], f[k], 1);
    }
    so3_log(i->turned, turn);
    double angle = sqrt(turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2]);
    for (int k = 0; k < 3; k++)
        c[(N + 1) * k] += r->noise * (TURN_NOISE * TURN_NOISE * angle + GYRO_NOISE * GYRO_NOISE * seconds);
    for (int k = 0; k < N; k++) c[(N + 1) * k] += walks[k] * walks[k] * seconds;
    so3_multiply(r->carried, i->turned, r->carried);
}

/* Corrects with alignment's orientation, axis by axis (Bierman 1977, Section II.8). Returns the normalised innovation
 * squared, per axis. */
static double update(const double misfit[3], double variance, double error[N], double c[N * N]) {
    double squares = 0, column[N];
    for (int row = 0; row < 3; row++) {
        double rest = misfit[row] - error[row], s = c[(N + 1) * row] + variance;
        for (int k = 0; k < N; k++) column[k] = c[N * k + row];
        squares += rest * rest / s;
        for (int k = 0; k < N; k++) {
            error[k] += column[k] * rest / s;
            for (int j = 0; j < N; j++) c[N * k + j] -= column[k] * column[j] / s;
        }
    }
    return squares / 3;
}

void rig_refiner_add(rig_refiner *r, const rig_interval *i, double seconds) {
    double error[N] = {0}, rest[9], misfit[3], variance = POSE_NOISE * POSE_NOISE;
    if (!r->started) start_orientation(r, i->from);
    memcpy(error + MOUNTING, r->mounting, sizeof r->mounting);
    error[OFFSET] = r->offset;
    predict(r, i, seconds, error);
    so3_transpose_multiply(r->carried, i->to, rest);
    so3_log(rest, misfit);
    double next[N], c[N * N];
    memcpy(next, error, sizeof next);
    memcpy(c, r->covariance, sizeof c);
    double odd = update(misfit, r->noise * variance, next, c);
    if (odd > ODD) {
        memcpy(next, error, sizeof next);
        memcpy(c, r->covariance, sizeof c);
        update(misfit, r->noise * variance * odd, next, c);
    }
    memcpy(r->covariance, c, sizeof c);
    memcpy(r->mounting, next + MOUNTING, sizeof r->mounting);
    r->offset = next[OFFSET];
    for (int k = 0; k < 3; k++) r->bias[k] += next[BIAS + k];
    so3_exp(next + ORIENTATION, rest);
    so3_multiply(r->carried, rest, r->carried);
    r->noise = fmin(fmax(r->noise * exp(NOISE_RATE * (fmin(odd, ODD) - 1)), NOISE_LEAST), NOISE_MOST);
    r->misfit += (fmin(odd, 8) - r->misfit) / MISFIT_INTERVALS;
    memcpy(r->rate, i->rate_to, sizeof r->rate);
    r->intervals++;
    if (r->misfit > KNOCKED) forget(r); /* or the clock leapt */
}

void rig_refiner_break(rig_refiner *r) {
    r->started = false;
}

double rig_refiner_sigma(const rig_refiner *r, int part) {
    return sqrt(r->covariance[(N + 1) * (MOUNTING + part)]);
}

bool rig_refiner_take(rig_refiner *r, double mounting[3], double *offset) {
    bool much = fabs(r->offset) > fmax(LEAST_OFFSET, STANDS_OUT * rig_refiner_sigma(r, 3));
    for (int k = 0; k < 3; k++)
        much = much || fabs(r->mounting[k]) > fmax(LEAST_ROTATION, STANDS_OUT * rig_refiner_sigma(r, k));
    if (!much) return false;
    double turn[9], bias[3];
    memcpy(mounting, r->mounting, sizeof r->mounting);
    *offset = r->offset;
    so3_exp(r->mounting, turn); /* the bias is in the axes of the mounting in use */
    memcpy(bias, r->bias, sizeof bias);
    for (int k = 0; k < 3; k++)
        r->bias[k] = turn[3 * k] * bias[0] + turn[3 * k + 1] * bias[1] + turn[3 * k + 2] * bias[2];
    memset(r->mounting, 0, sizeof r->mounting);
    r->offset = 0;
    return true;
}
