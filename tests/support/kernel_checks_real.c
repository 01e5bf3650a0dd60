/* The kernels one after the other, as a scan does. */
#include "kernel_checks_real.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fathom_drivers.h"
#include "selftest/kernel_checks_bench.h"

#define RECORDING "../shared/data/kitchen"

static float *maps_of(bench *b, const uint16_t *raw, const kernel_depth_source *s, const kernel_camera *c,
                      float *normals) {
    float *depth = bench_plane(c, 1, 0), *smooth = bench_plane(c, 1, 0);
    compare_convert_depth(b, raw, s, c, bench_noise);
    ref_convert_depth(raw, s, c, bench_noise, depth, NULL);
    compare_smooth_depth(b, depth, c, bench_noise, 1, 1e-6f);
    ref_smooth_depth(depth, c, bench_noise, 4, 1, 0, smooth);
    compare_halve_depth(b, depth, c, bench_noise);
    compare_normal_map(b, smooth, c, bench_noise);
    ref_normal_map(smooth, c, bench_noise, normals, NULL);
    compare_pack_map(b, depth, normals, c);
    compare_pack_planes(b, depth, smooth, 1.5f, normals, c, bench_noise);
    free(smooth);
    return depth;
}

/* The blocks that the frame's rays meet, as the library would place them. */
static void allocate(bench_volume *v, const float *depth, const kernel_camera *c,
                     const kernel_rigid *to_world) {
    enum { MOST = 8192 };
    int tiles = ((c->width + TILE - 1) / TILE) * ((c->height + TILE - 1) / TILE);
    cl_int4 *met = bench_alloc(MOST * sizeof *met);
    for (int i = 0; i < tiles; i++) {
        int count = ref_met_blocks(depth, c, to_world, v->surface.voxel * BLOCK_EDGE, v->surface.truncation,
                                   i, met, MOST);
        for (int k = 0; k < count && v->count < v->capacity; k++)
            bench_volume_add(v, met[k].s[0], met[k].s[1], met[k].s[2]);
    }
    free(met);
}

static void check_frames(bench *b, const fathom_recording *recording, uint16_t *raw) {
    kernel_camera c =
        kernel_camera_of(recording->camera.width / 2, recording->camera.height / 2, (float)recording->camera.fx / 2,
                         (float)recording->camera.fy / 2, (float)recording->camera.cx / 2 - 0.25f,
                         (float)recording->camera.cy / 2 - 0.25f);
    kernel_depth_source s = {.width = recording->camera.width, .height = recording->camera.height, .factor = 2};
    s.metres_per_unit = (float)(1 / recording->depth_units_per_metre);
    s.min_m = 0.3f;
    s.max_m = 5;
    size_t pixels = (size_t)c.width * (size_t)c.height;
    float *depth[2], *normals[2], *model = bench_alloc(pixels * 16);
    for (int i = 0; i < 2; i++) {
        normals[i] = bench_plane(&c, 4, 0);
        if (fathom_recording_read_depth(recording, i * 5, raw) != FATHOM_OK)
            bench_fail(b, "a frame can't be read");
        depth[i] = maps_of(b, raw, &s, &c, normals[i]);
    }
    pose moved = bench_motion(b, 0.01, 0.01), turned = bench_motion(b, 1, 1), back = pose_inverse(&turned);
    kernel_rigid motion = kernel_rigid_of(&moved), to_world = kernel_rigid_of(&turned),
                 to_camera = kernel_rigid_of(&back);
    kernel_pair_limits limits = {0.01f, 0.76f, 0.005f, {{0, 0, 1.5f, 0}}};
    ref_pack_map(depth[0], normals[0], &c, model);
    compare_halve_map(b, model, &c);
    compare_align_reduce(b, depth[1], normals[1], &c, model, &c, &motion, &limits);

    bench_volume v, few;
    bench_volume_make(&v, 8000, 0.01f, 0.04f);
    allocate(&v, depth[0], &c, &to_world);
    bench_volume_make(&few, 1000, 0.01f, 0.04f); /* some blocks are there already */
    for (int i = 0; i < v.count && few.count < 1000; i += 3)
        bench_volume_add(&few, v.blocks[i].s[0], v.blocks[i].s[1], v.blocks[i].s[2]);
    compare_request_blocks(b, depth[0], &c, &to_world, &few, 0.08f, -1);
    bench_volume_free(&few);
    for (int i = 0; i < 2; i++)
        compare_fuse_blocks(b, depth[0], normals[0], &c, bench_noise, &to_camera, &v, 100);
    compare_ranges(b, &v, &c, &to_camera, 0.3f, 5);
    /* every ray costs the reference some tenths of a millisecond: the middle of the view will do */
    kernel_camera part = kernel_camera_of(120, 88, c.fx, c.fy, c.cx - 100, c.cy - 76);
    bench_view view = {.c = part, .camera_to_world = turned, .near_m = 0.3f, .far_m = 5, .reach = 0.1f};
    view.allowed = 0.02; /* at the rims of what was seen one frame leaves a lot to chance */
    compare_raycast(b, &v, &view);
    float *scan = bench_plane(&part, 1, 0);
    for (int i = 0; i < part.width * part.height; i++) {
        int x = i % part.width, y = i / part.width;
        scan[ref_at(&part, x, y)] = depth[0][ref_at(&c, x + 100, y + 76)];
    }
    view.scan = scan;
    compare_raycast(b, &v, &view);
    free(scan);
    compare_triangles(b, &v, 0, true);
    bench_volume_free(&v);
    for (int i = 0; i < 2; i++) {
        free(depth[i]);
        free(normals[i]);
    }
    free(model);
}

fathom_check check_real_frame(device *d, bool small, char *why, size_t size) {
    bench b;
    fathom_recording *recording;
    bench_start(&b, d, small, why, size);
    if (b.small || fathom_recording_open(&recording, RECORDING, NULL) != FATHOM_OK) {
        snprintf(why, size, b.small ? "small sizes only" : "no recording in " RECORDING);
        return FATHOM_CHECK_SKIPPED;
    }
    uint16_t *raw = bench_alloc((size_t)recording->camera.width * (size_t)recording->camera.height * sizeof *raw);
    check_frames(&b, recording, raw);
    free(raw);
    fathom_recording_close(recording);
    return bench_end(&b);
}
