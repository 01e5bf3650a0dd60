/* The absolute trajectory error against cases worked out by hand. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "fathom/replay/evaluate.h"

/* A turn of 120 degrees about (1 1 1), which takes x to y to z to x, and a shift. */
static void move(const double in[3], double out[3]) {
    out[0] = in[2] + 3;
    out[1] = in[0] - 7;
    out[2] = in[1] + 0.5;
}

static const double corners[][3] = {{0, 0, 0}, {1, 0, 0}, {0, 2, 0}, {0, 0, 3}, {1, 1, 1}, {-2, 0.5, 1}};
#define CORNERS ((int)(sizeof corners / sizeof *corners))

static void test_rigid_is_zero(void **state) {
    (void)state;
    double moved[CORNERS][3];
    for (int i = 0; i < CORNERS; i++) move(corners[i], moved[i]);
    assert_float_equal(evaluate_rmse(corners, (const double(*)[3])moved, CORNERS), 0, 1e-12);
    assert_float_equal(evaluate_rmse(corners, corners, CORNERS), 0, 1e-12);
}

static void test_half_turn(void **state) {
    (void)state;
    double moved[CORNERS][3]; /* the quaternion's w is zero here */
    for (int i = 0; i < CORNERS; i++) {
        moved[i][0] = -corners[i][0];
        moved[i][1] = -corners[i][1];
        moved[i][2] = corners[i][2];
    }
    assert_float_equal(evaluate_rmse(corners, (const double(*)[3])moved, CORNERS), 0, 1e-12);
}

/* No scale: a square's corners at 1 and at 2 from the middle are 1 apart, whatever is turned. */
static void test_scale_is_an_error(void **state) {
    (void)state;
    const double one[][3] = {{1, 0, 0}, {0, 1, 0}, {-1, 0, 0}, {0, -1, 0}};
    const double two[][3] = {{0, 2, 5}, {-2, 0, 5}, {0, -2, 5}, {2, 0, 5}};
    assert_float_equal(evaluate_rmse(one, two, 4), 1, 1e-12);
}

/* Nor a reflection: what differs in sign along the one thin axis stays. */
static void test_mirror_is_an_error(void **state) {
    (void)state;
    const double a[][3] = {{2, 0, 0.1}, {-2, 0, 0.1}, {0, 3, -0.1}, {0, -3, -0.1}};
    double b[4][3];
    memcpy(b, a, sizeof b);
    for (int i = 0; i < 4; i++) b[i][2] = -b[i][2];
    assert_float_equal(evaluate_rmse(a, (const double(*)[3])b, 4), 0.2, 1e-9);
}

/* One point in a hundred is off by 1, across a plane: the alignment shifts by 0.01 and can hardly tilt, so
 * what is left is sqrt(1^2 / 100 - 0.01^2). */
static void test_known_offset(void **state) {
    (void)state;
    double a[100][3], b[100][3];
    for (int i = 0; i < 100; i++) {
        a[i][0] = b[i][0] = i < 50 ? -1000 : 1000; /* far apart, so that turning helps nothing */
        a[i][1] = b[i][1] = (i % 2) * 1000.0;
        a[i][2] = b[i][2] = 0;
    }
    b[0][2] = 1;
    assert_float_equal(evaluate_rmse((const double(*)[3])a, (const double(*)[3])b, 100), sqrt(0.01 - 0.0001),
                       2e-3);
}

static void test_too_few(void **state) {
    (void)state;
    assert_true(isnan(evaluate_rmse(corners, corners, 2)));
    assert_true(isnan(evaluate_rmse(corners, corners, 0)));
}

/* Only the poses that have a reference count, and it is interpolated. */
static void test_association(void **state) {
    (void)state;
    fathom_recording_pose poses[5];
    struct path_point points[6];
    memset(poses, 0, sizeof poses);
    memset(points, 0, sizeof points);
    for (int i = 0; i < 5; i++) {
        poses[i].timestamp_ns = i * INT64_C(30000000);
        poses[i].pose.position[0] = i;
        poses[i].pose.position[1] = 2 * i;
        poses[i].pose.orientation[3] = 1;
    }
    for (int i = 0; i < 6; i++) {
        points[i].timestamp_ns =
            i * INT64_C(30000000) + 15000000; /* half-way; the last two within and beyond 20 ms */
        points[i].pose.position[0] = i + 0.5;
        points[i].pose.position[1] = 2 * i + 1;
        points[i].pose.position[2] = 4;
    }
    points[4].pose.position[0] = 4; /* held there: the nearest is taken */
    points[4].pose.position[1] = 8;
    points[5].pose.position[0] = 1000;
    fathom_recording recording = {.pose_count = 5, .poses = poses};
    const struct path path = {6, points};
    assert_float_equal(evaluate_ate(&recording, &path), 0, 1e-6);
    recording.pose_count = 0;
    assert_true(isnan(evaluate_ate(&recording, &path)));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rigid_is_zero),     cmocka_unit_test(test_half_turn),
        cmocka_unit_test(test_scale_is_an_error), cmocka_unit_test(test_mirror_is_an_error),
        cmocka_unit_test(test_known_offset),      cmocka_unit_test(test_too_few),
        cmocka_unit_test(test_association),
    };
    return cmocka_run_group_tests_name("evaluate", tests, NULL, NULL);
}
