/* The simulated phone's LiDAR against a real one: flicker, smear and second differences, by depth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "depth_figures.h"
#include "fathom_drivers.h"
#include "simulate/camera_path.h"
#include "simulate/scene.h"
#include "simulate/sensor.h"

#define REAL "../shared/data/stray_walk"
#define WIDTH 256
#define HEIGHT 192
#define PIXELS (WIDTH * HEIGHT)
#define LATER 4 /* frames, over which flicker is measured, too */

/* Of two frames. */
static float depth[2][PIXELS], truth[PIXELS], cosine[PIXELS];
static uint8_t confidence[2][PIXELS];
static bool has_recording;
static struct depth_figures real, real_later, made, made_later;

/* ---- The recording ---- */

static void rotation_of(const double q[4], double r[9]) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double rows[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                            2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                            2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
    memcpy(r, rows, sizeof rows);
}

static struct depth_view real_view(const fathom_recording *recording, const struct render_camera *camera,
                                   int frame, int buffer) {
    static uint16_t units[PIXELS];
    struct depth_view view = {camera, {{0}, {0}}, depth[buffer], confidence[buffer], NULL};
    const int64_t stamp = recording->frames[frame].timestamp_ns;
    int pose = 0;
    while (pose < recording->pose_count - 1 && recording->poses[pose].timestamp_ns < stamp) pose++;
    assert_true(recording->poses[pose].timestamp_ns == stamp);
    memcpy(view.pose.position, recording->poses[pose].pose.position, sizeof view.pose.position);
    rotation_of(recording->poses[pose].pose.orientation, view.pose.rotation);
    assert_int_equal(fathom_recording_read_depth(recording, frame, units), FATHOM_OK);
    assert_int_equal(fathom_recording_read_confidence(recording, frame, confidence[buffer]), FATHOM_OK);
    for (int i = 0; i < PIXELS; i++) depth[buffer][i] = (float)(units[i] / recording->depth_units_per_metre);
    return view;
}

static bool measure_recording(void) {
    fathom_recording *recording;
    if (fathom_recording_open(&recording, REAL, NULL)) return false;
    const fathom_pinhole *c = &recording->camera;
    assert_int_equal(c->width, WIDTH);
    assert_int_equal(c->height, HEIGHT);
    const struct render_camera camera = {c->width, c->height, c->fx, c->fy, c->cx, c->cy};
    for (int i = 0; i + LATER < recording->frame_count; i += 15) {
        struct depth_view before = real_view(recording, &camera, i, 0);
        depth_figures_second(&real, &before);
        depth_figures_edges(&real, &before);
        struct depth_view after = real_view(recording, &camera, i + 1, 1);
        depth_figures_pair(&real, &before, &after);
        after = real_view(recording, &camera, i + LATER, 1);
        depth_figures_pair(&real_later, &before, &after);
    }
    fathom_recording_close(recording);
    return true;
}

/* ---- The simulation ---- */

static const struct camera_pose ahead = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};

/* A frame into a buffer, with what is true in truth. */
static void make(const struct scene *scene, const struct camera_pose *pose, long frame, uint64_t seed,
                 int buffer) {
    const struct render_camera *camera = &sensor_lidar.camera;
    const struct sensor_frame measured = {.camera = camera,
                                          .depth = depth[buffer],
                                          .cosine = cosine,
                                          .confidence = confidence[buffer],
                                          .seed = seed,
                                          .number = frame,
                                          .seconds = (double)frame / sensor_lidar.rate_hz};
    assert_true(render_depth(scene, camera, pose, 13.0, 2, depth[buffer], cosine));
    memcpy(truth, depth[buffer], sizeof truth);
    assert_true(sensor_lidar.measure(&measured));
}

/* The same, in whole millimetres, as the recording is. */
static struct depth_view made_view(const struct scene *scene, const struct camera_pose *pose, long frame,
                                   int buffer) {
    make(scene, pose, frame, 1, buffer);
    for (int i = 0; i < PIXELS; i++) depth[buffer][i] = roundf(1000.0f * depth[buffer][i]) / 1000.0f;
    return (struct depth_view){&sensor_lidar.camera, *pose, depth[buffer], confidence[buffer], truth};
}

/* Figures of a frame and of what changes up to later ones. */
static void measure_frames(const struct scene *scene, const struct camera_pose poses[3], long frame,
                           bool second) {
    struct depth_view before = made_view(scene, &poses[0], frame, 0);
    if (second) depth_figures_second(&made, &before);
    struct depth_view after = made_view(scene, &poses[1], frame + 1, 1);
    depth_figures_pair(&made, &before, &after);
    after = made_view(scene, &poses[2], frame + LATER, 1);
    depth_figures_pair(&made_later, &before, &after);
}

