/* What motion during the exposure does to simulated depth, against what geometry says of it. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "simulate/exposure.h"
#include "simulate/sensor_kinect.h"

#define WIDTH 160
#define HEIGHT 120
#define PIXELS (WIDTH * HEIGHT)
#define FOCAL 146.25

static const struct render_camera camera = {WIDTH, HEIGHT, FOCAL, FOCAL, 79.625, 59.625};
static float depth[PIXELS], cosine[PIXELS], expected[PIXELS], expected_cosine[PIXELS];
static uint8_t lost[PIXELS];

/* A wall at z = 3 and, when card isn't 0, a card at z = 1 that ends at x = 0: card > 0 lies at x > 0. */
static void make_scene(struct scene *scene, double card) {
    *scene = (struct scene){.low = {-4.0, -4.0, -1.0}, .high = {4.0, 4.0, 3.0}};
    if (card != 0.0) scene_box(scene, card, 0.0, 1.005, 2.0 * fabs(card), 6.0, 0.01, 0.0, 0.0);
}

/* From one point to the next, half a second each, looking along z without turning. */
static void make_path(struct camera_path *path, struct path_sample *samples, size_t count) {
    for (size_t i = 0; i < count; i++) {
        samples[i].t = 0.5 * (double)i;
        samples[i].quaternion[3] = 1.0;
    }
    *path = (struct camera_path){.samples = samples, .count = count};
}

static int lost_in_row(int y) {
    int count = 0;
    for (int x = 0; x < WIDTH; x++) count += lost[y * WIDTH + x];
    return count;
}

static void without_motion_nothing_changes(void **state) {
    (void)state;
    const struct exposure exposure = {0.02, 0.02};
    struct scene scene;
    struct camera_path path;
    struct camera_pose pose;
    assert_true(scene_make(&scene, SCENE_ROOM, 3, 0.0));
    camera_path_make(&path, &scene, 2.0, 1.0, 1.0);
    camera_path_pose(&path, 1.0, &pose);
    assert_true(render_depth(&scene, &camera, &pose, 13.0, 2, expected, expected_cosine));
    assert_true(exposure_render(&exposure, &scene, &camera, &path, 1.0, 13.0, 2, true, depth, cosine, lost));
    assert_memory_equal(depth, expected, sizeof depth);
    assert_memory_equal(cosine, expected_cosine, sizeof cosine);
    for (int i = 0; i < PIXELS; i++) assert_int_equal(lost[i], 0);
    scene_free(&scene);
}

static void an_edge_that_moves_loses_a_band(void **state) {
    (void)state;
    struct scene scene;
    struct camera_path path;
    make_scene(&scene, -1.0);
    for (double speed = -2.0; speed <= 2.0; speed += 0.5) {
        for (double exposure_s = 0.01; exposure_s < 0.033; exposure_s += 0.01) {
            const struct exposure exposure = {exposure_s, 0.0};
            struct path_sample samples[2] = {{.position = {-0.25 * speed}}, {.position = {0.25 * speed}}};
            make_path(&path, samples, 2);
            assert_true(
                exposure_render(&exposure, &scene, &camera, &path, 0.25, 13.0, 2, false, depth, NULL, lost));
            const double band = fabs(speed) * exposure_s * FOCAL / 1.0;
            for (int y = 0; y < HEIGHT; y++) {
                assert_true(fabs(lost_in_row(y) - band) < 1.0);
                for (int x = 0; x < WIDTH; x++) {
                    const double z = depth[y * WIDTH + x], from_edge = x - camera.cx;
                    if (lost[y * WIDTH + x])
                        assert_true(fabs(from_edge) < 0.5 * band + 1.0);
                    else
                        assert_true(fabs(z - (from_edge < 0.0 ? 1.0 : 3.0)) < 1e-5);
                }
            }
        }
    }
    scene_free(&scene);
}

static void the_shadow_moves_with_its_edge(void **state) {
    (void)state;
    const struct exposure exposure = {0.03, 0.0};
    struct scene scene;
    struct camera_path path;
    struct path_sample samples[2] = {{.position = {-0.5}}, {.position = {0.5}}};
    make_scene(&scene, 1.0);
    make_path(&path, samples, 2);
    assert_true(exposure_render(&exposure, &scene, &camera, &path, 0.25, 13.0, 2, true, depth, NULL, lost));
    const double band = 2.0 * 0.03 * FOCAL, shadow = KINECT_DISPARITY_PX_M / 4.0 * (1.0 - 1.0 / 3.0);
    for (int y = 0; y < HEIGHT; y++) {
        /* The shadow's end sweeps a band as wide as the edge's. The shadow is narrower, so the two overlap, and
         * half a pixel of it counts as lit. */
        assert_true(shadow < band);
        assert_true(fabs(lost_in_row(y) - (band + shadow - 0.5)) < 2.0);
    }
    scene_free(&scene);
}

