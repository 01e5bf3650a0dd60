/* Calibration of the rig (examples/calibrate/calibration.h) on simulated ways whose rig is known. The poses are the true ones
 * with noise, so no frame is rendered and no library runs. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "base/se3.h"
#include "calibrate/calibration.h"
#include "simulate/counter_random.h"
#include "simulate/imu_model.h"

#define DEGREES 57.29577951308232
#define FRAME_RATE 30.0
#define MOST_FRAMES 1200
#define MOST_SAMPLES 30000

/* What is simulated; what is zero is taken as fits the case: 300 frames, 200 Hz, a consumer's part. */
struct rig {
    struct imu_mounting mounting;
    const char *grade;
    double imu_rate, still, speed, turn, noise_rad, noise_m;
    int frames;
    uint64_t seed;
};

static struct path_point points[MOST_FRAMES];
static struct path path = {0, points};
static fathom_imu_sample samples[MOST_SAMPLES];
static struct calibration_input input;
static struct calibration found;

static void simulate(const struct rig *rig) {
    struct scene scene;
    struct camera_path way;
    struct imu_model imu;
    const uint64_t key = random_key(rig->seed, 0xca1);
    const double rate = rig->imu_rate > 0 ? rig->imu_rate : 200;
    scene_make(&scene, SCENE_ROOM, rig->seed, 12);
    camera_path_make(&way, &scene, rig->still, rig->speed > 0 ? rig->speed : 1, rig->turn);
    imu_model_make(&imu, imu_grade_of(rig->grade ? rig->grade : "consumer"), &rig->mounting, rate, rig->seed);
    path.count = rig->frames ? rig->frames : 300;
    for (int i = 0; i < path.count; i++) {
        const double t = 0.4 + i / FRAME_RATE;
        double vector[3], error[9];
        struct camera_pose at;
        camera_path_pose(&way, t, &at);
        for (int k = 0; k < 3; k++) vector[k] = rig->noise_rad * random_normal(key, (uint64_t)(6 * i + k));
        rotation_of_vector(vector, error);
        memset(&points[i], 0, sizeof points[i]);
        points[i].timestamp_ns = llround(1e9 * t);
        points[i].state = i ? FATHOM_TRACKED : FATHOM_FIRST;
        double seen[9];
        so3_multiply(at.rotation, error, seen);
        quaternion_of(seen, points[i].pose.orientation);
        for (int r = 0; r < 3; r++)
            points[i].pose.position[r] =
                at.position[r] + rig->noise_m * random_normal(key, (uint64_t)(6 * i + 3 + r));
    }
    const double seconds = 0.8 + path.count / FRAME_RATE;
    input = (struct calibration_input){.path = &path, .imu = samples, .offset_range = 0.5};
    for (; input.imu_count < MOST_SAMPLES && input.imu_count < seconds * rate; input.imu_count++) {
        struct imu_sample sample;
        fathom_imu_sample *out = &samples[input.imu_count];
        imu_model_next(&imu, &way, &sample);
        out->timestamp_ns = llround(1e9 * sample.stamp);
        for (int k = 0; k < 3; k++) {
            out->gyro[k] = (float)sample.gyro[k];
            out->accel[k] = (float)sample.accel[k];
        }
    }
    scene_free(&scene);
}

/* The error of the rotation found, about the camera's axes, radians. */
static void rotation_error(const double rotation_deg[3], double error[3]) {
    double vector[3], truth[9], left[9];
    for (int k = 0; k < 3; k++) vector[k] = rotation_deg[k] / DEGREES;
    rotation_of_vector(vector, truth);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            left[3 * r + c] = 0;
            for (int k = 0; k < 3; k++) left[3 * r + c] += found.rotation[3 * r + k] * truth[3 * c + k];
        }
    vector_of_rotation(left, error);
}

