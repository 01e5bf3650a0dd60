/* Inertial navigation (lib/inertial/inertial.c): integration against closed forms, bias from a still start, bad samples, the ring
 * between two threads. Also built and run under the thread sanitizer (tests/e2e/thread_sanitizer.sh). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "base/covariance.h"
#include "base/stamps.h"
#include "inertial/inertial.h"
#include "inertial/strapdown.h"

#define SECOND 1000000000ll

static _Alignas(ARENA_ALIGNMENT) unsigned char block[4 << 20];
static fathom_config config;
static inertial n;

static void begin(void) {
    arena a = {block, sizeof block, 0};
    memset(&n, 0, sizeof n);
    inertial_init(&n, &a, &config);
    assert_non_null(n.samples.ring);
}

static int setup(void **state) {
    (void)state;
    fathom_config_init(&config);
    begin();
    return 0;
}

static int64_t ns(double seconds) {
    return (int64_t)llround(1e9 * seconds);
}

static void push_rate(double t, const double rate[3]) {
    fathom_imu_sample s = {ns(t), {(float)rate[0], (float)rate[1], (float)rate[2]}, {0, -9.8f, 0}};
    assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
}

static inertial_motion estimate(double from, double to) {
    inertial_motion m;
    assert_int_equal(inertial_estimate(&n, ns(from), ns(to), &m), FATHOM_OK);
    assert_true(pose_is_finite(&m.motion));
    for (int i = 0; i < 36; i++) assert_true(isfinite(m.covariance[i]));
    return m;
}

/* Radians between an estimate and the rotation that is known. */
static double off(const inertial_motion *m, const double r[9]) {
    double d[9], w[3];
    so3_transpose_multiply(m->motion.r, r, d);
    so3_log(d, w);
    return sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
}

static double sigma(const inertial_motion *m, int i) {
    return sqrt(m->covariance[7 * i]);
}

/* ---- integration -------------------------------------------------------------------------------------------------- */

static void constant_rate_about_a_tilted_axis(void **state) {
    (void)state;
    const double rate[3] = {0.7, -1.1, 0.4}, rates[] = {25, 100, 200.0 / 3, 1000};
    const double from[] = {0.1, 0.1033, 0.5, 0.11111}, to[] = {0.9, 0.1049, 0.5001, 1.23456};
    for (int k = 0; k < 4; k++) {
        begin();
        for (int i = 0; i <= 2 * rates[k]; i++) push_rate(i / rates[k], rate);
        inertial_drain(&n);
        for (int j = 0; j < 4; j++) {
            double w[3], r[9];
            for (int a = 0; a < 3; a++) w[a] = rate[a] * (to[j] - from[j]);
            so3_exp(w, r);
            inertial_motion m = estimate(from[j], to[j]);
            assert_true(off(&m, r) < 1e-6 * (to[j] - from[j]) + 3e-9);
        }
    }
}

/* Coning: the rotation vector phi keeps its length and goes around in a plane; its rate in the body's axes follows from
 * the right Jacobian (Sola et al. 2018, eq. 143). */
#define CONE 0.2
#define CONE_TURN (2 * 3.14159265358979323846 * 2) /* twice a second */

static void cone(double t, double r[9], double rate[3]) {
    const double phi[3] = {CONE * cos(CONE_TURN * t), CONE * sin(CONE_TURN * t), 0};
    const double dot[3] = {-CONE_TURN * phi[1], CONE_TURN * phi[0], 0};
    const double once[3] = {phi[1] * dot[2] - phi[2] * dot[1], phi[2] * dot[0] - phi[0] * dot[2],
                            phi[0] * dot[1] - phi[1] * dot[0]};
    const double twice[3] = {phi[1] * once[2] - phi[2] * once[1], phi[2] * once[0] - phi[0] * once[2],
                             phi[0] * once[1] - phi[1] * once[0]};
    for (int i = 0; i < 3 && rate; i++)
        rate[i] = dot[i] - (1 - cos(CONE)) / (CONE * CONE) * once[i] +
                  (CONE - sin(CONE)) / (CONE * CONE * CONE) * twice[i];
    if (r) so3_exp(phi, r);
}

static void push_cone_samples(double rate_hz, double seconds) {
    for (int i = 0; i <= seconds * rate_hz; i++) {
        double rate[3];
        cone(i / rate_hz, NULL, rate);
        push_rate(i / rate_hz, rate);
    }
    inertial_drain(&n);
}

static void push_cone(double rate_hz, double seconds) {
    begin();
    push_cone_samples(rate_hz, seconds);
}

static double cone_error(double from, double to) {
    double a[9], b[9], r[9];
    cone(from, a, NULL);
    cone(to, b, NULL);
    so3_transpose_multiply(a, b, r);
    inertial_motion m = estimate(from, to);
    return off(&m, r);
}

