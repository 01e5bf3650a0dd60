/* The pose that never jumps (lib/tracking/odometry.c). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "base/covariance.h"
#include "simulate/counter_random.h"
#include "tracking/odometry.h"

#define STEP_S (1.0 / 30)

static const double nothing[36];

static void diagonal(double sigma, double c[36]) {
    for (int i = 0; i < 36; i++) c[i] = i % 7 == 0 ? sigma * sigma : 0;
}

/* A walk with turns, a lever arm of metres from where it began. */
static pose walk(int i) {
    const double twist[6] = {0.3 * sin(0.2 * i), 0.05 * i, 0.2 * cos(0.3 * i), 0.1 * i, 0.4 * sin(0.1 * i), 1};
    return pose_exp(twist);
}

static double apart(const pose *a, const pose *b) {
    pose way = pose_between(a, b);
    return pose_distance(&way) + pose_angle(&way);
}

static void equals_the_pose_while_every_frame_is_tracked(void **state) {
    (void)state;
    odometry o;
    pose at = walk(0), wrong = walk(7);
    double c[36];
    diagonal(0.002, c);
    odometry_start(&o, &at);
    for (int i = 1; i < 200; i++) {
        at = walk(i);
        odometry_advance(&o, &wrong, c, &at, c, true, STEP_S);
        assert_true(apart(&o.at, &at) < 1e-9);
    }
}

static void does_not_jump_when_the_camera_is_found_again(void **state) {
    (void)state;
    odometry o;
    pose at = walk(0), last = at;
    double c[36];
    diagonal(0.002, c);
    odometry_start(&o, &at);
    for (int i = 1; i < 40; i++) {
        bool tracked = i < 10 || i >= 20;
        const double astray[6] = {0.02, 0.01, 0, 0.03, -0.02, 0.01}; /* inertia is wrong by that much a frame */
        pose truth = walk(i), before = walk(i - 1), error = pose_exp(astray), way = pose_between(&before, &truth);
        pose motion = pose_multiply(&way, &error);
        at = tracked ? truth : pose_multiply(&at, &motion); /* in the map it jumps at frame 20 */
        pose old = o.at;
        odometry_advance(&o, &motion, c, &at, c, tracked, STEP_S);
        pose moved = pose_between(&old, &o.at);
        bool by_alignment = tracked && i != 20;
        assert_true(apart(&moved, by_alignment ? &way : &motion) < 1e-9);
        if (i == 20) {
            pose jump = pose_between(&last, &at);
            assert_true(apart(&jump, &way) > 0.2);
        }
        last = at;
    }
}

static double determinant_sigma(const double c[36]) { /* of position: the cube root of its volume */
    double a = c[21], b = c[22], d = c[23], e = c[28], f = c[29], g = c[35];
    return pow(a * (e * g - f * f) - b * (b * g - f * d) + d * (b * f - e * d), 1.0 / 6);
}

static void grows_less_sure_through_an_outage_and_never_surer_again(void **state) {
    (void)state;
    odometry o;
    pose at = walk(0), motion = pose_identity();
    double aligned[36], reckoned[36];
    diagonal(0.001, aligned);
    diagonal(0.01, reckoned);
    odometry_start(&o, &at);
    double before = 0;
    for (int i = 1; i < 60; i++) {
        bool tracked = i < 20 || i >= 30;
        at = walk(i);
        odometry_advance(&o, &motion, reckoned, &at, tracked ? aligned : reckoned, tracked, STEP_S);
        double now = determinant_sigma(o.covariance);
        assert_true(now >= 0.9 * before);
        if (i == 19) assert_true(now < 0.01);
        if (i == 30) assert_true(now > 0.03);
        before = now;
    }
}

static void a_pose_drifts_with_the_map_by_time_alone(void **state) {
    (void)state;
    odometry o;
    pose at = pose_identity();
    odometry_start(&o, &at);
    for (int i = 0; i < 100; i++) odometry_advance(&o, &at, nothing, &at, nothing, true, 0.25);
    for (int i = 0; i < 6; i++) {
        double sigma = (i < 3 ? 2e-3 : 1e-3) * 5;
        assert_true(fabs(sqrt(o.covariance[7 * i]) - sigma) < 1e-9);
    }
}

static void draw(const double sigma, uint64_t key, uint64_t *k, double e[6]) {
    for (int i = 0; i < 6; i++) e[i] = sigma * random_normal(key, (*k)++);
}

static pose disturbed(const pose *p, const double e[6]) {
    pose by = pose_exp(e);
    return pose_multiply(p, &by);
}

/* Tracked, lost, found again, lost at once, found, tracked: samples of all errors that have those covariances. */
static void the_covariance_is_what_samples_of_the_errors_find(void **state) {
    (void)state;
    enum { TRIALS = 4000, FRAMES = 13 };
    static const bool tracked[FRAMES] = {true, true, true, false, false, true, true, true, false, true, false, true, true};
    static double found[FRAMES][36], said[FRAMES][36];
    double aligned[36], reckoned[36];
    uint64_t key = random_key(11, 1), k = 0;
    memset(found, 0, sizeof found);
    diagonal(0.004, aligned);
    diagonal(0.003, reckoned);
    for (int t = 0; t < TRIALS; t++) {
        odometry o;
        double e[6];
        pose first = walk(0);
        odometry_start(&o, &first);
        for (int i = 1; i < FRAMES; i++) {
            pose truth = walk(3 * i), before = walk(3 * i - 3), way = pose_between(&before, &truth);
            draw(0.003, key, &k, e);
            pose motion = disturbed(&way, e);
            draw(0.004, key, &k, e);
            pose at = disturbed(&truth, e);
            odometry_advance(&o, &motion, reckoned, &at, aligned, tracked[i], 0);
            pose off = pose_between(&truth, &o.at);
            pose_log(&off, e);
            for (int r = 0; r < 36; r++) found[i][r] += e[r / 6] * e[r % 6] / TRIALS;
            memcpy(said[i], o.covariance, sizeof said[i]);
        }
    }
    for (int i = 1; i < FRAMES; i++)
        for (int r = 0; r < 36; r++) {
            double scale = sqrt(said[i][7 * (r / 6)] * said[i][7 * (r % 6)]);
            if (fabs(found[i][r] - said[i][r]) >= 0.1 * scale)
                print_message("frame %d, entry %d: %g, not %g\n", i, r, said[i][r], found[i][r]);
            assert_true(fabs(found[i][r] - said[i][r]) < 0.1 * scale);
        }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(equals_the_pose_while_every_frame_is_tracked),
        cmocka_unit_test(does_not_jump_when_the_camera_is_found_again),
        cmocka_unit_test(grows_less_sure_through_an_outage_and_never_surer_again),
        cmocka_unit_test(a_pose_drifts_with_the_map_by_time_alone),
        cmocka_unit_test(the_covariance_is_what_samples_of_the_errors_find),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
