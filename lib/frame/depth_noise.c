#include "frame/depth_noise.h"

#include <math.h>
#include <string.h>

#define ROWS 24 /* that are looked at in a frame */
#define EACH 30 /* frames: each is looked at; then one in SOME */
#define SOME 8
#define KEPT 0.95f /* of the counts, from look to look */
#define EDGE 0.05f /* of the depth: a second difference beyond is an edge */
#define QUANTILE 0.9f
#define OF_SIGMA 4.03f /* that quantile of second differences of independent pixels of sigma 1 */
#define EVEN 0.1f     /* of the noise */
#define ENOUGH 200.0f     /* pixels in a range */
#define FULL 2000.0f      /* pixels: a range counts wholly */
#define SHAPE_WEIGHT 0.05 /* of the settings' shape, at each of these depths where nothing was seen */
static const double shape_m[] = {0.5, 1, 2, 4, 8};
#define SHAPES (int)(sizeof shape_m / sizeof *shape_m)

/* A float's exponent and the first bits of its fraction number its range: two or four ranges an octave. */
static uint32_t bits_of(float x) {
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static float of_bits(uint32_t bits) {
    float x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

#define DEPTH_SHIFT 22
#define DEPTH_FIRST 0.0625f /* m */
#define SIZE_SHIFT 21
#define SIZE_FIRST 0.00003f /* m */

static int range_of(float x, float first, int shift, int ranges) {
    const int i = (int)(bits_of(x) >> shift) - (int)(bits_of(first) >> shift);
    return i < 0 ? 0 : i < ranges ? i : ranges - 1;
}

static float start_of(int i, float first, int shift) {
    return of_bits(((bits_of(first) >> shift) + (uint32_t)i) << shift);
}

void depth_noise_init(depth_noise *n, const fathom_config *c) {
    memset(n, 0, sizeof *n);
    n->config = c;
    n->given = (kernel_noise){c->depth_noise_base_m, c->depth_noise_slope, c->depth_noise_growth_per_m};
}

void depth_noise_reset(depth_noise *n) {
    n->frames = 0;
    memset(n->count, 0, sizeof n->count);
    memset(n->depth, 0, sizeof n->depth);
    memset(n->sizes, 0, sizeof n->sizes);
}

/* ---- counting ---- */

static void fade(depth_noise *n) {
    for (int i = 0; i < DEPTH_NOISE_RANGES; i++) {
        n->count[i] *= KEPT;
        n->depth[i] *= KEPT;
        for (int j = 0; j < DEPTH_NOISE_SIZES; j++) n->sizes[i][j] *= KEPT;
    }
}

static void count_row(depth_noise *n, const depth_maps *m, const fathom_depth_frame *f, int y, int low,
                      int high) {
    const uint16_t *row = f->depth + (size_t)y * (size_t)(f->row_stride_bytes / 2);
    const float unit = m->source.metres_per_unit;
    for (int x = 1; x < f->width - 1; x++) {
        const int a = row[x - 1], b = row[x], c = row[x + 1];
        if (a < low || a > high || b < low || b > high || c < low || c > high) continue;
        const bool sure =
            depth_maps_sure(m, f, x - 1, y) && depth_maps_sure(m, f, x, y) && depth_maps_sure(m, f, x + 1, y);
        if (!sure) continue;
        const float z = (float)b * unit, size = (float)abs(a - 2 * b + c) * unit;
        if (size > EDGE * z) continue;
        const int i = range_of(z, DEPTH_FIRST, DEPTH_SHIFT, DEPTH_NOISE_RANGES);
        n->count[i] += 1;
        n->depth[i] += z;
        n->sizes[i][range_of(size, SIZE_FIRST, SIZE_SHIFT, DEPTH_NOISE_SIZES)] += 1;
    }
}

static void count_frame(depth_noise *n, const depth_maps *m, const fathom_depth_frame *f) {
    const float unit = m->source.metres_per_unit;
    const int low = (int)fminf(fmaxf(ceilf(n->config->min_depth_m / unit), 1), 65535);
    const int high = (int)fminf(n->config->max_depth_m / unit, 65534);
    const int rows = f->height < ROWS ? f->height : ROWS;
    for (int i = 0; i < rows; i++) count_row(n, m, f, i * f->height / rows, low, high);
}

/* ---- fitting ---- */

/* Solves the normal equations of the chosen terms; false when one comes out negative or they are singular. */
static bool solve(const double a[3][3], const double b[3], int chosen, double x[3]) {
    double m[3][4];
    int terms[3], count = 0;
    for (int i = 0; i < 3; i++)
        if (chosen >> i & 1) terms[count++] = i;
    for (int i = 0; i < count; i++) {
        for (int j = 0; j < count; j++) m[i][j] = a[terms[i]][terms[j]];
        m[i][count] = b[terms[i]];
    }
    for (int i = 0; i < count; i++) { /* positive definite: no pivoting */
        if (!(m[i][i] > 1e-12 * a[terms[i]][terms[i]])) return false;
        for (int k = i + 1; k < count; k++)
            for (int j = count; j >= i; j--) m[k][j] -= m[k][i] / m[i][i] * m[i][j];
    }
    x[0] = x[1] = x[2] = 0;
    for (int i = count - 1; i >= 0; i--) {
        double v = m[i][count];
        for (int j = i + 1; j < count; j++) v -= m[i][j] * x[terms[j]];
        x[terms[i]] = v / m[i][i];
        if (x[terms[i]] < 0) return false;
    }
    return true;
}

kernel_noise depth_noise_fit(const double *z, const double *values, const double *weights, int count) {
    double a[3][3] = {{0}}, b[3] = {0}, best[3] = {0}, best_gain = -1;
    for (int k = 0; k < count; k++) {
        const double f[3] = {1 / values[k], z[k] / values[k], z[k] * z[k] / values[k]};
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) a[i][j] += weights[k] * f[i] * f[j];
            b[i] += weights[k] * f[i];
        }
    }
    for (int chosen = 1; chosen < 8; chosen++) { /* the sum of squares falls by b^T x */
        double x[3];
        if (!solve(a, b, chosen, x)) continue;
        const double gain = b[0] * x[0] + b[1] * x[1] + b[2] * x[2];
        if (gain > best_gain) {
            best_gain = gain;
            memcpy(best, x, sizeof best);
        }
    }
    return (kernel_noise){(float)fmax(best[0], 1e-6), (float)best[1], (float)best[2]};
}

