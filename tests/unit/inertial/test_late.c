/* Measurements that come late (lib/inertial/correct.c, timeline.c) are applied at their own time: the state is the one that
 * they would have made on time. The IMU swings on a lever of 0.3 m; all samples are there beforehand. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "inertial/inertial.h"
#include "simulate/counter_random.h"

#define MS 1000000ll
#define FRAME_NS (33 * MS)

static _Alignas(ARENA_ALIGNMENT) unsigned char block[2][4 << 20];
static fathom_config config;
static inertial on_time, late;

/* The IMU swings about a fixed axis while it moves on ellipses. */
static pose imu_at(double t) {
    const double axis[3] = {0.48, -0.6, 0.64}, angle = 0.5 * sin(2 * t);
    double w[3] = {axis[0] * angle, axis[1] * angle, axis[2] * angle};
    pose p;
    so3_exp(w, p.r);
    p.t[0] = 0.3 * sin(1.5 * t), p.t[1] = 0.2 * cos(2.5 * t), p.t[2] = 0.1 * sin(3 * t);
    return p;
}

static pose camera_at(double t) {
    pose imu = imu_at(t), lever = pose_identity();
    for (int i = 0; i < 3; i++) lever.t[i] = -(double)config.imu_to_camera_translation[i];
    return pose_multiply(&imu, &lever);
}

static void push(inertial *n, int64_t t_ns, bool still) {
    const double axis[3] = {0.48, -0.6, 0.64}, t = 1e-9 * (double)t_ns, rate = cos(2 * t);
    const double a[3] = {-0.675 * sin(1.5 * t), -1.25 * cos(2.5 * t), -0.9 * sin(3 * t) + 9.80665};
    pose imu = imu_at(t);
    fathom_imu_sample s = {.timestamp_ns = t_ns};
    for (int i = 0; i < 3; i++) {
        double force = imu.r[i] * a[0] + imu.r[3 + i] * a[1] + imu.r[6 + i] * a[2];
        s.gyro[i] = (float)(still ? 0.01 * (i + 1) : axis[i] * rate);
        s.accel[i] = (float)(still ? 9.80665 * (i == 2) : force);
    }
    assert_int_equal(inertial_push(n, &s), FATHOM_OK);
}

static void push_until(inertial *n, int64_t from_ns, int64_t to_ns, bool still) {
    for (int64_t t = from_ns; t < to_ns; t += 3 * MS) push(n, t, still);
    inertial_drain(n);
}

static void begin(inertial *n, unsigned char *memory) {
    arena a = {memory, sizeof block[0], 0};
    memset(n, 0, sizeof *n);
    inertial_init(n, &a, &config);
    assert_non_null(n->past.moments);
}

static int setup(void **state) {
    (void)state;
    fathom_config_init(&config);
    config.imu_to_camera_translation[0] = 0.2f;
    config.imu_to_camera_translation[1] = -0.18f;
    config.imu_to_camera_translation[2] = 0.14f;
    begin(&on_time, block[0]);
    begin(&late, block[1]);
    push_until(&on_time, 0, 4000 * MS, false);
    push_until(&late, 0, 4000 * MS, false);
    return 0;
}

/* A pose with some noise, better known in some directions than in others. */
static measurement seen_at(const inertial *n, int64_t t_ns) {
    double twist[6], information[36] = {0};
    for (int i = 0; i < 6; i++) {
        twist[i] = 2e-3 * random_normal(random_key(5, (uint64_t)t_ns), (uint64_t)i);
        information[7 * i] = i == 4 ? 0 : 1e5 * (i + 1);
    }
    pose p = camera_at(1e-9 * (double)t_ns), off = pose_exp(twist);
    p = pose_multiply(&p, &off);
    return measurement_of_pose(t_ns, &p, information, NULL, n->lever, 0.002, 0.003);
}

static void take_frame(inertial *n, int64_t t_ns) {
    measurement m = seen_at(n, t_ns);
    if (t_ns / FRAME_NS % 5 == 3)
        inertial_advance(n, t_ns); /* a frame that isn't tracked */
    else
        assert_int_equal(inertial_correct(n, &m.camera_to_world, m.information, NULL, true, t_ns), FATHOM_OK);
}

