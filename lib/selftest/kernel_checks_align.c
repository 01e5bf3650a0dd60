#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "selftest/kernel_checks_bench.h"

/* Relative to the magnitudes of a sum's terms before cancellation. Five roundings (6e-8 each) per term; their different
 * signs make up for the addition of some twenty terms. Measured: 1e-7 holds on PoCL, 5e-8 doesn't. */
#define SUM_TOLERANCE 3e-7

void compare_align_reduce(bench *b, const float *depth, float *normals, const kernel_camera *c,
                          const float *model, const kernel_camera *mc, const kernel_rigid *motion,
                          const kernel_pair_limits *limits) {
    int count = c->height * SUMS;
    size_t bytes = (size_t)count * sizeof(float);
    double *want = bench_alloc((size_t)count * sizeof *want),
           *magnitudes = bench_alloc((size_t)count * sizeof *want);
    uint8_t *doubt = bench_alloc((size_t)c->width * (size_t)c->height);
    float *got = bench_alloc(bytes);
    memset(got, 0xff, bytes);
    float *packed = bench_alloc((size_t)mc->width * (size_t)mc->height * 16);
    memcpy(packed, model, (size_t)mc->width * (size_t)mc->height * 16);
    cl_mem model_memory = bench_model(b, mc->width * mc->height, packed);
    ref_align_reduce(depth, normals, c, packed, mc, motion, limits, want, magnitudes, doubt);
    for (int i = 0; i < c->width * c->height; i++) {
        int at = 3 * c->plane + ref_at(c, i % c->width, i / c->width);
        if (doubt[i]) normals[at] = 0;
        *(doubt[i] ? &b->doubtful : &b->compared) += 1;
    }
    ref_align_reduce(depth, normals, c, packed, mc, motion, limits, want, magnitudes, NULL);
    cl_mem depth_memory = bench_buffer(b, (size_t)c->plane * 4, depth),
           normals_memory = bench_buffer(b, (size_t)c->plane * 16, normals),
           sums_memory = bench_buffer(b, bytes, got);
    LAUNCH(b, "align_reduce", (size_t)b->d->group, (size_t)c->height, (size_t)b->d->group, ARG(depth_memory),
           ARG(normals_memory), ARG(*c), ARG(model_memory), ARG(*mc), ARG(*motion), ARG(*limits),
           ARG(sums_memory));
    bench_read(b, sums_memory, got, bytes);
    /* The pairs n and the overlap are counts: magnitude 0, so exact. */
    for (int i = 0; i < count && !b->failed; i++)
        bench_near(b, "align_reduce: sum, row", i % SUMS, i / SUMS, got[i], want[i],
                   SUM_TOLERANCE * magnitudes[i]);
    bench_free(b);
    free(packed);
    free(want);
    free(magnitudes);
    free(doubt);
    free(got);
}

/* A scan, and a similar model. */
typedef struct {
    kernel_camera c;
    float *depth, *normals, *model;
} scan;

static scan make_scan(bench *b, image_size size, image_kind kind) {
    scan s = {.c = bench_camera(b, size.width, size.height)};
    float *other = bench_plane(&s.c, 1, 0), *other_normals = bench_plane(&s.c, 4, 0);
    s.depth = bench_depth(b, &s.c, bench_noise, kind);
    s.normals = bench_plane(&s.c, 4, 0);
    s.model = bench_alloc((size_t)s.c.width * (size_t)s.c.height * 16);
    ref_normal_map(s.depth, &s.c, bench_noise, s.normals, NULL);
    for (int i = 0; i < s.c.plane; i++) other[i] = s.depth[i] * (float)bench_random(b, 0.998, 1.004);
    ref_normal_map(other, &s.c, bench_noise, other_normals, NULL);
    ref_pack_map(other, other_normals, &s.c, s.model);
    free(other);
    free(other_normals);
    return s;
}

static void free_scan(scan *s) {
    free(s->depth);
    free(s->normals);
    free(s->model);
}

static kernel_pair_limits random_limits(bench *b) {
    kernel_pair_limits l = {0.01f, 0.76f, 0.005f, {{0, 0, 1.5f, 0}}};
    for (int i = 0; i < 3; i++) l.centre.s[i] += (float)bench_random(b, -0.5, 0.5);
    return l;
}

fathom_check check_align_reduce(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * IMAGE_KINDS * 4; i++) {
        static const double motions[4][2] = {{0.01, 0.01}, {0.2, 0.1}, {3, 0.5}, {0.05, 5}};
        const double *m = motions[i / count / IMAGE_KINDS];
        scan s = make_scan(&b, sizes[i % count], (image_kind)(i / count % IMAGE_KINDS));
        pose moved = bench_motion(&b, m[0], m[1]);
        kernel_rigid motion = kernel_rigid_of(&moved);
        kernel_pair_limits limits = random_limits(&b);
        compare_align_reduce(&b, s.depth, s.normals, &s.c, s.model, &s.c, &motion, &limits);
        free_scan(&s);
    }
    return bench_end(&b);
}

/* Values outside of pairs may be anything, and must not enter the sums. */
fathom_check check_align_not_finite(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * 3; i++) {
        scan s = make_scan(&b, sizes[i % count], IMAGE_SURFACES);
        pose moved = bench_motion(&b, 0.02, 0.02);
        kernel_rigid motion = kernel_rigid_of(&moved);
        kernel_pair_limits limits = random_limits(&b);
        const float junk[3] = {NAN, INFINITY, -3e38f};
        for (int k = 0; k < s.c.width * s.c.height; k++) {
            int at = ref_at(&s.c, k % s.c.width, k / s.c.width);
            if (bench_random_int(&b, 0, 9) == 0) s.normals[3 * s.c.plane + at] = 0;
            if (s.normals[3 * s.c.plane + at] == 0) {
                s.depth[at] = junk[i / count];
                for (int axis = 0; axis < 3; axis++) s.normals[axis * s.c.plane + at] = junk[i / count];
            }
            float *m = s.model + 4 * k;
            if (bench_random_int(&b, 0, 9) == 0) m[3] = k % 2 ? 0 : -1;
            if (m[3] <= 0)
                for (int axis = 0; axis < 3; axis++) m[axis] = junk[i / count];
            else if (bench_random_int(&b, 0, 9) == 0)
                m[0] = NAN; /* has no angle with anything */
        }
        compare_align_reduce(&b, s.depth, s.normals, &s.c, s.model, &s.c, &motion, &limits);
        free_scan(&s);
    }
    return bench_end(&b);
}