static float quantile(const float *sizes, float count) {
    float below = 0;
    for (int j = 0; j < DEPTH_NOISE_SIZES; j++) {
        if (below + sizes[j] >= QUANTILE * count) {
            const float from = j > 0 ? start_of(j, SIZE_FIRST, SIZE_SHIFT) : 0;
            const float to = start_of(j + 1, SIZE_FIRST, SIZE_SHIFT);
            return from + (to - from) * (QUANTILE * count - below) / sizes[j];
        }
        below += sizes[j];
    }
    return start_of(DEPTH_NOISE_SIZES, SIZE_FIRST, SIZE_SHIFT);
}

static double sigma_of(const kernel_noise *n, double z) {
    return n->base + n->slope * z + n->growth * z * z;
}

/* even: set where depth varies from pixel to pixel by so much less than the noise that there is nothing to smooth. */
static kernel_noise estimate(const depth_noise *n, bool *even) {
    double z[DEPTH_NOISE_RANGES + SHAPES], values[DEPTH_NOISE_RANGES + SHAPES],
        weights[DEPTH_NOISE_RANGES + SHAPES];
    int count = 0;
    for (int i = 0; i < DEPTH_NOISE_RANGES; i++) {
        if (n->count[i] < ENOUGH) continue;
        z[count] = n->depth[i] / n->count[i];
        values[count] = quantile(n->sizes[i], n->count[i]);
        weights[count++] = fmin(n->count[i] / FULL, 1);
    }
    *even = false;
    if (count == 0) return n->given;
    const int seen = count;
    const int nearest = 0, farthest = count - 1;
    for (int i = 0; i < SHAPES; i++) {
        const int from = shape_m[i] < z[nearest] ? nearest : farthest;
        if (shape_m[i] > z[nearest] && shape_m[i] < z[farthest]) continue;
        z[count] = shape_m[i];
        values[count] = values[from] * sigma_of(&n->given, shape_m[i]) / sigma_of(&n->given, z[from]);
        weights[count++] = SHAPE_WEIGHT;
    }
    kernel_noise noise = depth_noise_fit(z, values, weights, count);
    double excess = 0, total = 0;
    for (int i = 0; i < seen; i++) {
        excess += weights[i] * log(sigma_of(&n->given, z[i]) / sigma_of(&noise, z[i]));
        total += weights[i];
    }
    const float scale = (float)exp(excess / total);
    *even = OF_SIGMA * EVEN * scale > 1;
    return (kernel_noise){scale * noise.base, scale * noise.slope, scale * noise.growth};
}

void depth_noise_look(depth_noise *n, depth_maps *m, const fathom_depth_frame *f) {
    if (!n->config->refine_depth_noise) return;
    if (n->frames < EACH || n->frames % SOME == 0) {
        fade(n);
        count_frame(n, m, f);
        bool even;
        const kernel_noise noise = estimate(n, &even);
        depth_maps_set_noise(m, n->config, &noise);
        if (even) m->raw_m = m->once_m = INFINITY;
    }
    n->frames++;
}