static void assert_same(const navigation *a, const navigation *b, double tolerance) {
    assert_true(a->state.timestamp_ns == b->state.timestamp_ns);
    for (int i = 0; i < 9; i++) assert_true(fabs(a->state.r[i] - b->state.r[i]) <= tolerance);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(a->state.p[i] - b->state.p[i]) <= tolerance);
        assert_true(fabs(a->state.v[i] - b->state.v[i]) <= tolerance);
        assert_true(fabs(a->state.gyro_bias[i] - b->state.gyro_bias[i]) <= tolerance);
        assert_true(fabs(a->state.accel_bias[i] - b->state.accel_bias[i]) <= tolerance);
        assert_true(fabs(a->state.gravity[i] - b->state.gravity[i]) <= tolerance);
        assert_true(fabs(a->turning[i] - b->turning[i]) <= tolerance);
        assert_true(fabs(a->corrected.t[i] - b->corrected.t[i]) <= tolerance);
    }
    for (int i = 0; i < NAVIGATOR_STATES * NAVIGATOR_STATES; i++)
        assert_true(fabs(a->state.covariance[i] - b->state.covariance[i]) <= tolerance);
    assert_true(fabs(a->mismatch - b->mismatch) <= tolerance && a->corrected_ns == b->corrected_ns);
    assert_true(fabs(a->gyro_error - b->gyro_error) <= tolerance && a->doubted == b->doubted);
}

static double apart(const navigation *a, const navigation *b) {
    double sum = 0;
    for (int i = 0; i < 3; i++) sum += fabs(a->state.p[i] - b->state.p[i]) + fabs(a->state.v[i] - b->state.v[i]);
    return sum;
}

/* One pose beside the frames', 50 ms late: two frames have come meanwhile. */
static void a_pose_50_ms_late_makes_the_state_of_one_on_time(void **state) {
    (void)state;
    const int64_t when = 12 * FRAME_NS + 10 * MS;
    measurement m = seen_at(&late, when);
    for (int k = 0; k <= 40; k++) {
        if (k == 13) assert_int_equal(inertial_measure(&on_time, &m), FATHOM_OK);
        take_frame(&on_time, k * FRAME_NS);
        take_frame(&late, k * FRAME_NS);
        if (k == 13) assert_true(apart(&on_time.now, &late.now) > 1e-5); /* it does tell something */
        if (when + 50 * MS > k * FRAME_NS && when + 50 * MS <= (k + 1) * FRAME_NS) {
            assert_int_equal(inertial_measure(&late, &m), FATHOM_OK);
            assert_int_equal(late.late, 1);
        }
        if (k < 13 || k >= 14) assert_same(&on_time.now, &late.now, 1e-9);
    }
    assert_int_equal(on_time.late + on_time.refused + late.refused, 0);
}

/* Frames' own poses late and in any order: what they teach about noise, and the doubts, too. */
static void frames_poses_in_any_order_make_the_state_of_those_in_order(void **state) {
    (void)state;
    static const int order[] = {0, 1, 4, 2, 3, 5, 7, 6, 9, 11, 10, 8, 12};
    const int count = sizeof order / sizeof *order;
    for (int k = 0; k < count; k++) {
        int64_t t = k * 40 * MS, u = order[k] * 40 * MS;
        measurement a = seen_at(&on_time, t), b = seen_at(&late, u);
        assert_int_equal(inertial_correct(&on_time, &a.camera_to_world, a.information, NULL, true, t), FATHOM_OK);
        assert_int_equal(inertial_correct(&late, &b.camera_to_world, b.information, NULL, true, u), FATHOM_OK);
    }
    assert_int_equal(late.late, 5);
    assert_same(&on_time.now, &late.now, 1e-9);
}

/* A late pose is applied after those of its own stamp, and one at the state's stamp isn't late. */
static void measurements_of_one_stamp_stay_in_the_order_of_arrival(void **state) {
    (void)state;
    for (int k = 0; k <= 5; k++) {
        take_frame(&on_time, k * FRAME_NS);
        take_frame(&late, k * FRAME_NS);
    }
    measurement m = seen_at(&late, 5 * FRAME_NS);
    m.camera_to_world.t[0] += 0.01;
    assert_int_equal(inertial_measure(&on_time, &m), FATHOM_OK);
    assert_int_equal(on_time.late, 0);
    take_frame(&on_time, 6 * FRAME_NS);
    take_frame(&late, 6 * FRAME_NS);
    assert_int_equal(inertial_measure(&late, &m), FATHOM_OK);
    assert_int_equal(late.late, 1);
    assert_same(&on_time.now, &late.now, 1e-9);
}

