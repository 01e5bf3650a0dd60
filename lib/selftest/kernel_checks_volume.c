#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "selftest/kernel_checks_bench.h"

/* ---- request_blocks ------------------------------------------------------------------------------------------- */

#define MOST_MET 8192 /* blocks that a tile's rays may meet: 64 of them, 16 points, all three axes in doubt */

static bool same_block(const cl_int4 *a, const cl_int4 *b) {
    return a->s[0] == b->s[0] && a->s[1] == b->s[1] && a->s[2] == b->s[2];
}

static bool listed(const cl_int4 *list, int count, const cl_int4 *block) {
    for (int i = 0; i < count; i++)
        if (same_block(&list[i], block)) return true;
    return false;
}

/* Each missing block that a tile's rays meet is requested by it or by an earlier tile of the same work-item, unless
 * slots ran out; no other block is, and none twice. */
static void compare_tile(bench *b, const cl_int4 *requests, const int *counts, int tile, int tiles_x,
                         int sharing, const cl_int4 *met, int met_count, ref_volume *v) {
    const cl_int4 *slots = requests + tile * TILE_SLOTS;
    if (counts[tile] < 0 || counts[tile] > TILE_SLOTS) {
        bench_fail(b, "request_blocks: tile %d asks for %d", tile, counts[tile]);
        return;
    }
    for (int i = 0; i < counts[tile]; i++) {
        const int *s = slots[i].s;
        const char *wrong = listed(slots, i, &slots[i])                  ? "twice"
                            : ref_volume_place(v, s[0], s[1], s[2]) >= 0 ? "though it is there"
                            : !listed(met, met_count, &slots[i])         ? "which no ray meets"
                                                                         : NULL;
        b->compared++;
        if (wrong)
            bench_fail(b, "request_blocks: tile %d asks for block %d %d %d %s", tile, s[0], s[1], s[2],
                       wrong);
    }
    bool full = false;
    for (int at = tile % tiles_x; at >= 0; at -= sharing)
        full |= counts[tile - tile % tiles_x + at] == TILE_SLOTS;
    for (int i = 0; i < met_count && !full; i++) {
        const int *s = met[i].s;
        bool asked = false;
        if (!s[3]) b->doubtful++;
        if (!s[3] || ref_volume_place(v, s[0], s[1], s[2]) >= 0) continue;
        for (int at = tile % tiles_x; at >= 0 && !asked; at -= sharing) {
            int other = tile - tile % tiles_x + at;
            asked = listed(requests + other * TILE_SLOTS, counts[other], &met[i]);
        }
        b->compared++;
        if (!asked)
            bench_fail(b, "request_blocks: nobody asks for block %d %d %d that tile %d meets", s[0], s[1],
                       s[2], tile);
    }
}

