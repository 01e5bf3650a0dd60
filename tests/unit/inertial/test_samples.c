/* What the history of samples keeps, to the number: a mounting that turns, stillness that ends, blind time, constant axes. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "inertial/health/axis_maps.h"
#include "inertial/health/evidence.h"
#include "inertial/inertial.h"

#define PERIOD_NS 5000000ll

static _Alignas(ARENA_ALIGNMENT) unsigned char block[4 << 20];
static fathom_config config;
static inertial n;

static int begin(void **state) {
    (void)state;
    arena a = {block, sizeof block, 0};
    fathom_config_init(&config);
    memset(&n, 0, sizeof n);
    inertial_init(&n, &a, &config);
    return 0;
}

static void take(int64_t timestamp_ns, float x, float y, float z) {
    const fathom_imu_sample s = {timestamp_ns, {x, y, z}, {0.1f, -9.8f, 0.2f}};
    samples_take(&n.samples, &s);
}

static void assert_near(const double *got, const double *want, int count, double tolerance) {
    for (int i = 0; i < count; i++)
        if (!(fabs(got[i] - want[i]) <= tolerance)) fail_msg("number %d: %.9g, not %.9g", i, got[i], want[i]);
}

/* ---- the mounting ---- */

static void a_mounting_that_turns_takes_along_all_that_is_kept(void **state) {
    (void)state;
    const double mounting[3] = {0.2, -0.1, 0.3}, bias[3] = {0.01, -0.02, 0.03};
    imu_samples *s = &n.samples;
    double r[9], want[3], whole[9];
    for (int i = 0; i < 100; i++) take(i * PERIOD_NS, 0.5f, 0.1f * (float)(i % 3), -0.2f);
    take(100 * PERIOD_NS, 30, -20, 10); /* so sudden that it waits */
    assert_true(s->doubtful && s->count == 100);
    memcpy(s->still.gyro_bias, bias, sizeof bias);
    s->still.samples = 7;
    const inertial_sample before[2] = {*sample_at(s, 4), s->doubt};
    so3_exp(mounting, r);
    so3_multiply(r, s->rotation, whole);
    samples_remount(s, mounting, 1234);
    assert_near(s->rotation, whole, 9, 1e-12);
    assert_true(s->refined_ns == 1234);
    const inertial_sample *after[2] = {sample_at(s, 4), &s->doubt};
    for (int i = 0; i < 2; i++) {
        so3_apply(r, before[i].gyro, want);
        assert_near(after[i]->gyro, want, 3, 1e-12);
        so3_apply(r, before[i].accel, want);
        assert_near(after[i]->accel, want, 3, 1e-12);
        assert_true(after[i]->timestamp_ns == before[i].timestamp_ns + 1234);
    }
    so3_apply(r, bias, want);
    assert_near(s->still.gyro_bias, want, 3, 1e-12);
    assert_int_equal(s->still.samples, 0); /* what was summed is in the old axes */
}

/* Up to 5 rad/s and 100 m/s^2 from one sample to the next are motion; more waits, to be a glitch or not. */
static void a_change_is_sudden_beyond_its_bound_on_each_axis(void **state) {
    (void)state;
    for (int axis = 0; axis < 6; axis++)
        for (int sign = -1; sign <= 1; sign += 2)
            for (int beyond = 0; beyond < 2; beyond++) {
                begin(NULL);
                fathom_imu_sample s = {0};
                samples_take(&n.samples, &s);
                s.timestamp_ns = PERIOD_NS;
                float *value = axis < 3 ? &s.gyro[axis] : &s.accel[axis - 3], bound = axis < 3 ? 5 : 100;
                *value = (float)sign * (beyond ? nextafterf(bound, 1000) : bound);
                samples_take(&n.samples, &s);
                assert_int_equal(n.samples.doubtful, beyond);
                assert_int_equal(n.samples.count, 2 - beyond);
            }
}

/* ---- stillness ---- */

