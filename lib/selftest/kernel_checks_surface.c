#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "map/mesh.h"
#include "selftest/kernel_checks_bench.h"

static int tiles_of(const kernel_camera *c) {
    return ((c->width + TILE - 1) / TILE) * ((c->height + TILE - 1) / TILE);
}

/* ---- ranges ---------------------------------------------------------------------------------------------------- */

/* Queues clear_ranges and range_blocks for a volume that has been uploaded. */
static cl_mem make_ranges(bench *b, bench_volume *v, const kernel_camera *c,
                          const kernel_rigid *world_to_camera, float near_m, float far_m) {
    cl_mem ranges = bench_buffer(b, (size_t)tiles_of(c) * 2 * sizeof(float), NULL);
    LAUNCH(b, "clear_ranges", (size_t)tiles_of(c), 1, 0, ARG(ranges));
    LAUNCH(b, "range_blocks", (size_t)v->count, 1, 1, ARG(v->blocks_memory), ARG(v->surface), ARG(*c),
           ARG(*world_to_camera), ARG(near_m), ARG(far_m), ARG(ranges));
    return ranges;
}

/* Equal, or between the range without those blocks that are in doubt and the range with them. */
static void compare_range(bench *b, const char *what, int tile, float got, float sure, float widest) {
    b->compared++;
    if (got == sure || got == widest) return; /* infinite, too */
    double low = fmin(sure, widest), high = fmax(sure, widest), slack = 2e-6 * (1 + fabs(low));
    if (!(got >= low - slack && got <= high + slack))
        bench_fail(b, "range_blocks: %s of tile %d: %.9g where the reference has %.9g to %.9g", what, tile,
                   got, low, high);
}

void compare_ranges(bench *b, bench_volume *v, const kernel_camera *c, const kernel_rigid *world_to_camera,
                    float near_m, float far_m) {
    size_t bytes = (size_t)tiles_of(c) * 2 * sizeof(float);
    float *got = bench_alloc(bytes), *sure = bench_alloc(bytes), *widest = bench_alloc(bytes);
    bench_volume_upload(b, v);
    bench_read(b, make_ranges(b, v, c, world_to_camera, near_m, far_m), got, bytes);
    ref_clear_ranges(tiles_of(c), sure);
    ref_clear_ranges(tiles_of(c), widest);
    ref_range_blocks(v->blocks, v->count, c, world_to_camera, v->surface.voxel, near_m, far_m, sure, widest);
    for (int i = 0; i < tiles_of(c) && !b->failed; i++) {
        compare_range(b, "near", i, got[2 * i], sure[2 * i], widest[2 * i]);
        compare_range(b, "far", i, got[2 * i + 1], sure[2 * i + 1], widest[2 * i + 1]);
    }
    bench_free(b);
    free(got);
    free(sure);
    free(widest);
}

fathom_check check_range_blocks(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * 4; i++) {
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        pose at = bench_motion(&b, 3, 1), inverse = pose_inverse(&at);
        kernel_rigid world_to_camera = kernel_rigid_of(&inverse);
        bench_volume v;
        bench_volume_make(&v, 64, 0.01f, 0.04f);
        /* about the camera on all sides, also across its plane */
        for (int k = 0; k < 1 + 20 * (i / count); k++)
            bench_volume_add(&v, bench_random_int(&b, -20, 20), bench_random_int(&b, -20, 20),
                             bench_random_int(&b, -20, 20));
        compare_ranges(&b, &v, &c, &world_to_camera, 0.3f, 1.2f);
        bench_volume_free(&v);
    }
    return bench_end(&b);
}

/* ---- raycast ----------------------------------------------------------------------------------------------------- */

/* Surface or not is certain where a pixel's neighbours agree with it and the ray isn't grazing; elsewhere the outcome
 * depends on the positions of a ray's samples. 1: a surface, 0: none, -1: not sure. */
static int sure_surface(const float *model, const kernel_camera *c, int x, int y, double voxel) {
    const float *m = model + 4 * (y * c->width + x);
    for (int k = 0; k < 9; k++) {
        int nx = x + k % 3 - 1, ny = y + k / 3 - 1;
        if (nx < 0 || ny < 0 || nx >= c->width || ny >= c->height) continue;
        const float *n = model + 4 * (ny * c->width + nx);
        if ((n[3] > 0) != (m[3] > 0) || fabs(n[3] - m[3]) > 6 * voxel) return -1;
    }
    if (m[3] == 0) return 0;
    double u = (x - c->cx) / c->fx, v = (y - c->cy) / c->fy;
    return -(m[0] * u + m[1] * v + m[2]) / sqrt(u * u + v * v + 1) > 0.3 ? 1 : -1;
}

