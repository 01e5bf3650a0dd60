#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "selftest/kernel_checks_bench.h"

#define UNWRITTEN 9.0f /* initial value of output pixels */
/* Four or five operations in single precision (6e-8 each). */
#define DEPTH_TOLERANCE 1e-6

static size_t plane_bytes(const kernel_camera *c) {
    return (size_t)c->plane * sizeof(float);
}

static size_t pixels(const kernel_camera *c) {
    return (size_t)c->width * (size_t)c->height;
}

static kernel_camera halved(const kernel_camera *f) {
    return kernel_camera_of(f->width / 2, f->height / 2, f->fx / 2, f->fy / 2, (f->cx - 0.5f) / 2,
                            (f->cy - 0.5f) / 2);
}

/* ---- convert_depth --------------------------------------------------------------------------------------------- */

void compare_convert_depth(bench *b, const uint16_t *raw, const kernel_depth_source *s,
                           const kernel_camera *c, kernel_noise noise) {
    float *got = bench_plane(c, 1, UNWRITTEN), *want = bench_plane(c, 1, 0);
    uint8_t *doubt = bench_alloc(pixels(c));
    cl_mem in = bench_buffer(b, (size_t)s->width * (size_t)s->height * sizeof *raw, raw);
    cl_mem out = bench_buffer(b, plane_bytes(c), got);
    LAUNCH_ROWS(b, "convert_depth", (c->width + 7) / 8, c->height, ARG(in), ARG(*s), ARG(*c), ARG(noise),
                ARG(out));
    bench_read(b, out, got, plane_bytes(c));
    ref_convert_depth(raw, s, c, noise, want, doubt);
    bench_compare_plane(b, "convert_depth", c, got, want, doubt, DEPTH_TOLERANCE, 0);
    bench_free(b);
    free(got);
    free(want);
    free(doubt);
}

/* A frame whose every pixel is one of a few: surfaces a little apart, both invalid values, and the limits of the range
 * with their neighbours. */
static uint16_t *random_frame(bench *b, const kernel_depth_source *s, bool limits) {
    uint16_t *raw = bench_alloc((size_t)s->width * (size_t)s->height * sizeof *raw);
    int base = bench_random_int(b, 500, 4000), low = (int)lrint(s->min_m / s->metres_per_unit),
        high = (int)lrint(s->max_m / s->metres_per_unit);
    for (int i = 0; i < s->width * s->height; i++) {
        int choice = bench_random_int(b, 0, 9);
        if (limits && choice < 5)
            raw[i] = (uint16_t)((choice < 2 ? low : high) + bench_random_int(b, -1, 1));
        else
            raw[i] = (uint16_t)(choice == 5 ? 0 : choice == 6 ? 65535 : base + bench_random_int(b, -60, 60));
    }
    return raw;
}

fathom_check check_convert_depth(device *d, bool small, char *why, size_t size) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * 20; i++) {
        int factor = 1 + i / count % 4, kind = i / count / 4; /* plain, limits, distorted, empty, rational */
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        kernel_depth_source s = {.fx = c.fx * (float)factor,
                                 .fy = c.fy * (float)factor,
                                 .cx = c.cx * (float)factor + 0.5f * (float)(factor - 1),
                                 .cy = c.cy * (float)factor + 0.5f * (float)(factor - 1),
                                 .width = c.width * factor,
                                 .height = c.height * factor,
                                 .factor = factor,
                                 .metres_per_unit = factor % 2 ? 0.001f : 0.0002f,
                                 .min_m = 0.3f,
                                 .max_m = kind == 1 ? 5 : 100};
        if (kind == 2) { /* a Kinect's, and then one so strong that corners leave the image */
            const float k[2][5] = {{-0.26f, 0.75f, -0.0009f, 0.0023f, -0.7f},
                                   {0.9f, 0.4f, 0.02f, -0.03f, 0.2f}};
            const float *q = k[factor % 2];
            s.k1 = q[0];
            s.k2 = q[1];
            s.p1 = q[2];
            s.p2 = q[3];
            s.k3 = q[4];
            s.lens = FATHOM_LENS_FIVE;
        }
        if (kind == 4) { /* a wide lens as calibrations give them */
            const float k[8] = {0.52f, -2.71f, 0.0005f, -0.0002f, 1.49f, 0.40f, -2.53f, 1.42f};
            float *const to[8] = {&s.k1, &s.k2, &s.p1, &s.p2, &s.k3, &s.k4, &s.k5, &s.k6};
            for (int j = 0; j < 8; j++) *to[j] = factor % 2 ? k[j] : 0.5f * k[j];
            s.lens = FATHOM_LENS_RATIONAL;
        }
        uint16_t *raw = random_frame(&b, &s, kind == 1);
        if (kind == 3) memset(raw, factor % 2 ? 0 : 0xff, (size_t)s.width * (size_t)s.height * sizeof *raw);
        compare_convert_depth(&b, raw, &s, &c, bench_noise);
        free(raw);
    }
    return bench_end(&b);
}

