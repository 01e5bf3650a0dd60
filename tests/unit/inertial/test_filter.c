/* The error-state filter and its measurements (lib/inertial/filter.cpp, measurement.c) by properties: Jacobians against
 * numerical differentiation, noise that adds up, consistency against samples drawn from it. The lever arm is 0.3 m long. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "base/covariance.h"
#include "inertial/measurement.h"
#include "simulate/counter_random.h"

#define N NAVIGATOR_STATES

static const double lever[3] = {0.2, -0.18, 0.14}; /* 0.3 m */
static const double none[3] = {0, 0, 0};

static double draw(double sigma) {
    static uint64_t counter;
    return sigma * random_normal(random_key(17, 3), counter++);
}

/* Some state: turned, moving, with biases; its covariance is zero. */
static navigator some_state(void) {
    const double twist[6] = {0.4, -0.9, 0.3, 1, 2, 3}, gravity[3] = {0.5, -0.4, -9.7};
    const double v[3] = {0.3, -0.5, 0.2}, gyro_bias[3] = {0.02, -0.01, 0.03}, accel_bias[3] = {0.1, -0.2, 0.05};
    navigator n;
    pose p = pose_exp(twist);
    memset(&n, 0, sizeof n);
    navigator_start(&n, &p, gravity, 0.5, 0.02, 0.1, 0.2);
    memcpy(n.v, v, sizeof v);
    memcpy(n.gyro_bias, gyro_bias, sizeof gyro_bias);
    memcpy(n.accel_bias, accel_bias, sizeof accel_bias);
    memset(n.covariance, 0, sizeof n.covariance);
    return n;
}

/* A full covariance: of errors of usual sizes that are all correlated with each other. */
static void correlate(navigator *n) {
    const double sigmas[6] = {0.02, 0.05, 0.2, 0.01, 0.1, 0.1};
    double root[N][N];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) root[i][j] = sigmas[i / 3] * ((i == j) + 0.3 * draw(1));
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            n->covariance[N * i + j] = 0;
            for (int k = 0; k < N; k++) n->covariance[N * i + j] += root[i][k] * root[j][k];
        }
}

static navigator perturbed(const navigator *n, int part, double by) {
    navigator other = *n;
    double error[N] = {0};
    error[part] = by;
    navigator_perturb(&other, error);
    return other;
}

/* The error that takes one state to the other, in the order of the covariance. */
static void error_between(const navigator *from, const navigator *to, double error[N]) {
    double turn[9];
    so3_transpose_multiply(from->r, to->r, turn);
    so3_log(turn, error + NAVIGATOR_ROTATION);
    for (int i = 0; i < 3; i++) {
        error[NAVIGATOR_POSITION + i] = to->p[i] - from->p[i];
        error[NAVIGATOR_VELOCITY + i] = to->v[i] - from->v[i];
        error[NAVIGATOR_GYRO_BIAS + i] = to->gyro_bias[i] - from->gyro_bias[i];
        error[NAVIGATOR_ACCEL_BIAS + i] = to->accel_bias[i] - from->accel_bias[i];
        error[NAVIGATOR_GRAVITY + i] = to->gravity[i] - from->gravity[i];
    }
}

/* ---- Jacobians ------------------------------------------------------------------------------------------------------ */

static void an_error_taken_in_is_the_error_between(void **state) {
    (void)state;
    navigator n = some_state(), other = n;
    double error[N], back[N];
    for (int i = 0; i < N; i++) error[i] = draw(0.3);
    navigator_perturb(&other, error);
    error_between(&n, &other, back);
    for (int i = 0; i < N; i++) assert_true(fabs(back[i] - error[i]) < 1e-12);
}

static void the_lever_moves_the_camera_as_its_jacobian_says(void **state) {
    (void)state;
    const double step = 1e-6;
    double jacobian[6 * N];
    navigator n = some_state();
    pose camera = navigator_camera(&n, lever);
    navigator_camera_jacobian(&n, lever, jacobian);
    for (int j = 0; j < N; j++) {
        navigator more = perturbed(&n, j, step), less = perturbed(&n, j, -step);
        pose a = navigator_camera(&less, lever), b = navigator_camera(&more, lever);
        pose from = pose_between(&camera, &a), to = pose_between(&camera, &b);
        double before[6], after[6];
        pose_log(&from, before);
        pose_log(&to, after);
        for (int i = 0; i < 6; i++)
            assert_true(fabs((after[i] - before[i]) / (2 * step) - jacobian[N * i + j]) < 1e-8);
    }
    double longest = 0;
    for (int i = 3; i < 6; i++)
        for (int j = 0; j < 3; j++) longest = fmax(longest, fabs(jacobian[N * i + j]));
    assert_true(longest > 0.19); /* it is the lever that moves it */
}

