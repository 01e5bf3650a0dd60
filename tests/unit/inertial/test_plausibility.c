/* Plausibility of the IMU (lib/inertial/health/plausibility.c, lib/inertial/health/inertial_check.c) on simulated hand-held paths: each mistake is named
 * and acted on, what is right stays silent. Poses are the true ones with an alignment's noise; nothing is rendered.
 * Links with examples/cli/{scene*,camera_path,imu_model}.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "simulate/camera_path.h"
#include "simulate/counter_random.h"
#include "simulate/imu_model.h"
#include "inertial/inertial.h"

#define DEGREES 57.29577951308232
#define IMU_RATE 200.0

static _Alignas(ARENA_ALIGNMENT) unsigned char block[4 << 20];
static fathom_config config;
static inertial n;
static char said[2000]; /* the warnings, a line each */
static int warnings;

/* A scan: what differs from the usual one. */
typedef struct {
    uint64_t seed;
    double still, speed, turn, seconds, frame_rate;
    const char *grade;
    struct imu_mounting mounting; /* of the part; the settings have `usual` */
} scan;

static const struct imu_mounting usual = {.rotation_deg = {0.8, -1.2, 90.0},
                                          .translation = {0.025, -0.010, 0.004}};

static scan usual_scan(uint64_t seed) {
    return (scan){seed, 0.5, 1.5, 1.5, 8, 30, "consumer", usual};
}

/* What may happen to a sample of true time t on its way; false: it never arrives. */
typedef bool fault(double t, fathom_imu_sample *s);

static int64_t ns(double seconds) {
    return (int64_t)llround(1e9 * seconds);
}

static void keep_warning(void *user, fathom_log_level level, const char *text) {
    (void)user;
    size_t used = strlen(said);
    if (level != FATHOM_LOG_WARNING) return;
    warnings++;
    snprintf(said + used, sizeof said - used, "%s\n", text);
}

/* Runs a scan; frames that came late in it are aligned as well as all others. Returns the time of the first warning. */
static double run(const scan *s, fault *how) {
    struct scene scene;
    struct camera_path path;
    struct imu_model imu;
    double r[9], v[3], when = INFINITY;
    fathom_config_init(&config);
    config.log = keep_warning;
    for (int i = 0; i < 3; i++) v[i] = usual.rotation_deg[i] / DEGREES;
    rotation_of_vector(v, r);
    for (int i = 0; i < 9; i++) config.imu_to_camera_rotation[i] = (float)r[i];
    for (int i = 0; i < 3; i++) config.imu_to_camera_translation[i] = (float)usual.translation[i];
    arena a = {block, sizeof block, 0};
    memset(&n, 0, sizeof n);
    inertial_init(&n, &a, &config);
    said[0] = 0;
    warnings = 0;
    assert_true(scene_make(&scene, SCENE_ROOM, s->seed, 40.0));
    camera_path_make(&path, &scene, s->still, s->speed, s->turn);
    scene_free(&scene);
    imu_model_make(&imu, imu_grade_of(s->grade), &s->mounting, IMU_RATE, s->seed);

    uint64_t key = random_key(s->seed, 77), draw = 0;
    struct imu_sample next;
    imu_model_next(&imu, &path, &next);
    for (double t = 0.1; t < s->seconds; t += 1 / s->frame_rate) {
        struct camera_pose c;
        pose p;
        double noise[6], information[36] = {0};
        for (; next.stamp + s->mounting.clock_offset <= t; imu_model_next(&imu, &path, &next)) {
            fathom_imu_sample sample = {.timestamp_ns = ns(next.stamp)};
            for (int i = 0; i < 3; i++) {
                sample.gyro[i] = (float)next.gyro[i];
                sample.accel[i] = (float)next.accel[i];
            }
            if (!how || how(next.stamp, &sample)) inertial_push(&n, &sample);
        }
        inertial_drain(&n);
        camera_path_pose(&path, t, &c);
        memcpy(p.r, c.rotation, sizeof p.r);
        memcpy(p.t, c.position, sizeof p.t);
        for (int i = 0; i < 6; i++) noise[i] = (i < 3 ? 0.0015 : 0.001) * random_normal(key, draw++);
        pose error = pose_exp(noise);
        p = pose_multiply(&p, &error);
        for (int i = 0; i < 6; i++) information[7 * i] = 1e6;
        inertial_correct(&n, &p, information, NULL, true, ns(t));
        inertial_check(&n, &p, true, ns(t));
        if (warnings > 0 && t < when) when = t;
    }
    camera_path_free(&path);
    return when;
}