static void coning_converges_with_the_square_of_the_period(void **state) {
    (void)state;
    const double rates[] = {100, 200, 400, 800};
    double last = 0;
    for (int k = 0; k < 4; k++) {
        push_cone(rates[k], 2.5);
        double error = cone_error(0.2531, 2.2519); /* between samples at both ends */
        if (k > 0) assert_true(error < last / 3);
        last = error;
    }
    assert_true(last < 2e-4); /* over two seconds at 800 Hz */
    push_cone(200, 2.5);      /* a frame's time at a usual rate: far below the seed's floor */
    for (double t = 0.1; t < 2.4; t += 0.0371) assert_true(cone_error(t, t + 1.0 / 30) < 5e-4);
}

static void parts_compose_to_the_whole(void **state) {
    (void)state;
    push_cone(200, 2);
    inertial_motion a = estimate(0.3012, 0.9551), b = estimate(0.9551, 1.5023),
                    whole = estimate(0.3012, 1.5023);
    pose both = pose_multiply(&a.motion, &b.motion);
    assert_true(off(&whole, both.r) < 2e-4);
}

static void reversed_interval_is_the_inverse(void **state) {
    (void)state;
    push_cone(200, 2);
    const double turned[6] = {0.3, -0.7, 1.1, 0.2, 0.1, -0.4}, moved[6] = {0.02, 0.01, 0, 0.05, -0.02, 0.03};
    pose before = pose_exp(turned), way = pose_exp(moved), after = pose_multiply(&before, &way);
    inertial_correct(&n, &before, NULL, NULL, true, ns(0.3));
    inertial_correct(&n, &after, NULL, NULL, true, ns(0.4)); /* so that it has a velocity */
    const int64_t first[] = {ns(0.4), ns(0.4123), ns(0.2), ns(1.9)},
                  second[] = {ns(0.9), ns(1.7001), ns(0.7), ns(2.6)};
    for (int i = 0; i < 4; i++) { /* after, across and before the last pose, and beyond the samples */
        inertial_motion there, back;
        assert_int_equal(inertial_estimate(&n, first[i], second[i], &there), FATHOM_OK);
        assert_int_equal(inertial_estimate(&n, second[i], first[i], &back), FATHOM_OK);
        pose around = pose_multiply(&there.motion, &back.motion);
        assert_true(pose_distance(&there.motion) > 0.1);
        assert_true(pose_angle(&around) < 1e-9 && pose_distance(&around) < 1e-9);
        for (int k = 0; k < 6; k++) assert_true(sigma(&back, k) > 0 && isfinite(sigma(&back, k)));
        assert_int_equal(inertial_estimate(&n, first[i], first[i], &there), FATHOM_OK);
        assert_true(pose_angle(&there.motion) == 0 && pose_distance(&there.motion) == 0);
    }
}

/* The error of the inverse, seen from the earlier camera: exp(a) m = m exp(inv(Ad(m)) a). */
static void a_backward_estimates_covariance_is_the_forward_ones_carried_over(void **state) {
    (void)state;
    config.seed_noise_rad = config.seed_noise_m = 0;
    config.imu_to_camera_translation[0] = 0.3f;
    begin();
    push_cone(200, 2);
    const double turned[6] = {0.3, -0.7, 1.1, 0.2, 0.1, -0.4}, moved[6] = {0.02, 0.01, 0, 0.05, -0.02, 0.03};
    pose before = pose_exp(turned), way = pose_exp(moved), after = pose_multiply(&before, &way);
    inertial_correct(&n, &before, NULL, NULL, true, ns(0.3));
    inertial_correct(&n, &after, NULL, NULL, true, ns(0.4));
    inertial_motion there = estimate(0.5, 1.3), back = estimate(1.3, 0.5);
    double adjoint[36], carried[36], largest = 0;
    pose_adjoint(&there.motion, adjoint);
    covariance_transport(adjoint, there.covariance, carried);
    for (int i = 0; i < 36; i++) {
        assert_true(fabs(back.covariance[i] - carried[i]) < 1e-9 * (carried[0] + carried[35]));
        largest = fmax(largest, fabs(there.covariance[i] - carried[i]));
    }
    assert_true(largest > 0.1 * there.covariance[0]); /* it does differ */
}