void compare_request_blocks(bench *b, const float *depth, const kernel_camera *c,
                            const kernel_rigid *camera_to_world, bench_volume *v, float block_m,
                            cl_int turn) {
    int tiles_x = (c->width + TILE - 1) / TILE, tiles_y = (c->height + TILE - 1) / TILE,
        tiles = tiles_x * tiles_y;
    size_t request_bytes = (size_t)tiles * TILE_SLOTS * sizeof(cl_int4),
           count_bytes = (size_t)tiles * sizeof(cl_int);
    cl_int4 *requests = bench_alloc(request_bytes), *met = bench_alloc(MOST_MET * sizeof *met);
    float *got_farthest = bench_alloc(count_bytes), *want_farthest = bench_alloc(count_bytes);
    int *counts = bench_alloc(count_bytes);
    memset(counts, 0xff, count_bytes);
    bench_volume_upload(b, v);
    cl_mem depth_memory = bench_buffer(b, (size_t)c->plane * 4, depth),
           requests_memory = bench_buffer(b, request_bytes, NULL),
           counts_memory = bench_buffer(b, count_bytes, counts),
           farthest = bench_buffer(b, count_bytes, NULL);
    LAUNCH_ROWS(b, "request_blocks", tiles_x, tiles_y, ARG(depth_memory), ARG(*c), ARG(*camera_to_world),
                ARG(block_m), ARG(v->surface.truncation), ARG(v->table_memory), ARG(v->surface.mask),
                ARG(v->surface.submap), ARG(requests_memory), ARG(counts_memory), ARG(farthest), ARG(turn));
    bench_read(b, requests_memory, requests, request_bytes);
    bench_read(b, counts_memory, counts, count_bytes);
    bench_read(b, farthest, got_farthest, count_bytes);
    ref_tile_farthest(depth, c, want_farthest);
    ref_volume reference;
    ref_volume_open(&reference, v->blocks, v->count, v->voxels, &v->surface);
    for (int tile = 0; tile < tiles && !b->failed; tile++) {
        bench_near(b, "request_blocks: farthest of tile", tile, 0, got_farthest[tile], want_farthest[tile],
                   0);
        int met_count =
            ref_met_blocks(depth, c, camera_to_world, block_m, v->surface.truncation, tile, met, MOST_MET);
        if (met_count < 0) bench_fail(b, "request_blocks: tile %d meets more than %d", tile, MOST_MET);
        if (turn >= 0 && tile / tiles_x % 2 != turn) { /* waits */
            bench_near(b, "request_blocks: count of tile", tile, 0, counts[tile], 0, 0);
            continue;
        }
        compare_tile(b, requests, counts, tile, tiles_x, b->d->cpu ? 1 : tiles_x, met, met_count, &reference);
    }
    ref_volume_close(&reference);
    bench_free(b);
    free(requests);
    free(met);
    free(counts);
    free(got_farthest);
    free(want_farthest);
}

fathom_check check_request_blocks(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
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
        for (int k = 0; k < 300; k++) { /* some of the blocks to be met, and some others */
            int x = bench_random_int(&b, 0, c.width - 1), y = bench_random_int(&b, 0, c.height - 1);
            double z = depth[ref_at(&c, x, y)], world[3],
                   p[3] = {(x - c.cx) / c.fx * z, (y - c.cy) / c.fy * z, z};
            ref_transform(&camera_to_world, p, world);
            if (k % 2)
                for (int a = 0; a < 3; a++) world[a] = bench_random(&b, -3, 3);
            bench_volume_add(&v, (int)floor(world[0] / block_m), (int)floor(world[1] / block_m),
                             (int)floor(world[2] / block_m));
        }
        compare_request_blocks(&b, depth, &c, &camera_to_world, &v, block_m, i % 3 - 1);
        bench_volume_free(&v);
        free(depth);
    }
    return bench_end(&b);
}

/* ---- clear_blocks, clear_ranges ---------------------------------------------------------------------------------- */