/* ---- smooth_depth, halve_depth ----------------------------------------------------------------------------------- */

void compare_smooth_depth(bench *b, const float *depth, const kernel_camera *c, kernel_noise noise, int step,
                          float from_m) {
    float *got = bench_plane(c, 1, UNWRITTEN), *want = bench_plane(c, 1, 0);
    cl_float reach = 4;
    cl_mem in = bench_buffer(b, plane_bytes(c), depth), out = bench_buffer(b, plane_bytes(c), got);
    LAUNCH_ROWS(b, "smooth_depth", c->width, c->height, ARG(in), ARG(*c), ARG(noise), ARG(reach), ARG(step),
                ARG(from_m), ARG(out));
    bench_read(b, out, got, plane_bytes(c));
    ref_smooth_depth(depth, c, noise, reach, step, from_m, want);
    /* 25 terms, all positive. A weight's own error is at most that of e, which shifts the mean by less than one part in
     * 1e6 of the depth: |v - z| <= 4 sigma, and e is known to 1e-6 z / sigma. */
    bench_compare_plane(b, "smooth_depth", c, got, want, NULL, 6e-6, 0);
    bench_free(b);
    free(got);
    free(want);
}

void compare_halve_depth(bench *b, const float *fine, const kernel_camera *f, kernel_noise noise) {
    kernel_camera c = halved(f);
    if (c.width == 0 || c.height == 0) return;
    float *got = bench_plane(&c, 1, UNWRITTEN), *want = bench_plane(&c, 1, 0);
    uint8_t *doubt = bench_alloc(pixels(&c));
    cl_mem in = bench_buffer(b, plane_bytes(f), fine), out = bench_buffer(b, plane_bytes(&c), got);
    LAUNCH_ROWS(b, "halve_depth", c.width, c.height, ARG(in), ARG(*f), ARG(c), ARG(noise), ARG(out));
    bench_read(b, out, got, plane_bytes(&c));
    ref_halve_depth(fine, f, &c, noise, want, doubt);
    bench_compare_plane(b, "halve_depth", &c, got, want, doubt, DEPTH_TOLERANCE, 0);
    bench_free(b);
    free(got);
    free(want);
    free(doubt);
}

/* ---- normal_map -------------------------------------------------------------------------------------------------- */

void compare_normal_map(bench *b, const float *depth, const kernel_camera *c, kernel_noise noise) {
    float *got = bench_plane(c, 4, UNWRITTEN), *want = bench_plane(c, 4, 0);
    uint8_t *doubt = bench_alloc(pixels(c));
    cl_mem in = bench_buffer(b, plane_bytes(c), depth), out = bench_buffer(b, 4 * plane_bytes(c), got);
    LAUNCH_ROWS(b, "normal_map", c->width, c->height, ARG(in), ARG(*c), ARG(noise), ARG(out));
    bench_read(b, out, got, 4 * plane_bytes(c));
    ref_normal_map(depth, c, noise, want, doubt);
    static const char *const names[4] = {"normal_map nx", "normal_map ny", "normal_map nz",
                                         "normal_map confidence"};
    for (int i = 0; i < 4; i++)
        /* A normal: the longest of its parts cancels at most from 30 times its size (a slope beyond 75 degrees isn't
         * taken). Confidence: the bend is a difference of depths known to 1e-7 z, and is counted in sigmas, of which
         * there are 3000 in z at the worst. */
        bench_compare_plane(b, names[i], c, got + i * c->plane, want + i * c->plane, doubt, i < 3 ? 0 : 2e-3,
                            i < 3 ? 2e-5 : 1e-9);
    for (int i = 0; i < c->width * c->height && !b->failed; i++) { /* of unit length, or nothing at all */
        const float *n = got + ref_at(c, i % c->width, i / c->width);
        double length = sqrt((double)n[0] * n[0] + (double)n[c->plane] * n[c->plane] +
                             (double)n[2 * c->plane] * n[2 * c->plane]);
        bench_near(b, "normal_map length", i % c->width, i / c->width, length, n[3 * c->plane] > 0, 1e-5);
    }
    bench_free(b);
    free(got);
    free(want);
    free(doubt);
}

/* ---- pack_map, halve_map ----------------------------------------------------------------------------------------- */