static void beyond_the_samples_the_rate_is_held_and_trust_falls(void **state) {
    (void)state;
    const double rate[3] = {0.2, 0.5, -0.3};
    for (int i = 0; i <= 100; i++) push_rate(1 + 0.005 * i, rate); /* 1.0 to 1.5 s */
    inertial_drain(&n);
    inertial_motion covered = estimate(1.1, 1.2);
    double last = 0;
    for (double over = 0; over < 0.55; over += 0.1) {
        double w[3], r[9];
        for (int k = 0; k < 3; k++) w[k] = rate[k] * (0.1 + over);
        so3_exp(w, r);
        inertial_motion m = estimate(1.4, 1.5 + over);
        assert_true(off(&m, r) < 1e-6);
        assert_true(sigma(&m, 0) > last);
        last = sigma(&m, 0);
    }
    /* half a second without samples is as uncertain as a hand's turning makes it */
    assert_true(last > 0.5 * config.motion_sigma_rad_s2 * 0.25 && last > 20 * sigma(&covered, 0));
    inertial_motion early = estimate(0.5, 0.9), after = estimate(3, 3.4); /* wholly outside */
    double w[3], r[9];
    for (int k = 0; k < 3; k++) w[k] = rate[k] * 0.4;
    so3_exp(w, r);
    assert_true(off(&early, r) < 1e-6 && off(&after, r) < 1e-6);
    assert_true(sigma(&early, 0) > 5 * sigma(&covered, 0) && sigma(&after, 0) > 5 * sigma(&covered, 0));
}

static void a_gap_is_bridged_and_lowers_trust(void **state) {
    (void)state;
    const double rate[3] = {0, 0.4, 0};
    for (int i = 0; i <= 300; i++)
        if (i < 100 || i > 160) push_rate(0.005 * i, rate); /* none from 0.5 to 0.8 s */
    inertial_drain(&n);
    assert_int_equal(n.samples.gaps, 1);
    double w[3] = {0, 0.4 * 0.6, 0}, r[9];
    so3_exp(w, r);
    inertial_motion with = estimate(0.4, 1.0), without = estimate(0.81, 1.41);
    assert_true(off(&with, r) < 1e-6);
    assert_true(sigma(&with, 1) > 3 * sigma(&without, 1));
}

/* ---- frames and clocks -------------------------------------------------------------------------------------------- */

static void mounting_turns_the_rate(void **state) {
    (void)state;
    const double mounting[3] = {0.9, -0.4, 1.7}, rate[3] = {0.6, 0.2, -0.5};
    double m[9], w[3] = {0}, r[9];
    so3_exp(mounting, m);
    for (int i = 0; i < 9; i++) config.imu_to_camera_rotation[i] = (float)m[i];
    begin();
    for (int i = 0; i <= 100; i++) push_rate(0.01 * i, rate);
    inertial_drain(&n);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) w[i] += m[3 * i + j] * rate[j] * 0.5;
    so3_exp(w, r);
    inertial_motion e = estimate(0.2, 0.7);
    assert_true(off(&e, r) < 1e-6);
}

static void clock_offset_is_added_to_stamps(void **state) {
    (void)state;
    push_cone(200, 2);
    inertial_motion here = estimate(0.5, 0.8), there;
    config.imu_clock_offset_ns = -37 * SECOND - 12345;
    begin();
    for (int i = 0; i <= 400; i++) {
        double rate[3];
        cone(i / 200.0, NULL, rate);
        fathom_imu_sample s = {ns(i / 200.0) + 37 * SECOND + 12345,
                               {(float)rate[0], (float)rate[1], (float)rate[2]},
                               {0, 0, 9.8f}};
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
    }
    inertial_drain(&n);
    there = estimate(0.5, 0.8);
    assert_memory_equal(&here.motion, &there.motion, sizeof here.motion);
}

/* Exact poses of a way with constant velocity and turn, ten a second until 1 s. The last one. */
static const double steady_turn[3] = {0.3, -0.6, 0.2}, steady_velocity[3] = {0.5, -0.2, 0.1};

static pose follow_a_steady_way(void) {
    const double first[6] = {0.4, 1.2, -0.3, 1, 2, 3};
    pose start = pose_exp(first), p = start;
    for (int i = 0; i <= 10; i++) {
        double w[3], r[9];
        for (int k = 0; k < 3; k++) {
            w[k] = steady_turn[k] * 0.1 * i;
            p.t[k] = start.t[k] + 0.1 * i * steady_velocity[k];
        }
        so3_exp(w, r);
        so3_multiply(start.r, r, p.r);
        inertial_correct(&n, &p, NULL, NULL, true, ns(0.1 * i));
    }
    return p;
}

static void without_an_imu_velocity_and_turn_are_kept(void **state) {
    (void)state;
    config.imu = false;
    begin();
    const double rate[3] = {1, 1, 1}; /* samples that mustn't count */
    for (int i = 0; i <= 100; i++) push_rate(0.01 * i, rate);
    inertial_drain(&n);
    inertial_motion m;
    assert_int_equal(inertial_estimate(&n, ns(0.1), ns(0.2), &m), FATHOM_ERROR_NO_DATA);

    pose q = follow_a_steady_way();
    for (double dt = 0.05; dt < 0.5; dt *= 2) {
        double w[3], r[9];
        assert_int_equal(inertial_estimate(&n, ns(1), ns(1 + dt), &m), FATHOM_OK);
        for (int k = 0; k < 3; k++) w[k] = steady_turn[k] * dt;
        so3_exp(w, r);
        assert_true(off(&m, r) < 0.01 * dt);
        pose end = pose_multiply(&q, &m.motion);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(end.t[k] - q.t[k] - steady_velocity[k] * dt) < 0.01 * 0.55 * dt);
    }
    inertial_motion soon, late;
    assert_int_equal(inertial_estimate(&n, ns(1), ns(1.1), &soon), FATHOM_OK);
    assert_int_equal(inertial_estimate(&n, ns(1), ns(2), &late), FATHOM_OK);
    for (int k = 0; k < 6; k++) assert_true(sigma(&late, k) > 2 * sigma(&soon, k));
    inertial_reset(&n);
    assert_int_equal(inertial_estimate(&n, ns(1), ns(1.3), &m), FATHOM_ERROR_NO_DATA);
}

