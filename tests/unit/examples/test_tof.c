/* The simulated time-of-flight camera: noise, multipath, wiggling and flying pixels, against what geometry says. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "simulate/multipath.h"
#include "simulate/scene.h"
#include "simulate/sensor.h"

#define WIDTH 256
#define HEIGHT 212
#define PIXELS (WIDTH * HEIGHT)
#define FRAMES 24

static const struct camera_pose ahead = {.rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
static struct render_camera camera;
static float depth[FRAMES][PIXELS], truth[PIXELS], cosine[PIXELS], bias[PIXELS];

static int set_up(void **state) {
    (void)state;
    camera = sensor_camera(&sensor_tof, WIDTH, HEIGHT);
    return 0;
}

static void make(const struct scene *scene, const struct camera_pose *pose, long frame, uint64_t seed,
                 float *out) {
    assert_true(render_depth(scene, &camera, pose, 13.0, 2, truth, cosine));
    memcpy(out, truth, sizeof truth);
    const struct sensor_frame measured = {.camera = &camera,
                                          .depth = out,
                                          .cosine = cosine,
                                          .seed = seed,
                                          .number = frame,
                                          .seconds = (double)frame / 30.0};
    assert_true(sensor_tof.measure(&measured));
}

static struct scene wall_at(double z) {
    return (struct scene){.low = {-20.0, -20.0, -1.0}, .high = {20.0, 20.0, z}};
}

/* About a pixel, over all frames: metres too far along the optical axis, and sigma about each pixel's own mean. */
static double mean_error(int x, int y, int reach, double *sigma) {
    double sum = 0.0, square = 0.0;
    long count = 0;
    for (int v = y - reach; v <= y + reach; v++)
        for (int u = x - reach; u <= x + reach; u++) {
            double mean = 0.0;
            for (int f = 0; f < FRAMES; f++) {
                assert_true(depth[f][v * WIDTH + u] > 0.0f);
                mean += depth[f][v * WIDTH + u] / FRAMES;
            }
            for (int f = 0; f < FRAMES; f++) square += pow(depth[f][v * WIDTH + u] - mean, 2.0);
            sum += mean - truth[v * WIDTH + u];
            count++;
        }
    if (sigma) *sigma = sqrt(square / (double)(count * (FRAMES - 1)));
    return sum / (double)count;
}

static void make_all(const struct scene *scene, const struct camera_pose *pose) {
    for (long f = 0; f < FRAMES; f++) make(scene, pose, f, 1, depth[f]);
}

static void noise_grows_with_range_and_slant(void **state) {
    (void)state;
    double before = 0.0, sigma;
    for (double z = 1.0; z < 4.6; z += 0.5) {
        const struct scene wall = wall_at(z);
        make_all(&wall, &ahead);
        const double error = mean_error(WIDTH / 2, HEIGHT / 2, 6, &sigma);
        print_message("# %.1f m: %.2f mm too far, sigma %.2f mm\n", z, 1000.0 * error, 1000.0 * sigma);
        assert_true(sigma > before);
        assert_true(fabs(error) < 0.006); /* wiggling; nothing faces the wall */
        if (z == 1.0) assert_true(fabs(sigma - 0.0015) < 0.0002);
        if (z == 4.5) assert_true(fabs(sigma - 0.008) < 0.001);
        before = sigma;
    }
    /* Turned by 60 degrees, at the same range. */
    const double s = 0.8660254037844386;
    const struct camera_pose aside = {.rotation = {0.5, 0, s, 0, 1, 0, -s, 0, 0.5}};
    const struct scene far = wall_at(2.0), near = wall_at(1.0);
    double straight;
    make_all(&far, &ahead);
    mean_error(WIDTH / 2, HEIGHT / 2, 4, &straight);
    make_all(&near, &aside);
    mean_error(WIDTH / 2, HEIGHT / 2, 4, &sigma);
    assert_true(sigma > 1.4 * straight && sigma < 2.6 * straight);
}

static void the_range_wiggles(void **state) {
    (void)state;
    double least = 1.0, most = -1.0;
    for (double z = 1.0; z < 3.5; z += 0.1) {
        const struct scene wall = wall_at(z);
        make_all(&wall, &ahead);
        const double error = mean_error(WIDTH / 2, HEIGHT / 2, 6, NULL);
        least = fmin(least, error);
        most = fmax(most, error);
    }
    assert_true(least < -0.003 && least > -0.006 && most > 0.003 && most < 0.006);
}