static void walk(enum scene_kind kind, uint64_t seed, int step) {
    struct scene scene;
    struct camera_path path;
    assert_true(scene_make(&scene, kind, seed, 12.0));
    camera_path_make(&path, &scene, 0.5, 1.0, 1.0);
    for (int i = 30; i < 400; i += step) {
        struct camera_pose poses[3];
        camera_path_pose(&path, i / sensor_lidar.rate_hz, &poses[0]);
        camera_path_pose(&path, (i + 1) / sensor_lidar.rate_hz, &poses[1]);
        camera_path_pose(&path, (i + LATER) / sensor_lidar.rate_hz, &poses[2]);
        measure_frames(&scene, poses, i, true);
    }
    camera_path_free(&path);
    scene_free(&scene);
}

/* No room here has a bare wall to face at 3 to 4 m, as the recording has. It adds to flicker only: second differences
 * of nothing but bare wall are no room's. */
static void face_wall(double z) {
    const struct scene scene = {.low = {-20.0, -20.0, -1.0}, .high = {20.0, 20.0, z}};
    for (long frame = 0; frame < 120; frame += 20) {
        struct camera_pose poses[3];
        for (int k = 0; k < 3; k++) { /* nearer by 7 mm a frame, and ten degrees aside */
            poses[k] = (struct camera_pose){.rotation = {0.98481, 0, 0.17365, 0, 1, 0, -0.17365, 0, 0.98481}};
            poses[k].position[2] = 0.007 * (k == 2 ? LATER : k);
        }
        measure_frames(&scene, poses, frame, false);
    }
}

/* Squares of 40 pixels, 80 apart, before a wall: straight steps of one height. */
static void face_cards(double near, double height) {
    const struct render_camera *c = &sensor_lidar.camera;
    const double back = near * (1.0 + height), pixel = near / c->fx;
    struct scene scene = {.low = {-20.0, -20.0, -1.0}, .high = {20.0, 20.0, back}};
    for (int v = 40; v < HEIGHT; v += 80)
        for (int u = 40; u < WIDTH; u += 80)
            scene_box(&scene, (u - c->cx) * pixel, (v - c->cy) * pixel, near + 0.005, 40.0 * pixel,
                      40.0 * pixel, 0.01, 0.0, 0.0);
    for (long frame = 0; frame < 120; frame += 30) {
        const struct depth_view view = made_view(&scene, &ahead, frame, 0);
        depth_figures_edges(&made, &view);
    }
    scene_free(&scene);
}

static int measure_all(void **state) {
    (void)state;
    static const double heights[] = {0.2, 0.25, 0.4, 0.5, 0.8, 1.2};
    has_recording = measure_recording();
    if (!has_recording) return 0;
    for (uint64_t seed = 1; seed <= 4; seed++) walk(SCENE_ROOM, seed, 30);
    walk(SCENE_DESK, 1, 40);
    walk(SCENE_WALL, 1, 40);
    face_wall(3.5);
    for (int k = 0; k < 6; k++)
        for (double near = 1.25; near < 4.0; near += 0.5) face_cards(near, heights[k]);
    return 0;
}

/* ---- The comparison ---- */

/* 1 when both have the figure and they agree to 30 %, 0 when either lacks it; fails when they don't agree. */
static int agree(const char *what, int range, double recorded, double simulated, double unit) {
    print_message("# %s, %g to %g m: recorded %.3f, simulated %.3f\n", what, figure_depths[range],
                  figure_depths[range + 1], recorded * unit, simulated * unit);
    if (isnan(recorded) || isnan(simulated)) return 0;
    assert_true(fabs(simulated / recorded - 1.0) <= 0.3);
    return 1;
}

static void flicker_is_a_real_ones(void **state) {
    (void)state;
    static const char *const names[FIGURE_ANGLES][2] = {
        {"flicker of a surface face on, %", "over four frames, %"},
        {"flicker of a slanted one, %", "over four frames, %"}};
    int agreed = 0;
    if (!has_recording) return;
    for (int angle = 0; angle < FIGURE_ANGLES; angle++)
        for (int i = 0; i < FIGURE_DEPTHS; i++)
            agreed += agree(names[angle][0], i, depth_figures_flicker(&real, angle, i),
                            depth_figures_flicker(&made, angle, i), 100.0) +
                      agree(names[angle][1], i, depth_figures_flicker(&real_later, angle, i),
                            depth_figures_flicker(&made_later, angle, i), 100.0);
    assert_int_equal(agreed, 4 * FIGURE_DEPTHS);
}

