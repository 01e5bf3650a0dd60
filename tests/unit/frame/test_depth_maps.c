/* The geometry of the maps that a frame becomes, before any kernel runs (lib/frame/depth_maps.c). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "frame/depth_maps.h"

static depth_maps maps_of(fathom_config *c) {
    depth_maps maps;
    device none = {0};
    arena count = {NULL, 0, 0};
    none.config = c;
    depth_maps_init(&maps, &none, &count, c);
    return maps;
}

/* The corner of the picture is half a pixel from the first pixel's centre, on every level. */
static void every_level_sees_the_same_field_of_view(void **state) {
    (void)state;
    fathom_config c;
    fathom_config_init(&c);
    c.depth_camera.cx = 301.7f;
    c.depth_camera.cy = 255.3f;
    for (int factor = 1; factor <= 4; factor++) {
        c.align_width = c.depth_camera.width / factor;
        c.align_height = c.depth_camera.height / factor;
        if (c.align_width * factor != c.depth_camera.width) continue;
        depth_maps maps = maps_of(&c);
        for (int i = 0; i < FATHOM_LEVELS; i++) {
            const kernel_camera *k = &maps.camera[i];
            double scale = (double)c.depth_camera.width / k->width;
            assert_true(fabs((k->cx + 0.5) * scale - (c.depth_camera.cx + 0.5)) < 1e-3);
            assert_true(fabs((k->cy + 0.5) * scale - (c.depth_camera.cy + 0.5)) < 1e-3);
            assert_true(fabs(k->fx * scale - c.depth_camera.fx) < 1e-3 && fabs(k->fy * scale - c.depth_camera.fy) < 1e-3);
        }
    }
}

/* The sigma of a slope, in pixels, at a depth where the surface begins to be rough. */
static double slope_sigma(const depth_maps *m, const fathom_config *c, double z, double of_slope) {
    const double sigma = c->depth_noise_base_m + c->depth_noise_slope * z + c->depth_noise_growth_per_m * z * z;
    return of_slope * sigma / m->source.factor * m->camera[FINEST].fx / z;
}

/* Two sigma of it are the maximum angle of a pair's normals, whatever the sensor and the size of the maps. */
static void rough_depth_begins_where_normals_lose_pairs(void **state) {
    (void)state;
    static const struct {
        int width;
        float base, slope, growth;
    } of[] = {{640, 0.0001f, 0, 0.003f}, {320, 0.0001f, 0, 0.003f}, {160, 0.0001f, 0, 0.003f}, {320, 0.0005f, 0.0005f, 0.001f}};
    for (int i = 0; i < 4; i++) {
        fathom_config c;
        fathom_config_init(&c);
        c.max_align_width = of[i].width;
        c.depth_noise_base_m = of[i].base;
        c.depth_noise_slope = of[i].slope;
        c.depth_noise_growth_per_m = of[i].growth;
        const kernel_noise noise = {of[i].base, of[i].slope, of[i].growth};
        depth_maps m = maps_of(&c);
        depth_maps_set_noise(&m, &c, &noise);
        const double half = (double)c.max_pair_angle_rad / 2;
        assert_true(m.raw_m < m.once_m);
        assert_int_equal(m.raw_m > 0, i > 0); /* at 640x480 a Kinect is rough everywhere */
        if (i > 0) assert_true(fabs(slope_sigma(&m, &c, (double)m.raw_m, 0.71) - half) < 0.01 * half);
        assert_true(fabs(slope_sigma(&m, &c, (double)m.once_m, 0.15) - half) < 0.01 * half);
        const kernel_noise constant = {0.004f, 0, 0}, little = {0.0001f, 0, 0}, lots = {0.001f, 0.05f, 0};
        depth_maps_set_noise(&m, &c, &lots);
        assert_true(m.raw_m == 0);
        depth_maps_set_noise(&m, &c, &little);
        assert_true(isinf(m.raw_m) && isinf(m.once_m));
        if (of[i].width < 320) continue;
        depth_maps_set_noise(&m, &c, &constant);
        assert_true(m.raw_m == 0);
    }
}

/* Where sigma, base + growth z^2, is two truncations (of four voxels). */
static void depth_ends_where_noise_is_thicker_than_the_surface(void **state) {
    (void)state;
    fathom_config c;
    fathom_config_init(&c);
    c.max_depth_m = 20;
    for (int i = 0; i < 3; i++) {
        c.voxel_m = 0.005f * (float)(1 << i);
        depth_maps maps = maps_of(&c);
        double z = maps.source.max_m;
        assert_true(z < 20);
        assert_true(fabs(c.depth_noise_base_m + c.depth_noise_growth_per_m * z * z - 8 * c.voxel_m) < 1e-5);
    }
    c.truncation_m = 0.01f;
    depth_maps maps = maps_of(&c);
    double z = maps.source.max_m;
    assert_true(fabs(c.depth_noise_base_m + c.depth_noise_growth_per_m * z * z - 0.02) < 1e-5);
    c.max_depth_m = 1.5f; /* and no further than the settings say */
    assert_true(maps_of(&c).source.max_m == 1.5f);
    c.depth_noise_growth_per_m = 0;
    assert_true(maps_of(&c).source.max_m == 1.5f);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_level_sees_the_same_field_of_view),
        cmocka_unit_test(rough_depth_begins_where_normals_lose_pairs),
        cmocka_unit_test(depth_ends_where_noise_is_thicker_than_the_surface),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