/* Looking along the bisector of two walls that meet 2 m away, at a right angle. */
static void a_corner_reads_too_far(void **state) {
    (void)state;
    const double s = 0.7071067811865476;
    const struct scene corner = {.low = {-20.0, -20.0, -20.0}, .high = {2.0 * s, 20.0, 2.0 * s}};
    const struct camera_pose pose = {.rotation = {s, 0, s, 0, 1, 0, -s, 0, s}};
    assert_true(render_depth(&corner, &camera, &pose, 13.0, 2, truth, cosine));
    assert_true(fabsf(truth[HEIGHT / 2 * WIDTH + WIDTH / 2] - 2.0f) < 0.02f);
    assert_true(multipath_bias(&camera, truth, cosine, bias));
    double most = 0.0;
    for (int x = 0; x < WIDTH; x++) {
        const double b = bias[HEIGHT / 2 * WIDTH + x];
        assert_true(b >= 0.0 &&
                    fabs(b - bias[HEIGHT / 2 * WIDTH + WIDTH - 1 - x]) < 0.003); /* alike on both sides */
        most = fmax(most, b);
    }
    print_message("# in a corner up to %.1f mm too far\n", 1000.0 * most);
    assert_true(most > 0.008 && most < 0.025);
    /* From outside the two form an edge, which no light bounces at. */
    struct scene edge = wall_at(6.0);
    scene_box(&edge, 0.0, 0.0, 3.0, 1.5, 10.0, 1.5, 0.0, 0.0);
    assert_true(render_depth(&edge, &camera, &ahead, 13.0, 2, truth, cosine));
    assert_true(multipath_bias(&camera, truth, cosine, bias));
    assert_true(fabsf(bias[HEIGHT / 2 * WIDTH + WIDTH / 2]) < 0.002f);
    scene_free(&edge);
}

static void edges_fly_or_are_dropped(void **state) {
    (void)state;
    struct scene card = wall_at(3.0);
    scene_box(&card, 0.0, 0.0, 1.505, 0.8, 0.8, 0.01, 0.0, 0.0);
    make(&card, &ahead, 0, 1, depth[0]);
    long flying = 0, dropped = 0, kept = 0;
    for (int i = 0; i < PIXELS; i++) {
        const double own = truth[i], z = depth[0][i];
        const bool dark = z == 0.0;
        const bool between = !dark && z > 1.55 && z < 2.9;
        flying += between;
        dropped += dark;
        kept += !dark && fabs(z - own) < 0.05;
    }
    print_message("# %ld flying, %ld dropped\n", flying, dropped);
    /* Some 97 pixels a side, and the wall's next to them. */
    assert_in_range(flying, 100, 400);
    assert_in_range(dropped, 250, 550);
    assert_true(kept > PIXELS - 800);
    scene_free(&card);
}

static void frames_depend_on_seed_and_number_alone(void **state) {
    (void)state;
    const struct scene wall = wall_at(2.0);
    make(&wall, &ahead, 3, 1, depth[0]);
    make(&wall, &ahead, 3, 1, depth[1]);
    assert_memory_equal(depth[0], depth[1], sizeof depth[0]);
    make(&wall, &ahead, 4, 1, depth[1]);
    assert_memory_not_equal(depth[0], depth[1], sizeof depth[0]);
    make(&wall, &ahead, 3, 2, depth[1]);
    assert_memory_not_equal(depth[0], depth[1], sizeof depth[0]);
}

static void what_is_too_near_or_too_dark_has_no_depth(void **state) {
    (void)state;
    const struct scene near = wall_at(0.4), far = wall_at(9.0);
    make(&near, &ahead, 0, 1, depth[0]);
    make(&far, &ahead, 0, 1, depth[1]);
    const int middle = HEIGHT / 2 * WIDTH + WIDTH / 2;
    assert_true(depth[0][middle] == 0.0f && depth[1][middle] == 0.0f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(noise_grows_with_range_and_slant),
        cmocka_unit_test(the_range_wiggles),
        cmocka_unit_test(a_corner_reads_too_far),
        cmocka_unit_test(edges_fly_or_are_dropped),
        cmocka_unit_test(frames_depend_on_seed_and_number_alone),
        cmocka_unit_test(what_is_too_near_or_too_dark_has_no_depth),
    };
    return cmocka_run_group_tests(tests, set_up, NULL);
}