/* Poses along a steady way, or of a hand that jerks by so much from frame to frame. */
static inertial_motion after_poses(double jerk_rad, double jerk_m) {
    inertial_motion m;
    config.imu = false;
    begin();
    for (int i = 0; i <= 40; i++) {
        const double side = i % 4 < 2 ? 1 : -1;
        const double twist[6] = {0, side * jerk_rad, 0, side * jerk_m, 0, 0.01 * i};
        const pose p = pose_exp(twist);
        inertial_correct(&n, &p, NULL, NULL, true, ns(i / 30.0));
    }
    assert_int_equal(inertial_estimate(&n, ns(40 / 30.0), ns(41 / 30.0), &m), FATHOM_OK);
    return m;
}

/* Constant velocity foretells a hand that jerks badly, and says so. */
static void without_an_imu_an_unsteady_hand_is_foretold_with_less_trust(void **state) {
    (void)state;
    const inertial_motion steady = after_poses(0, 0), turning = after_poses(0.04, 0), moving = after_poses(0, 0.04);
    assert_true(sigma(&steady, 1) < 0.02 && sigma(&steady, 3) < 0.02);
    assert_true(sigma(&turning, 1) > 0.04 && sigma(&turning, 1) < 0.2);
    assert_true(sigma(&moving, 3) > 0.03 && sigma(&moving, 3) < 0.2);
    assert_true(sigma(&moving, 1) < 1.05 * sigma(&steady, 1)); /* the rotation was foretold well */
}

/* The accelerometer lies, but it isn't asked; the gyroscope turns, and the velocity is kept. */
static void without_translation_the_accelerometer_does_not_count(void **state) {
    (void)state;
    config.imu_translation = false;
    begin();
    for (int i = 0; i <= 400; i++) {
        fathom_imu_sample s = {ns(0.005 * i),
                               {(float)steady_turn[0], (float)steady_turn[1], (float)steady_turn[2]},
                               {30, -20, (float)(i % 50)}};
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
    }
    inertial_drain(&n);
    pose q = follow_a_steady_way();
    inertial_motion m;
    double w[3], r[9];
    assert_int_equal(inertial_estimate(&n, ns(1), ns(1.5), &m), FATHOM_OK);
    for (int k = 0; k < 3; k++) w[k] = steady_turn[k] * 0.5;
    so3_exp(w, r);
    assert_true(off(&m, r) < 2e-3);
    pose end = pose_multiply(&q, &m.motion);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(end.t[k] - q.t[k] - steady_velocity[k] * 0.5) < 0.01 * 0.55 * 0.5);
    for (int k = 0; k < 3; k++) assert_true(sigma(&m, 3 + k) > 0.05); /* a hand changes its velocity */
}

/* Stamps from a broken caller: no number overflows, and what comes out is finite. */
static void absurd_stamps_stay_finite(void **state) {
    (void)state;
    const int64_t stamps[] = {-STAMP_MAX, -1000 * SECOND, 0, SECOND, 100 * SECOND, STAMP_MAX};
    for (int imu = 0; imu < 2; imu++)
        for (int running = 0; running < 2; running++) {
            config.imu = imu;
            begin();
            push_cone_samples(200, 2);
            if (running) follow_a_steady_way();
            for (int i = 0; i < 6; i++)
                for (int j = 0; j < 6; j++) {
                    inertial_motion m;
                    int known = inertial_estimate(&n, stamps[i], stamps[j], &m);
                    assert_int_equal(known, imu || running ? FATHOM_OK : FATHOM_ERROR_NO_DATA);
                    if (known != FATHOM_OK) continue;
                    assert_true(pose_is_finite(&m.motion));
                    for (int k = 0; k < 36; k++)
                        assert_true(isfinite(m.covariance[k]) && isfinite(m.pose_covariance[k]));
                    for (int k = 0; k < 6; k++) assert_true(m.covariance[7 * k] > 0);
                }
            if (!running) continue;
            for (int i = 0; i < 6; i++) {
                const pose origin = pose_identity();
                inertial_advance(&n, stamps[5 - i]);
                inertial_correct(&n, &origin, NULL, NULL, true, stamps[i]);
                for (int k = 0; k < 9; k++) assert_true(isfinite(n.now.state.r[k]));
                for (int k = 0; k < 3; k++) assert_true(isfinite(n.now.state.p[k]) && isfinite(n.now.state.v[k]));
                for (int k = 0; k < NAVIGATOR_STATES * NAVIGATOR_STATES; k++)
                    assert_true(isfinite(n.now.state.covariance[k]));
            }
        }
}