static double length(const double v[3]) {
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

static enum calibration_outcome solve(const struct rig *rig) {
    simulate(rig);
    return calibration_solve(&input, &found);
}

/* Within what the issue asks of simulated rigs, and within what the result says of itself. */
static void assert_found(const struct rig *rig, double most_deg, double most_s) {
    double error[3];
    rotation_error(rig->mounting.rotation_deg, error);
    const double offset = found.offset - rig->mounting.clock_offset;
    assert_true(length(error) * DEGREES < most_deg);
    assert_true(fabs(offset) < most_s);
    for (int k = 0; k < 3; k++) assert_true(fabs(error[k]) < 5 * found.rotation_sigma[k]);
    assert_true(fabs(offset) < 5 * found.offset_sigma);
    assert_true(found.offset_observable);
}

/* Large turns, half turns, offsets of either sign; moving from the first sample on, and standing still first. */
static void test_rigs(void **state) {
    (void)state;
    static const double rotations[][3] = {{0, 0, 0},     {0.8, -1.2, 90}, {180, 0, 0}, {0, 0, -180},
                                          {120, 40, 85}, {-60, 100, -20}, {0, -90, 0}, {127, 127, 0}};
    static const double offsets[] = {0, 0.1, -0.1, 0.013, -0.0571, 0.05, -0.004, 0.09};
    static const char *const grades[] = {"ideal", "consumer"};
    for (int i = 0; i < 8; i++) {
        struct rig rig = {.turn = 1,
                          .noise_rad = 1e-3,
                          .noise_m = 1e-3,
                          .seed = 20 + (uint64_t)i,
                          .still = i % 2 ? 0.5 : -2};
        memcpy(rig.mounting.rotation_deg, rotations[i], sizeof rotations[i]);
        rig.mounting.clock_offset = offsets[i];
        rig.mounting.translation[0] = 0.03;
        rig.grade = grades[i % 2];
        assert_int_equal(solve(&rig), CALIBRATION_DONE);
        assert_found(&rig, 0.3, 0.002);
        assert_float_equal(found.gyro_scale, 1, 0.005);
    }
}

static void test_lever_arm(void **state) {
    (void)state;
    const struct rig rig = {.mounting = {{10, 80, -30}, {0.05, -0.08, 0.12}, 0.02},
                            .turn = 2,
                            .speed = 1,
                            .noise_rad = 3e-4,
                            .noise_m = 3e-4,
                            .frames = 600,
                            .seed = 3};
    assert_int_equal(solve(&rig), CALIBRATION_DONE);
    assert_true(found.lever_observable);
    for (int k = 0; k < 3; k++) assert_float_equal(found.lever[k], rig.mounting.translation[k], 0.01);
    assert_float_equal(length(found.gravity), STANDARD_GRAVITY, 0.05);
}

static void test_gyro_scale_and_bias(void **state) {
    (void)state;
    const struct rig rig = {.mounting = {{0, 30, 60}, {0}, 0.03},
                            .turn = 2,
                            .noise_rad = 5e-4,
                            .noise_m = 1e-3,
                            .seed = 5,
                            .grade = "ideal"};
    simulate(&rig);
    for (int i = 0; i < input.imu_count; i++) {
        for (int k = 0; k < 3; k++) samples[i].gyro[k] *= 1.02f;
        samples[i].gyro[1] += 0.02f;
    }
    assert_int_equal(calibration_solve(&input, &found), CALIBRATION_DONE);
    assert_found(&rig, 0.3, 0.002);
    assert_float_equal(found.gyro_scale, 1 / 1.02, 0.003);
    assert_float_equal(found.gyro_bias[1], 0.02, 0.002);
}

/* A third of the way wrongly tracked, and frames without tracking in between. */
static void test_wrong_frames_are_left_out(void **state) {
    (void)state;
    const struct rig rig = {
        .mounting = {{20, -50, 100}, {0}, 0.06}, .turn = 1, .noise_rad = 1e-3, .noise_m = 1e-3, .seed = 9};
    simulate(&rig);
    points[40].state = FATHOM_RECKONED;
    for (int i = 200; i < 300; i++) {
        double vector[3], turned[9];
        pose wrong;
        for (int k = 0; k < 3; k++) vector[k] = 0.4 * sin(0.3 * i + 2 * k);
        rotation_of_vector(vector, turned);
        assert_true(pose_take(&points[i].pose, &wrong));
        so3_multiply(wrong.r, turned, wrong.r);
        points[i].pose = pose_give(&wrong);
    }
    assert_int_equal(calibration_solve(&input, &found), CALIBRATION_DONE);
    assert_true(found.left_out > 50);
    double error[3];
    rotation_error(rig.mounting.rotation_deg, error);
    assert_true(length(error) * DEGREES < 1);
    assert_float_equal(found.offset, 0.06, 0.004);
}

static void test_no_turning(void **state) {
    (void)state;
    const struct rig rig = {.turn = 0, .noise_rad = 1e-3, .noise_m = 1e-3, .still = 1000, .seed = 2};
    assert_int_equal(solve(&rig), CALIBRATION_LITTLE_TURNING);
}

/* What tremor alone shows of the mounting is drowned in tracking's errors. */
static void test_tremor_is_refused(void **state) {
    (void)state;
    const struct rig rig = {.turn = 0, .noise_rad = 5e-4, .noise_m = 1e-3, .grade = "phone", .seed = 2};
    assert_int_equal(solve(&rig), CALIBRATION_LITTLE_TURNING);
    assert_true(found.weak_sigma == 0);
}

/* Noisy turning, and mountings at and near quarter turns, and far from them. */
static void test_square_mountings(void **state) {
    (void)state;
    static const double rotations[3][3] = {{0, 0, 90}, {2.5, 0, 90}, {25, 0, 90}};
    for (int i = 0; i < 3; i++) {
        struct rig rig = {.turn = 1, .noise_rad = 0.02, .noise_m = 0.02, .frames = 150, .seed = 6};
        memcpy(rig.mounting.rotation_deg, rotations[i], sizeof rotations[i]);
        assert_int_equal(solve(&rig), CALIBRATION_DONE);
        assert_true(found.data_weak_sigma * DEGREES > 1); /* the doubt in which the prior counts */
        double error[3], data_error[3];
        rotation_error(rotations[i], error);
        memcpy(found.rotation, found.data_rotation, sizeof found.rotation);
        rotation_error(rotations[i], data_error);
        assert_true(length(error) < 3 * found.weak_sigma);
        assert_true(length(data_error) < 3 * found.data_weak_sigma);
        if (i < 2) {
            assert_true(found.square_moved > 0.1);
            assert_true(found.weak_sigma < 0.9 * found.data_weak_sigma);
            assert_true(length(error) < length(data_error));
        } else { /* out of the question: the data are left alone */
            assert_true(found.square_moved == 0);
            assert_float_equal(found.weak_sigma, found.data_weak_sigma, 1e-12);
            assert_float_equal(length(error), length(data_error), 1e-9);
        }
    }
}

static void test_unfit_samples(void **state) {
    (void)state;
    const struct rig rig = {.turn = 2, .noise_rad = 5e-4, .noise_m = 1e-3, .seed = 4};
    simulate(&rig);
    for (int i = 0; i < input.imu_count; i++)
        for (int k = 0; k < 3; k++) samples[i].gyro[k] *= (float)DEGREES;
    assert_int_equal(calibration_solve(&input, &found), CALIBRATION_SCALE);
    assert_float_equal(found.gyro_scale * DEGREES, 1, 0.05);

    simulate(&rig);
    for (int i = 0; i < input.imu_count; i++) samples[i].gyro[0] = -samples[i].gyro[0];
    assert_int_equal(calibration_solve(&input, &found), CALIBRATION_MIRRORED);

    simulate(&rig);
    input.imu_count = 40; /* 0.2 s */
    assert_int_equal(calibration_solve(&input, &found), CALIBRATION_FEW_FRAMES);

    simulate(&rig);
    for (int i = 0; i < input.imu_count; i++) samples[i].accel[2] = NAN;
    assert_int_equal(calibration_solve(&input, &found), CALIBRATION_DONE);
    assert_false(found.accelerometer);
    assert_false(found.lever_observable);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rigs),
        cmocka_unit_test(test_lever_arm),
        cmocka_unit_test(test_gyro_scale_and_bias),
        cmocka_unit_test(test_wrong_frames_are_left_out),
        cmocka_unit_test(test_no_turning),
        cmocka_unit_test(test_tremor_is_refused),
        cmocka_unit_test(test_square_mountings),
        cmocka_unit_test(test_unfit_samples),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
