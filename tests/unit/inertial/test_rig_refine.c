/* The rig refined while scanning (lib/inertial/extrinsics.c, lib/inertial/rig.c) on simulated hand-held paths whose rig is known: the
 * poses are the true ones with noise, so no frame is rendered. Links with examples/cli/{scene*,camera_path,imu_model}.c. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/camera_path.h"
#include "simulate/counter_random.h"
#include "simulate/imu_model.h"
#include "inertial/inertial.h"

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
    fathom_config_init(&config);
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
        inertial_correct(&n, &p, information, NULL, true, ns(t));
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

static void a_right_rig_stays_right(void **state) {
    (void)state;
    static const double none[3] = {0, 0, 0};
    const char *grades[] = {"consumer", "phone"};
    for (int g = 0; g < 2; g++) {
        configure(none, 0, true);
        begin(11 + (uint64_t)g, grades[g], 1, 1.5);
        double worst_deg = 0, worst_s = 0, sigmas = 0;
        for (int second = 1; second <= 60; second++) {
            track(second - 1 + 0.1, second + 0.1);
            rig_error e = error_now();
            worst_deg = fmax(worst_deg, e.angle * DEGREES);
            worst_s = fmax(worst_s, fabs(e.offset));
            sigmas = fmax(sigmas, e.sigmas);
        }
        rig_error e = error_now();
        say(grades[g], &e);
        print_message("over 60 s: at worst %.3f deg, %.2f ms, %.1f sigma\n", worst_deg, 1e3 * worst_s,
                      sigmas);
        assert_true(worst_deg < 1 && worst_s < 0.005 && sigmas < 4);
        assert_true(e.angle < 0.2 / DEGREES && fabs(e.offset) < 0.001);
    }
}

static void standing_still_moves_nothing(void **state) {
    (void)state;
    static const double wrong[3] = {2, -2, 2};
    configure(wrong, 0.015, true);
    begin(21, "phone", 60, 1);
    rig_error first = error_now();
    track(0.1, 30.1);
    rig_error e = error_now();
    say("still", &e);
    assert_true(e.rig.intervals > 800);
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(e.mounting[k] - first.mounting[k]) < 0.2 / DEGREES);
        assert_true(e.rig.rotation_sigma[k] > 0.9 * config.rig_rotation_sigma_rad);
    }
    assert_true(fabs(e.offset - first.offset) < 0.25e-9 * (double)config.rig_clock_sigma_ns);
    assert_true(n.samples.refined_ns == 0); /* nothing stands out, so nothing was applied */
    assert_true((double)e.rig.clock_sigma_ns > 0.8 * (double)config.rig_clock_sigma_ns);
}

/* A camera that turns about its z axis, there and back; the gyroscope's axes are wrong by `wrong`, its stamps by `late`. */
static void turn_about_z(rig_refiner *r, const double wrong[3], double late, int frames) {
    double m[9], from[9], to[9];
    so3_exp(wrong, m);
    for (int k = 0; k < frames; k++) {
        double t = k / FRAME_RATE, dt = 1 / FRAME_RATE, axis[3] = {0}, angle[3] = {0}, rate[2];
        rig_interval i = {.by_bias = {dt, 0, 0, 0, dt, 0, 0, 0, dt}};
        axis[2] = sin(2 * t);
        so3_exp(axis, from);
        axis[2] = sin(2 * (t + dt));
        so3_exp(axis, to);
        memcpy(i.from, from, sizeof from);
        memcpy(i.to, to, sizeof to);
        angle[2] = sin(2 * (t + dt + late)) - sin(2 * (t + late));
        rate[0] = 2 * cos(2 * (t + late));
        rate[1] = 2 * cos(2 * (t + dt + late));
        for (int a = 0; a < 3; a++) { /* v = exp(-wrong) v_camera */
            i.rate_from[a] = m[6 + a] * rate[0] - r->bias[a];
            i.rate_to[a] = m[6 + a] * rate[1] - r->bias[a];
            axis[a] = m[6 + a] * angle[2] - dt * r->bias[a];
        }
        so3_exp(axis, i.turned);
        rig_refiner_add(r, &i, dt);
    }
}