/* ---- mistakes ------------------------------------------------------------------------------------------------------ */

static void scale(float v[3], double by) {
    for (int i = 0; i < 3; i++) v[i] = (float)(v[i] * by);
}

static void swap(float *a, float *b) {
    float keep = *a;
    *a = *b;
    *b = keep;
}

static void clip(float v[3], float limit) {
    for (int i = 0; i < 3; i++) v[i] = fminf(fmaxf(v[i], -limit), limit);
}

static bool in_degrees(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->gyro, DEGREES);
    return true;
}
static bool divided(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->gyro, 1 / DEGREES);
    return true;
}
static bool twice(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->gyro, 2);
    return true;
}
static bool opposite_gyro(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->gyro, -1);
    return true;
}
static bool swapped_xy(double t, fathom_imu_sample *s) {
    (void)t;
    swap(&s->gyro[0], &s->gyro[1]);
    swap(&s->accel[0], &s->accel[1]);
    return true;
}
static bool swapped_yz(double t, fathom_imu_sample *s) {
    (void)t;
    swap(&s->gyro[1], &s->gyro[2]);
    return true;
}
static bool mirrored_x(double t, fathom_imu_sample *s) {
    (void)t;
    s->gyro[0] = -s->gyro[0];
    return true;
}
static bool mirrored_z(double t, fathom_imu_sample *s) {
    (void)t;
    s->gyro[2] = -s->gyro[2];
    s->accel[2] = -s->accel[2];
    return true;
}
static bool degrees_and_swapped(double t, fathom_imu_sample *s) {
    return in_degrees(t, s) && swapped_xy(t, s);
}
static bool in_g(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->accel, 1 / 9.80665);
    return true;
}
static bool in_milli_g(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->accel, 1000 / 9.80665);
    return true;
}
static bool opposite_accel(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->accel, -1);
    return true;
}
static bool swapped_accel(double t, fathom_imu_sample *s) {
    (void)t;
    swap(&s->accel[0], &s->accel[2]);
    return true;
}
static bool stuck_gyro(double t, fathom_imu_sample *s) {
    static float last[3];
    if (t < 3) memcpy(last, s->gyro, sizeof last);
    memcpy(s->gyro, last, sizeof last);
    return true;
}
static bool zero_gyro(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->gyro, 0);
    return true;
}
static bool stuck_accel(double t, fathom_imu_sample *s) {
    static float last[3];
    if (t < 2) memcpy(last, s->accel, sizeof last);
    memcpy(s->accel, last, sizeof last);
    return true;
}
static bool clipped_gyro(double t, fathom_imu_sample *s) {
    (void)t;
    clip(s->gyro, 0.55f);
    return true;
}
static bool half_stamps(double t, fathom_imu_sample *s) {
    s->timestamp_ns = ns(0.5 * t);
    return true;
}
static bool double_stamps(double t, fathom_imu_sample *s) {
    s->timestamp_ns = ns(2 * t);
    return true;
}
static bool late_stamps(double t, fathom_imu_sample *s) {
    s->timestamp_ns = ns(t + 0.4);
    return true;
}
static bool noise_only(double t, fathom_imu_sample *s) {
    uint64_t key = random_key((uint64_t)(1e6 * t), 5);
    for (int i = 0; i < 3; i++) s->gyro[i] = (float)random_normal(key, (uint64_t)i);
    return true;
}

typedef struct {
    const char *name;
    fault *how;
    fathom_imu_health gyro, accel; /* at the end; GOOD also stands for not said to be bad */
    const char *words;             /* in the warning */
} mistake;