/* The camera's covariance is the state's, carried by numbers alone. */
static void the_cameras_covariance_counts_the_lever(void **state) {
    (void)state;
    navigator n = some_state();
    double numeric[6][N], covariance[36], got[36];
    correlate(&n);
    pose camera = navigator_camera(&n, lever);
    for (int j = 0; j < N; j++) {
        navigator more = perturbed(&n, j, 1e-6);
        pose b = navigator_camera(&more, lever), way = pose_between(&camera, &b);
        double twist[6];
        pose_log(&way, twist);
        for (int i = 0; i < 6; i++) numeric[i][j] = 1e6 * twist[i];
    }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            covariance[6 * i + j] = 0;
            for (int k = 0; k < N; k++)
                for (int l = 0; l < N; l++)
                    covariance[6 * i + j] += numeric[i][k] * n.covariance[N * k + l] * numeric[j][l];
        }
    navigator_camera_covariance(&n, lever, got);
    for (int i = 0; i < 36; i++) assert_true(fabs(got[i] - covariance[i]) < 1e-7);
}

static void each_measurements_jacobian_is_its_residuals_slope(void **state) {
    (void)state;
    const double step = 1e-6, mean[3] = {0.01, 0.02, -0.01};
    navigator n = some_state();
    pose camera = navigator_camera(&n, lever);
    const measurement kinds[] = {measurement_of_pose(0, &camera, NULL, NULL, lever, 0.006, 0.004),
                                 measurement_of_rest(0, 0.01), measurement_of_gyro_bias(0, mean, 0.002)};
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        linearisation at = {.residual = {0}};
        kinds[k].linearise(&kinds[k], &n, &at);
        for (int j = 0; j < N; j++) {
            navigator more = perturbed(&n, j, step), less = perturbed(&n, j, -step);
            linearisation a = {.residual = {0}}, b = a;
            kinds[k].linearise(&kinds[k], &less, &a);
            kinds[k].linearise(&kinds[k], &more, &b);
            for (int i = 0; i < MEASUREMENT_ROWS; i++)
                assert_true(fabs((a.residual[i] - b.residual[i]) / (2 * step) - at.jacobian[N * i + j]) < 1e-8);
        }
    }
}

/* F P F^T with the error of one state alone is that state's column of F by itself. */
static void a_steps_transition_is_the_numerical_one(void **state) {
    (void)state;
    const double dt = 0.01, accel[3] = {1.5, -2, 9}, step = 1e-5;
    const navigator_noise silent = {.gyro = 0};
    navigator n = some_state();
    for (int forceless = 0; forceless < 2; forceless++)
        for (int j = 0; j < N; j++) {
            navigator before = n, after, more = perturbed(&n, j, step), less = perturbed(&n, j, -step);
            const double *rate = n.gyro_bias; /* not turning, so that it doesn't matter where in the step forces act */
            double a[N], b[N], column[N];
            before.covariance[(N + 1) * j] = 1;
            after = before;
            navigator_step(&after, dt, rate, forceless ? NULL : accel, &silent);
            navigator_step(&more, dt, rate, forceless ? NULL : accel, &silent);
            navigator_step(&less, dt, rate, forceless ? NULL : accel, &silent);
            error_between(&after, &less, a);
            error_between(&after, &more, b);
            for (int i = 0; i < N; i++) column[i] = (b[i] - a[i]) / (2 * step);
            for (int i = 0; i < N; i++)
                for (int k = 0; k < N; k++) {
                    /* what a bias of the gyroscope does to forces within the step is left out: second order */
                    bool left_out = j >= NAVIGATOR_GYRO_BIAS && j < NAVIGATOR_ACCEL_BIAS &&
                                    ((i >= 3 && i < 9) || (k >= 3 && k < 9));
                    double got = after.covariance[N * i + k], wanted = column[i] * column[k];
                    if (!left_out) assert_true(fabs(got - wanted) < 1e-8 + 1e-6 * fabs(wanted));
                }
        }
}

