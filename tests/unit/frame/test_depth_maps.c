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
        cmocka_unit_test(depth_ends_where_noise_is_thicker_than_the_surface),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