static const mistake mistakes[] = {
    {"degrees/s", in_degrees, FATHOM_IMU_UNITS, FATHOM_IMU_GOOD, "degrees/s, not rad/s"},
    {"rad/s divided by 57.3", divided, FATHOM_IMU_UNITS, FATHOM_IMU_GOOD, "taken for degrees/s"},
    {"gyroscope times two", twice, FATHOM_IMU_SCALE, FATHOM_IMU_GOOD, "times what the depth frames show"},
    {"gyroscope negated", opposite_gyro, FATHOM_IMU_SIGN, FATHOM_IMU_GOOD, "opposite sign in all axes"},
    {"x and y swapped", swapped_xy, FATHOM_IMU_AXES, FATHOM_IMU_GOOD, "x and y swapped"},
    {"gyroscope's y and z swapped", swapped_yz, FATHOM_IMU_AXES, FATHOM_IMU_GOOD, "y and z swapped"},
    {"gyroscope's x mirrored", mirrored_x, FATHOM_IMU_AXES, FATHOM_IMU_GOOD, "x mirrored"},
    {"z mirrored", mirrored_z, FATHOM_IMU_AXES, FATHOM_IMU_GOOD, "z mirrored"},
    {"degrees/s and swapped", degrees_and_swapped, FATHOM_IMU_AXES, FATHOM_IMU_GOOD, "x and y swapped"},
    {"g", in_g, FATHOM_IMU_GOOD, FATHOM_IMU_UNITS, "in g"},
    {"milli-g", in_milli_g, FATHOM_IMU_GOOD, FATHOM_IMU_UNITS, "milli-g"},
    {"accelerometer negated", opposite_accel, FATHOM_IMU_GOOD, FATHOM_IMU_SIGN, "opposite sign"},
    {"accelerometer's x and z swapped", swapped_accel, FATHOM_IMU_GOOD, FATHOM_IMU_AXES, "x and z swapped"},
    {"gyroscope stuck from 3 s on", stuck_gyro, FATHOM_IMU_STUCK, FATHOM_IMU_GOOD, "stuck"},
    {"gyroscope reads zero", zero_gyro, FATHOM_IMU_STUCK, FATHOM_IMU_GOOD, "stuck"},
    {"accelerometer stuck from 2 s on", stuck_accel, FATHOM_IMU_GOOD, FATHOM_IMU_STUCK, "stuck"},
    {"gyroscope clipped", clipped_gyro, FATHOM_IMU_SATURATED, FATHOM_IMU_GOOD, "cut off at 0.55 rad/s"},
    {"stamps at half the pace", half_stamps, FATHOM_IMU_CLOCK, FATHOM_IMU_GOOD, "run 0.5 times as fast"},
    {"stamps at twice the pace", double_stamps, FATHOM_IMU_CLOCK, FATHOM_IMU_GOOD, "run 2 times as fast"},
    {"stamps 0.4 s late", late_stamps, FATHOM_IMU_CLOCK, FATHOM_IMU_GOOD, "0.40 s too late"},
    {"nothing but noise", noise_only, FATHOM_IMU_UNRELATED, FATHOM_IMU_GOOD, "doesn't follow"},
};

static bool matches(fathom_imu_health health, fathom_imu_health expected) {
    return expected == FATHOM_IMU_GOOD ? health <= FATHOM_IMU_GOOD : health == expected;
}

static void each_mistake_is_named_and_acted_on(void **state) {
    (void)state;
    int failures = 0;
    for (size_t i = 0; i < sizeof mistakes / sizeof *mistakes; i++)
        for (uint64_t seed = 1; seed <= 3; seed++) {
            const mistake *m = &mistakes[i];
            scan s = usual_scan(seed);
            double when = run(&s, m->how);
            bool gyro_bad = m->gyro >= FATHOM_IMU_UNITS, accel_bad = m->accel >= FATHOM_IMU_UNITS;
            bool good = matches(n.check.gyro.health, m->gyro) && warnings == 1 && strstr(said, m->words) &&
                        (gyro_bad || matches(n.check.accel.health, m->accel)) && n.usable == !gyro_bad &&
                        (gyro_bad || n.force_usable == !accel_bad) && when < 6.5;
            if (good) continue;
            failures++;
            print_message("%s, seed %d: gyroscope %s, accelerometer %s, %d warnings, first after %.1f s\n%s",
                          m->name, (int)seed, fathom_imu_health_name(n.check.gyro.health),
                          fathom_imu_health_name(n.check.accel.health), warnings, when, said);
        }
    assert_int_equal(failures, 0);
}