/* A ray's crossing is found by interpolation between samples most of a voxel apart: to a twentieth of a voxel. The
 * shape itself is sampled at voxels and stored to 1/32767: another twentieth where it bends. */
#define HIT_TOLERANCE 0.05

/* Distance of a hit from the true shape, in voxels. */
static double off_truth(const bench_volume *v, const kernel_camera *c, const kernel_rigid *to_world, int x,
                        int y, double z, bench_shape truth) {
    double world[3], p[3] = {(x - c->cx) / c->fx * z, (y - c->cy) / c->fy * z, z};
    ref_transform(to_world, p, world);
    return fabs(truth(world)) / v->surface.voxel;
}

/* Runs the kernel, and the reference; doubt: a byte per pixel. */
static void cast(bench *b, bench_volume *v, const bench_view *view, float *got, float *want, float *full,
                 uint8_t *doubt) {
    const kernel_camera *c = &view->c;
    size_t bytes = (size_t)c->width * (size_t)c->height * 16;
    pose inverse = pose_inverse(&view->camera_to_world);
    kernel_rigid to_world = kernel_rigid_of(&view->camera_to_world), to_camera = kernel_rigid_of(&inverse);
    bench_volume_upload(b, v);
    cl_mem model = bench_model(b, c->width * c->height, NULL);
    if (view->scan) {
        cl_mem scan = bench_buffer(b, (size_t)c->plane * 4, view->scan);
        size_t strips = (size_t)((c->width + b->d->lanes - 1) / b->d->lanes);
        cl_int marched = 1;
        LAUNCH(b, "raycast_near", strips, (size_t)c->height, b->d->cpu ? 1 : 0, ARG(v->voxels_memory),
               ARG(v->table_memory), ARG(v->surface), ARG(*c), ARG(to_world), ARG(scan), ARG(view->reach),
               ARG(marched), ARG(model));
    } else {
        cl_mem ranges = make_ranges(b, v, c, &to_camera, view->near_m, view->far_m);
        LAUNCH(b, "raycast", (size_t)c->width, (size_t)c->height, 0, ARG(v->voxels_memory),
               ARG(v->table_memory), ARG(v->surface), ARG(*c), ARG(to_world), ARG(ranges), ARG(model));
    }
    bench_read_model(b, model, c->width * c->height, got);
    bench_free(b);

    ref_volume reference;
    ref_volume_open(&reference, v->blocks, v->count, v->voxels, &v->surface);
    ref_raycast(&reference, c, &to_world, view->near_m, view->far_m, full);
    if (view->scan)
        ref_raycast_near(&reference, c, &to_world, view->scan, view->reach, v->surface.voxel / 2, want,
                         doubt);
    else
        memcpy(want, full, bytes);
    ref_volume_close(&reference);
}

void compare_raycast(bench *b, bench_volume *v, const bench_view *view) {
    const kernel_camera *c = &view->c;
    size_t bytes = (size_t)c->width * (size_t)c->height * 16;
    kernel_rigid to_world = kernel_rigid_of(&view->camera_to_world);
    float *got = bench_alloc(bytes), *want = bench_alloc(bytes), *full = bench_alloc(bytes);
    uint8_t *doubt = bench_alloc(bytes / 16);
    cast(b, v, view, got, want, full, doubt);
    const char *name = view->scan ? "raycast_near" : "raycast";
    int sure = 0, wrong = 0, hits = 0;
    char first[160] = "";
    for (int i = 0; i < c->width * c->height; i++) {
        int x = i % c->width, y = i / c->width;
        const float *g = got + 4 * i, *w = want + 4 * i;
        /* everywhere: nothing at all, or a unit normal towards the camera */
        double length = sqrt((double)g[0] * g[0] + (double)g[1] * g[1] + (double)g[2] * g[2]);
        bool hit = g[3] > 0, surface = w[3] > 0;
        if (!bench_near(b, "raycast: length of the normal", x, y, length, hit, 1.5 * REF_NORMAL_STEP)) break;
        bool blank = view->scan && view->scan[ref_at(c, x, y)] == 0;
        if (doubt[i] || (!blank && sure_surface(full, c, x, y, v->surface.voxel) < 0)) continue;
        sure++;
        double miss = hit && surface ? fabs(g[3] - w[3]) / v->surface.voxel : 0;
        double off = hit && view->truth ? off_truth(v, c, &to_world, x, y, g[3], view->truth) : 0;
        double cosine = hit && surface ? (double)g[0] * w[0] + (double)g[1] * w[1] + (double)g[2] * w[2] : 1;
        /* in depth, a ray that meets the surface at a slant (a cosine above 0.3) magnifies it */
        bool bad = hit != surface || miss > HIT_TOLERANCE / 0.3 ||
                   (view->truth && (off > 2 * HIT_TOLERANCE || cosine < 0.99));
        if (bad && !wrong++)
            snprintf(first, sizeof first,
                     "%d, %d: depth %.6f where the reference has %.6f, cosine of the normals %.4f", x, y,
                     g[3], w[3], cosine);
        hits += hit;
    }
    b->compared += sure;
    if (wrong > view->allowed * sure)
        bench_fail(b, "%s: %d of %d pixels differ; the first at %s", name, wrong, sure, first);
    if (view->truth && !view->scan && hits < sure / 4)
        bench_fail(b, "%s: only %d of %d pixels see a surface", name, hits, sure);
    free(got);
    free(want);
    free(full);
    free(doubt);
}