fathom_check check_clear_blocks(device *d, bool small, char *why, size_t size) {
    enum { BLOCKS = 7 };
    bench b;
    bench_start(&b, d, small, why, size);
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

fathom_check check_clear_ranges(device *d, bool small, char *why, size_t size) {
    enum { TILES = 37 };
    bench b;
    float got[2 * TILES], want[2 * TILES];
    bench_start(&b, d, small, why, size);
    for (int i = 0; i < 2 * TILES; i++) got[i] = (float)bench_random(&b, -1, 1);
    cl_mem ranges = bench_buffer(&b, sizeof got, got);
    LAUNCH(&b, "clear_ranges", TILES, 1, 0, ARG(ranges));
    bench_read(&b, ranges, got, sizeof got);
    ref_clear_ranges(TILES, want);
    bench_compare_bytes(&b, "clear_ranges", got, want, sizeof got);
    return bench_end(&b);
}

/* ---- pack_planes ------------------------------------------------------------------------------------------------- */

/* Roundings of single precision beside those of the packing: n is rounded near 8192, whose neighbours are 1e-3
 * apart. */
#define TIE_SLACK 6e-4

void compare_pack_planes(bench *b, const float *raw, const float *smooth, float from_m, const float *normals,
                         const kernel_camera *c, kernel_noise noise) {
    size_t bytes = (size_t)c->width * (size_t)c->height * sizeof(cl_uint2);
    cl_uint2 *got = bench_alloc(bytes);
    float *depth = bench_plane(c, 1, 0);
    for (int i = 0; i < c->plane; i++) depth[i] = raw[i] < from_m ? raw[i] : smooth[i];
    memset(got, 0xff, bytes);
    cl_mem raw_memory = bench_buffer(b, (size_t)c->plane * 4, raw),
           smooth_memory = bench_buffer(b, (size_t)c->plane * 4, smooth),
           normals_memory = bench_buffer(b, (size_t)c->plane * 16, normals),
           planes = bench_buffer(b, bytes, got);
    LAUNCH_ROWS(b, "pack_planes", c->width, c->height, ARG(raw_memory), ARG(smooth_memory), ARG(from_m),
                ARG(normals_memory), ARG(*c), ARG(noise), ARG(planes));
    bench_read(b, planes, got, bytes);
    double shifts = 0;
    int held = 0;
    for (int i = 0; i < c->width * c->height && !b->failed; i++) {
        int x = i % c->width, y = i / c->width;
        ref_plane want = ref_plane_of(depth, normals, c, noise, x, y), p = ref_unpack_plane(got[i]);
        if (isinf(want.w)) {
            b->compared++;
            if (!(isinf(p.w) && p.w > 0)) bench_fail(b, "pack_planes: depth at %d, %d out of nothing", x, y);
            continue;
        }
        /* half a step; a step of n's third part is 1/511.5, but 511 of them stand for 1 */
        for (int k = 0; k < 3; k++)
            bench_near(b, "pack_planes: normal", x, y, p.n[k], want.n[k],
                       k < 2 ? (0.5 + TIE_SLACK) / 1023 : (0.5 + TIE_SLACK + 0.5 * fabs(want.n[2])) / 511.5);
        /* 14 bits of w's fraction are left; the plane of the n that was packed holds the pixel's point */
        double z = depth[ref_at(c, x, y)],
               w = z * (p.n[0] * (x - (double)c->cx) / c->fx + p.n[1] * (y - (double)c->cy) / c->fy + p.n[2]);
        bench_near(b, "pack_planes: distance of the plane", x, y, p.w, w, fabs(w) / 16384 + 1e-6 * (1 + z));
        shifts += (p.w - w) / fabs(w) * 16384;
        held++;
        bool tie = fabs(want.weight - floor(want.weight) - 0.5) < TIE_SLACK + 1e-5 * want.weight;
        if (tie)
            b->doubtful++;
        else
            bench_near(b, "pack_planes: weight", x, y, p.weight, floor(want.weight + 0.5), 0);
    }
    /* truncation of w mustn't move the surface: on average less than a fifth of the last remaining bit */
    if (held >= 400) bench_near(b, "pack_planes: mean shift of planes", 0, 0, shifts / held, 0, 0.2);
    bench_free(b);
    free(depth);
    free(got);
}

fathom_check check_pack_planes(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * IMAGE_KINDS; i++) {
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        float *depth = bench_depth(&b, &c, bench_noise, (image_kind)(i / count)),
              *normals = bench_plane(&c, 4, 0), *smooth = bench_plane(&c, 1, 0);
        ref_normal_map(depth, &c, bench_noise, normals, NULL);
        ref_smooth_depth(depth, &c, bench_noise, 4, 1, 0, smooth);
        compare_pack_planes(&b, depth, smooth, 1.5f, normals, &c, bench_noise);
        free(depth);
        free(normals);
        free(smooth);
    }
    return bench_end(&b);
}

/* ---- fuse_blocks ------------------------------------------------------------------------------------------------- */

/* Blocks in view carry the frame's number; those out of view and those whose turn it wasn't don't. */
static void compare_seen(bench *b, const int *seen, int block, uint8_t in_view, int frame, bool turn) {
    if (turn && in_view == REF_DOUBTFUL)
        b->doubtful++;
    else
        bench_near(b, "fuse_blocks: the frame of block", block, 0, seen[block],
                   turn && in_view == REF_IN_VIEW ? frame : 0, 0);
}