/* ---- bias --------------------------------------------------------------------------------------------------------- */

static const double bias[3] = {0.02, -0.015, 0.008};

/* Samples at 200 Hz of a sensor with bias and noise that turns by `rate` from `moving` seconds on. */
static void push_biased(double seconds, double moving, const double rate[3], bool accel) {
    uint64_t key = random_key(3, 9), k = 0;
    for (int i = 0; i <= 200 * seconds; i++) {
        double t = i / 200.0;
        fathom_imu_sample s = {ns(t), {0}, {NAN, NAN, NAN}};
        for (int j = 0; j < 3; j++) {
            double turn = t >= moving ? rate[j] * sin(9 * (t - moving)) : 0;
            s.gyro[j] = (float)(bias[j] + turn + 1e-3 * random_normal(key, k++));
            if (accel) s.accel[j] = (float)(9.8 * (j == 2) + 0.02 * random_normal(key, k++));
        }
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
    }
    inertial_drain(&n);
}

static void a_still_start_finds_the_bias(void **state) {
    (void)state;
    const double rate[3] = {0.5, 0.8, -0.3};
    for (int accel = 0; accel < 2; accel++) { /* with and without an accelerometer */
        begin();
        inertial_motion before, after;
        push_biased(0.2, 10, rate, accel);
        before = estimate(0.05, 0.15);
        begin();
        push_biased(2, 1.5, rate, accel);
        for (int j = 0; j < 3; j++) assert_true(fabs(n.samples.still.gyro_bias[j] - bias[j]) < 4 * n.samples.still.gyro_bias_sigma);
        for (int j = 0; j < 3; j++) assert_true(fabs(n.samples.still.gyro_bias[j] - bias[j]) < 1e-3);
        assert_true(n.samples.still.gyro_bias_sigma < 0.25 * config.gyro_bias_sigma_rad_s && n.samples.still.gyro_bias_sigma > 0);
        after = estimate(0.05, 0.15);
        assert_true(sigma(&after, 0) < sigma(&before, 0));
        double none[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}; /* at rest it reads no turn any more */
        inertial_motion rest = estimate(0.2, 1.2);
        assert_true(off(&rest, none) < 2e-3);
        inertial_reset(&n); /* forgets it */
        assert_true(n.samples.still.gyro_bias[0] == 0 && n.samples.still.gyro_bias_sigma == (double)config.gyro_bias_sigma_rad_s);
    }
}

static void a_known_bias_gets_old(void **state) {
    (void)state;
    const double rate[3] = {0.5, 0.8, -0.3};
    push_biased(2, 1, rate, true);
    double fresh = n.samples.still.gyro_bias_sigma, first = n.samples.still.gyro_bias[0];
    int64_t from = sample_at(&n.samples, n.samples.count - 1)->timestamp_ns;
    for (int i = 1; i <= 200 * 60; i++) {
        fathom_imu_sample s = {from + i * SECOND / 200, {0.5f, 0.5f * (float)(i % 20), 0}, {0, 0, 9.8f}};
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
        if (i % 1000 == 0) inertial_drain(&n);
    }
    double old = n.samples.still.gyro_bias_sigma;
    assert_true(n.samples.still.gyro_bias[0] == first); /* it was never still */
    assert_true(fabs(sqrt(old * old - fresh * fresh) / (2e-4 * sqrt(60)) - 1) < 0.01);
}

static void a_moving_start_finds_none(void **state) {
    (void)state;
    const double rate[3] = {0.5, 0.8, -0.3};
    push_biased(2, -0.1, rate, true);
    for (int j = 0; j < 3; j++) assert_true(n.samples.still.gyro_bias[j] == 0);
    assert_true(n.samples.still.gyro_bias_sigma >= (double)config.gyro_bias_sigma_rad_s);

    begin(); /* 0.3 s of stillness are too short */
    push_biased(1, 0.3, rate, true);
    for (int j = 0; j < 3; j++) assert_true(n.samples.still.gyro_bias[j] == 0);

    begin(); /* a steady turn that no bias reaches isn't stillness */
    const double steady[3] = {0, 0.2, 0};
    for (int i = 0; i <= 400; i++) push_rate(0.005 * i, steady);
    inertial_drain(&n);
    for (int j = 0; j < 3; j++) assert_true(n.samples.still.gyro_bias[j] == 0);

    begin(); /* turning slowly about the vertical while the hand shakes: the accelerometer gives it away */
    for (int i = 0; i <= 400; i++) {
        fathom_imu_sample s = {ns(0.005 * i), {0, 0, 0.03f}, {i % 20 < 10 ? 0.6f : -0.6f, 0, 9.8f}};
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
    }
    inertial_drain(&n);
    for (int j = 0; j < 3; j++) assert_true(n.samples.still.gyro_bias[j] == 0);
}

