/* The ray-cast: a surface is where distances that were seen side by side change from outside to inside, and nowhere else. Voxels
 * never seen, missing blocks and back sides make none, whether a ray is marched or starts at the scan's depth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "map/raycast.h"
#include "selftest/kernel_checks_bench.h"

#define BLOCKS 400
#define ARENA_BYTES ((size_t)16 << 20)
#define VOXEL 0.02f
#define TRUNCATION 0.08f
#define WALL 50   /* voxels from the camera to the wall: a metre */
#define UNSEEN 99 /* what a layer of voxels holds: a distance in voxels, or this */
#define ABSENT 98 /* the layer's whole block isn't there */
#define WIDTH 24
#define HEIGHT 16

/* What a column of voxels along the ray holds, from 24 voxels on (where a block begins); the same all over the picture. */
#define FIRST 24
#define LAYERS 56

typedef struct {
    fathom_config config;
    device d;
    void *memory;
    volume v;
    raycaster r;
    depth_maps maps;
    device_buffer model;
    bench_volume filled;
    float layers[LAYERS];
    bool striped; /* every other column of voxels was never seen */
} scene;

static int open_scene(void **state) {
    scene *s = bench_alloc(sizeof *s);
    fathom_config_init(&s->config);
    s->config.voxel_m = VOXEL;
    s->config.truncation_m = TRUNCATION;
    s->config.depth_camera = (fathom_pinhole){.width = WIDTH, .height = HEIGHT, .fx = 60, .fy = 60, .cx = 11.3, .cy = 7.6};
    s->config.align_width = WIDTH;
    s->config.align_height = HEIGHT;
    if (kernel_checks_open(&s->d, &s->config, SHAPE_OWN) != FATHOM_OK) return -1;
    if (posix_memalign(&s->memory, ARENA_ALIGNMENT, ARENA_BYTES)) return -1;
    arena a = {s->memory, ARENA_BYTES, 0};
    depth_maps_init(&s->maps, &s->d, &a, &s->config);
    raycaster_init(&s->r, &s->d, &a, &s->v, kernel_tiles(&s->maps.camera[FINEST]));
    volume_init(&s->v, &s->d, &a, &s->config, BLOCKS);
    device_buffer_make(&s->d, &a, WIDTH * HEIGHT * sizeof(cl_uint2), &s->model);
    bench_volume_make(&s->filled, BLOCKS, VOXEL, TRUNCATION);
    for (int i = 0; i < LAYERS; i++) s->layers[i] = UNSEEN;
    *state = s;
    return s->d.error == FATHOM_OK && a.used <= a.size ? 0 : -1;
}

static int close_scene(void **state) {
    scene *s = *state;
    device_wait(&s->d);
    raycaster_close(&s->r);
    volume_close(&s->v);
    depth_maps_close(&s->maps);
    device_buffer_free(&s->model);
    device_close(&s->d);
    bench_volume_free(&s->filled);
    free(s->memory);
    free(s);
    return 0;
}

static void copy_in(scene *s, device_buffer *buffer, const void *from, size_t size) {
    assert_true(size <= buffer->size);
    void *p = device_map(&s->d, buffer, CL_MAP_WRITE);
    assert_non_null(p);
    memcpy(p, from, size);
    device_unmap(&s->d, buffer, p);
}

/* A wall whose surface lies at `at` voxels, as a camera in front of it saw it: a truncation before it and one behind. */
static void wall(scene *s, float at) {
    for (int i = 0; i < LAYERS; i++) {
        const float d = at - (float)(FIRST + i);
        if (fabsf(d) <= 4) s->layers[i] = d;
    }
}

static void layers(scene *s, int from, int to, float holds) {
    for (int i = from; i <= to; i++) s->layers[i - FIRST] = holds;
}

static void fill(scene *s) {
    for (int z = 0; z < LAYERS / BLOCK_EDGE; z++) {
        if (s->layers[z * BLOCK_EDGE] == ABSENT) continue;
        for (int k = 0; k < 56; k++) { /* wide enough for the picture at its farthest */
            const int from_middle = (k + 28) % 56; /* the pool's first block lies there */
            int16_t *data =
                s->filled.voxels + (size_t)bench_volume_add(&s->filled, from_middle % 8 - 4, from_middle / 8 - 3,
                                                            z + FIRST / BLOCK_EDGE) * BLOCK_SHORTS;
            for (int i = 0; i < BLOCK_VOXELS; i++) {
                const float d = s->striped && i % 2 ? UNSEEN : s->layers[z * BLOCK_EDGE + i / 64];
                data[i] = d == UNSEEN ? NEVER_SEEN : (int16_t)rintf(TSDF_ONE * d * VOXEL / TRUNCATION);
                data[BLOCK_VOXELS + i] = d == UNSEEN ? 0 : 64;
            }
        }
    }
    s->v.pool.count = s->filled.count;
    s->v.surface = s->filled.surface;
    copy_in(s, &s->v.pool.keys, s->filled.blocks, (size_t)s->v.pool.count * sizeof(cl_int4));
    copy_in(s, &s->v.table.entries, s->filled.table, TABLE_BYTES(s->filled.entries));
    copy_in(s, &s->v.pool.voxels, s->filled.voxels, (size_t)s->v.pool.count * BLOCK_BYTES);
}