void compare_fuse_blocks(bench *b, const float *depth, const float *normals, const kernel_camera *c,
                         kernel_noise noise, const kernel_rigid *world_to_camera, bench_volume *v,
                         float max_weight) {
    size_t bytes = (size_t)v->count * BLOCK_BYTES, seen_bytes = (size_t)v->count * sizeof(cl_int),
           plane_bytes = (size_t)c->width * (size_t)c->height * sizeof(cl_uint2);
    int voxels = v->count * BLOCK_VOXELS;
    int tiles = ((c->width + TILE - 1) / TILE) * ((c->height + TILE - 1) / TILE);
    int16_t *got = bench_alloc(bytes);
    int *seen = bench_alloc(seen_bytes);
    uint8_t *outcomes = bench_alloc((size_t)voxels), *in_view = bench_alloc((size_t)v->count);
    cl_uint2 *planes = bench_alloc(plane_bytes);
    float *farthest = bench_alloc((size_t)tiles * 4);
    cl_float voxel = v->surface.voxel, truncation = v->surface.truncation, most = max_weight;
    cl_int settled = v->count / 3, turn = v->count & 1, frame = 7;
    ref_pack_planes(depth, normals, c, noise, planes);
    ref_tile_farthest(depth, c, farthest);
    bench_volume_upload(b, v);
    cl_mem planes_memory = bench_buffer(b, plane_bytes, planes),
           farthest_memory = bench_buffer(b, (size_t)tiles * 4, farthest),
           seen_memory = bench_buffer(b, seen_bytes, NULL);
    LAUNCH_ROWS(b, "fuse_blocks", 64, v->count, ARG(planes_memory), ARG(*c), ARG(farthest_memory),
                ARG(*world_to_camera), ARG(v->surface), ARG(most), ARG(v->blocks_memory), ARG(settled),
                ARG(turn), ARG(frame), ARG(seen_memory), ARG(v->voxels_memory));
    bench_read(b, v->voxels_memory, got, bytes);
    bench_read(b, seen_memory, seen, seen_bytes);
    ref_fuse_blocks(planes, c, world_to_camera, voxel, truncation, most, v->blocks, v->count, settled, turn,
                    v->voxels, outcomes);
    ref_in_view(farthest, c, world_to_camera, &v->surface, v->blocks, v->count, in_view);
    /* A voxel's place in camera axes is known to 1e-6 m (some 5 m, a few roundings), and half a unit is rounded off. */
    double tolerance = 1.01 + 32767 * 2e-6 / truncation;
    for (int i = 0; i < voxels && !b->failed; i++) {
        int at = i / BLOCK_VOXELS * 2 * BLOCK_VOXELS + i % BLOCK_VOXELS;
        if (i % BLOCK_VOXELS == 0)
            compare_seen(b, seen, i / BLOCK_VOXELS, in_view[i / BLOCK_VOXELS], frame,
                         i / BLOCK_VOXELS >= settled || i / BLOCK_VOXELS % 2 == turn);
        if (outcomes[i] == REF_DOUBTFUL) {
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
    free(seen);
    free(outcomes);
    free(in_view);
    free(planes);
    free(farthest);
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

fathom_check check_fuse_blocks(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * IMAGE_KINDS; i++) {
        /* The kernel leaves out blocks out of view by a sphere against the frustum, which is generous by a pixel or so:
         * an image of one pixel isn't its purpose (fathom_config's minimum is 16). */
        if (sizes[i % count].width < 16) continue;
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        float *depth = bench_depth(&b, &c, bench_noise, (image_kind)(i / count));
        float *normals = bench_plane(&c, 4, 0);
        ref_normal_map(depth, &c, bench_noise, normals, NULL);
        pose at = bench_motion(&b, 3, 1), inverse = pose_inverse(&at);
        kernel_rigid camera_to_world = kernel_rigid_of(&at), world_to_camera = kernel_rigid_of(&inverse);
        bench_volume v;
        bench_volume_make(&v, b.small ? 12 : 200, i % 2 ? 0.01f : 0.02f, i % 2 ? 0.04f : 0.06f);
        blocks_about(&b, &v, depth, &c, &camera_to_world);
        compare_fuse_blocks(&b, depth, normals, &c, bench_noise, &world_to_camera, &v, 100);
        bench_volume_free(&v);
        free(depth);
        free(normals);
    }
    return bench_end(&b);
}