static void second_differences_are_a_real_ones(void **state) {
    (void)state;
    int agreed = 0;
    if (!has_recording) return;
    for (int i = 0; i < FIGURE_DEPTHS; i++)
        agreed += agree("second differences, mm", i, depth_figures_second_difference(&real, i),
                        depth_figures_second_difference(&made, i), 1000.0);
    assert_int_equal(agreed, FIGURE_DEPTHS);
}

/* From 1 m on: the recording has hardly any steps before. */
static void smear_is_a_real_ones(void **state) {
    (void)state;
    int agreed = 0;
    if (!has_recording) return;
    for (int i = 1; i < FIGURE_DEPTHS; i++)
        agreed += agree("width of steps, pixels", i, depth_figures_width(&real, i, &real),
                        depth_figures_width(&made, i, &real), 1.0);
    assert_int_equal(agreed, FIGURE_DEPTHS - 1);
}

/* ---- Without the recording ---- */

static void depth_is_held_in_half_floats(void **state) {
    (void)state;
    const struct scene scene = {.low = {-20.0, -20.0, -1.0}, .high = {20.0, 20.0, 3.0}};
    make(&scene, &ahead, 7, 1, 0);
    for (int i = 0; i < PIXELS; i++) {
        const double steps = depth[0][i] * (depth[0][i] < 2.0f ? 1024.0 : 512.0);
        assert_true(depth[0][i] > 2.9f && depth[0][i] < 3.1f && steps == round(steps));
    }
}

static void frames_depend_on_seed_and_number_alone(void **state) {
    (void)state;
    const struct scene scene = {.low = {-20.0, -20.0, -1.0}, .high = {20.0, 20.0, 3.0}};
    make(&scene, &ahead, 7, 1, 0);
    make(&scene, &ahead, 7, 1, 1);
    assert_memory_equal(depth[0], depth[1], sizeof depth[0]);
    assert_memory_equal(confidence[0], confidence[1], sizeof confidence[0]);
    make(&scene, &ahead, 7, 2, 1);
    assert_memory_not_equal(depth[0], depth[1], sizeof depth[0]);
    assert_memory_not_equal(confidence[0], confidence[1], sizeof confidence[0]);
    make(&scene, &ahead, 8, 1, 1);
    assert_memory_not_equal(depth[0], depth[1], sizeof depth[0]);
}

static double sure_share(const struct scene *scene, int x0, int y0, int x1, int y1) {
    long sure = 0;
    make(scene, &ahead, 3, 1, 0);
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) sure += confidence[0][y * WIDTH + x] == 2;
    return (double)sure / ((x1 - x0) * (y1 - y0));
}

static void confidence_falls_at_the_border_at_steps_and_far_away(void **state) {
    (void)state;
    const struct scene near = {.low = {-20.0, -20.0, -1.0}, .high = {20.0, 20.0, 2.0}};
    const struct scene far = {.low = {-20.0, -20.0, -1.0}, .high = {20.0, 20.0, 6.0}};
    struct scene card = near;
    scene_box(&card, 0.0, 0.0, 1.005, 0.5, 0.5, 0.01, 0.0, 0.0); /* 90 pixels wide */
    assert_true(sure_share(&near, 40, 40, WIDTH - 40, HEIGHT - 40) > 0.9);
    assert_true(sure_share(&near, 0, 0, WIDTH, 2) < 0.2);
    assert_true(sure_share(&far, 40, 40, WIDTH - 40, HEIGHT - 40) < 0.1);
    assert_true(sure_share(&card, 80, 70, 85, 120) < 0.1); /* its left edge */
    scene_free(&card);
}

#define NEEDS_RECORDING(test)                                                                                \
    { there ? #test : #test " # SKIP " REAL " isn't there", test, NULL, NULL, NULL }

int main(void) {
    const bool there = access(REAL "/odometry.csv", R_OK) == 0;
    const struct CMUnitTest tests[] = {
        NEEDS_RECORDING(flicker_is_a_real_ones),
        NEEDS_RECORDING(second_differences_are_a_real_ones),
        NEEDS_RECORDING(smear_is_a_real_ones),
        cmocka_unit_test(depth_is_held_in_half_floats),
        cmocka_unit_test(frames_depend_on_seed_and_number_alone),
        cmocka_unit_test(confidence_falls_at_the_border_at_steps_and_far_away),
    };
    return cmocka_run_group_tests(tests, measure_all, NULL);
}
