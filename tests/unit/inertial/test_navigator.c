/* The filter behind InertialEstimate (lib/inertial/filter.cpp, lib/inertial/inertial.c) on simulated hand-held paths: dead reckoning,
 * convergence of biases and gravity, directions without information, mounting, consistency, broken samples.
 * Links with examples/cli/{scene*,camera_path,imu_model}.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/camera_path.h"
#include "simulate/imu_model.h"
#include "inertial/inertial.h"

#define SECOND 1000000000ll
#define DEGREES 57.29577951308232
#define IMU_RATE 200.0
#define FRAME_RATE 30.0
#define MOST_WINDOWS 256

static _Alignas(ARENA_ALIGNMENT) unsigned char block[4 << 20];
static fathom_config config;
static inertial n;

/* Made for the tests as `fathom simulate` does it: a scene's path, an IMU on it. */
static struct scene scene;
static struct camera_path path;
static struct imu_model imu;
static struct imu_sample pending;
static bool is_pending;

static const struct imu_mounting usual = {.rotation_deg = {0.8, -1.2, 90.0},
                                          .translation = {0.025, -0.010, 0.004}};

/* What may happen to a sample of true time t on its way; false: it never arrives. */
typedef bool broken(double t, fathom_imu_sample *s);

static int64_t ns(double seconds) {
    return (int64_t)llround(1e9 * seconds);
}

static void configure(const struct imu_mounting *m) {
    double r[9], v[3];
    fathom_config_init(&config);
    for (int i = 0; i < 3; i++) v[i] = m->rotation_deg[i] / DEGREES;
    rotation_of_vector(v, r);
    for (int i = 0; i < 9; i++) config.imu_to_camera_rotation[i] = (float)r[i];
    for (int i = 0; i < 3; i++) config.imu_to_camera_translation[i] = (float)m->translation[i];
    config.imu_clock_offset_ns = ns(m->clock_offset);
}

/* A new part of that grade on a new path, filter and all; `configure` comes before. */
static void begin(enum scene_kind kind, uint64_t seed, const char *grade, const struct imu_mounting *m) {
    arena a = {block, sizeof block, 0};
    memset(&n, 0, sizeof n);
    inertial_init(&n, &a, &config);
    assert_non_null(n.samples.ring);
    assert_true(scene_make(&scene, kind, seed, 40.0));
    camera_path_make(&path, &scene, 0.5, 1.0, 1.0);
    scene_free(&scene);
    imu_model_make(&imu, imu_grade_of(grade), m, IMU_RATE, seed);
    is_pending = false;
}

static pose true_pose(double t) {
    struct camera_pose c;
    pose p;
    camera_path_pose(&path, t, &c);
    memcpy(p.r, c.rotation, sizeof p.r);
    memcpy(p.t, c.position, sizeof p.t);
    return p;
}

/* Pushes the samples of the depth clock's time from `since` to `until`. */
static void feed(double since, double until, broken *how) {
    for (;;) {
        if (!is_pending) imu_model_next(&imu, &path, &pending);
        is_pending = true;
        double t = pending.stamp + imu.mounting.clock_offset;
        if (t > until) break;
        is_pending = false;
        fathom_imu_sample s = {.timestamp_ns = ns(pending.stamp)};
        for (int i = 0; i < 3; i++) {
            s.gyro[i] = (float)pending.gyro[i];
            s.accel[i] = (float)pending.accel[i];
        }
        if (t < since || (how && !how(t, &s))) continue;
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
    }
    inertial_drain(&n);
}

static void correct_at(double t) {
    double information[36] = {0};
    pose p = true_pose(t);
    for (int i = 0; i < 6; i++) information[7 * i] = 1e8;
    inertial_correct(&n, &p, information, NULL, true, ns(t));
}

/* Frames from `from` to `to`, samples from `start` on. */
static void track(double start, double from, double to, broken *how) {
    for (long k = lround(from * FRAME_RATE); k <= lround(to * FRAME_RATE); k++) {
        double t = (double)k / FRAME_RATE;
        feed(start, t, how);
        correct_at(t);
    }
}