static void a_history_that_begins_again_ends_the_stillness(void **state) {
    (void)state;
    imu_samples *s = &n.samples;
    for (int i = 0; i < 60; i++) take((1000 + i) * PERIOD_NS, 0.01f, 0, 0);
    assert_true(s->still.samples > 40);
    int64_t t = 0;
    while (s->count != 1) take(t++ * PERIOD_NS, 0.01f, 0, 0); /* a clock that was set back */
    assert_int_equal(s->still.samples, 0);
    assert_int_equal(s->still.window_samples, 1);
}

static void a_gap_ends_the_stillness(void **state) {
    (void)state;
    imu_samples *s = &n.samples;
    for (int i = 0; i < 60; i++) take(i * PERIOD_NS, 0.01f, 0, 0);
    assert_true(s->still.samples > 40);
    take(80 * PERIOD_NS, 0.01f, 0, 0);
    assert_int_equal(s->gaps, 1);
    assert_int_equal(s->still.samples, 0);
    assert_int_equal(s->still.window_samples, 1);
}

/* Windows of ten samples; each that goes by changes one axis of one sensor by a little less or more than its bound. */
static void stillness_ends_at_its_bounds_on_each_axis(void **state) {
    (void)state;
    for (int axis = 0; axis < 6; axis++)
        for (int sign = -1; sign <= 1; sign += 2)
            for (int beyond = 0; beyond < 2; beyond++) {
                stillness w;
                double sample[2][3] = {{0}};
                stillness_reset(&w, 0.05);
                for (int i = 0; i < 30; i++) stillness_add(&w, sample[0], sample[1], 0.005, 0.001);
                assert_int_equal(w.samples, 30);
                sample[axis / 3][axis % 3] = sign * (axis < 3 ? 0.03 : 0.25) * (beyond ? 1.01 : 0.99);
                for (int i = 0; i < 10; i++) stillness_add(&w, sample[0], sample[1], 0.005, 0.001);
                assert_int_equal(w.samples, beyond ? 0 : 40);
            }
}

/* Numbers that have no rounding: a quarter is the bound. */
static void a_force_that_changes_by_the_bound_is_still(void **state) {
    (void)state;
    const double none[3] = {0, 0, 0}, quarter[3] = {0, 0.25, 0};
    stillness w;
    stillness_reset(&w, 0.05);
    for (int i = 0; i < 40; i++) stillness_add(&w, none, i < 30 ? none : quarter, 0.005, 0.001);
    assert_int_equal(w.samples, 40);
}

/* ---- blind time ---- */

/* The angle grows with the square of the time since the last sample, however that time is cut: from one instant to another
 * its variance is the difference. */
static void blind_time_counts_from_the_last_sample(void **state) {
    (void)state;
    const double from[] = {0, 0.1, 0.3, 0.6}, to = 1;
    for (int i = 0; i <= 200; i++) {
        const fathom_imu_sample s = {i * PERIOD_NS, {0.1f, 0, 0}, {0, -9.8f, 0}};
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
    }
    inertial_drain(&n);
    const int64_t last = 200 * PERIOD_NS;
    double known = 0;
    for (int k = 0; k < 4; k++) {
        inertial_motion m, none;
        assert_int_equal(inertial_estimate(&n, last + (int64_t)(1e9 * from[k]), last + (int64_t)(1e9 * to), &m), FATHOM_OK);
        assert_int_equal(inertial_estimate(&n, last, last, &none), FATHOM_OK); /* the floor */
        const double grown = m.covariance[0] - none.covariance[0];
        if (k == 0) known = grown;
        assert_true(fabs(grown / known - (1 - pow(from[k], 4))) < 0.02);
    }
    assert_true(known > 0.5 * pow((double)config.motion_sigma_rad_s2, 2));
}

/* ---- axes ---- */

static void the_angle_of_a_rotation_is_how_far_it_turns(void **state) {
    (void)state;
    const double axes[][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.6, 0, -0.8}, {0.36, 0.48, 0.8}};
    for (int i = 0; i < 5; i++)
        for (double angle = 0.05; angle < 3.1; angle += 0.3) {
            double w[3], r[9];
            for (int k = 0; k < 3; k++) w[k] = angle * axes[i][k];
            so3_exp(w, r);
            assert_true(fabs(angle_of(r) - angle) < 1e-9);
        }
}

