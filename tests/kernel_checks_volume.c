#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "kernel_checks_bench.h"

/* ---- request_blocks ------------------------------------------------------------------------------------------- */

void compare_request_blocks(bench *b, float *depth, const kernel_camera *c,
                            const kernel_rigid *camera_to_world, bench_volume *v, float block_m) {
    int tiles = ((c->width + TILE - 1) / TILE) * ((c->height + TILE - 1) / TILE);
    size_t request_bytes = (size_t)tiles * TILE_SLOTS * sizeof(cl_int4),
           count_bytes = (size_t)tiles * sizeof(cl_int);
    cl_int4 *got = bench_alloc(request_bytes), *want = bench_alloc(request_bytes);
    float *got_farthest = bench_alloc(count_bytes), *want_farthest = bench_alloc(count_bytes);
    int *got_counts = bench_alloc(count_bytes), *want_counts = bench_alloc(count_bytes);
    uint8_t *doubt = bench_alloc((size_t)c->width * (size_t)c->height);
    ref_volume reference;
    ref_volume_open(&reference, v->blocks, v->count, v->voxels, &v->surface);
    ref_request_blocks(depth, c, camera_to_world, block_m, v->surface.truncation, &reference, want,
                       want_counts, doubt);
    for (int i = 0; i < c->width * c->height; i++) {
        if (doubt[i]) depth[ref_at(c, i % c->width, i / c->width)] = 0;
        *(doubt[i] ? &b->doubtful : &b->compared) += 1;
    }
    ref_request_blocks(depth, c, camera_to_world, block_m, v->surface.truncation, &reference, want,
                       want_counts, NULL);
    ref_volume_close(&reference);

    bench_volume_upload(b, v);
    cl_mem depth_memory = bench_buffer(b, (size_t)c->plane * 4, depth),
           requests = bench_buffer(b, request_bytes, NULL), counts = bench_buffer(b, count_bytes, NULL),
           farthest = bench_buffer(b, count_bytes, NULL);
    LAUNCH(b, "request_blocks", (size_t)tiles, 1, 1, ARG(depth_memory), ARG(*c), ARG(*camera_to_world),
           ARG(block_m), ARG(v->surface.truncation), ARG(v->table_memory), ARG(v->surface.mask),
           ARG(requests), ARG(counts), ARG(farthest));
    bench_read(b, requests, got, request_bytes);
    bench_read(b, counts, got_counts, count_bytes);
    bench_read(b, farthest, got_farthest, count_bytes);
    ref_tile_farthest(depth, c, want_farthest);
    for (int tile = 0; tile < tiles && !b->failed; tile++) { /* exactly the same blocks in the same order */
        bench_near(b, "request_blocks: farthest of tile", tile, 0, got_farthest[tile], want_farthest[tile],
                   0);
        bench_near(b, "request_blocks: count of tile", tile, 0, got_counts[tile], want_counts[tile], 0);
        for (int i = 0; i < want_counts[tile] && !b->failed; i++)
            for (int a = 0; a < 3; a++)
                bench_near(b, "request_blocks: tile, slot", tile, i, got[tile * TILE_SLOTS + i].s[a],
                           want[tile * TILE_SLOTS + i].s[a], 0);
    }
    bench_free(b);
    free(got);
    free(want);
    free(got_counts);
    free(want_counts);
    free(got_farthest);
    free(want_farthest);
    free(doubt);
}

check_result check_request_blocks(device *d, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * IMAGE_KINDS * 2; i++) {
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        float *depth = bench_depth(&b, &c, bench_noise, (image_kind)(i / count % IMAGE_KINDS));
        pose at = bench_motion(&b, 3, 2);
        for (int k = 0; k < 3; k++) at.t[k] += b.shift;
        kernel_rigid camera_to_world = kernel_rigid_of(&at);
        /* as by default; and so small that a tile wants more blocks than it has slots */
        float block_m = i / count / IMAGE_KINDS ? 0.012f : 0.08f;
        bench_volume v;
        bench_volume_make(&v, 300, block_m / BLOCK_EDGE, 0.04f);
        for (int k = 0; k < 300; k++) { /* some of what will be met, and some anywhere */
            int x = bench_random_int(&b, 0, c.width - 1), y = bench_random_int(&b, 0, c.height - 1);
            double z = depth[ref_at(&c, x, y)], world[3],
                   p[3] = {(x - c.cx) / c.fx * z, (y - c.cy) / c.fy * z, z};
            ref_transform(&camera_to_world, p, world);
            if (k % 2)
                for (int a = 0; a < 3; a++) world[a] = bench_random(&b, -3, 3);
            bench_volume_add(&v, (int)floor(world[0] / block_m), (int)floor(world[1] / block_m),
                             (int)floor(world[2] / block_m));
        }
        compare_request_blocks(&b, depth, &c, &camera_to_world, &v, block_m);
        bench_volume_free(&v);
        free(depth);
    }
    return bench_end(&b);
}