/* ---- corrections ---------------------------------------------------------------------------------------------------- */

/* Sliding evenly feels like rest: gyroscope and accelerometer say nothing. The poses may not tell either (a wall), but the
 * navigator knows its velocity. */
static void an_even_slide_is_no_rest(void **state) {
    (void)state;
    for (int moving = 0; moving < 2; moving++) {
        const double nothing[36] = {0};
        pose origin = pose_identity();
        begin();
        for (int i = 0; i <= 100; i++) {
            fathom_imu_sample s = {ns(0.005 * i), {0.01f, 0, 0}, {0, -9.8f, 0}};
            assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
        }
        inertial_drain(&n);
        inertial_correct(&n, &origin, NULL, NULL, true, ns(0.5));
        n.now.state.v[0] = moving ? 0.06 : 0.03;
        n.now.state.covariance[(NAVIGATOR_STATES + 1) * NAVIGATOR_VELOCITY] = 0.05 * 0.05;
        timeline_restart(&n.past, &n.now);
        for (int k = 1; k <= 10; k++) {
            for (int i = 1; i <= 10; i++) {
                fathom_imu_sample s = {ns(0.5 + 0.05 * k + 0.005 * (i - 10)), {0.01f, 0, 0}, {0, -9.8f, 0}};
                assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
            }
            inertial_drain(&n);
            inertial_correct(&n, &origin, nothing, NULL, true, ns(0.5 + 0.05 * k));
        }
        assert_true(moving ? n.now.state.v[0] > 0.055 : n.now.state.v[0] < 0.01);
        assert_true(moving ? n.samples.still.used == 0 : n.samples.still.used > 0);
    }
}

/* A rig that has proved to be good meets a pose that is off by far: the stretch that led there is as uncertain as the misfit
 * shows, not as those before it were. */
static void a_sudden_misfit_widens_the_stretch_that_it_happened_in(void **state) {
    (void)state;
    double information[36] = {0}, before[36], after[36];
    for (int i = 0; i < 6; i++) information[7 * i] = 1e6; /* 1 mm, 1 mrad */
    pose p = pose_identity();
    for (int k = 0; k <= 301; k++) {
        for (int i = 1; i <= 6; i++) {
            fathom_imu_sample s = {ns(k / 30.0) + (i - 6) * SECOND / 180,
                                   {0.1f * (float)(i % 2 ? 1 : -1), 0, 0},
                                   {0.3f * (float)(i % 2 ? 1 : -1), -9.8f, 0}};
            assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
        }
        inertial_drain(&n);
        if (k <= 300) inertial_correct(&n, &p, information, NULL, true, ns(k / 30.0));
    }
    double known = n.now.mismatch;
    assert_true(known < 0.2);
    navigator foretold = n.now.state;
    navigate(&n, &foretold, ns(301 / 30.0));
    navigator_camera_covariance(&foretold, n.lever, before);
    p.t[0] += 0.1;
    inertial_correct(&n, &p, information, NULL, true, ns(301 / 30.0));
    pose camera = navigator_camera(&n.now.state, n.lever);
    assert_true(n.now.mismatch > 2 * known);
    /* the same by hand, and what a stretch of the noise known before would make of it */
    measurement m = measurement_of_pose(ns(301 / 30.0), &p, information, NULL, n.lever, config.pose_noise_rad,
                                        config.pose_noise_m);
    navigator widened = timeline_at(&n.past, n.past.count - 2)->after.state, narrow = foretold;
    navigate(&n, &widened, ns(301 / 30.0)); /* by the mismatch that is known now */
    navigator_camera_covariance(&widened, n.lever, after);
    assert_true(after[21] > before[21]);
    navigator_correct(&widened, &m, n.now.mismatch);
    navigator_correct(&narrow, &m, known);
    pose there = navigator_camera(&widened, n.lever), otherwise = navigator_camera(&narrow, n.lever);
    assert_true(fabs(camera.t[0] - there.t[0]) < 1e-12);
    assert_true(fabs(camera.t[0] - otherwise.t[0]) > 1e-4);
}