static void an_axis_that_tells_nothing_is_left_alone(void **state) {
    (void)state;
    const double wrong[3] = {0.03, -0.02, 0.025};
    rig_refiner r;
    rig_refiner_start(&r, 0.05, 0.02, 0.02);
    turn_about_z(&r, wrong, 0.012, 300);
    print_message("about z alone: found %.4f %.4f %.4f rad (+- %.4f %.4f %.4f), %.4f s (+- %.4f)\n",
                  r.mounting[0], r.mounting[1], r.mounting[2], rig_refiner_sigma(&r, 0),
                  rig_refiner_sigma(&r, 1), rig_refiner_sigma(&r, 2), r.offset, rig_refiner_sigma(&r, 3));
    for (int k = 0; k < 2; k++) assert_true(fabs(r.mounting[k] - wrong[k]) < 0.002);
    assert_true(fabs(r.mounting[2]) < 0.003); /* a second-order trace of the others, no more */
    assert_true(rig_refiner_sigma(&r, 2) > 0.045);
    assert_true(rig_refiner_sigma(&r, 0) < 0.01 && rig_refiner_sigma(&r, 1) < 0.01);
    assert_true(fabs(r.offset - 0.012) < 0.001);
}

static void what_stands_out_is_handed_out_once(void **state) {
    (void)state;
    const double wrong[3] = {0.03, -0.02, 0};
    double mounting[3], offset;
    rig_refiner r;
    rig_refiner_start(&r, 0.05, 0.02, 0.02);
    assert_false(rig_refiner_take(&r, mounting, &offset));
    turn_about_z(&r, wrong, 0.012, 300);
    const double found = r.mounting[0];
    assert_true(rig_refiner_take(&r, mounting, &offset));
    assert_true(mounting[0] == found && r.mounting[0] == 0 && r.offset == 0);
    assert_false(rig_refiner_take(&r, mounting, &offset));
}

/* A refiner that is too often wrong begins again: as unsure as at first, of everything by itself. */
static void what_was_learnt_before_a_knock_is_forgotten(void **state) {
    (void)state;
    const double wrong[3] = {0.03, -0.02, 0};
    rig_refiner r, fresh;
    rig_refiner_start(&fresh, 0.05, 0.02, 0.02);
    rig_refiner_start(&r, 0.05, 0.02, 0.02);
    turn_about_z(&r, wrong, 0.012, 300);
    assert_true(r.started && rig_refiner_sigma(&r, 0) < 0.01);
    r.misfit = 100;
    turn_about_z(&r, wrong, 0.012, 1);
    assert_false(r.started);
    assert_memory_equal(r.covariance, fresh.covariance, sizeof r.covariance);
    assert_true(r.noise == 1 && r.misfit == 1);
}

/* The IMU is knocked in the middle of a scan, and its clock jumps. */
static void a_knocked_rig_is_found_again(void **state) {
    (void)state;
    static const double none[3] = {0, 0, 0};
    configure(none, 0, true);
    begin(31, "consumer", 0, 2.5);
    track(0.1, 10.1);
    const double knock[3] = {0, 4 / DEGREES, 0};
    double r[9], v[3];
    for (int k = 0; k < 3; k++) v[k] = usual.rotation_deg[k] / DEGREES;
    rotation_of_vector(v, imu.rotation);
    rotation_of_vector(knock, r);
    so3_multiply(r, imu.rotation, imu.rotation);
    vector_of_rotation(imu.rotation, v);
    for (int k = 0; k < 3; k++) truth.rotation_deg[k] = v[k] * DEGREES;
    track(10.1, 20.1);
    rig_error e = error_now();
    say("knocked by 4 degrees", &e);
    assert_true(e.angle < 0.5 / DEGREES && fabs(e.offset) < 0.002 && e.sigmas < 5);
    imu.mounting.clock_offset += 0.06;
    truth.clock_offset += 0.06;
    track(20.1, 30.1);
    e = error_now();
    say("the clock leapt by 60 ms", &e);
    assert_true(e.angle < 0.5 / DEGREES && fabs(e.offset) < 0.002 && e.sigmas < 5);
}