/* ---- noise ---------------------------------------------------------------------------------------------------------- */

/* White noise of the force: position and velocity, and how they go together, grow as a^2 t^3/3, a^2 t, a^2 t^2/2. */
static void position_and_velocity_noise_grow_together_however_a_stretch_is_cut(void **state) {
    (void)state;
    const navigator_noise noise = {.accel = 0.3};
    const int cuts[] = {1, 2, 7, 50};
    for (int c = 0; c < 4; c++) {
        navigator n = some_state();
        double at_rest[3], t = 0.8, a2 = 0.3 * 0.3;
        memcpy(at_rest, n.gyro_bias, sizeof at_rest);
        for (int i = 0; i < cuts[c]; i++) navigator_step(&n, t / cuts[c], at_rest, n.accel_bias, &noise);
        for (int i = 0; i < 3; i++) {
            const double *p = n.covariance + (N + 1) * (NAVIGATOR_POSITION + i);
            const double *v = n.covariance + (N + 1) * (NAVIGATOR_VELOCITY + i);
            assert_true(fabs(*p / (a2 * t * t * t / 3) - 1) < 1e-9);
            assert_true(fabs(*v / (a2 * t) - 1) < 1e-9);
            assert_true(fabs(p[3] / (a2 * t * t / 2) - 1) < 1e-9);
            assert_true(p[3] == v[-3]);
        }
    }
}

static void walks_add_up_in_their_own_states(void **state) {
    (void)state;
    const navigator_noise noise = {.gyro = 0.01, .gyro_walk = 0.02, .accel_walk = 0.03, .turn = 0};
    navigator n = some_state();
    navigator_step(&n, 0.5, n.gyro_bias, NULL, &noise);
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(n.covariance[(N + 1) * (NAVIGATOR_ROTATION + i)] - 1e-4 * 0.5) < 1e-12);
        assert_true(fabs(n.covariance[(N + 1) * (NAVIGATOR_GYRO_BIAS + i)] - 4e-4 * 0.5) < 1e-12);
        assert_true(fabs(n.covariance[(N + 1) * (NAVIGATOR_ACCEL_BIAS + i)] - 9e-4 * 0.5) < 1e-12);
    }
}

/* ---- mounting ------------------------------------------------------------------------------------------------------- */

static void a_remounted_imu_turns_both_biases_and_what_is_known_of_them(void **state) {
    (void)state;
    const double turn[3] = {0.3, -0.5, 0.4}, usual_rate = 0.3;
    double q[9], gyro[3], accel[3], square = 0.09 + 0.25 + 0.16, f[N][N] = {{0}};
    navigator before = some_state(), n;
    correlate(&before);
    n = before;
    navigator_turn_imu(&n, turn);
    so3_exp(turn, q);
    so3_apply(q, before.gyro_bias, gyro);
    so3_apply(q, before.accel_bias, accel);
    double gravity = before.gravity[0] * before.gravity[0] + before.gravity[1] * before.gravity[1] +
                     before.gravity[2] * before.gravity[2];
    for (int i = 0; i < 3; i++) {
        assert_true(fabs(n.gyro_bias[i] - gyro[i]) < 1e-15);
        assert_true(fabs(n.accel_bias[i] - accel[i]) < 1e-15);
        assert_true(n.gravity[i] == before.gravity[i] && n.v[i] == before.v[i]);
    }
    for (int i = 0; i < N; i++) f[i][i] = 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) f[9 + i][9 + j] = f[12 + i][12 + j] = q[3 * i + j];
    for (int i = 0; i < N; i++)
        for (int j = 0; j < N; j++) {
            double wanted = 0;
            for (int k = 0; k < N; k++)
                for (int l = 0; l < N; l++) wanted += f[i][k] * before.covariance[N * k + l] * f[j][l];
            if (i == j && i >= 9 && i < 12) wanted += square * usual_rate * usual_rate;
            if (i == j && i >= 12) wanted += square * gravity;
            assert_true(fabs(n.covariance[N * i + j] - wanted) < 1e-12 * (1 + fabs(wanted)));
        }
}

/* ---- measurements --------------------------------------------------------------------------------------------------- */