/* A guess by velocity is no surer than the pose that it goes on from. */
static void a_guess_by_velocity_has_its_poses_error(void **state) {
    (void)state;
    const double turning[3] = {0.5, 0, 0};
    const pose seed = {{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0.2, 0, 0}};
    pose guess, at = pose_identity();
    double before[36], after[36];
    begin();
    for (int i = 0; i < 60; i++) push_rate(0.005 * i, turning);
    inertial_drain(&n);
    for (int k = 0; k < 3; k++) {
        assert_int_equal(inertial_correct(&n, &at, NULL, NULL, true, ns(k / 30.0)), FATHOM_OK);
        inertial_check(&n, &at, true, ns(k / 30.0));
    }
    assert_true(inertial_second_guess(&n, &seed, ns(0.1), &guess, before));
    for (int i = 0; i < 3; i++)
        n.now.state.covariance[(NAVIGATOR_POSITION + i) * (NAVIGATOR_STATES + 1)] += 0.04;
    assert_true(inertial_second_guess(&n, &seed, ns(0.1), &guess, after));
    for (int i = 3; i < 6; i++) assert_true(fabs(after[7 * i] - before[7 * i] - 0.04) < 1e-3);
}

/* ---- bad samples -------------------------------------------------------------------------------------------------- */

static void bad_samples_are_counted_and_dropped(void **state) {
    (void)state;
    const double rate[3] = {0, 0.4, 0};
    for (int i = 0; i <= 100; i++) {
        push_rate(0.005 * i, rate);
        if (i == 20) push_rate(0.005 * i, rate);       /* twice */
        if (i == 30) push_rate(0.005 * (i - 3), rate); /* late */
        if (i == 40) push_rate(0, rate);               /* very late */
    }
    const float bad[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < 6; j++) {
            fathom_imu_sample s = {ns(0.6), {0, 0.4f, 0}, {0, 0, 9.8f}};
            (j < 3 ? s.gyro : s.accel)[j % 3] = bad[k];
            assert_int_equal(inertial_push(&n, &s), FATHOM_ERROR_ARGUMENT);
        }
    fathom_imu_sample no_accel = {ns(0.505), {0, 0.4f, 0}, {NAN, NAN, NAN}};
    assert_int_equal(inertial_push(&n, &no_accel), FATHOM_OK);
    inertial_drain(&n);
    assert_int_equal(n.samples.accepted, 102);
    assert_int_equal(n.samples.out_of_order, 3);
    assert_int_equal(atomic_load(&n.samples.not_finite), 18);
    assert_int_equal(atomic_load(&n.samples.overrun), 0);
    assert_int_equal(n.samples.gaps, 0);
    double w[3] = {0, 0.4 * 0.35, 0}, r[9]; /* and what is left is whole */
    so3_exp(w, r);
    inertial_motion m = estimate(0.05, 0.4);
    assert_true(off(&m, r) < 1e-6);
    push_rate(0.9, rate);
    push_rate(1.9, rate);
    inertial_drain(&n);
    assert_int_equal(n.samples.gaps, 2);
}

static void a_full_ring_drops_the_newest_and_counts(void **state) {
    (void)state;
    const double rate[3] = {0, 0, 0.1};
    config.max_imu_samples = 100; /* rounded up to a power of two */
    begin();
    assert_int_equal(n.samples.capacity, 128);
    for (int i = 0; i < 128; i++) push_rate(0.01 * i, rate);
    for (int i = 128; i < 200; i++) {
        fathom_imu_sample s = {ns(0.01 * i), {0, 0, 0.1f}, {0, -9.8f, 0}};
        assert_int_equal(inertial_push(&n, &s), FATHOM_ERROR_FULL);
    }
    assert_int_equal(atomic_load(&n.samples.overrun), 72);
    inertial_drain(&n);
    assert_int_equal(n.samples.accepted, 128);
    assert_int_equal(n.samples.history[(n.samples.first + 127) & 127].timestamp_ns, ns(1.27));
    for (int i = 200; i < 300; i++) push_rate(0.01 * i, rate); /* the history keeps the latest */
    inertial_drain(&n);
    assert_int_equal(n.samples.accepted, 228);
    assert_int_equal(n.samples.count, 128);
    assert_int_equal(n.samples.history[n.samples.first & 127].timestamp_ns, ns(1.00));
    assert_int_equal(n.samples.history[(n.samples.first + 127) & 127].timestamp_ns, ns(2.99));
    for (unsigned i = 1; i < n.samples.count; i++)
        assert_true(n.samples.history[(n.samples.first + i) & 127].timestamp_ns >
                    n.samples.history[(n.samples.first + i - 1) & 127].timestamp_ns);
}

static void nothing_known_is_said(void **state) {
    (void)state;
    inertial_motion m;
    const double rate[3] = {0, 0, 0.1};
    assert_int_equal(inertial_estimate(&n, 0, SECOND, &m), FATHOM_ERROR_NO_DATA);
    push_rate(0.1, rate);
    inertial_drain(&n); /* one sample has no rate yet to interpolate */
    assert_int_equal(inertial_estimate(&n, 0, SECOND, &m), FATHOM_ERROR_NO_DATA);
    push_rate(0.2, rate);
    inertial_drain(&n);
    assert_int_equal(inertial_estimate(&n, 0, SECOND, &m), FATHOM_OK);
}