/* Moments that wrong samples have led to are nothing to go back to. */
static void a_navigator_that_starts_again_has_no_past(void **state) {
    (void)state;
    scan s = usual_scan(1);
    double when = run(&s, in_degrees);
    assert_true(isfinite(when));
    s.seconds = when + 1e-6; /* up to that frame */
    run(&s, in_degrees);
    assert_false(n.usable);
    pose origin = pose_identity();
    measurement m = measurement_of_pose(n.now.state.timestamp_ns - 1, &origin, NULL, NULL, n.lever, 0, 0);
    assert_int_equal(inertial_measure(&n, &m), FATHOM_ERROR_TIME);
}

static void a_turned_part_is_told_its_mounting(void **state) {
    (void)state;
    static const double right[][3] = {{0.8, -1.2, 50}, {0, 0, -90}, {30, 20, 70}};
    for (int i = 0; i < 3; i++) {
        scan s = usual_scan(4);
        memcpy(s.mounting.rotation_deg, right[i], sizeof right[i]);
        assert_true(run(&s, NULL) < 6.5);
        assert_int_equal(n.check.gyro.health, FATHOM_IMU_MOUNTING);
        assert_false(n.usable);
        const char *told = strstr(said, "imu_to_camera_rotation");
        double v[3], found[9], truth[9], apart[9], w[3];
        assert_non_null(told);
        assert_int_equal(sscanf(told, "imu_to_camera_rotation %lf %lf %lf", &v[0], &v[1], &v[2]), 3);
        for (int k = 0; k < 3; k++) {
            v[k] /= DEGREES;
            w[k] = right[i][k] / DEGREES;
        }
        so3_exp(v, found);
        so3_exp(w, truth);
        so3_transpose_multiply(found, truth, apart);
        so3_log(apart, w);
        assert_true(sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) < 6 / DEGREES);
    }
}

/* ---- what is right ------------------------------------------------------------------------------------------------- */

static bool steps_of_a_coarse_part(double t, fathom_imu_sample *s) {
    (void)t;
    for (int i = 0; i < 3; i++) {
        s->gyro[i] = roundf(s->gyro[i] / 0.0175f) * 0.0175f;
        s->accel[i] = roundf(s->accel[i] / 0.0981f) * 0.0981f;
    }
    return true;
}
static bool without_accelerometer(double t, fathom_imu_sample *s) {
    (void)t;
    for (int i = 0; i < 3; i++) s->accel[i] = NAN;
    return true;
}
static bool large_bias(double t, fathom_imu_sample *s) {
    (void)t;
    s->gyro[1] += 0.05f;
    return true;
}
static bool two_per_cent_more(double t, fathom_imu_sample *s) {
    (void)t;
    scale(s->gyro, 1.02);
    return true;
}
static bool gaps(double t, fathom_imu_sample *s) {
    (void)s;
    return fmod(t, 1.7) > 0.3;
}