static inertial_motion estimate(double from, double to) {
    inertial_motion m;
    assert_int_equal(inertial_estimate(&n, ns(from), ns(to), &m), FATHOM_OK);
    assert_true(pose_is_finite(&m.motion));
    for (int i = 0; i < 36; i++) assert_true(isfinite(m.covariance[i]) && isfinite(m.pose_covariance[i]));
    for (int i = 0; i < 6; i++) assert_true(m.covariance[7 * i] > 0);
    return m;
}

/* What an estimate is off, as the twist that it is perturbed by. */
static void error_of(const inertial_motion *m, double from, double to, double e[6]) {
    pose a = true_pose(from), b = true_pose(to), truth = pose_between(&a, &b);
    pose rest = pose_between(&m->motion, &truth);
    pose_log(&rest, e);
}

static double length(const double v[3]) {
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static int by_size(const void *a, const void *b) {
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

typedef struct {
    double metres[MOST_WINDOWS], radians[MOST_WINDOWS];
    int count, outside; /* outside: some component beyond 4 sigma */
    double squares;     /* of the components over their sigmas */
} windows;

static void sort_windows(windows *w) {
    qsort(w->metres, (size_t)w->count, sizeof *w->metres, by_size);
    qsort(w->radians, (size_t)w->count, sizeof *w->radians, by_size);
}

/* One part on one path from `start` on: after ten seconds a second of dead reckoning, again and again. */
static void reckon(windows *w, double start, double seconds) {
    double t = start + 10, done = start;
    for (; t <= start + seconds; t += 1) {
        track(start, done, t, NULL);
        done = t + 1 / FRAME_RATE;
        feed(start, t + 1.02, NULL);
        double e[6];
        inertial_motion m = estimate(t, t + 1);
        error_of(&m, t, t + 1, e);
        assert_true(w->count < MOST_WINDOWS);
        bool out = false;
        for (int i = 0; i < 6; i++) {
            double x = e[i] / sqrt(m.covariance[7 * i]);
            out = out || fabs(x) > 4;
            w->squares += x * x;
        }
        w->outside += out;
        w->radians[w->count] = length(e);
        w->metres[w->count++] = length(e + 3);
    }
}

static windows reckon_all(const char *grade, const struct imu_mounting *m) {
    static const double starts[] = {0, 3.3, 7.7}; /* from a still start, and amid the motion */
    static const enum scene_kind kinds[] = {SCENE_ROOM, SCENE_DESK};
    windows w = {.count = 0};
    for (uint64_t seed = 1; seed <= 5; seed++) {
        begin(kinds[seed % 2], seed, grade, m);
        reckon(&w, starts[seed % 3], 15);
    }
    sort_windows(&w);
    print_message("%s: %d windows of 1 s: position median %.4f m, worst %.4f m; rotation median %.3f deg, "
                  "worst %.3f deg; %d beyond 4 sigma, rms %.2f sigma\n",
                  grade, w.count, w.metres[w.count / 2], w.metres[w.count - 1],
                  w.radians[w.count / 2] * DEGREES, w.radians[w.count - 1] * DEGREES, w.outside,
                  sqrt(w.squares / (6.0 * w.count)));
    assert_true(w.count >= 20);
    return w;
}

/* ---- doubt ------------------------------------------------------------------------------------------------------ */

static bool turned_over(double t, fathom_imu_sample *s) {
    (void)t;
    for (int i = 0; i < 3; i++) s->gyro[i] = -s->gyro[i];
    return true;
}

/* How wrong samples and going on without them foretell a turn is learnt from interval to interval; samples that contradict the
 * poses are left aside until they agree again. */
static void samples_that_contradict_the_poses_are_left_aside_until_they_agree(void **state) {
    (void)state;
    const double much = 0.012 * 0.012;
    configure(&usual);
    begin(SCENE_ROOM, 3, "consumer", &usual);
    track(0, 0, 4, NULL);
    assert_false(n.now.doubted);
    assert_true(n.now.gyro_error > 0 && n.now.gyro_error < much / 16);
    assert_true(n.now.turn_error > n.now.gyro_error);
    track(0, 4 + 1 / FRAME_RATE, 6, turned_over);
    assert_true(n.now.doubted);
    assert_true(n.now.gyro_error > much);
    track(0, 6 + 1 / FRAME_RATE, 8, NULL);
    assert_false(n.now.doubted);
    assert_true(n.now.gyro_error < much / 4);
}

/* ---- dead reckoning ----------------------------------------------------------------------------------------------- */

static void ideal_samples_dead_reckon(void **state) {
    (void)state;
    configure(&usual);
    windows w = reckon_all("ideal", &usual);
    assert_true(w.metres[w.count - 1] < 0.01);
    assert_true(w.radians[w.count - 1] < 0.1 / DEGREES);
    assert_true(w.outside <= w.count / 20);
}

static void a_parts_noise_and_biases_dead_reckon(void **state) {
    (void)state;
    const char *grades[] = {"consumer", "phone"};
    for (int g = 0; g < 2; g++) {
        configure(&usual);
        windows w = reckon_all(grades[g], &usual);
        assert_true(w.metres[w.count / 2] <= 0.03);
        assert_true(w.radians[w.count / 2] <= 0.5 / DEGREES);
        assert_true(w.outside <= w.count / 20);
    }
}

static void mounting_and_lever_are_honoured(void **state) {
    (void)state;
    const struct imu_mounting odd = {
        .rotation_deg = {10, -25, 80}, .translation = {0.3, -0.2, 0.25}, .clock_offset = 0.0123};
    windows right = {.count = 0}, no_lever = right, no_turn = right, no_offset = right;
    configure(&odd);
    begin(SCENE_DESK, 4, "ideal", &odd);
    reckon(&right, 1, 11);
    for (int i = 0; i < 3; i++) config.imu_to_camera_translation[i] = 0;
    begin(SCENE_DESK, 4, "ideal", &odd);
    reckon(&no_lever, 1, 11);
    configure(&odd);
    config.imu_clock_offset_ns = 0;
    begin(SCENE_DESK, 4, "ideal", &odd);
    reckon(&no_offset, 1, 11);
    configure(&odd);
    for (int i = 0; i < 9; i++) config.imu_to_camera_rotation[i] = i % 4 == 0;
    begin(SCENE_DESK, 4, "ideal", &odd);
    reckon(&no_turn, 1, 11);
    sort_windows(&right);
    sort_windows(&no_lever);
    sort_windows(&no_offset);
    sort_windows(&no_turn);
    print_message("worst position: %.4f m; without the lever %.4f m, offset %.4f m, rotation %.4f m\n",
                  right.metres[right.count - 1], no_lever.metres[no_lever.count - 1],
                  no_offset.metres[no_offset.count - 1], no_turn.metres[no_turn.count - 1]);
    assert_true(right.metres[right.count - 1] < 0.01 && right.radians[right.count - 1] < 0.1 / DEGREES);
    assert_true(no_lever.metres[no_lever.count - 1] > 3 * right.metres[right.count - 1]);
    assert_true(no_offset.metres[no_offset.count - 1] > 3 * right.metres[right.count - 1]);
    assert_true(no_turn.metres[no_turn.count - 1] > 10 * right.metres[right.count - 1]);
}

/* ---- what the filter learns --------------------------------------------------------------------------------------- */

static void biases_and_gravity_converge(void **state) {
    (void)state;
    const char *grades[] = {"ideal", "consumer", "phone"};
    double worst_gyro = 0, worst_lean = 0, worst_accel = 0;
    for (int g = 0; g < 3; g++)
        for (uint64_t seed = 11; seed < 14; seed++) {
            double start = 2.1 * (double)(seed - 11), gyro[3], accel[3], lean;
            configure(&usual);
            begin(seed % 2 ? SCENE_ROOM : SCENE_DESK, seed, grades[g], &usual);
            track(start, start, start + 10, NULL);
            for (int i = 0; i < 3; i++) {
                gyro[i] = n.now.state.gyro_bias[i];
                accel[i] = n.now.state.accel_bias[i];
                for (int j = 0; j < 3; j++) {
                    gyro[i] -= imu.rotation[3 * i + j] * imu.gyro_bias[j];
                    accel[i] -= imu.rotation[3 * i + j] * imu.accel_bias[j];
                }
            }
            lean = acos(fmin(1, -n.now.state.gravity[2] / length(n.now.state.gravity)));
            worst_gyro = fmax(worst_gyro, length(gyro));
            worst_accel = fmax(worst_accel, length(accel));
            worst_lean = fmax(worst_lean, lean);
            assert_true(length(gyro) < 2e-3);
            assert_true(lean < 1 / DEGREES);
        }
    print_message("worst after 10 s: gyro bias %.5f rad/s, accel bias %.3f m/s^2, gravity %.3f deg\n",
                  worst_gyro, worst_accel, worst_lean * DEGREES);
}

static void covariance_stays_symmetric_and_positive(void **state) {
    (void)state;
    configure(&usual);
    begin(SCENE_ROOM, 5, "consumer", &usual);
    track(0, 0, 60, NULL);
    enum { N = NAVIGATOR_STATES };
    double l[N][N] = {{0}}, scale[N];
    for (int i = 0; i < N; i++) {
        scale[i] = sqrt(n.now.state.covariance[i * (N + 1)]);
        assert_true(isfinite(scale[i]) && scale[i] > 0);
    }
    double least = 1;
    for (int i = 0; i < N; i++) /* Cholesky of the correlations */
        for (int j = 0; j <= i; j++) {
            assert_true(n.now.state.covariance[N * i + j] == n.now.state.covariance[N * j + i]);
            double s = n.now.state.covariance[N * i + j] / (scale[i] * scale[j]);
            for (int k = 0; k < j; k++) s -= l[i][k] * l[j][k];
            if (i == j) least = fmin(least, s);
            if (i == j) assert_true(s > 0);
            l[i][j] = i == j ? sqrt(s) : s / l[j][j];
        }
    print_message("after 60 s: least pivot of the correlations %.2e\n", least);
}

/* ---- directions without information ------------------------------------------------------------------------------- */

static void start_uncertain(navigator *s, const double twist[6]) {
    const double gravity[3] = {0, 0, -9.8};
    pose p = pose_exp(twist);
    memset(s, 0, sizeof *s);
    navigator_start(s, &p, gravity, 0.5, 0.02, 0.1, 0.2);
    for (int i = 0; i < 6; i++) s->covariance[(NAVIGATOR_STATES + 1) * i] = 0.1 * 0.1;
}

static void correct_pose(navigator *s, const double lever[3], const pose *measured, const double information[36],
                         double floor_rad, double floor_m) {
    measurement m = measurement_of_pose(0, measured, information, NULL, lever, floor_rad, floor_m);
    assert_true(navigator_correct(s, &m, 1));
}

static void a_direction_without_information_is_not_corrected(void **state) {
    (void)state;
    const double none[3] = {0, 0, 0}, at[6] = {0.4, -0.9, 0.3, 1, 2, 3};
    for (int blind = 0; blind < 7; blind++) { /* one of the six, and then all of them */
        double information[36] = {0}, twist[6] = {0.001, -0.002, 0.0015, 0.03, -0.02, 0.04}, got[6];
        for (int i = 0; i < 6; i++) information[7 * i] = i == blind || blind == 6 ? 0 : 1e8;
        if (blind < 3) twist[3] = twist[4] = twist[5] = 0; /* else the motion by V isn't one axis' */
        if (blind >= 3 && blind < 6) twist[0] = twist[1] = twist[2] = 0;
        navigator s;
        start_uncertain(&s, at);
        navigator before = s;
        pose predicted = navigator_camera(&s, none), way = pose_exp(twist);
        pose measured = pose_multiply(&predicted, &way);
        correct_pose(&s, none, &measured, information, 0, 0);
        pose after = navigator_camera(&s, none), moved = pose_between(&predicted, &after);
        pose_log(&moved, got);
        double covariance[36];
        navigator_camera_covariance(&s, none, covariance);
        for (int i = 0; i < 6; i++) {
            bool seen = information[7 * i] > 0;
            assert_true(fabs(got[i] - (seen ? twist[i] : 0)) < 1e-5 * fabs(twist[i]) + (seen ? 1e-8 : 1e-12));
            assert_true(seen ? covariance[7 * i] < 1.1e-8 : fabs(covariance[7 * i] - 0.01) < 1e-12);
        }
        if (blind == 6) assert_memory_equal(before.covariance, s.covariance, sizeof s.covariance);
    }
    /* not along an axis either: blind along a slanted direction of the camera */
    const double slant[3] = {2.0 / 3, -2.0 / 3, 1.0 / 3}, twist[6] = {0, 0, 0, 0.03, -0.02, 0.04};
    double information[36] = {0}, got[6], along = 0;
    for (int i = 0; i < 3; i++) {
        information[7 * i] = 1e8;
        for (int j = 0; j < 3; j++) information[6 * (3 + i) + 3 + j] = 1e8 * ((i == j) - slant[i] * slant[j]);
        along += slant[i] * twist[3 + i];
    }
    navigator s;
    start_uncertain(&s, at);
    pose predicted = navigator_camera(&s, none), way = pose_exp(twist);
    pose measured = pose_multiply(&predicted, &way);
    correct_pose(&s, none, &measured, information, 0.006, 0.004);
    pose after = navigator_camera(&s, none), moved = pose_between(&predicted, &after);
    pose_log(&moved, got);
    for (int i = 0; i < 3; i++) /* the floor of 4 mm beside a sigma of 10 cm takes 0.16 % */
        assert_true(fabs(got[3 + i] - (twist[3 + i] - along * slant[i])) < 1e-4);
    double rest = slant[0] * got[3] + slant[1] * got[4] + slant[2] * got[5];
    assert_true(fabs(rest) < 1e-9);
}

/* ---- broken samples ----------------------------------------------------------------------------------------------- */

static bool no_accelerometer(double t, fathom_imu_sample *s) {
    (void)t;
    s->accel[0] = s->accel[1] = s->accel[2] = NAN;
    return true;
}

static void without_accelerometer_the_velocity_is_kept(void **state) {
    (void)state;
    inertial_motion m[2];
    for (int k = 0; k < 2; k++) { /* without one, and with one that mustn't count */
        configure(&usual);
        config.imu_translation = k == 0;
        begin(SCENE_ROOM, 3, "ideal", &usual);
        track(0, 0, 5, k == 0 ? no_accelerometer : NULL);
        feed(0, 6.1, k == 0 ? no_accelerometer : NULL);
        m[k] = estimate(5, 5.5);
        pose lever = pose_identity(), p = true_pose(5), q = pose_multiply(&p, &m[k].motion);
        memcpy(lever.t, n.lever, sizeof lever.t);
        p = pose_multiply(&p, &lever); /* it is the IMU that goes straight */
        q = pose_multiply(&q, &lever);
        for (int i = 0; i < 3; i++) assert_true(fabs(q.t[i] - p.t[i] - 0.5 * n.now.state.v[i]) < 1e-3);
        double e[6];
        error_of(&m[k], 5, 5.5, e);
        assert_true(length(e) < 0.1 / DEGREES);
        for (int i = 0; i < 6; i++) assert_true(fabs(e[i]) < 4 * sqrt(m[k].covariance[7 * i]));
    }
    for (int i = 0; i < 3; i++) assert_true(fabs(m[0].motion.t[i] - m[1].motion.t[i]) < 2e-3);
}

static bool starts_late(double t, fathom_imu_sample *s) {
    (void)s;
    return t > 6;
}

static bool dies(double t, fathom_imu_sample *s) {
    (void)s;
    return t < 6;
}

static bool has_a_gap(double t, fathom_imu_sample *s) {
    (void)s;
    return t < 6 || t > 7;
}

static bool jumps_ahead(double t, fathom_imu_sample *s) {
    if (t > 6) s->timestamp_ns += 3 * SECOND;
    return true;
}

static bool jumps_back(double t, fathom_imu_sample *s) {
    if (t > 6) s->timestamp_ns -= 2 * SECOND;
    return true;
}

static bool jumps_an_hour(double t, fathom_imu_sample *s) {
    if (t > 6) s->timestamp_ns += 3600 * SECOND;
    return true;
}

static void a_broken_imu_stays_finite_and_lowers_trust(void **state) {
    (void)state;
    static const struct {
        const char *name;
        broken *how;
        double from, to; /* when there is nothing to go by */
        bool recovers;
    } cases[] = {
        {"starts late", starts_late, 1, 5.8, true}, {"dies", dies, 6.2, 12, false},
        {"has a gap", has_a_gap, 6.2, 6.8, true},   {"jumps ahead", jumps_ahead, 6.2, 8.8, false},
        {"jumps back", jumps_back, 6.2, 12, false}, {"jumps an hour", jumps_an_hour, 6.2, 12, false},
    };
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        double usual_sigma[2], sigma[2], worst = 0, e[6];
        configure(&usual);
        begin(SCENE_ROOM, 8, "ideal", &usual);
        track(0, 0, 5, NULL);
        feed(0, 6, NULL);
        inertial_motion m = estimate(5, 5.2);
        usual_sigma[0] = sqrt(m.covariance[0]), usual_sigma[1] = sqrt(m.covariance[21]);
        sigma[0] = sigma[1] = INFINITY;
        begin(SCENE_ROOM, 8, "ideal", &usual);
        for (int k = 0; k <= 15 * 30; k++) {
            double t = k / FRAME_RATE;
            feed(0, t, cases[c].how);
            if (k % 7 == 3 && n.running) { /* a frame that isn't accepted */
                inertial_advance(&n, ns(t));
            } else {
                correct_at(t);
                pose here = navigator_camera(&n.now.state, n.lever), truth = true_pose(t);
                pose rest = pose_between(&here, &truth);
                if (t > 1) worst = fmax(worst, pose_distance(&rest));
            }
            if (k % 5 == 0) m = estimate(t, t + 0.2);
            if (k % 5 == 0 && t > cases[c].from && t + 0.2 < cases[c].to)
                for (int i = 0; i < 2; i++) sigma[i] = fmin(sigma[i], sqrt(m.covariance[21 * i]));
            for (int i = 0; i < NAVIGATOR_STATES * NAVIGATOR_STATES; i++)
                assert_true(isfinite(n.now.state.covariance[i]));
        }
        feed(0, 16, cases[c].how);
        m = estimate(15, 15.5);
        error_of(&m, 15, 15.5, e);
        print_message(
            "%s: sigma %.4f rad, %.4f m (usually %.4f, %.4f); corrected pose off by %.3f m at most; at last "
            "half a second is off by %.4f m, sigma %.4f m\n",
            cases[c].name, sigma[0], sigma[1], usual_sigma[0], usual_sigma[1], worst, length(e + 3),
            sqrt(m.covariance[21]));
        assert_true(sigma[0] > 2 * usual_sigma[0] && sigma[1] > 2 * usual_sigma[1]);
        if (cases[c].recovers) assert_true(length(e + 3) < 0.01);
    }
}

/* A slow IMU's period is as long as a frame's time: that a frame comes soon doesn't mean that samples do. */
static bool slow_and_dies(double t, fathom_imu_sample *s) {
    (void)s;
    return lround(t * IMU_RATE) % 6 == 0 && t < 6;
}

static void a_slow_imu_that_dies_is_noticed(void **state) {
    (void)state;
    configure(&usual);
    begin(SCENE_ROOM, 8, "ideal", &usual);
    track(0, 0, 5, slow_and_dies);
    feed(0, 6, slow_and_dies);
    double with = sqrt(estimate(5, 5 + 1 / FRAME_RATE).covariance[21]);
    track(0, 5, 8, slow_and_dies);
    double without = sqrt(estimate(8, 8 + 1 / FRAME_RATE).covariance[21]);
    double before = sqrt(n.now.state.covariance[(NAVIGATOR_STATES + 1) * 6]);
    for (int k = 1; k <= 30; k++) inertial_advance(&n, ns(8 + k / FRAME_RATE));
    double grown = sqrt(n.now.state.covariance[(NAVIGATOR_STATES + 1) * 6]);
    print_message("position sigma of a frame's time %.4f m, dead %.4f m; velocity sigma %.3f m/s, a second "
                  "later %.3f\n",
                  with, without, before, grown);
    assert_true(without > 1.1 * with);
    assert_true(grown > 0.5 * config.motion_sigma_m_s2 * sqrt(0.2));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(samples_that_contradict_the_poses_are_left_aside_until_they_agree),
        cmocka_unit_test(ideal_samples_dead_reckon),
        cmocka_unit_test(a_parts_noise_and_biases_dead_reckon),
        cmocka_unit_test(mounting_and_lever_are_honoured),
        cmocka_unit_test(biases_and_gravity_converge),
        cmocka_unit_test(covariance_stays_symmetric_and_positive),
        cmocka_unit_test(a_direction_without_information_is_not_corrected),
        cmocka_unit_test(without_accelerometer_the_velocity_is_kept),
        cmocka_unit_test(a_broken_imu_stays_finite_and_lowers_trust),
        cmocka_unit_test(a_slow_imu_that_dies_is_noticed),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