/* ---- the ring between threads ------------------------------------------------------------------------------------- */

#define MANY 400000

typedef struct {
    bool retry;
    atomic_bool done;
} pusher;

static void *push_many(void *argument) {
    pusher *p = argument;
    bool bad = false;
    for (int i = 0; i < MANY; i++) {
        fathom_imu_sample s = {
            (int64_t)i * 1000, {1e-3f * (float)(i % 1000), 1e-4f * (float)i, 1}, {0, 0, (float)(i % 7)}};
        int e;
        while ((e = inertial_push(&n, &s)) == FATHOM_ERROR_FULL && p->retry) sched_yield();
        bad |= e != FATHOM_OK && e != FATHOM_ERROR_FULL;
    }
    atomic_store(&p->done, true);
    return bad ? p : NULL;
}

/* Drains while the other thread pushes, and looks at each sample that arrives. Returns how many did. */
static int drain_all(pusher *p, bool all) {
    int64_t last = -1000;
    int arrived = 0;
    for (bool done = false; !done;) {
        done = atomic_load(&p->done); /* what was pushed before is there now */
        int64_t before = n.samples.accepted;
        inertial_drain(&n);
        int fresh = (int)(n.samples.accepted - before);
        assert_true(fresh <= (int)n.samples.capacity);
        for (int i = 0; i < fresh; i++) {
            inertial_sample *s = &n.samples.history[(n.samples.first + n.samples.count - (unsigned)(fresh - i)) & (n.samples.capacity - 1)];
            int64_t which = s->timestamp_ns / 1000;
            assert_true(all ? s->timestamp_ns == last + 1000 : s->timestamp_ns > last);
            assert_true(s->gyro[0] == (double)(1e-3f * (float)(which % 1000)) &&
                        s->gyro[1] == (double)(1e-4f * (float)which) && s->accel[2] == (double)(which % 7));
            last = s->timestamp_ns;
        }
        arrived += fresh;
        if (fresh == 0) sched_yield();
    }
    return arrived;
}

static void all_samples_cross_exactly_once_and_in_order(void **state) {
    (void)state;
    for (int retry = 0; retry < 2; retry++) {
        config.max_imu_samples = 64;
        begin();
        pusher p = {.retry = retry};
        pthread_t thread;
        void *result;
        assert_int_equal(pthread_create(&thread, NULL, push_many, &p), 0);
        int arrived = drain_all(&p, retry);
        pthread_join(thread, &result);
        assert_null(result);
        assert_int_equal(n.samples.out_of_order, 0);
        assert_int_equal(n.samples.accepted, arrived);
        if (retry)
            assert_int_equal(arrived, MANY);
        else /* none is lost uncounted */
            assert_int_equal(arrived + atomic_load(&n.samples.overrun), MANY);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(constant_rate_about_a_tilted_axis, setup),
        cmocka_unit_test_setup(coning_converges_with_the_square_of_the_period, setup),
        cmocka_unit_test_setup(parts_compose_to_the_whole, setup),
        cmocka_unit_test_setup(reversed_interval_is_the_inverse, setup),
        cmocka_unit_test_setup(a_backward_estimates_covariance_is_the_forward_ones_carried_over, setup),
        cmocka_unit_test_setup(beyond_the_samples_the_rate_is_held_and_trust_falls, setup),
        cmocka_unit_test_setup(a_gap_is_bridged_and_lowers_trust, setup),
        cmocka_unit_test_setup(mounting_turns_the_rate, setup),
        cmocka_unit_test_setup(clock_offset_is_added_to_stamps, setup),
        cmocka_unit_test_setup(without_an_imu_velocity_and_turn_are_kept, setup),
        cmocka_unit_test_setup(without_an_imu_an_unsteady_hand_is_foretold_with_less_trust, setup),
        cmocka_unit_test_setup(without_translation_the_accelerometer_does_not_count, setup),
        cmocka_unit_test_setup(absurd_stamps_stay_finite, setup),
        cmocka_unit_test_setup(a_still_start_finds_the_bias, setup),
        cmocka_unit_test_setup(a_guess_by_velocity_has_its_poses_error, setup),
        cmocka_unit_test_setup(a_known_bias_gets_old, setup),
        cmocka_unit_test_setup(a_moving_start_finds_none, setup),
        cmocka_unit_test_setup(an_even_slide_is_no_rest, setup),
        cmocka_unit_test_setup(a_sudden_misfit_widens_the_stretch_that_it_happened_in, setup),
        cmocka_unit_test_setup(bad_samples_are_counted_and_dropped, setup),
        cmocka_unit_test_setup(a_full_ring_drops_the_newest_and_counts, setup),
        cmocka_unit_test_setup(nothing_known_is_said, setup),
        cmocka_unit_test_setup(all_samples_cross_exactly_once_and_in_order, setup),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