static void what_is_older_than_the_timeline_is_refused_and_counted(void **state) {
    (void)state;
    measurement early = seen_at(&late, -MS), m = seen_at(&late, 0);
    assert_int_equal(inertial_measure(&late, &m), FATHOM_ERROR_NO_DATA);
    for (int k = 0; k <= 5; k++) take_frame(&late, k * FRAME_NS);
    navigation before = late.now;
    assert_int_equal(inertial_measure(&late, &early), FATHOM_ERROR_TIME); /* before the first pose */
    assert_int_equal(late.refused, 1);
    assert_memory_equal(&before, &late.now, sizeof before);
    for (int k = 6; k <= 40; k++) take_frame(&late, k * FRAME_NS);
    int64_t oldest = (40 - TIMELINE_MOMENTS + 1) * FRAME_NS; /* of the moments that are kept */
    measurement old = seen_at(&late, oldest - MS), kept = seen_at(&late, oldest + MS);
    before = late.now;
    assert_int_equal(inertial_measure(&late, &old), FATHOM_ERROR_TIME);
    assert_int_equal(late.refused, 2);
    assert_int_equal(late.late, 0);
    assert_memory_equal(&before, &late.now, sizeof before);
    assert_int_equal(inertial_measure(&late, &kept), FATHOM_OK);
    assert_int_equal(late.late, 1);
    assert_int_equal(late.past.count, TIMELINE_MOMENTS);
    for (int i = 1; i < late.past.count; i++)
        assert_true(timeline_at(&late.past, i)->by.timestamp_ns >= timeline_at(&late.past, i - 1)->by.timestamp_ns);
}

/* Moments far apart would be many samples to go over again. */
static void nothing_is_applied_further_back_than_the_bound(void **state) {
    (void)state;
    for (int k = 0; k <= 4; k++) take_frame(&late, k * 500 * MS);
    measurement old = seen_at(&late, 2000 * MS - TIMELINE_NS - 1), young = seen_at(&late, 2000 * MS - TIMELINE_NS);
    assert_int_equal(inertial_measure(&late, &old), FATHOM_ERROR_TIME);
    assert_int_equal(inertial_measure(&late, &young), FATHOM_OK);
}

static void a_reset_forgets_the_past(void **state) {
    (void)state;
    for (int k = 0; k <= 5; k++) take_frame(&late, k * FRAME_NS);
    inertial_reset(&late);
    measurement m = seen_at(&late, 2 * FRAME_NS);
    assert_int_equal(inertial_measure(&late, &m), FATHOM_ERROR_NO_DATA);
    take_frame(&late, 10 * FRAME_NS);
    assert_int_equal(inertial_measure(&late, &m), FATHOM_ERROR_TIME);
}

/* The rig refiner turns the history; the moments of the past turn with it, and what was measured at rest. */
static void a_late_pose_across_a_refined_mounting_counts_in_the_new_axes(void **state) {
    (void)state;
    const double mounting[3] = {0.5, -0.3, 0.4};
    double turn[9], bias[3];
    pose origin = camera_at(0);
    begin(&late, block[1]);
    for (int k = 0; k <= 40; k++) {
        push_until(&late, k * FRAME_NS, (k + 1) * FRAME_NS, true);
        inertial_correct(&late, &origin, NULL, NULL, true, k * FRAME_NS);
    }
    for (int i = 0; i < 3; i++) assert_true(fabs(late.now.state.gyro_bias[i] - 0.01 * (i + 1)) < 2e-4);
    memcpy(late.refiner.mounting, mounting, sizeof mounting);
    memset(late.refiner.covariance, 0, sizeof late.refiner.covariance);
    inertial_rig_add(&late, NULL, &origin, 40 * FRAME_NS); /* takes the mounting over */
    so3_exp(mounting, turn);
    so3_apply(turn, (const double[]){0.01, 0.02, 0.03}, bias);
    measurement m = measurement_of_pose(39 * FRAME_NS - MS, &origin, NULL, NULL, late.lever, 0.002, 0.003);
    for (int i = 0; i < 3; i++) assert_true(fabs(late.now.state.gyro_bias[i] - bias[i]) < 2e-4);
    assert_int_equal(inertial_measure(&late, &m), FATHOM_OK);
    assert_int_equal(late.late, 1);
    for (int i = 0; i < 3; i++) assert_true(fabs(late.now.state.gyro_bias[i] - bias[i]) < 2e-4);
    int turned = 0;
    for (int i = 0; i < late.past.count; i++) {
        const double *v = timeline_at(&late.past, i)->by.value;
        if (v[0] == 0) continue;
        turned++;
        for (int k = 0; k < 3; k++) assert_true(fabs(v[k] - bias[k]) < 2e-4);
    }
    assert_true(turned > 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_pose_50_ms_late_makes_the_state_of_one_on_time, setup),
        cmocka_unit_test_setup(frames_poses_in_any_order_make_the_state_of_those_in_order, setup),
        cmocka_unit_test_setup(measurements_of_one_stamp_stay_in_the_order_of_arrival, setup),
        cmocka_unit_test_setup(what_is_older_than_the_timeline_is_refused_and_counted, setup),
        cmocka_unit_test_setup(nothing_is_applied_further_back_than_the_bound, setup),
        cmocka_unit_test_setup(a_reset_forgets_the_past, setup),
        cmocka_unit_test_setup(a_late_pose_across_a_refined_mounting_counts_in_the_new_axes, setup),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