/* What a camera would measure of the volume, with errors of up to 6 cm, holes, and a place that the surface is far
 * from. */
static float *scan_of(bench *b, bench_volume *v, const bench_view *view) {
    const kernel_camera *c = &view->c;
    float *scan = bench_plane(c, 1, 0), *full = bench_alloc((size_t)c->width * (size_t)c->height * 16);
    kernel_rigid to_world = kernel_rigid_of(&view->camera_to_world);
    ref_volume reference;
    ref_volume_open(&reference, v->blocks, v->count, v->voxels, &v->surface);
    ref_raycast(&reference, c, &to_world, view->near_m, view->far_m, full);
    ref_volume_close(&reference);
    for (int i = 0; i < c->width * c->height; i++) {
        int x = i % c->width, y = i / c->width;
        double z = full[4 * i + 3] > 0 ? full[4 * i + 3] + bench_random(b, -0.06, 0.06) : 1;
        if (x > 3 * c->width / 4 && y > c->height / 2) z = 0.6;
        scan[ref_at(c, x, y)] = bench_random_int(b, 0, 9) ? (float)z : 0;
    }
    free(full);
    return scan;
}

static fathom_check raycasts(device *d, bool small, char *why, size_t size, bool near_scan) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    bench_shape ball = b.small ? bench_ball_shifted : bench_ball;
    /* so wide that its rim isn't in view: there, too, the outcome depends on the samples' positions */
    const double low[3] = {b.shift - 1.3, b.shift - 1.3, b.shift + 0.5},
                 high[3] = {b.shift + 1.3, b.shift + 1.3, b.shift + 1.5};
    bench_volume v, none, front; /* all seen; empty; only voxels in front of the surface seen */
    float voxel = b.small ? 0.02f : 0.01f, truncation = 4 * voxel;
    bench_volume_make(&v, 6000, voxel, truncation);
    bench_volume_make(&none, 1, voxel, truncation);
    bench_volume_make(&front, 6000, voxel, truncation);
    bench_volume_fill(&v, ball, low, high);
    bench_volume_fill(&front, ball, low, high);
    for (int i = 0; i < front.count * BLOCK_VOXELS; i++) {
        int16_t *data = front.voxels + i / BLOCK_VOXELS * 2 * BLOCK_VOXELS + i % BLOCK_VOXELS;
        if (*data > 0) continue;
        *data = REF_NEVER_SEEN;
        data[BLOCK_VOXELS] = 0;
    }
    bench_volume *volumes[4] = {&v, &v, &none, &front};
    for (int i = 0; i < count * 4; i++) {
        bench_view view = {.c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height)};
        int kind = i / count;
        if (kind >= 2 && i % count > 4) continue; /* nothing to be seen: some sizes are enough */
        view.camera_to_world = bench_motion(&b, 0.1, 0.1);
        view.near_m = 0.1f;
        view.far_m = 3;
        view.reach = (i % 2 ? 10 : 3) * voxel; /* more than a truncation, and less */
        for (int k = 0; k < 3; k++) view.camera_to_world.t[k] += b.shift;
        if (kind == 1)
            view.camera_to_world.t[2] += 0.9; /* within the ball, whose back side isn't seen: the wall is */
        if (kind < 2 && view.c.height > 3) view.truth = ball;
        float *scan = near_scan ? scan_of(&b, &v, &view) : NULL;
        view.scan = scan;
        compare_raycast(&b, volumes[kind], &view);
        free(scan);
    }
    bench_volume_free(&v);
    bench_volume_free(&none);
    bench_volume_free(&front);
    return bench_end(&b);
}

fathom_check check_raycast(device *d, bool small, char *why, size_t size) {
    return raycasts(d, small, why, size, false);
}

fathom_check check_raycast_near(device *d, bool small, char *why, size_t size) {
    return raycasts(d, small, why, size, true);
}

/* ---- triangles --------------------------------------------------------------------------------------------------- */

