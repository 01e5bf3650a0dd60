#include <math.h>
#include <stdlib.h>

#include "selftest/kernel_checks_bench.h"

/* ---- mark_seen --------------------------------------------------------------------------------------------------- */

enum { MOST = 1000 };

static void compare_mark_seen(bench *b, const float *depth, const kernel_camera *c,
                              const kernel_rigid *world_to_camera, const kernel_surface *f,
                              const cl_int4 *blocks, int count) {
    int tiles = ((c->width + TILE - 1) / TILE) * ((c->height + TILE - 1) / TILE);
    size_t seen_bytes = (size_t)count * sizeof(cl_int);
    cl_int *seen = bench_alloc(seen_bytes), *got = bench_alloc(seen_bytes), frame = 1000;
    float *farthest = bench_alloc((size_t)tiles * sizeof *farthest);
    uint8_t *outcomes = bench_alloc((size_t)count);
    for (int i = 0; i < count; i++) seen[i] = bench_random_int(b, 0, 999);
    ref_tile_farthest(depth, c, farthest);
    cl_mem farthest_memory = bench_buffer(b, (size_t)tiles * sizeof *farthest, farthest),
           blocks_memory = bench_buffer(b, (size_t)count * sizeof *blocks, blocks),
           seen_memory = bench_buffer(b, seen_bytes, seen);
    LAUNCH(b, "mark_seen", (size_t)count, 1, 1, ARG(*c), ARG(farthest_memory), ARG(*world_to_camera), ARG(*f),
           ARG(blocks_memory), ARG(frame), ARG(seen_memory));
    bench_read(b, seen_memory, got, seen_bytes);
    ref_in_view(farthest, c, world_to_camera, f, blocks, count, outcomes);
    for (int i = 0; i < count && !b->failed; i++) {
        if (outcomes[i] == REF_DOUBTFUL)
            b->doubtful++;
        else
            bench_near(b, "mark_seen: the frame of block", i, 0, got[i],
                       outcomes[i] == REF_IN_VIEW ? frame : seen[i], 0);
    }
    bench_free(b);
    free(seen);
    free(got);
    free(farthest);
    free(outcomes);
}

fathom_check check_mark_seen(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    cl_int4 *blocks = bench_alloc(MOST * sizeof *blocks);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * IMAGE_KINDS; i++) {
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        float *depth = bench_depth(&b, &c, bench_noise, (image_kind)(i / count));
        pose at = bench_motion(&b, 3, 1), inverse = pose_inverse(&at);
        kernel_rigid camera_to_world = kernel_rigid_of(&at), world_to_camera = kernel_rigid_of(&inverse);
        kernel_surface f = {.voxel = i % 2 ? 0.01f : 0.03f, .truncation = 0.05f, .submap = i % 3};
        const int most = b.small ? 100 : MOST, about = b.small ? 0 : 40; /* Oclgrind 21.10 rounds negative numbers up */
        for (int k = 0; k < most; k++) { /* behind the camera, about the picture's sides, about what is seen there */
            int x = bench_random_int(&b, -about, c.width - 1 + about),
                y = bench_random_int(&b, -about, c.height - 1 + about);
            double z = bench_random(&b, -0.5, 5), world[3];
            if (k % 2 && x >= 0 && y >= 0 && x < c.width && y < c.height)
                z = depth[ref_at(&c, x, y)] + bench_random(&b, -0.1, 0.4);
            double p[3] = {(x - c.cx) / c.fx * z, (y - c.cy) / c.fy * z, z};
            ref_transform(&camera_to_world, p, world);
            for (int a = 0; a < 3; a++) blocks[k].s[a] = (int)floor(world[a] / (f.voxel * BLOCK_EDGE));
            blocks[k].s[3] = k % 8 ? f.submap : (f.submap + 1) % 3;
        }
        compare_mark_seen(&b, depth, &c, &world_to_camera, &f, blocks, most);
        free(depth);
    }
    free(blocks);
    return bench_end(&b);
}