/* The camera turns about an axis whose reading stays the same. */
static void turn_with_constant(plausibility *p, float value, int64_t from, double angle) {
    const float none[3] = {NAN, NAN, NAN};
    for (int i = 0; i < 20; i++) {
        const float gyro[3] = {value, 0.001f * (float)i, -0.002f * (float)i};
        plausibility_sample(p, from + i * PERIOD_NS, gyro, none);
    }
    const plausibility_interval e = {
        .from_ns = from + 12 * PERIOD_NS, .to_ns = from + 42 * PERIOD_NS, .turn = {angle, 0, 0}};
    judge_constant(p, &e);
}

static void an_axis_is_stuck_only_while_it_says_the_same(void **state) {
    (void)state;
    const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    for (int moves = 0; moves < 2; moves++) { /* half of what proves it, twice: at one value, and at two */
        plausibility p;
        plausibility_start(&p, unit, 9.8);
        for (int i = 0; i < 2; i++) turn_with_constant(&p, moves ? 0.01f * (float)(i + 1) : 0.01f, 20 * i * PERIOD_NS, 6 * DEGREE);
        assert_int_equal(p.gyro.health == FATHOM_IMU_STUCK, !moves);
        if (!moves) assert_int_equal(p.gyro.axes, 1);
    }
}

/* The camera turns, and two axes of the accelerometer are swapped. */
static void turn_with_swapped_force(plausibility *p) {
    for (int i = 0; i < 40; i++) {
        const double w[3] = {0.2 * i, 1.1 * sin(0.3 * i), 0.13 * i}, down[3] = {0, 0, -9.8};
        plausibility_interval e = {.from_ns = i * 200000000ll, .to_ns = (i + 1) * 200000000ll, .has_force = true};
        double back[9], force[3];
        so3_exp(w, e.imu_to_world);
        for (int k = 0; k < 9; k++) back[k] = e.imu_to_world[k % 3 * 3 + k / 3];
        so3_apply(back, down, force);
        for (int k = 0; k < 3; k++) {
            e.turn[k] = e.gyro[k] = 0.1 * cos(i + k);
            e.force[k] = force[k == 0 ? 1 : k == 1 ? 0 : 2];
        }
        plausibility_add(p, &e);
    }
}

static void what_is_found_of_a_sensor_first_stays_to_the_last_bit(void **state) {
    (void)state;
    const double unit[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    plausibility p;
    plausibility_start(&p, unit, 9.8);
    turn_with_swapped_force(&p);
    assert_int_equal(p.gyro.health, FATHOM_IMU_GOOD);
    assert_int_equal(p.accel.health, FATHOM_IMU_AXES);
    plausibility_start(&p, unit, 9.8);
    found(&p.accel, FATHOM_IMU_UNITS, 1000, 7);
    const plausibility_finding before = p.accel;
    turn_with_swapped_force(&p);
    assert_memory_equal(&p.accel, &before, sizeof before);
}

int main(void) {
#define AT_REST(test) cmocka_unit_test_setup(test, begin)
    const struct CMUnitTest tests[] = {
        AT_REST(a_mounting_that_turns_takes_along_all_that_is_kept),
        cmocka_unit_test(a_change_is_sudden_beyond_its_bound_on_each_axis),
        AT_REST(a_history_that_begins_again_ends_the_stillness),
        AT_REST(a_gap_ends_the_stillness),
        cmocka_unit_test(stillness_ends_at_its_bounds_on_each_axis),
        cmocka_unit_test(a_force_that_changes_by_the_bound_is_still),
        AT_REST(blind_time_counts_from_the_last_sample),
        cmocka_unit_test(the_angle_of_a_rotation_is_how_far_it_turns),
        cmocka_unit_test(what_is_found_of_a_sensor_first_stays_to_the_last_bit),
        cmocka_unit_test(an_axis_is_stuck_only_while_it_says_the_same),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