static void a_wall_ahead_reads_its_mean_depth(void **state) {
    (void)state;
    const struct exposure exposure = {0.02, 0.0};
    struct scene scene;
    struct camera_path path;
    make_scene(&scene, 0.0);
    /* Two metres before the wall at a steady 2 m/s; and one that sets out in the middle of the exposure. */
    struct path_sample steady[2] = {{.position = {0.0, 0.0, 0.5}}, {.position = {0.0, 0.0, 1.5}}};
    make_path(&path, steady, 2);
    assert_true(exposure_render(&exposure, &scene, &camera, &path, 0.25, 13.0, 2, false, depth, NULL, lost));
    const double steady_depth = 0.04 / log(2.02 / 1.98); /* 1 over the mean of 1 / z */
    for (int i = 0; i < PIXELS; i++) assert_true(!lost[i] && fabs(depth[i] - steady_depth) < 1e-6);
    struct path_sample starting[3] = {
        {.position = {0.0, 0.0, 1.0}}, {.position = {0.0, 0.0, 1.0}}, {.position = {0.0, 0.0, 2.0}}};
    make_path(&path, starting, 3);
    assert_true(exposure_render(&exposure, &scene, &camera, &path, 0.5, 13.0, 2, false, depth, NULL, lost));
    for (int i = 0; i < PIXELS; i++) assert_true(!lost[i] && fabs(depth[i] - (2.0 - 0.005)) < 1e-4);
    scene_free(&scene);
}

static void a_surface_that_comes_too_fast_is_lost(void **state) {
    (void)state;
    const struct exposure exposure = {0.02, 0.0};
    struct scene scene;
    struct camera_path path;
    make_scene(&scene, 0.0);
    /* At 1 m a spot of the pattern moves by a pixel in 1 / 43.875 m: 1.14 m/s. */
    for (int fast = 0; fast < 2; fast++) {
        const double speed = fast ? 1.2 : 1.1;
        struct path_sample samples[2] = {{.position = {0.0, 0.0, 2.0 - 0.25 * speed}},
                                         {.position = {0.0, 0.0, 2.0 + 0.25 * speed}}};
        make_path(&path, samples, 2);
        assert_true(
            exposure_render(&exposure, &scene, &camera, &path, 0.25, 13.0, 2, false, depth, NULL, lost));
        for (int i = 0; i < PIXELS; i++) assert_int_equal(lost[i], fast);
    }
    scene_free(&scene);
}

static void a_rolling_shutter_shears_an_edge(void **state) {
    (void)state;
    const struct exposure exposure = {0.0, 0.02};
    struct scene scene;
    struct camera_path path;
    struct path_sample samples[2] = {{.position = {-0.5}}, {.position = {0.5}}};
    make_scene(&scene, -1.0);
    make_path(&path, samples, 2);
    assert_true(exposure_render(&exposure, &scene, &camera, &path, 0.25, 13.0, 2, false, depth, NULL, lost));
    int columns[HEIGHT];
    for (int y = 0; y < HEIGHT; y++) {
        for (columns[y] = 0; depth[y * WIDTH + columns[y]] < 2.0f;) columns[y]++;
        const double t = 0.02 * ((double)y / (HEIGHT - 1) - 0.5); /* after the stamp */
        assert_true(fabs(columns[y] - 0.5 - (camera.cx - 2.0 * t * FOCAL)) <= 0.51);
    }
    assert_true(abs(columns[0] - columns[HEIGHT - 1] - 6) <= 1); /* 2 m/s, 20 ms, 146 / 1 m: 5.85 pixels */
    scene_free(&scene);
}

/* The renderer's cones must hold the rays of all the rows: each row as it comes out alone. */
static void rolling_rows_are_the_rows_of_their_poses(void **state) {
    (void)state;
    static struct camera_pose rows[HEIGHT];
    for (int kind = 0; kind < 4; kind++) {
        struct scene scene;
        struct camera_path path;
        assert_true(scene_make(&scene, (enum scene_kind)kind, 5, 20.0));
        camera_path_make(&path, &scene, 0.0, 6.0, 20.0);
        for (int i = 0; i < 3; i++) {
            for (int y = 0; y < HEIGHT; y++)
                camera_path_pose(&path, 1.0 + 0.4 * i + 0.033 * y / HEIGHT, &rows[y]);
            assert_true(render_rolling(&scene, &camera, rows, 13.0, 1, depth, cosine));
            for (int y = 0; y < HEIGHT; y += 7) {
                assert_true(render_depth(&scene, &camera, &rows[y], 13.0, 2, expected, expected_cosine));
                for (int x = 0; x < WIDTH; x++)
                    assert_true(fabsf(depth[y * WIDTH + x] - expected[y * WIDTH + x]) < 1e-4f);
            }
            assert_true(render_rolling(&scene, &camera, rows, 13.0, 3, expected, expected_cosine));
            assert_memory_equal(depth, expected, sizeof depth);
            assert_memory_equal(cosine, expected_cosine, sizeof cosine);
        }
        scene_free(&scene);
    }
}

static void exposure_without_blur_is_refused(void **state) {
    (void)state;
    char *without[] = {"simulate", "room", "never-written", "--exposure", "0.01"};
    char *long_one[] = {"simulate", "room", "never-written", "--blur", "--rolling", "0.2"};
    assert_int_equal(command_simulate.run(&command_simulate, 5, without), CLI_USAGE);
    assert_int_equal(command_simulate.run(&command_simulate, 6, long_one), CLI_USAGE);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_motion_nothing_changes),
        cmocka_unit_test(an_edge_that_moves_loses_a_band),
        cmocka_unit_test(the_shadow_moves_with_its_edge),
        cmocka_unit_test(a_wall_ahead_reads_its_mean_depth),
        cmocka_unit_test(a_surface_that_comes_too_fast_is_lost),
        cmocka_unit_test(a_rolling_shutter_shears_an_edge),
        cmocka_unit_test(rolling_rows_are_the_rows_of_their_poses),
        cmocka_unit_test(exposure_without_blur_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