static void rest_is_left_out_where_the_velocity_is_known_to_be_another(void **state) {
    (void)state;
    for (int sure = 0; sure < 2; sure++) {
        navigator n = some_state(), before;
        for (int i = 0; i < N; i++) n.covariance[(N + 1) * i] = sure && i / 3 == 2 ? 1e-4 : 0.25;
        before = n;
        measurement rest = measurement_of_rest(0, 0.005);
        assert_int_equal(navigator_correct(&n, &rest, 1), !sure);
        for (int i = 0; i < 3 && !sure; i++) assert_true(fabs(n.v[i]) < 1e-3 * fabs(before.v[i]));
        if (sure) assert_memory_equal(&n, &before, sizeof n);
    }
}

/* A pose found jointly with a prior, as alignment does it, corrects like the measurement alone. */
static void a_pull_keeps_the_prior_from_counting_twice(void **state) {
    (void)state;
    const double way[6] = {1e-5, -2e-5, 3e-5, 4e-5, -1e-5, 2e-5};
    double information[36] = {0}, predicted[36], sum[36], left[36], found[6] = {0}, pull[6] = {0}, a[N], b[N];
    navigator n = some_state(), alone, jointly;
    correlate(&n);
    for (int i = 0; i < 6; i++) information[7 * i] = i < 3 ? 1e4 : 500;
    information[1] = information[6] = 2000;
    pose camera = navigator_camera(&n, lever), step = pose_exp(way), z = pose_multiply(&camera, &step);
    navigator_camera_covariance(&n, lever, predicted);
    assert_true(covariance_invert(predicted, sum));
    for (int i = 0; i < 36; i++) sum[i] += information[i];
    assert_true(covariance_invert(sum, left));
    for (int i = 0; i < 6; i++) /* (P^-1 + Y)^-1 Y z */
        for (int j = 0; j < 6; j++)
            for (int k = 0; k < 6; k++) found[i] += left[6 * i + j] * information[6 * j + k] * way[k];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) pull[i] += information[6 * i + j] * (way[j] - found[j]);
    step = pose_exp(found);
    pose x = pose_multiply(&camera, &step);
    alone = jointly = n;
    measurement m = measurement_of_pose(0, &z, information, NULL, lever, 0, 0);
    assert_true(navigator_correct(&alone, &m, 1));
    m = measurement_of_pose(0, &x, information, pull, lever, 0, 0);
    assert_true(navigator_correct(&jointly, &m, 1));
    error_between(&n, &alone, a);
    error_between(&n, &jointly, b);
    double largest = 0;
    for (int i = 0; i < N; i++) {
        assert_true(fabs(a[i] - b[i]) < 1e-8);
        largest = fmax(largest, fabs(a[i]));
    }
    assert_true(largest > 1e-5);
}

static void floors_grow_with_the_mismatch(void **state) {
    (void)state;
    navigator n = some_state(), a, b;
    double covariance[36];
    correlate(&n);
    a = b = n;
    pose camera = navigator_camera(&n, none);
    measurement exact = measurement_of_pose(0, &camera, NULL, NULL, none, 0.001, 0.002);
    assert_true(navigator_correct(&a, &exact, 1));
    assert_true(navigator_correct(&b, &exact, 3));
    navigator_camera_covariance(&a, none, covariance);
    for (int i = 0; i < 6; i++) assert_true(fabs(sqrt(covariance[7 * i]) / (i < 3 ? 0.001 : 0.002) - 1) < 0.01);
    navigator_camera_covariance(&b, none, covariance);
    for (int i = 0; i < 6; i++) assert_true(fabs(sqrt(covariance[7 * i]) / (i < 3 ? 0.003 : 0.006) - 1) < 0.02);
}

/* ---- consistency ---------------------------------------------------------------------------------------------------- */

/* e^T P^-1 e by Cholesky. */
static double squares(const double *covariance, const double *error, int n) {
    double l[N][N], y[N], sum = 0;
    for (int i = 0; i < n; i++) {
        for (int j = 0; j <= i; j++) {
            double s = covariance[n * i + j];
            for (int k = 0; k < j; k++) s -= l[i][k] * l[j][k];
            assert_true(i != j || s > 0);
            l[i][j] = i == j ? sqrt(s) : s / l[j][j];
        }
        y[i] = error[i];
        for (int k = 0; k < i; k++) y[i] -= l[i][k] * y[k];
        y[i] /= l[i][i];
        sum += y[i] * y[i];
    }
    return sum;
}

