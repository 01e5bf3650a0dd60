/* The rig refined while scanning (lib/rig_refine.c, lib/inertial_rig.c) on simulated hand-held paths whose rig is known: the
 * poses are the true ones with noise, so no frame is rendered. Links with examples/cli/{scene*,camera_path,imu_model}.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../examples/cli/camera_path.h"
#include "../examples/cli/counter_random.h"
#include "../examples/cli/imu_model.h"
#include "inertial.h"

#define DEGREES 57.29577951308232
#define IMU_RATE 200.0
#define FRAME_RATE 30.0
#define POSE_RAD 0.001 /* noise of the poses that alignment would find */
#define POSE_M 0.0005

static _Alignas(ARENA_ALIGNMENT) unsigned char block[4 << 20];
static fathom_config config;
static inertial n;
static struct camera_path path;
static struct imu_model imu;
static struct imu_mounting truth;
static struct imu_sample pending;
static bool is_pending;
static uint64_t noise_key;

static const struct imu_mounting usual = {
    .rotation_deg = {0.8, -1.2, 90.0}, .translation = {0.025, -0.010, 0.004}, .clock_offset = 0.03};

static int64_t ns(double seconds) {
    return (int64_t)llround(1e9 * seconds);
}

/* Settings that are wrong by a turn about the camera's axes and by an offset. */
static void configure(const double wrong_deg[3], double wrong_s, bool refine) {
    double v[3], r[9], wrong[9];
    for (int k = 0; k < 3; k++) v[k] = usual.rotation_deg[k] / DEGREES;
    rotation_of_vector(v, r);
    for (int k = 0; k < 3; k++) v[k] = wrong_deg[k] / DEGREES;
    rotation_of_vector(v, wrong);
    so3_multiply(wrong, r, r);
    config = fathom_config_default();
    config.refine_rig = refine;
    for (int i = 0; i < 9; i++) config.imu_to_camera_rotation[i] = (float)r[i];
    for (int i = 0; i < 3; i++) config.imu_to_camera_translation[i] = (float)usual.translation[i];
    config.imu_clock_offset_ns = ns(usual.clock_offset + wrong_s);
}

/* A new part of that grade on a new path. turn: how far the path turns, 1 is usual. */
static void begin(uint64_t seed, const char *grade, double still, double turn) {
    struct scene scene;
    arena a = {block, sizeof block, 0};
    memset(&n, 0, sizeof n);
    inertial_init(&n, &a, &config);
    assert_true(scene_make(&scene, SCENE_ROOM, seed, 40.0));
    camera_path_make(&path, &scene, still, 1.0, turn);
    scene_free(&scene);
    truth = usual;
    imu_model_make(&imu, imu_grade_of(grade), &truth, IMU_RATE, seed);
    noise_key = random_key(seed, 0x719);
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

/* Samples as they arrive, with 40 ms to spare. */
static void feed(double until) {
    for (;;) {
        if (!is_pending) imu_model_next(&imu, &path, &pending);
        is_pending = true;
        if (pending.stamp + truth.clock_offset > until + 0.04) break;
        is_pending = false;
        fathom_imu_sample s = {.timestamp_ns = ns(pending.stamp)};
        for (int i = 0; i < 3; i++) {
            s.gyro[i] = (float)pending.gyro[i];
            s.accel[i] = (float)pending.accel[i];
        }
        assert_int_equal(inertial_push(&n, &s), FATHOM_OK);
    }
    inertial_drain(&n);
}

static void track(double from, double to) {
    double information[36] = {0}, noise[6];
    for (int i = 0; i < 6; i++)
        information[7 * i] = i < 3 ? 1 / (POSE_RAD * POSE_RAD) : 1 / (POSE_M * POSE_M);
    for (long k = lround(from * FRAME_RATE); k < lround(to * FRAME_RATE); k++) {
        double t = (double)k / FRAME_RATE;
        feed(t);
        inertial_follow_clock(&n, ns(t));
        for (int i = 0; i < 6; i++)
            noise[i] = (i < 3 ? POSE_RAD : POSE_M) * random_normal(noise_key, (uint64_t)(6 * k + i));
        pose p = true_pose(t), off = pose_exp(noise);
        p = pose_multiply(&p, &off);
        inertial_correct(&n, &p, information, NULL, ns(t));
        inertial_check(&n, &p, true, ns(t));
    }
}

typedef struct {
    double mounting[3], angle, offset; /* radians about the camera's axes; seconds */
    double sigmas;                     /* the largest of them in its own sigma */
    fathom_rig rig;
} rig_error;

static rig_error error_now(void) {
    rig_error e = {.sigmas = 0};
    double v[3], right[9], found[9], rest[9];
    inertial_rig(&n, &e.rig);
    for (int k = 0; k < 3; k++) v[k] = truth.rotation_deg[k] / DEGREES;
    rotation_of_vector(v, right);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) { /* transposed for so3_transpose_multiply */
            found[3 * i + j] = e.rig.imu_to_camera_rotation[3 * j + i];
            rest[3 * i + j] = right[3 * j + i];
        }
    so3_transpose_multiply(found, rest, rest);
    so3_log(rest, e.mounting);
    e.offset = 1e-9 * (double)e.rig.imu_clock_offset_ns - truth.clock_offset;
    for (int k = 0; k < 3; k++) {
        e.angle += e.mounting[k] * e.mounting[k];
        if (e.rig.rotation_sigma[k] > 0)
            e.sigmas = fmax(e.sigmas, fabs(e.mounting[k]) / e.rig.rotation_sigma[k]);
    }
    e.angle = sqrt(e.angle);
    if (e.rig.clock_sigma_ns > 0)
        e.sigmas = fmax(e.sigmas, fabs(1e9 * e.offset) / (double)e.rig.clock_sigma_ns);
    return e;
}

static void say(const char *what, const rig_error *e) {
    print_message("%s: %.3f %.3f %.3f deg (+- %.3f %.3f %.3f), %.2f ms (+- %.2f), %.1f sigma, %d intervals\n",
                  what, e->mounting[0] * DEGREES, e->mounting[1] * DEGREES, e->mounting[2] * DEGREES,
                  (double)e->rig.rotation_sigma[0] * DEGREES, (double)e->rig.rotation_sigma[1] * DEGREES,
                  (double)e->rig.rotation_sigma[2] * DEGREES, 1e3 * e->offset,
                  1e-6 * (double)e->rig.clock_sigma_ns, e->sigmas, e->rig.intervals);
}

static void a_wrong_rig_comes_right(void **state) {
    (void)state;
    static const struct {
        double deg[3], s;
    } wrong[] = {{{2, 2, 2}, 0.015},
                 {{-2, 2, -2}, -0.02},
                 {{2, -2, 2}, 0.01},
                 {{-2, -2, 2}, -0.01},
                 {{5, 0, -5}, 0.04}};
    const char *grades[] = {"consumer", "phone"};
    int outside = 0, runs = 0;
    for (int g = 0; g < 2; g++)
        for (size_t w = 0; w < sizeof wrong / sizeof *wrong; w++, runs++) {
            configure(wrong[w].deg, wrong[w].s, true);
            begin(w + 1, grades[g], 0, 2.5);
            track(0.1, 10.1);
            rig_error e = error_now();
            say(grades[g], &e);
            assert_true(e.angle < 0.3 / DEGREES);
            assert_true(fabs(e.offset) < 0.002);
            assert_true(e.sigmas < 5);
            outside += e.sigmas > 3;
        }
    assert_true(outside <= runs / 5);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wrong_rig_comes_right),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