static void what_is_right_stays_silent(void **state) {
    (void)state;
    static const struct {
        const char *name;
        fault *how;
        double still, speed, rate;
        const char *grade;
    } cases[] = {
        {"usual", NULL, 0.5, 1, 30, "consumer"},
        {"moving from the start", NULL, 0, 1.5, 30, "phone"},
        {"fast", NULL, 0, 4, 30, "consumer"},
        {"slow", NULL, 0.5, 0.3, 30, "phone"},
        {"without noise", NULL, 0.5, 1, 30, "ideal"},
        {"five frames a second", NULL, 0, 1.5, 5, "phone"},
        {"two frames a second", NULL, 0, 1, 2, "consumer"},
        {"coarse steps", steps_of_a_coarse_part, 0.5, 1, 30, "consumer"},
        {"no accelerometer", without_accelerometer, 0.5, 1, 30, "consumer"},
        {"a bias of 3 degrees/s", large_bias, 0.5, 1, 30, "consumer"},
        {"two per cent of scale", two_per_cent_more, 0, 1.5, 30, "phone"},
        {"gaps", gaps, 0, 1.5, 30, "consumer"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        for (uint64_t seed = 11; seed < 15; seed++) {
            scan s = {seed, cases[i].still, cases[i].speed, cases[i].speed,
                      10,   cases[i].rate,  cases[i].grade, usual};
            run(&s, cases[i].how);
            if (warnings > 0) print_message("%s, seed %d: %s", cases[i].name, (int)seed, said);
            assert_int_equal(warnings, 0);
            assert_true(n.usable && n.force_usable);
            if (cases[i].speed >= 1 && cases[i].rate > 5)
                assert_int_equal(n.check.gyro.health, FATHOM_IMU_GOOD);
            if (cases[i].speed >= 1 && cases[i].rate > 5 && cases[i].how != without_accelerometer)
                assert_int_equal(n.check.accel.health, FATHOM_IMU_GOOD);
        }
}

/* Readings of the gyroscope's x: up to a peak in fine steps, there for some samples, and away again. */
static void stay_at(plausibility *p, int64_t *t_ns, float peak) {
    const float accel[3] = {NAN, NAN, NAN};
    for (int i = 0; i < 12; i++) {
        float gyro[3] = {i < 4 ? peak - 0.001f * (float)(4 - i) : i < 10 ? peak : 0.1f * (float)(12 - i), 0, 0};
        plausibility_sample(p, *t_ns += 5000000, gyro, accel);
    }
}

static void a_higher_peak_shows_that_the_ones_before_were_no_limit(void **state) {
    (void)state;
    const double mounting[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    plausibility p;
    int64_t t = 0;
    plausibility_start(&p, mounting, 9.8);
    for (int i = 0; i < 8; i++) stay_at(&p, &t, 1 + 0.2f * (float)(i / 2)); /* twice at each */
    assert_int_equal(p.gyro.health, FATHOM_IMU_UNCHECKED);
    stay_at(&p, &t, 1.6f); /* for the third time */
    assert_int_equal(p.gyro.health, FATHOM_IMU_SATURATED);
    assert_true(fabs(p.gyro.scale - 1.6) < 1e-6);
}

static void a_camera_at_rest_proves_nothing(void **state) {
    (void)state;
    scan s = usual_scan(2);
    s.still = 20;
    run(&s, NULL);
    assert_int_equal(warnings, 0);
    assert_int_equal(n.check.gyro.health, FATHOM_IMU_UNCHECKED);
    run(&s, zero_gyro); /* nothing turns, so zero is right */
    assert_int_equal(warnings, 0);
}

static void a_reset_forgets_the_mistake(void **state) {
    (void)state;
    scan s = usual_scan(1);
    run(&s, in_degrees);
    assert_false(n.usable);
    inertial_reset(&n);
    assert_true(n.usable && n.force_usable);
    assert_int_equal(n.check.gyro.health, FATHOM_IMU_UNCHECKED);
}

static void names_are_all_different(void **state) {
    (void)state;
    for (int i = 0; i <= FATHOM_IMU_UNRELATED; i++)
        for (int j = 0; j < i; j++)
            assert_string_not_equal(fathom_imu_health_name((fathom_imu_health)i),
                                    fathom_imu_health_name((fathom_imu_health)j));
    assert_string_equal(fathom_imu_health_name((fathom_imu_health)99), "unknown");
}

/* A bias of a tenth of a radian a second is taken for one at once; ten times as much is no bias, until long evidence says so. */
static void a_bias_that_no_sensor_has_is_suspect(void **state) {
    (void)state;
    static const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, biases[] = {0, 0.05, 0.1, 1};
    for (int k = 0; k < 4; k++) {
        plausibility p;
        plausibility_start(&p, unit, 9.8);
        for (int i = 0; i < 6; i++) {
            plausibility_interval e = {.from_ns = i * 150000000ll, .to_ns = (i + 1) * 150000000ll};
            e.turn[i % 3] = i < 3 ? 0.12 : -0.12;
            for (int a = 0; a < 3; a++) e.gyro[a] = e.turn[a] + (a == 1 ? biases[k] * 0.15 : 0);
            plausibility_add(&p, &e);
        }
        assert_int_equal(p.suspect, k == 3);
        assert_int_equal(p.gyro.health, k == 3 ? FATHOM_IMU_UNCHECKED : FATHOM_IMU_GOOD);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_mistake_is_named_and_acted_on),
        cmocka_unit_test(a_navigator_that_starts_again_has_no_past),
        cmocka_unit_test(a_turned_part_is_told_its_mounting),
        cmocka_unit_test(what_is_right_stays_silent),
        cmocka_unit_test(a_higher_peak_shows_that_the_ones_before_were_no_limit),
        cmocka_unit_test(a_camera_at_rest_proves_nothing),
        cmocka_unit_test(a_reset_forgets_the_mistake),
        cmocka_unit_test(names_are_all_different),
        cmocka_unit_test(a_bias_that_no_sensor_has_is_suspect),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