#define RUNS 400
#define RATE 200

/* Truth, sensors and poses drawn from what the filter is told: its errors are as large as it says. */
static void drawn_errors_are_as_large_as_the_filter_says(void **state) {
    (void)state;
    const double dt = 1.0 / RATE, sigmas[6] = {0.02, 0.05, 0.3, 0.02, 0.1, 0.1};
    const double pose_sigma[6] = {0.03, 0.03, 0.03, 0.003, 0.003, 0.003}; /* it is the lever that tells the tilt */
    const navigator_noise noise = {.gyro = 2e-3, .accel = 2e-2, .gyro_walk = 1e-3, .accel_walk = 1e-2};
    double mean = 0, camera_mean = 0, information[36] = {0};
    for (int i = 0; i < 6; i++) information[7 * i] = 1 / (pose_sigma[i] * pose_sigma[i]);
    for (int run = 0; run < RUNS; run++) {
        navigator n = some_state(), truth = n;
        double error[N], covariance[36], twist[6];
        for (int i = 0; i < N; i++) {
            error[i] = draw(sigmas[i / 3]);
            n.covariance[(N + 1) * i] = sigmas[i / 3] * sigmas[i / 3];
        }
        navigator_perturb(&truth, error);
        for (int k = 1; k <= RATE; k++) {
            double t = k * dt, gyro[3], accel[3], rate[3], force[3];
            for (int i = 0; i < 3; i++) {
                rate[i] = 1.2 * sin(3 * t + i);
                force[i] = 9.8 * (i == 2) + 2 * cos(4 * t + 2 * i);
                truth.gyro_bias[i] += draw(noise.gyro_walk * sqrt(dt));
                truth.accel_bias[i] += draw(noise.accel_walk * sqrt(dt));
                gyro[i] = rate[i] + truth.gyro_bias[i];
                accel[i] = force[i] + truth.accel_bias[i];
            }
            navigator_step(&truth, dt, gyro, accel, &noise);
            for (int i = 0; i < 3; i++) {
                gyro[i] += draw(noise.gyro / sqrt(dt));
                accel[i] += draw(noise.accel / sqrt(dt));
            }
            navigator_step(&n, dt, gyro, accel, &noise);
            if (k % 10 != 0) continue;
            for (int i = 0; i < 6; i++) twist[i] = draw(pose_sigma[i]);
            pose camera = navigator_camera(&truth, lever), off = pose_exp(twist);
            pose seen = pose_multiply(&camera, &off);
            measurement m = measurement_of_pose(0, &seen, information, NULL, lever, 0, 0);
            assert_true(navigator_correct(&n, &m, 1));
        }
        error_between(&n, &truth, error);
        mean += squares(n.covariance, error, N) / RUNS;
        pose a = navigator_camera(&n, lever), b = navigator_camera(&truth, lever), way = pose_between(&a, &b);
        pose_log(&way, twist);
        navigator_camera_covariance(&n, lever, covariance);
        camera_mean += squares(covariance, twist, 6) / RUNS;
    }
    print_message("mean normalised error squared: %.2f of %d states, %.2f of 6 of the camera's pose\n", mean, N,
                  camera_mean);
    assert_true(fabs(mean - N) < 4 * sqrt(2.0 * N / RUNS));
    assert_true(fabs(camera_mean - 6) < 4 * sqrt(12.0 / RUNS));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_error_taken_in_is_the_error_between),
        cmocka_unit_test(the_lever_moves_the_camera_as_its_jacobian_says),
        cmocka_unit_test(the_cameras_covariance_counts_the_lever),
        cmocka_unit_test(each_measurements_jacobian_is_its_residuals_slope),
        cmocka_unit_test(a_steps_transition_is_the_numerical_one),
        cmocka_unit_test(position_and_velocity_noise_grow_together_however_a_stretch_is_cut),
        cmocka_unit_test(walks_add_up_in_their_own_states),
        cmocka_unit_test(a_remounted_imu_turns_both_biases_and_what_is_known_of_them),
        cmocka_unit_test(rest_is_left_out_where_the_velocity_is_known_to_be_another),
        cmocka_unit_test(a_pull_keeps_the_prior_from_counting_twice),
        cmocka_unit_test(floors_grow_with_the_mismatch),
        cmocka_unit_test(drawn_errors_are_as_large_as_the_filter_says),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
