/* The depth noise that is estimated from frames: its growth with depth, whatever the sensor, the units and the scene. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "frame/depth_noise.h"

#define WIDTH 320
#define HEIGHT 240

typedef double (*sensor)(double z, uint32_t *random); /* what it reads of a depth, m */

static double uniform(uint32_t *random) {
    *random = *random * 1664525u + 1013904223u;
    return (*random >> 8) / 16777216.0;
}

static double normal(uint32_t *random) {
    return sqrt(-2 * log(uniform(random) + 1e-12)) * cos(6.283185307179586 * uniform(random));
}

/* Steps of an eighth of a pixel of disparity at a base of 75 mm, and a little noise: a Kinect. */
static double triangulation(double z, uint32_t *random) {
    const double fb = 580 * 0.075, disparity = fb / z + 0.03 * normal(random);
    return fb / (round(disparity * 8) / 8);
}

static double lidar(double z, uint32_t *random) {
    return z * (1 + 0.0015 * normal(random));
}

static double time_of_flight(double z, uint32_t *random) {
    return z + 0.004 * normal(random);
}

static fathom_config settings(float units) {
    fathom_config c;
    fathom_config_init(&c);
    c.depth_camera.width = WIDTH;
    c.depth_camera.height = HEIGHT;
    c.depth_units_per_metre = units;
    c.max_depth_m = 10;
    return c;
}

static fathom_depth_frame frame_of(const uint16_t *depth) {
    return (fathom_depth_frame){.struct_size = sizeof(fathom_depth_frame), .width = WIDTH, .height = HEIGHT, .depth = depth,
                                .row_stride_bytes = 2 * WIDTH};
}

/* Slanted walls side by side, from near to far, each `step` pixels wide. */
static void render(uint16_t *depth, sensor s, double near_m, double far_m, int step, float units, uint32_t *random) {
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH; x++) {
            const int wall = x / step, walls = (WIDTH + step - 1) / step;
            const double at = near_m * pow(far_m / near_m, walls > 1 ? wall / (walls - 1.0) : 0);
            const double z = at / (1 - 0.3 * (x % step - step / 2) / 290.0 - 0.2 * (y - HEIGHT / 2) / 290.0);
            depth[y * WIDTH + x] = (uint16_t)lround(s(z, random) * units);
        }
}

static kernel_noise estimate_of(sensor s, double near_m, double far_m, int step, float units, int frames) {
    static uint16_t depth[WIDTH * HEIGHT];
    const fathom_config c = settings(units);
    const fathom_depth_frame frame = frame_of(depth);
    depth_noise n;
    depth_maps m = {.source.metres_per_unit = 1 / units};
    uint32_t random = 7;
    depth_noise_init(&n, &c);
    for (int i = 0; i < frames; i++) {
        render(depth, s, near_m, far_m, step, units, &random);
        depth_noise_look(&n, &m, &frame);
    }
    return m.noise;
}

static double sigma(const kernel_noise *n, double z) {
    return n->base + n->slope * z + n->growth * z * z;
}

/* Sigma grows like a power of the depth: which one, over two octaves? */
static double exponent(const kernel_noise *n) {
    return log(sigma(n, 4) / sigma(n, 1)) / log(4);
}

static void any_mixture_is_fitted_exactly(void **state) {
    (void)state;
    static const double truth[][3] = {{0.001, 0, 0.003}, {0.002, 0.004, 0}, {0.001, 0.002, 0.003}, {0.003, 0, 0}, {0, 0, 0.002}};
    for (size_t t = 0; t < sizeof truth / sizeof *truth; t++) {
        double z[9], values[9], weights[9];
        for (int i = 0; i < 9; i++) {
            z[i] = 0.4 * pow(1.4, i);
            values[i] = truth[t][0] + truth[t][1] * z[i] + truth[t][2] * z[i] * z[i];
            weights[i] = 1 + i % 3;
        }
        const kernel_noise n = depth_noise_fit(z, values, weights, 9);
        for (int i = 0; i < 9; i++) assert_true(fabs(sigma(&n, z[i]) / values[i] - 1) < 5e-3);
    }
}

static void no_part_is_negative(void **state) {
    (void)state;
    const double z[] = {0.5, 1, 2, 4}, falling[] = {0.008, 0.004, 0.002, 0.001}, one[] = {1, 1, 1, 1};
    const kernel_noise n = depth_noise_fit(z, falling, one, 4);
    assert_true(n.base > 0 && n.slope >= 0 && n.growth >= 0);
}