/* With the setting off the rig is the settings' to the last bit; resetting goes back to them. */
static void off_means_untouched(void **state) {
    (void)state;
    static const double wrong[3] = {2, -2, 2};
    for (int refine = 0; refine < 2; refine++) {
        configure(wrong, 0.015, refine != 0);
        begin(41, "consumer", 0, 2.5);
        track(0.1, 5.1);
        rig_error e = error_now();
        bool same = e.rig.imu_clock_offset_ns == config.imu_clock_offset_ns && e.rig.intervals == 0;
        for (int i = 0; i < 9; i++)
            same = same && e.rig.imu_to_camera_rotation[i] == config.imu_to_camera_rotation[i];
        assert_int_equal(same, !refine);
        if (!refine) assert_true(e.rig.rotation_sigma[0] == 0 && e.rig.clock_sigma_ns == 0);
        inertial_reset(&n);
        e = error_now();
        assert_true(e.rig.imu_clock_offset_ns == config.imu_clock_offset_ns && e.rig.intervals == 0);
        assert_memory_equal(e.rig.imu_to_camera_rotation, config.imu_to_camera_rotation,
                            sizeof config.imu_to_camera_rotation);
    }
}

/* A frame in eight is misaligned by degrees and passes for well-aligned. */
static void wrong_poses_do_little_harm(void **state) {
    (void)state;
    static const double wrong[3] = {2, 2, -2};
    configure(wrong, -0.015, true);
    begin(51, "consumer", 0, 2.5);
    for (int k = 3; k < 300; k++) {
        double t = k / FRAME_RATE, slip[6] = {0};
        feed(t);
        pose p = true_pose(t);
        for (int i = 0; i < 3; i++)
            slip[i] = (k % 8 == 0 ? 0.04 : POSE_RAD) * random_normal(noise_key, (uint64_t)(3 * k + i));
        pose off = pose_exp(slip);
        p = pose_multiply(&p, &off);
        inertial_check(&n, &p, true, ns(t));
    }
    rig_error e = error_now();
    say("one in eight slips", &e);
    assert_true(e.angle < 0.5 / DEGREES && fabs(e.offset) < 0.003 && e.sigmas < 5);
}

/* What the filter carries on is what the samples at hand say now: dead reckoning is better for it. */
static void dead_reckoning_gains(void **state) {
    (void)state;
    static const double wrong[3] = {2, -2, 2};
    double rotation[2] = {0}, position[2] = {0};
    for (int refine = 0; refine < 2; refine++) {
        configure(wrong, 0.015, refine != 0);
        begin(61, "consumer", 0, 2.5);
        track(0.1, 10);
        for (int second = 10; second < 20; second++) {
            inertial_motion m;
            track(second, second + 1);
            feed(second + 2);
            double last = second + 1 - 1 / FRAME_RATE;
            assert_int_equal(inertial_estimate(&n, ns(last), ns(last + 0.5), &m), FATHOM_OK);
            pose a = true_pose(last), b = true_pose(last + 0.5), way = pose_between(&a, &b);
            pose rest = pose_between(&m.motion, &way);
            rotation[refine] += 0.1 * pose_angle(&rest);
            position[refine] += 0.1 * pose_distance(&rest);
        }
    }
    print_message("half a second of dead reckoning: %.2f deg, %.4f m; refined %.2f deg, %.4f m\n",
                  rotation[0] * DEGREES, position[0], rotation[1] * DEGREES, position[1]);
    assert_true(rotation[1] < 0.5 * rotation[0]);
    assert_true(position[1] < 0.5 * position[0]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_wrong_rig_comes_right),
        cmocka_unit_test(a_right_rig_stays_right),
        cmocka_unit_test(standing_still_moves_nothing),
        cmocka_unit_test(an_axis_that_tells_nothing_is_left_alone),
        cmocka_unit_test(what_stands_out_is_handed_out_once),
        cmocka_unit_test(what_was_learnt_before_a_knock_is_forgotten),
        cmocka_unit_test(a_knocked_rig_is_found_again),
        cmocka_unit_test(off_means_untouched),
        cmocka_unit_test(wrong_poses_do_little_harm),
        cmocka_unit_test(dead_reckoning_gains),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
