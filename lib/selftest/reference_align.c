#include "selftest/reference.h"

#include <math.h>
#include <string.h>

#define PIXEL_SLACK 1e-3 /* a projection in single precision, at 640 pixels */

/* A scan pixel's partner in the model (Section 2). */
typedef struct {
    double p[3], d[3], n[3]; /* scan point in the model's camera, model point and its normal */
    double turned[3];        /* the scan's normal in the model's camera */
    double b, w;             /* n . (d - p), weight */
} pair;

typedef enum { NOTHING, OVERLAP, PAIR } met;

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* The result for pixel x, y of the scan: no surface, one that it can't be paired with, or a pair. */
static met find_pair(const float *depth, const float *normals, const kernel_camera *c, const float *model,
                     const kernel_camera *mc, const kernel_rigid *motion, const kernel_pair_limits *l, int x,
                     int y, pair *out, bool *doubt) {
    int at = ref_at(c, x, y);
    double confidence = normals[3 * c->plane + at], z = depth[at];
    if (!(confidence > 0)) return NOTHING;
    double scan[3] = {(x - (double)c->cx) / c->fx * z, (y - (double)c->cy) / c->fy * z, z};
    ref_transform(motion, scan, out->p);
    if (!ref_below(0.05, out->p[2], 1e-5, doubt)) return NOTHING;
    double u = out->p[0] / out->p[2] * mc->fx + mc->cx + 0.5,
           v = out->p[1] / out->p[2] * mc->fy + mc->cy + 0.5;
    if (!(fabs(u) < 1e6 && fabs(v) < 1e6)) return NOTHING;
    int column = ref_floor(u, PIXEL_SLACK, doubt), row = ref_floor(v, PIXEL_SLACK, doubt);
    if (column < 0 || row < 0 || column >= mc->width || row >= mc->height) return NOTHING;
    const float *m = model + 4 * (row * mc->width + column);
    if (!(m[3] > 0) || (m[0] == 0 && m[1] == 0 && m[2] == 0))
        return NOTHING; /* no surface, or none with a normal */

    double scan_normal[3], gap[3];
    for (int i = 0; i < 3; i++) {
        out->n[i] = m[i];
        scan_normal[i] = normals[i * c->plane + at];
    }
    ref_rotate(motion, scan_normal, out->turned);
    out->d[0] = (column - (double)mc->cx) / mc->fx * m[3];
    out->d[1] = (row - (double)mc->cy) / mc->fy * m[3];
    out->d[2] = m[3];
    for (int i = 0; i < 3; i++) gap[i] = out->d[i] - out->p[i];
    const double most = l->distance2, huber = l->huber;
    if (!ref_below(dot(gap, gap), most, 1e-4 * most, doubt)) return OVERLAP;
    if (!ref_below(l->cos_angle, dot(out->n, out->turned), 1e-5, doubt)) return OVERLAP;
    out->b = dot(out->n, gap);
    /* Huber: full weight up to the limit, then falling as 1 / |b| */
    out->w = fabs(out->b) <= huber ? confidence : confidence * huber / fabs(out->b);
    return PAIR;
}

static void row_of(const double p[3], const double n[3], double row[6]) {
    row[0] = p[1] * n[2] - p[2] * n[1];
    row[1] = p[2] * n[0] - p[0] * n[2];
    row[2] = p[0] * n[1] - p[1] * n[0];
    for (int i = 0; i < 3; i++) row[3 + i] = n[i];
}

static void add_pair(const pair *q, const kernel_pair_limits *l, bool across, double *sums,
                     double *magnitudes) {
    double p[3], row[6], scan[6], size[6];
    for (int i = 0; i < 3; i++) p[i] = q->p[i] - l->centre.s[i];
    row_of(p, q->n, row);
    row_of(p, q->turned, scan);
    double reach = sqrt(dot(q->p, q->p)) + fabs(l->centre.s[0]) + fabs(l->centre.s[1]) + fabs(l->centre.s[2]);
    double gap = sqrt(dot(q->p, q->p)) + sqrt(dot(q->d, q->d)); /* the terms of b before they cancel */
    double w =
        q->w * (1 + (fabs(q->b) > l->huber ? gap / fabs(q->b) : 0)); /* beyond the limit b decides on w */
    for (int i = 0; i < 3; i++) {
        size[i] = reach;
        size[3 + i] = 1;
    }
    int k = 0;
    for (int i = 0; i < 6; i++)
        for (int j = i; j < 6; j++, k++) {
            sums[k] += q->w * row[i] * row[j];
            magnitudes[k] += w * size[i] * size[j];
            if (!across) continue;
            sums[SUMS_ACROSS + k] += 0.5 * q->w * (row[i] * scan[j] + row[j] * scan[i]);
            magnitudes[SUMS_ACROSS + k] += w * size[i] * size[j];
        }
    for (int i = 0; i < 6; i++) {
        sums[21 + i] += q->w * row[i] * q->b;
        magnitudes[21 + i] += w * size[i] * gap;
    }
    sums[27] += q->w * q->b * q->b;
    magnitudes[27] += w * fabs(q->b) * gap;
    sums[28] += q->w;
    magnitudes[28] += w;
    for (int i = 0; i < 3; i++) {
        sums[29 + i] += q->w * p[i];
        magnitudes[29 + i] += w * reach;
    }
    sums[32] += q->w * dot(p, p);
    magnitudes[32] += w * reach * reach;
    sums[33] += 1;
}

void ref_align_reduce(const float *depth, const float *normals, const kernel_camera *c, const float *model,
                      const kernel_camera *mc, const kernel_rigid *motion, const kernel_pair_limits *limits,
                      double *sums, double *magnitudes, uint8_t *doubt) {
    memset(sums, 0, (size_t)c->height * SUMS * sizeof *sums);
    memset(magnitudes, 0, (size_t)c->height * SUMS * sizeof *magnitudes);
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            pair q;
            bool unsure = false;
            met m = find_pair(depth, normals, c, model, mc, motion, limits, x, y, &q, &unsure);
            if (m == PAIR)
                add_pair(&q, limits, y % ACROSS_EVERY == 0, sums + y * SUMS, magnitudes + y * SUMS);
            if (m != NOTHING) sums[y * SUMS + 34] += 1;
            if (doubt) doubt[y * c->width + x] = unsure;
        }
}