static void triangulation_grows_with_the_square(void **state) {
    (void)state;
    const kernel_noise n = estimate_of(triangulation, 0.7, 6, 40, 1000, 1);
    print_message("# %.4f %.4f %.4f, exponent %.2f\n", (double)n.base, (double)n.slope, (double)n.growth, exponent(&n));
    assert_true(exponent(&n) > 1.7 && exponent(&n) < 2.15);
}

static void a_lidar_grows_in_proportion(void **state) {
    (void)state;
    const kernel_noise n = estimate_of(lidar, 0.7, 6, 40, 1000, 1);
    print_message("# %.4f %.4f %.4f, exponent %.2f\n", (double)n.base, (double)n.slope, (double)n.growth, exponent(&n));
    assert_true(exponent(&n) > 0.75 && exponent(&n) < 1.25);
}

static void a_constant_error_stays_constant(void **state) {
    (void)state;
    const kernel_noise n = estimate_of(time_of_flight, 0.7, 6, 40, 1000, 1);
    print_message("# %.4f %.4f %.4f, exponent %.2f\n", (double)n.base, (double)n.slope, (double)n.growth, exponent(&n));
    assert_true(exponent(&n) > -0.1 && exponent(&n) < 0.3);
}

/* Whatever the sensor, sigma is the settings' in the geometric mean over what was seen. */
static void the_scale_stays_the_settings(void **state) {
    (void)state;
    const sensor sensors[] = {triangulation, lidar, time_of_flight};
    const kernel_noise given = {0.0001f, 0, 0.003f};
    for (int s = 0; s < 3; s++) {
        const kernel_noise n = estimate_of(sensors[s], 0.7, 6, 40, 1000, 1);
        double ratio = 0;
        for (int wall = 0; wall < 8; wall++) {
            const double z = 0.7 * pow(6 / 0.7, wall / 7.0);
            ratio += log(sigma(&n, z) / sigma(&given, z)) / 8;
        }
        assert_true(fabs(ratio) < log(1.2));
    }
}

/* Steps of a tenth of the depth, and a tenth of the pixels at them. */
static void edges_change_little(void **state) {
    (void)state;
    const kernel_noise calm = estimate_of(lidar, 1, 4, 160, 1000, 1), stepped = estimate_of(lidar, 1, 4, 20, 1000, 1);
    for (double z = 1; z <= 4; z *= 2) assert_true(fabs(log(sigma(&stepped, z) / sigma(&calm, z))) < log(1.4));
}

/* A fence of slats before a wall: a quarter of the pixels is at an edge, more than the quantile leaves out. */
static void a_fence_is_no_noise(void **state) {
    (void)state;
    static uint16_t depth[WIDTH * HEIGHT];
    const fathom_config c = settings(1000);
    const fathom_depth_frame frame = frame_of(depth);
    depth_noise n;
    depth_maps m = {.source.metres_per_unit = 0.001f};
    uint32_t random = 7;
    depth_noise_init(&n, &c);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        depth[i] = (uint16_t)lround(1000 * lidar(i % WIDTH / 8 % 2 ? 1 : 2, &random));
    depth_noise_look(&n, &m, &frame);
    const kernel_noise calm = estimate_of(lidar, 1, 2, 160, 1000, 1);
    for (double z = 1; z <= 2; z *= 2) assert_true(fabs(log(sigma(&m.noise, z) / sigma(&calm, z))) < log(1.2));
}

/* Rendered depth without noise is fused as it is, however rough the settings say that it may be. */
static void even_depth_is_not_smoothed(void **state) {
    (void)state;
    static uint16_t depth[WIDTH * HEIGHT];
    const fathom_config c = settings(5000);
    const fathom_depth_frame frame = frame_of(depth);
    for (int noisy = 0; noisy <= 1; noisy++) {
        depth_noise n;
        depth_maps m = {.source.metres_per_unit = 0.0002f, .source.factor = 2, .camera[FINEST].fx = 262};
        uint32_t random = 7;
        depth_noise_init(&n, &c);
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            const double z = 1 + 2.0 * (i % WIDTH) / WIDTH;
            depth[i] = (uint16_t)lround(5000 * (noisy ? triangulation(z, &random) : z));
        }
        depth_noise_look(&n, &m, &frame);
        assert_true(isinf(m.raw_m) == !noisy && isinf(m.once_m) == !noisy);
    }
}

static void units_change_nothing(void **state) {
    (void)state;
    const kernel_noise a = estimate_of(lidar, 0.7, 6, 40, 10000, 3), b = estimate_of(lidar, 0.7, 6, 40, 5000, 3);
    for (double z = 0.7; z < 6; z *= 1.5) assert_true(fabs(log(sigma(&a, z) / sigma(&b, z))) < log(1.1));
}