/* ---- clear_blocks, clear_ranges ----------------------------------------------------------------------------------- */

check_result check_clear_blocks(device *d, char *why, size_t size) {
    enum { BLOCKS = 7 };
    bench b;
    bench_start(&b, d, why, size);
    for (int i = 0; i < 3; i++) {
        static const int ranges[3][2] = {{0, BLOCKS}, {2, 3}, {BLOCKS - 1, 1}};
        cl_int first = ranges[i][0];
        int16_t *want = bench_alloc(BLOCKS * BLOCK_BYTES), *got = bench_alloc(BLOCKS * BLOCK_BYTES);
        for (int k = 0; k < BLOCKS * BLOCK_BYTES / 2; k++) want[k] = (int16_t)bench_random_int(&b, 1, 30000);
        cl_mem voxels = bench_buffer(&b, BLOCKS * BLOCK_BYTES, want);
        LAUNCH(&b, "clear_blocks", (size_t)ranges[i][1], BLOCK_BYTES / 16, 1, ARG(first), ARG(voxels));
        bench_read(&b, voxels, got, BLOCKS * BLOCK_BYTES);
        ref_clear_blocks(first, ranges[i][1], want);
        bench_compare_bytes(&b, "clear_blocks", got, want, BLOCKS * BLOCK_BYTES);
        bench_free(&b);
        free(want);
        free(got);
    }
    return bench_end(&b);
}

check_result check_clear_ranges(device *d, char *why, size_t size) {
    enum { TILES = 37 };
    bench b;
    float got[2 * TILES], want[2 * TILES];
    bench_start(&b, d, why, size);
    for (int i = 0; i < 2 * TILES; i++) got[i] = (float)bench_random(&b, -1, 1);
    cl_mem ranges = bench_buffer(&b, sizeof got, got);
    LAUNCH(&b, "clear_ranges", TILES, 1, 0, ARG(ranges));
    bench_read(&b, ranges, got, sizeof got);
    ref_clear_ranges(TILES, want);
    bench_compare_bytes(&b, "clear_ranges", got, want, sizeof got);
    return bench_end(&b);
}

/* ---- fuse_blocks ---------------------------------------------------------------------------------------------------- */

void compare_fuse_blocks(bench *b, const float *scan, const kernel_camera *c, cl_float2 noise,
                         const kernel_rigid *world_to_camera, bench_volume *v, float max_weight) {
    size_t bytes = (size_t)v->count * BLOCK_BYTES;
    int voxels = v->count * BLOCK_VOXELS;
    int16_t *got = bench_alloc(bytes);
    uint8_t *doubt = bench_alloc((size_t)voxels);
    cl_float voxel = v->surface.voxel, truncation = v->surface.truncation, most = max_weight;
    bench_volume_upload(b, v);
    cl_mem scan_memory = bench_buffer(b, (size_t)c->width * (size_t)c->height * 16, scan);
    int tiles = ((c->width + TILE - 1) / TILE) * ((c->height + TILE - 1) / TILE);
    float *depth = bench_plane(c, 1, 0), *farthest = bench_alloc((size_t)tiles * 4);
    for (int i = 0; i < c->width * c->height; i++)
        depth[ref_at(c, i % c->width, i / c->width)] = scan[4 * i + 3];
    ref_tile_farthest(depth, c, farthest);
    cl_mem farthest_memory = bench_buffer(b, (size_t)tiles * 4, farthest);
    cl_int settled = v->count / 3, turn = v->count & 1, frame = 7;
    cl_mem seen = bench_buffer(b, (size_t)v->count * 4, NULL);
    LAUNCH(b, "fuse_blocks", (size_t)v->count, 1, 1, ARG(scan_memory), ARG(*c), ARG(noise),
           ARG(farthest_memory), ARG(*world_to_camera), ARG(voxel), ARG(truncation), ARG(most),
           ARG(v->blocks_memory), ARG(settled), ARG(turn), ARG(frame), ARG(seen), ARG(v->voxels_memory));
    free(depth);
    free(farthest);
    bench_read(b, v->voxels_memory, got, bytes);
    ref_fuse_blocks(scan, c, noise, world_to_camera, voxel, truncation, most, v->blocks, v->count, settled,
                    turn, v->voxels, doubt);
    /* A voxel's place in camera axes is known to 1e-6 m (some 5 m, a few roundings), and half a unit is rounded off. */
    double tolerance = 1.01 + 32767 * 2e-6 / truncation;
    for (int i = 0; i < voxels && !b->failed; i++) {
        int at = i / BLOCK_VOXELS * 2 * BLOCK_VOXELS + i % BLOCK_VOXELS;
        if (doubt[i]) {
            b->doubtful++;
            continue;
        }
        bench_near(b, "fuse_blocks: distance of block, voxel", i / BLOCK_VOXELS, i % BLOCK_VOXELS, got[at],
                   v->voxels[at], tolerance);
        bench_near(b, "fuse_blocks: weight of block, voxel", i / BLOCK_VOXELS, i % BLOCK_VOXELS,
                   (uint16_t)got[at + BLOCK_VOXELS], (uint16_t)v->voxels[at + BLOCK_VOXELS], 0);
    }
    bench_free(b);
    free(got);
    free(doubt);
}