/* All pixels see the wall at `at` voxels, from straight ahead; 0: none sees anything. */
static void assert_seen(scene *s, const char *how, double at) {
    cl_uint2 *map = device_map(&s->d, &s->model, CL_MAP_READ);
    assert_non_null(map);
    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        const kernel_point p = kernel_point_of(map[i]);
        if (fabs((double)p.depth - at * (double)VOXEL) > 0.03 * (double)VOXEL)
            fail_msg("%s: pixel %d, %d sees %.4f voxels away", how, i % WIDTH, i / WIDTH, (double)(p.depth / VOXEL));
        if (at > 0) assert_true(p.normal[2] < -0.999f);
    }
    device_unmap(&s->d, &s->model, map);
}

/* By a march from 0.1 m on, and near a scan at `scan` voxels with and without the march. The last finds it only where
 * Newton's method can. */
static void assert_cast(scene *s, double at, float scan, bool newton) {
    const pose here = pose_identity();
    const kernel_camera *c = &s->maps.camera[FINEST];
    float *depth = bench_plane(c, 1, scan * VOXEL);
    fill(s);
    raycast_view(&s->r, &s->d, c, &here, 0.1f, 3, &s->model);
    assert_seen(s, "a march", at);
    copy_in(s, &s->maps.depth[FINEST], depth, (size_t)c->plane * sizeof *depth);
    raycast_near(&s->r, &s->d, &s->maps, &here, 0.3f, true, &s->model);
    assert_seen(s, "near the scan, with a march", at);
    raycast_near(&s->r, &s->d, &s->maps, &here, 0.3f, false, &s->model);
    assert_seen(s, "near the scan", newton ? at : 0);
    free(depth);
}

static void a_wall_is_seen_where_it_is(void **state) {
    wall(*state, WALL + 0.3f);
    assert_cast(*state, WALL + 0.3, WALL + 2, true);
}

static void a_wall_in_the_first_block_of_the_pool_is_seen(void **state) {
    wall(*state, 27.3f);
    assert_cast(*state, 27.3, 28, true);
}

static void a_hole_between_front_and_back_is_no_surface(void **state) {
    scene *s = *state;
    for (int width = 1; width < 5; width++) {
        wall(s, WALL + 0.3f);
        layers(s, WALL, WALL + width - 1, UNSEEN);
        assert_cast(s, 0, WALL + 2, false);
        wall(s, WALL + 0.3f);
        layers(s, WALL + 1 - width, WALL, UNSEEN);
        assert_cast(s, 0, WALL - 1, false);
    }
}

/* Between the two lies a block that isn't there; the wall behind them is seen. */
static void nor_is_a_block_that_is_missing_between_them(void **state) {
    scene *s = *state;
    wall(s, WALL + 0.3f);
    layers(s, 28, 31, 2);
    layers(s, 32, 39, ABSENT);
    layers(s, 40, 42, -2);
    assert_cast(s, WALL + 0.3, WALL + 1, true);
}

/* Of a cube all eight voxels must have been seen, and all its blocks be there. */
static void a_cube_with_an_unseen_corner_is_no_surface(void **state) {
    scene *s = *state;
    wall(s, WALL + 0.3f);
    s->striped = true;
    assert_cast(s, 0, WALL + 1, false);
}

static void a_cube_that_reaches_into_a_missing_block_is_no_surface(void **state) {
    scene *s = *state;
    wall(s, 55.2f);
    layers(s, 24, 31, -2); /* the first block of the pool: what a wrong place would take instead */
    layers(s, 56, 63, ABSENT);
    assert_cast(s, 0, 55.1f, false);
}

static void a_ray_that_begins_inside_sees_no_surface_there(void **state) {
    scene *s = *state;
    for (int i = 24; i < 44; i++) layers(s, i, i, -0.5f - 0.15f * (float)(i - 24)); /* deeper and deeper */
    assert_cast(s, 0, 45, false);
}

static void a_surface_behind_a_hole_is_seen(void **state) {
    scene *s = *state;
    wall(s, WALL + 0.3f);
    layers(s, 36, 38, 3);  /* something in the air: its front and its back were seen, not its middle */
    layers(s, 39, 40, UNSEEN);
    layers(s, 41, 43, -3);
    assert_cast(s, WALL + 0.3, WALL + 1, true);
}

static void a_back_side_is_looked_through(void **state) {
    scene *s = *state;
    wall(s, WALL + 0.3f);
    for (int i = 0; i < 8; i++) layers(s, 34 + i, 34 + i, (float)i - 3.5f); /* from inside to outside */
    assert_cast(s, WALL + 0.3, WALL + 1, true);
}

static void what_was_never_seen_at_all_is_nothing(void **state) {
    assert_cast(*state, 0, WALL, false);
}

int main(void) {
#define IN_SCENE(test) cmocka_unit_test_setup_teardown(test, open_scene, close_scene)
    const struct CMUnitTest tests[] = {
        IN_SCENE(a_wall_is_seen_where_it_is),
        IN_SCENE(a_wall_in_the_first_block_of_the_pool_is_seen),
        IN_SCENE(a_hole_between_front_and_back_is_no_surface),
        IN_SCENE(nor_is_a_block_that_is_missing_between_them),
        IN_SCENE(a_cube_with_an_unseen_corner_is_no_surface),
        IN_SCENE(a_cube_that_reaches_into_a_missing_block_is_no_surface),
        IN_SCENE(a_ray_that_begins_inside_sees_no_surface_there),
        IN_SCENE(a_surface_behind_a_hole_is_seen),
        IN_SCENE(a_back_side_is_looked_through),
        IN_SCENE(what_was_never_seen_at_all_is_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
