#include "simulate/window.h"

#include <math.h>
#include <stddef.h>
#include <string.h>

void window_sum(const struct window_sums *sums, const float *values) {
    const size_t w = (size_t)sums->width, h = (size_t)sums->height;
    memset(sums->sums, 0, (w + 1) * sizeof *sums->sums);
    for (size_t y = 0; y < h; y++) {
        const float *in = values + y * w;
        const double *above = sums->sums + y * (w + 1);
        double *out = sums->sums + (y + 1) * (w + 1), row = 0.0;
        out[0] = 0.0;
        for (size_t x = 0; x < w; x++) {
            row += in[x];
            out[x + 1] = above[x + 1] + row;
        }
    }
}

static double mean_of(const struct window_sums *s, int x, int y, int size) {
    const int before = (size - 1) / 2, after = size / 2;
    const int x0 = x > before ? x - before : 0, x1 = (x + after < s->width ? x + after : s->width - 1) + 1;
    const int y0 = y > before ? y - before : 0, y1 = (y + after < s->height ? y + after : s->height - 1) + 1;
    const size_t stride = (size_t)s->width + 1;
    const double *up = s->sums + (size_t)y0 * stride, *down = s->sums + (size_t)y1 * stride;
    return (down[x1] - down[x0] - up[x1] + up[x0]) / ((double)(x1 - x0) * (double)(y1 - y0));
}

double window_mean(const struct window_sums *sums, int x, int y, double size) {
    const int whole = (int)fmax(size, 1.0);
    const double rest = fmax(size, 1.0) - whole, mean = mean_of(sums, x, y, whole);
    return rest > 0.0 ? (1.0 - rest) * mean + rest * mean_of(sums, x, y, whole + 1) : mean;
}

/* Along a line of pixels; sign -1: the least of them. */
static void extreme(const float *in, float *out, int count, ptrdiff_t stride, int reach, float sign) {
    for (int i = 0; i < count; i++) {
        const int first = i > reach ? i - reach : 0, last = i + reach < count ? i + reach : count - 1;
        float most = sign * in[first * stride];
        for (int k = first + 1; k <= last; k++) most = fmaxf(most, sign * in[k * stride]);
        out[i * stride] = sign * most;
    }
}

static void extremes(const float *values, int width, int height, int reach, float *scratch, float *out,
                     float sign) {
    for (int y = 0; y < height; y++) {
        const size_t row = (size_t)y * (size_t)width;
        extreme(values + row, scratch + row, width, 1, reach, sign);
    }
    for (int x = 0; x < width; x++) extreme(scratch + x, out + x, height, width, reach, sign);
}

void window_least(const float *values, int width, int height, int reach, float *scratch, float *out) {
    extremes(values, width, height, reach, scratch, out, -1.0f);
}

void window_greatest(const float *values, int width, int height, int reach, float *scratch, float *out) {
    extremes(values, width, height, reach, scratch, out, 1.0f);
}
