/* The motion over the last second and its covariance (lib/tracking/span.c). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/covariance.h"
#include "simulate/counter_random.h"
#include "tracking/span.h"

#define SHARED_M 0.001

static unsigned char memory[200000];
static span s;

static int start(void **state) {
    (void)state;
    arena a = {memory, sizeof memory, 0};
    span_init(&s, &a);
    span_reset(&s);
    assert_non_null(s.frames);
    return 0;
}

static void diagonal(double sigma_rad, double sigma_m, double c[36]) {
    const double sigmas[2] = {sigma_rad, sigma_m};
    for (int i = 0; i < 36; i++) c[i] = i % 7 == 0 ? pow(sigmas[i / 21], 2) : 0;
}

/* A camera that walks and turns. */
static pose walk(double seconds) {
    const double twist[6] = {0.3 * seconds, 0.5 * seconds, 0.1, 0.4 * seconds, 0.1, 2 * seconds};
    return pose_exp(twist);
}

static void reaches_back_to_the_last_frame_a_second_older(void **state) {
    (void)state;
    static const int rates[] = {1, 9, 30, 60, 90, 125, 1000};
    for (size_t k = 0; k < sizeof rates / sizeof *rates; k++) {
        span_reset(&s);
        double c[36];
        span_motion m;
        assert_false(span_get(&s, &m));
        diagonal(0.001, 0.001, c);
        for (int i = 0; i < 3 * rates[k]; i++) {
            const double seconds = (double)i / rates[k];
            const int64_t ns = (int64_t)(1e9 * seconds) - 5000000000;
            const pose at = walk(seconds);
            span_add(&s, &at, c, true, SHARED_M, ns);
            assert_true(span_get(&s, &m) && m.to_ns == ns);
            const double reached = 1e-9 * (double)(m.to_ns - m.from_ns);
            const double apart = fmax(1.0 / rates[k], 0.0086);
            if (seconds < 1)
                assert_true(m.from_ns == -5000000000);
            else
                assert_true(reached > 1 - 1e-5 && reached < 1 + 1.01 * apart);
            const pose from = walk(seconds - reached), truth = pose_between(&from, &at);
            const pose rest = pose_between(&truth, &m.motion);
            assert_true(pose_distance(&rest) < 1e-6 && pose_angle(&rest) < 1e-6);
        }
    }
}

/* Draws poses with errors of known covariance: the motion's errors must be what its covariance says. */
static void two_aligned_poses_leave_the_errors_of_both(void **state) {
    (void)state;
    double squares = 0;
    const uint64_t key = random_key(3, 1);
    double c[36];
    diagonal(0.01, 0.02, c);
    for (int k = 0; k < 500; k++) {
        pose at[2];
        span_reset(&s);
        for (int i = 0; i < 2; i++) {
            double error[6];
            const pose truth = walk(i);
            for (int j = 0; j < 6; j++)
                error[j] = (j < 3 ? 0.01 : 0.02) * random_normal(key, (uint64_t)(12 * k + 6 * i + j));
            const pose off = pose_exp(error);
            at[i] = pose_multiply(&truth, &off);
            span_add(&s, &at[i], c, true, 0, 1000000000 * (int64_t)i);
        }
        span_motion m;
        assert_true(span_get(&s, &m));
        const pose first = walk(0), second = walk(1), truth = pose_between(&first, &second);
        const pose off = pose_between(&truth, &m.motion);
        double twist[6];
        pose_log(&off, twist);
        squares += pow(covariance_mahalanobis(m.covariance, twist), 2);
    }
    const double mean = squares / 500 / 6;
    if (!(mean > 0.9 && mean < 1.1)) fail_msg("%g times what is expected", mean);
}

static void dead_reckoning_leaves_what_has_been_added(void **state) {
    (void)state;
    double before[36], after[36];
    span_motion m;
    const pose still = pose_identity();
    diagonal(0.003, 0.3, before);
    diagonal(0.005, 0.5, after);
    span_add(&s, &still, before, false, SHARED_M, 0);
    span_add(&s, &still, after, false, SHARED_M, 1000000000);
    assert_true(span_get(&s, &m));
    assert_true(fabs(sqrt(m.covariance[35]) - 0.4) < 1e-9 && fabs(sqrt(m.covariance[0]) - 0.004) < 1e-9);
    span_add(&s, &still, before, true, SHARED_M, 2000000000); /* found again: both poses' errors */
    assert_true(span_get(&s, &m));
    assert_true(fabs(m.covariance[35] - 0.34) < 1e-9);
}

static void the_map_drifts_as_the_camera_moves_on(void **state) {
    (void)state;
    double c[36], sigma[3];
    diagonal(1e-5, 1e-5, c);
    for (int k = 0; k < 3; k++) { /* still; moving; moving before a noisier sensor */
        span_motion m;
        span_reset(&s);
        for (int i = 0; i <= 30; i++) {
            const pose at = walk(k > 0 ? i / 30.0 : 0);
            span_add(&s, &at, c, true, k == 2 ? 3 * SHARED_M : SHARED_M, (int64_t)i * 33400000);
        }
        assert_true(span_get(&s, &m));
        sigma[k] = sqrt(m.covariance[35]);
        if (k > 0) assert_true(fabs(sqrt(m.covariance[0]) / sigma[k] - 0.5) < 0.01); /* rad per metre */
    }
    assert_true(sigma[0] < 1e-4);
    assert_true(sigma[1] > 5 * SHARED_M && sigma[1] < 100 * SHARED_M);
    assert_true(fabs(sigma[2] / sigma[1] - 3) < 0.01);
}

static void the_first_frame_is_no_motion(void **state) {
    (void)state;
    double c[36];
    span_motion m;
    const pose at = walk(3);
    diagonal(0.1, 0.1, c);
    span_add(&s, &at, c, true, SHARED_M, 77);
    assert_true(span_get(&s, &m) && m.from_ns == 77 && m.to_ns == 77);
    for (int i = 0; i < 36; i++) assert_true(m.covariance[i] == 0);
    assert_true(pose_distance(&m.motion) == 0);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(reaches_back_to_the_last_frame_a_second_older, start),
        cmocka_unit_test_setup(two_aligned_poses_leave_the_errors_of_both, start),
        cmocka_unit_test_setup(dead_reckoning_leaves_what_has_been_added, start),
        cmocka_unit_test_setup(the_map_drifts_as_the_camera_moves_on, start),
        cmocka_unit_test_setup(the_first_frame_is_no_motion, start),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