/* Blocks in front of the camera, at the picture's edges, behind it and far away, with some history each. */
static void blocks_about(bench *b, bench_volume *v, const float *depth, const kernel_camera *c,
                         const kernel_rigid *camera_to_world) {
    double edge = v->surface.voxel * BLOCK_EDGE;
    for (int k = 0; k < v->capacity; k++) {
        int x = bench_random_int(b, -2, c->width + 1), y = bench_random_int(b, -2, c->height + 1);
        double z = bench_random(b, -0.5, 3), world[3];
        if (k % 4 && x >= 0 && y >= 0 && x < c->width && y < c->height && depth[ref_at(c, x, y)] > 0)
            z = depth[ref_at(c, x, y)] + bench_random(b, -1, 1) * v->surface.truncation;
        double p[3] = {(x - c->cx) / c->fx * z, (y - c->cy) / c->fy * z, z};
        ref_transform(camera_to_world, p, world);
        int place = bench_volume_add(v, (int)floor(world[0] / edge), (int)floor(world[1] / edge),
                                     (int)floor(world[2] / edge));
        int16_t *data = v->voxels + (size_t)place * 2 * BLOCK_VOXELS;
        for (int i = 0; i < BLOCK_VOXELS; i++) {
            int history = bench_random_int(b, 0, 3);
            data[i] = (int16_t)(history ? bench_random_int(b, -32767, 32767) : REF_NEVER_SEEN);
            data[BLOCK_VOXELS + i] = (int16_t)(history == 3 ? 6400
                                               : history    ? bench_random_int(b, 1, 6400)
                                                            : 0);
        }
    }
}

check_result check_fuse_blocks(device *d, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * IMAGE_KINDS; i++) {
        /* The kernel leaves out blocks out of view by a sphere against the frustum, which is generous by a pixel or so: a
         * picture of one pixel isn't what it's for (fathom_config takes 16 and more). */
        if (sizes[i % count].width < 16) continue;
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        float *depth = bench_depth(&b, &c, bench_noise, (image_kind)(i / count));
        float *normals = bench_plane(&c, 4, 0), *scan = bench_alloc((size_t)c.width * (size_t)c.height * 16);
        ref_normal_map(depth, &c, bench_noise, normals, NULL);
        ref_pack_map(depth, normals, &c, scan);
        pose at = bench_motion(&b, 3, 1), inverse = pose_inverse(&at);
        kernel_rigid camera_to_world = kernel_rigid_of(&at), world_to_camera = kernel_rigid_of(&inverse);
        bench_volume v;
        bench_volume_make(&v, b.small ? 12 : 200, i % 2 ? 0.01f : 0.02f, i % 2 ? 0.04f : 0.06f);
        blocks_about(&b, &v, depth, &c, &camera_to_world);
        compare_fuse_blocks(&b, scan, &c, bench_noise, &world_to_camera, &v, 100);
        bench_volume_free(&v);
        free(depth);
        free(normals);
        free(scan);
    }
    return bench_end(&b);
}
