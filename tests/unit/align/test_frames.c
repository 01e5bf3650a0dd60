/* What alignment says in the model camera's axes, as the rest of the library speaks of it (lib/align/frames.c): against
 * motions that are moved by small twists, from poses with a turn and a lever arm of metres. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "align/frames.h"
#include "base/covariance.h"
#include "simulate/counter_random.h"

static const double motion_twist[6] = {0.4, -0.7, 0.3, 1.2, -0.5, 2.1};

/* A positive definite matrix with every entry in it. */
static void some_covariance(uint64_t seed, double c[36]) {
    double a[36];
    for (int i = 0; i < 36; i++) a[i] = 0.1 * random_normal(random_key(seed, 1), (uint64_t)i);
    for (int i = 0; i < 36; i++) {
        c[i] = i % 7 == 0 ? 0.01 : 0;
        for (int k = 0; k < 6; k++) c[i] += a[i / 6 * 6 + k] * a[i % 6 * 6 + k];
    }
}

/* The error on the right that a small left twist is, found by moving the motion: out += twist's image. */
static void moved(const pose *motion, const double left[6], double out[6]) {
    const double step = 1e-6;
    double twist[6];
    for (int i = 0; i < 6; i++) twist[i] = step * left[i];
    pose by = pose_exp(twist), after = pose_multiply(&by, motion), way = pose_between(motion, &after);
    pose_log(&way, out);
    for (int i = 0; i < 6; i++) out[i] /= step;
}

/* That of each unit twist: a column of the linear map. */
static void map_to_scan(const pose *motion, double map[36]) {
    for (int j = 0; j < 6; j++) {
        double unit[6] = {0}, column[6];
        unit[j] = 1;
        moved(motion, unit, column);
        for (int i = 0; i < 6; i++) map[6 * i + j] = column[i];
    }
}

static void assert_near(const double *a, const double *b, int count, double tolerance) {
    for (int i = 0; i < count; i++) {
        if (fabs(a[i] - b[i]) > tolerance) print_message("entry %d: %.9g, not %.9g\n", i, a[i], b[i]);
        assert_true(fabs(a[i] - b[i]) <= tolerance);
    }
}

static void a_covariance_is_carried_by_the_motions_inverse(void **state) {
    (void)state;
    pose motion = pose_exp(motion_twist);
    double map[36], left[36], want[36], got[36];
    map_to_scan(&motion, map);
    some_covariance(1, left);
    covariance_transport(map, left, want);
    covariance_to_scan(&motion, left, got);
    assert_near(got, want, 36, 1e-7);
    pose back = pose_inverse(&motion);
    covariance_to_scan(&back, got, got); /* and back again */
    assert_near(got, left, 36, 1e-12);
}

static void an_information_stays_the_covariances_inverse(void **state) {
    (void)state;
    pose motion = pose_exp(motion_twist);
    double left[36], information[36], covariance[36], want[36], got[36];
    some_covariance(2, left);
    assert_true(covariance_invert(left, information));
    covariance_to_scan(&motion, left, covariance);
    assert_true(covariance_invert(covariance, want));
    information_to_scan(&motion, information, got);
    assert_near(got, want, 36, 1e-6 * information[0]);
}

static void a_pull_stays_information_times_way(void **state) {
    (void)state;
    const double way[6] = {0.02, -0.01, 0.03, 0.05, 0.04, -0.06};
    pose motion = pose_exp(motion_twist);
    double left[36], information[36], there[36], pull[6] = {0}, right_way[6], want[6] = {0}, got[6];
    some_covariance(3, left);
    assert_true(covariance_invert(left, information));
    information_to_scan(&motion, information, there);
    moved(&motion, way, right_way);
    for (int i = 0; i < 36; i++) {
        pull[i / 6] += information[i] * way[i % 6];
        want[i / 6] += there[i] * right_way[i % 6];
    }
    pull_to_scan(&motion, pull, got);
    assert_near(got, want, 6, 1e-4);
}

static void a_twist_is_carried_by_the_motions_inverse(void **state) {
    (void)state;
    const double left[6] = {0.3, -0.2, 0.5, 0.1, 0.7, -0.4};
    const pose motion = pose_exp(motion_twist);
    double want[6], got[6];
    moved(&motion, left, want);
    twist_to_scan(&motion, left, got);
    assert_near(got, want, 6, 1e-5);
}

/* Half a metre and half a radian from the mean, as relocalisation starts. */
static void a_prior_leads_to_its_mean_from_a_start_far_off(void **state) {
    (void)state;
    const double off[6] = {0.3, 0.4, -0.2, 0.3, -0.4, 0.2};
    align_prior prior = {.mean = pose_exp(motion_twist)};
    pose away = pose_exp(off), motion = pose_multiply(&prior.mean, &away);
    double mean[6], information[36], rest[6];
    some_covariance(4, prior.covariance);
    assert_true(prior_of_twist(&prior, &motion, mean, information));
    pose step = pose_exp(mean), reached = pose_multiply(&step, &motion), left = pose_between(&prior.mean, &reached);
    pose_log(&left, rest);
    for (int i = 0; i < 6; i++) assert_true(fabs(rest[i]) < 1e-12);
}

static void a_priors_information_is_that_of_its_error_from_a_start_far_off(void **state) {
    (void)state;
    const double off[6] = {0.3, 0.4, -0.2, 0.3, -0.4, 0.2}, small = 1e-6;
    align_prior prior = {.mean = pose_exp(motion_twist)};
    pose away = pose_exp(off), motion = pose_multiply(&prior.mean, &away);
    double mean[6], got[36], j[36], transposed[36], inverse[36], want[36];
    some_covariance(5, prior.covariance);
    assert_true(prior_of_twist(&prior, &motion, mean, got));
    for (int k = 0; k < 6; k++) { /* how the error changes with each part of the twist */
        double twist[6] = {0}, error[6];
        twist[k] = small;
        pose step = pose_exp(twist), there = pose_multiply(&step, &motion), way = pose_between(&prior.mean, &there);
        pose_log(&way, error);
        for (int i = 0; i < 6; i++) j[6 * i + k] = (error[i] - off[i]) / small;
    }
    for (int i = 0; i < 36; i++) transposed[i] = j[i % 6 * 6 + i / 6];
    assert_true(covariance_invert(prior.covariance, inverse));
    covariance_transport(transposed, inverse, want);
    for (int i = 0; i < 36; i++) {
        if (fabs(got[i] - want[i]) >= 1e-4 * sqrt(want[7 * (i / 6)] * want[7 * (i % 6)]))
            print_message("entry %d: %g, not %g\n", i, got[i], want[i]);
        assert_true(fabs(got[i] - want[i]) < 1e-4 * sqrt(want[7 * (i / 6)] * want[7 * (i % 6)]));
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_covariance_is_carried_by_the_motions_inverse),
        cmocka_unit_test(an_information_stays_the_covariances_inverse),
        cmocka_unit_test(a_pull_stays_information_times_way),
        cmocka_unit_test(a_twist_is_carried_by_the_motions_inverse),
        cmocka_unit_test(a_prior_leads_to_its_mean_from_a_start_far_off),
        cmocka_unit_test(a_priors_information_is_that_of_its_error_from_a_start_far_off),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