void compare_pack_map(bench *b, const float *depth, const float *normals, const kernel_camera *c) {
    int count = c->width * c->height;
    float *got = bench_alloc((size_t)count * 16), *want = bench_alloc((size_t)count * 16);
    cl_mem in = bench_buffer(b, plane_bytes(c), depth),
           in_normals = bench_buffer(b, 4 * plane_bytes(c), normals);
    cl_mem out = bench_model(b, count, NULL);
    LAUNCH(b, "pack_map", (size_t)c->width, (size_t)c->height, 0, ARG(in), ARG(in_normals), ARG(*c),
           ARG(out));
    bench_read_model(b, out, count, got);
    ref_pack_map(depth, normals, c, want);
    for (int i = 0; i < 4 * count && !b->failed; i++)
        bench_near(b, i % 4 < 3 ? "pack_map normal" : "pack_map depth", i / 4 % c->width, i / 4 / c->width,
                   got[i], want[i],
                   i % 4 < 3 && want[i] != 0 ? 1.001 * REF_NORMAL_STEP / (i % 4 < 2 ? 2 : 1) : 0);
    bench_free(b);
    free(got);
    free(want);
}

void compare_halve_map(bench *b, const float *fine, const kernel_camera *f) {
    kernel_camera c = halved(f);
    if (c.width == 0 || c.height == 0) return;
    int count = c.width * c.height;
    float *got = bench_alloc((size_t)count * 16), *want = bench_alloc((size_t)count * 16);
    float *packed = bench_alloc(pixels(f) * 16);
    uint8_t *doubt = bench_alloc(pixels(&c));
    memcpy(packed, fine, pixels(f) * 16);
    cl_mem in = bench_model(b, f->width * f->height, packed), out = bench_model(b, count, NULL);
    LAUNCH(b, "halve_map", (size_t)c.width, (size_t)c.height, 0, ARG(in), ARG(*f), ARG(c), ARG(out));
    bench_read_model(b, out, count, got);
    ref_halve_map(packed, f, &c, want, doubt);
    for (int i = 0; i < count * 4 && !b->failed; i++) {
        int at = i / 4;
        if (doubt[at])
            b->doubtful++;
        else
            bench_near(b, i % 4 < 3 ? "halve_map normal" : "halve_map depth", at % c.width, at / c.width,
                       got[i], want[i],
                       i % 4 < 3 ? 1.01 * REF_NORMAL_STEP / (i % 4 < 2 ? 2 : 1) : DEPTH_TOLERANCE * want[i]);
    }
    bench_free(b);
    free(got);
    free(want);
    free(packed);
    free(doubt);
}

/* ---- checks ------------------------------------------------------------------------------------------------------ */

/* Runs the function on images of every kind and size. */
static fathom_check on_images(device *d, bool small, char *why, size_t size,
                              void (*run)(bench *b, float *depth, kernel_camera *c)) {
    bench b;
    const image_size *sizes;
    bench_start(&b, d, small, why, size);
    int count = bench_sizes(&b, &sizes);
    for (int i = 0; i < count * IMAGE_KINDS; i++) {
        kernel_camera c = bench_camera(&b, sizes[i % count].width, sizes[i % count].height);
        float *depth = bench_depth(&b, &c, bench_noise, (image_kind)(i / count));
        run(&b, depth, &c);
        free(depth);
    }
    return bench_end(&b);
}

static void run_smooth(bench *b, float *depth, kernel_camera *c) {
    compare_smooth_depth(b, depth, c, bench_noise, 1, 1e-6f);
    compare_smooth_depth(b, depth, c, bench_noise, 2, 1.5f);
}

static void run_halve(bench *b, float *depth, kernel_camera *c) {
    compare_halve_depth(b, depth, c, bench_noise);
}

static void run_normal(bench *b, float *depth, kernel_camera *c) {
    compare_normal_map(b, depth, c, bench_noise);
}

static void run_pack(bench *b, float *depth, kernel_camera *c) {
    float *normals = bench_plane(c, 4, 0);
    ref_normal_map(depth, c, bench_noise, normals, NULL);
    compare_pack_map(b, depth, normals, c);
    free(normals);
}

static void run_halve_map(bench *b, float *depth, kernel_camera *c) {
    float *normals = bench_plane(c, 4, 0), *model = bench_alloc(pixels(c) * 16);
    ref_normal_map(depth, c, bench_noise, normals, NULL);
    ref_pack_map(depth, normals, c, model);
    compare_halve_map(b, model, c);
    free(normals);
    free(model);
}

fathom_check check_smooth_depth(device *d, bool small, char *why, size_t size) {
    return on_images(d, small, why, size, run_smooth);
}

fathom_check check_halve_depth(device *d, bool small, char *why, size_t size) {
    return on_images(d, small, why, size, run_halve);
}

fathom_check check_normal_map(device *d, bool small, char *why, size_t size) {
    return on_images(d, small, why, size, run_normal);
}

fathom_check check_pack_map(device *d, bool small, char *why, size_t size) {
    return on_images(d, small, why, size, run_pack);
}

fathom_check check_halve_map(device *d, bool small, char *why, size_t size) {
    return on_images(d, small, why, size, run_halve_map);
}