void compare_triangles(bench *b, bench_volume *v, float min_weight, bool emit) {
    kernel_surface f = v->surface;
    f.min_weight = min_weight;
    uint8_t cases[256 * 16];
    mesh_cases(cases);
    ref_volume reference;
    ref_volume_open(&reference, v->blocks, v->count, v->voxels, &f);
    bench_volume_upload(b, v);
    cl_int first = v->count / 3; /* a batch that doesn't start at the first block */
    size_t blocks = (size_t)(v->count - first), count_bytes = blocks * sizeof(cl_int);
    int *got = bench_alloc(count_bytes), *want = bench_alloc(count_bytes),
        *offsets = bench_alloc(count_bytes), sum = 0;
    cl_mem table = bench_buffer(b, sizeof cases, cases), counts = bench_buffer(b, count_bytes, NULL);
    LAUNCH(b, "count_triangles", blocks, 1, 1, ARG(v->voxels_memory), ARG(v->table_memory), ARG(f),
           ARG(v->blocks_memory), ARG(table), ARG(first), ARG(counts));
    bench_read(b, counts, got, count_bytes);
    ref_count_triangles(&reference, cases, first, (int)blocks, want);
    for (size_t i = 0; i < blocks; i++) {
        bench_near(b, "count_triangles: block", (int)i, 0, got[i], want[i], 0);
        offsets[i] = sum;
        sum += want[i];
    }
    size_t bytes = (size_t)sum * 18 * sizeof(float);
    if (emit && sum > 0 && !b->failed) {
        float *vertices = bench_alloc(bytes), *expected = bench_alloc(bytes);
        memset(vertices, 0xff, bytes);
        cl_mem start = bench_buffer(b, count_bytes, offsets), out = bench_buffer(b, bytes, vertices);
        LAUNCH(b, "emit_triangles", blocks, 1, 1, ARG(v->voxels_memory), ARG(v->table_memory), ARG(f),
               ARG(v->blocks_memory), ARG(table), ARG(first), ARG(start), ARG(out));
        bench_read(b, out, vertices, bytes);
        ref_emit_triangles(&reference, cases, first, (int)blocks, expected);
        for (int i = 0; i < sum * 18 && !b->failed; i++) {
            bool position = i % 6 < 3;
            /* A corner: a coordinate of up to 5 m, three roundings. A normal: differences of stored distances, exact
             * but for their mean along the edge; the shortest that counts as one is 1e-6 long (1e-12 squared). */
            bench_near(b,
                       position ? "emit_triangles: position of triangle, number"
                                : "emit_triangles: normal of triangle, number",
                       i / 18, i % 18, vertices[i], expected[i], position ? 1e-6 : 2e-4);
        }
        free(vertices);
        free(expected);
    }
    ref_volume_close(&reference);
    bench_free(b);
    free(got);
    free(want);
    free(offsets);
}

static fathom_check triangles(device *d, bool small, char *why, size_t size, bool emit) {
    bench b;
    bench_start(&b, d, small, why, size);
    for (int i = 0; i < 4; i++) { /* a smooth surface; anything, with holes, twice; nothing */
        const double low[3] = {-0.3, -0.3, 0.6}, high[3] = {0.3, 0.3, 1.5};
        bench_volume v;
        bench_volume_make(&v, 2000, b.small ? 0.04f : 0.02f, b.small ? 0.08f : 0.04f);
        if (i == 0) bench_volume_fill(&v, bench_ball, low, high);
        for (int k = 0; k < (b.small ? 4 : 40) && (i == 1 || i == 2); k++) {
            int16_t *data = v.voxels + (size_t)bench_volume_add(&v, bench_random_int(&b, -2, 2),
                                                                bench_random_int(&b, -2, 2),
                                                                bench_random_int(&b, -2, 2)) *
                                           2 * BLOCK_VOXELS;
            for (int j = 0; j < BLOCK_VOXELS; j++) {
                bool seen = bench_random_int(&b, 0, 30);
                data[j] = (int16_t)(seen ? bench_random_int(&b, -32767, 32767) : REF_NEVER_SEEN);
                data[BLOCK_VOXELS + j] = (int16_t)(seen ? bench_random_int(&b, 1, 6400) : 0);
            }
        }
        if (i == 3) bench_volume_add(&v, 0, 0, 0);
        compare_triangles(&b, &v, i == 1 ? 127.5f : 0, emit);
        bench_volume_free(&v);
    }
    return bench_end(&b);
}

fathom_check check_count_triangles(device *d, bool small, char *why, size_t size) {
    return triangles(d, small, why, size, false);
}

fathom_check check_emit_triangles(device *d, bool small, char *why, size_t size) {
    return triangles(d, small, why, size, true);
}