/* One wall at 1 m says nothing of other depths: there the settings' shape holds, at the scale that was seen. */
static void unseen_depths_have_the_settings_shape(void **state) {
    (void)state;
    const kernel_noise n = estimate_of(time_of_flight, 1, 1, WIDTH, 1000, 1);
    assert_true(fabs(exponent(&n) - 2) < 0.35);
}

static void blank_frames_leave_the_settings(void **state) {
    (void)state;
    static uint16_t depth[WIDTH * HEIGHT];
    const fathom_config c = settings(1000);
    const fathom_depth_frame frame = frame_of(depth);
    depth_noise n;
    depth_maps m = {.noise = {9, 9, 9}, .source.metres_per_unit = 0.001f};
    depth_noise_init(&n, &c);
    depth_noise_look(&n, &m, &frame);
    assert_memory_equal(&m.noise, &n.given, sizeof m.noise);
}

/* A sensor that changes in the middle is followed, and a reset forgets what was seen. */
static void a_change_is_followed(void **state) {
    (void)state;
    static uint16_t depth[WIDTH * HEIGHT];
    const fathom_config c = settings(1000);
    const fathom_depth_frame frame = frame_of(depth);
    depth_noise n;
    depth_maps m = {.source.metres_per_unit = 0.001f};
    uint32_t random = 3;
    depth_noise_init(&n, &c);
    for (int i = 0; i < 600; i++) {
        render(depth, i < 40 ? triangulation : lidar, 0.7, 6, 40, 1000, &random);
        depth_noise_look(&n, &m, &frame);
        if (i == 39) assert_true(exponent(&m.noise) > 1.7);
    }
    assert_true(exponent(&m.noise) < 1.25);
    depth_noise_reset(&n);
    render(depth, triangulation, 0.7, 6, 40, 1000, &random);
    depth_noise_look(&n, &m, &frame);
    assert_true(exponent(&m.noise) > 1.7);
}

/* Every other pixel is unsure, and wild. */
static void unsure_pixels_are_not_looked_at(void **state) {
    (void)state;
    static uint16_t depth[WIDTH * HEIGHT];
    static uint8_t confidence[WIDTH * HEIGHT];
    const fathom_config c = settings(1000);
    const fathom_depth_frame frame = {.struct_size = sizeof frame, .width = WIDTH, .height = HEIGHT, .depth = depth,
                                      .row_stride_bytes = 2 * WIDTH, .confidence = confidence,
                                      .confidence_stride_bytes = WIDTH};
    depth_maps m = {.source.metres_per_unit = 0.001f, .min_confidence = 2};
    depth_noise n;
    uint32_t random = 5;
    depth_noise_init(&n, &c);
    render(depth, lidar, 0.7, 6, 40, 1000, &random);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        confidence[i] = i / 8 % 2 ? 1 : 2;
        if (i / 8 % 2) depth[i] = (uint16_t)(depth[i] * (1 + 0.02 * normal(&random)));
    }
    depth_noise_look(&n, &m, &frame);
    const kernel_noise sure = estimate_of(lidar, 0.7, 6, 40, 1000, 1);
    for (double z = 0.7; z < 6; z *= 1.5) assert_true(fabs(log(sigma(&m.noise, z) / sigma(&sure, z))) < log(1.3));
}

static void what_is_given_can_be_kept(void **state) {
    (void)state;
    fathom_config c = settings(1000);
    depth_noise n;
    depth_maps m = {.noise = {1, 2, 3}};
    c.refine_depth_noise = false;
    depth_noise_init(&n, &c);
    depth_noise_look(&n, &m, NULL);
    assert_true(m.noise.base == 1 && m.noise.slope == 2 && m.noise.growth == 3);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_mixture_is_fitted_exactly),
        cmocka_unit_test(no_part_is_negative),
        cmocka_unit_test(triangulation_grows_with_the_square),
        cmocka_unit_test(a_lidar_grows_in_proportion),
        cmocka_unit_test(a_constant_error_stays_constant),
        cmocka_unit_test(the_scale_stays_the_settings),
        cmocka_unit_test(edges_change_little),
        cmocka_unit_test(a_fence_is_no_noise),
        cmocka_unit_test(even_depth_is_not_smoothed),
        cmocka_unit_test(units_change_nothing),
        cmocka_unit_test(unseen_depths_have_the_settings_shape),
        cmocka_unit_test(blank_frames_leave_the_settings),
        cmocka_unit_test(a_change_is_followed),
        cmocka_unit_test(unsure_pixels_are_not_looked_at),
        cmocka_unit_test(what_is_given_can_be_kept),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
