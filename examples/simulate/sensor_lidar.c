/* A phone's LiDAR as its depth maps come out. It times 24 x 24 laser dots (Luetzenburg, Kroon, Bjork 2021, "Evaluation
 * of the Apple iPhone 12 Pro LiDAR for an application in geosciences", Scientific Reports 11, 22221), and a picture
 * guides what fills the 256 x 192 pixels between them, 60 times a second, each with a confidence of 0 to 2. No paper
 * gives the errors of the maps; the figures here are fitted to a recording of an office (tests/unit/examples/
 * test_lidar.c measures both):
 *   - there is depth everywhere; an edge is smeared over 1 to 15 pixels, in stretches along it, and the more the
 *     weaker the step is;
 *   - the error is smooth over some ten pixels, grows in proportion to the depth, and is redrawn from frame to frame,
 *     from burst to burst of the laser and more slowly: flicker. Surfaces that are seen face on hardly flicker, others
 *     as the square of the incidence angle's sine, as if the dots were not where they are thought to be. A part of it is
 *     common to the whole frame;
 *   - depth is held in 16-bit floats, whose steps are 1 mm from 1 m on, 2 mm from 2 m on, 4 mm from 4 m on;
 *   - confidence falls towards the border of the picture, at steps of depth, beyond some four metres, and where a
 *     surface is grazed. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "simulate/sensor.h"
#include "simulate/smooth_noise.h"

#define NEAREST_M 0.2
#define LEAST_M 0.05 /* below it there is no depth at all */
#define WIDEST_PX 20 /* of a smeared step */
#define STEP_REACH_PX 8

/* Relative errors, facing and slanted, that change at three paces. */
static const struct {
    double seconds, common, facing, slanted;
} flickers[] = {
    {0.0, 0.0002, 0.0003, 0.0042}, {1.0 / 15.0, 0.0003, 0.0006, 0.0050}, {0.5, 0.0020, 0.0015, 0.0060}};
#define FLICKERS 3

enum { STREAM_COMMON, STREAM_FINE = 3, STREAM_COARSE = 6, STREAM_SMEAR = 9, STREAM_CONFIDENCE, STREAMS };

/* Of one frame, a value a pixel. */
struct lidar {
    const struct sensor_frame *frame;
    int width, height;
    float *nearest, *farthest; /* within STEP_REACH_PX; 0 where there is nothing */
    float *noise, *smear, *scratch;
    double *sums; /* of 1 / z, above and left of a pixel's corner: (width + 1) x (height + 1) */
};

static uint64_t key_of(const struct lidar *l, int stream) {
    return random_key(l->frame->seed, 0x11da0000u + (uint64_t)stream);
}

/* Pixels of this picture for one of the sensor's own size. */
static double pixels(const struct lidar *l, double at_full_size) {
    return at_full_size * l->width / sensor_lidar.camera.width;
}

/* ---- Steps of depth, and their smear ---- */

static float lesser(float a, float b) {
    return b > 0.0f && (a <= 0.0f || b < a) ? b : a;
}

static float greater(float a, float b) {
    return b > a ? b : a;
}

/* out: of each pixel and those up to reach before and after it along a line of pixels. */
static void spread(const float *in, float *out, int count, ptrdiff_t stride, int reach,
                   float (*choose)(float, float)) {
    for (int i = 0; i < count; i++) {
        const int first = i > reach ? i - reach : 0, last = i + reach < count ? i + reach : count - 1;
        float chosen = in[first * stride];
        for (int k = first + 1; k <= last; k++) chosen = choose(chosen, in[k * stride]);
        out[i * stride] = chosen;
    }
}

static void spread_around(const struct lidar *l, float *out, int reach, float (*choose)(float, float)) {
    const int w = l->width, h = l->height;
    for (int y = 0; y < h; y++)
        spread(l->frame->depth + (size_t)y * (size_t)w, l->scratch + (size_t)y * (size_t)w, w, 1, reach,
               choose);
    for (int x = 0; x < w; x++) spread(l->scratch + x, out + x, h, w, reach, choose);
}

/* Inverse depth, of which a plane's is linear in the picture: a mean over a window leaves it as it is. */
static void sum_up(const struct lidar *l) {
    const int w = l->width, h = l->height;
    memset(l->sums, 0, ((size_t)w + 1) * sizeof *l->sums);
    for (int y = 0; y < h; y++) {
        const float *z = l->frame->depth + (size_t)y * (size_t)w;
        const double *above = l->sums + (size_t)y * ((size_t)w + 1);
        double *sums = l->sums + ((size_t)y + 1) * ((size_t)w + 1), row = 0.0;
        sums[0] = 0.0;
        for (int x = 0; x < w; x++) {
            row += z[x] > 0.0f ? 1.0 / z[x] : 0.0;
            sums[x + 1] = above[x + 1] + row;
        }
    }
}

/* Over size x size pixels. */
static double mean_inverse(const struct lidar *l, int x, int y, int size) {
    const int before = (size - 1) / 2, after = size / 2;
    const int x0 = x > before ? x - before : 0, x1 = (x + after < l->width ? x + after : l->width - 1) + 1;
    const int y0 = y > before ? y - before : 0, y1 = (y + after < l->height ? y + after : l->height - 1) + 1;
    const size_t stride = (size_t)l->width + 1;
    const double *up = l->sums + (size_t)y0 * stride, *down = l->sums + (size_t)y1 * stride;
    return (down[x1] - down[x0] - up[x1] + up[x0]) / ((x1 - x0) * (y1 - y0));
}

/* How many pixels a step takes, from the smear's normal number. */
static double step_width(double normal, double contrast) {
    const double share = 0.5 * erfc(-normal * 0.7071067811865476); /* uniform in 0..1 */
    const double weakness = fmin(0.75 / sqrt(contrast), 1.8);
    const double usual = share < 0.22 ? 0.0 : share < 0.5 ? 1.0 : 1.0 + 14.0 * pow(2.0 * share - 1.0, 1.6);
    return fmin(usual * weakness, WIDEST_PX);
}

static double smeared(const struct lidar *l, int x, int y) {
    const size_t at = (size_t)y * (size_t)l->width + (size_t)x;
    const double contrast = l->nearest[at] > 0.0f ? l->farthest[at] / l->nearest[at] - 1.0 : 0.0;
    if (contrast < 0.02) return l->frame->depth[at];
    const double size = 1.0 + pixels(l, step_width(l->smear[at], contrast));
    const int whole = (int)size;
    const double inverse = (1.0 - (size - whole)) * mean_inverse(l, x, y, whole) +
                           (size - whole) * mean_inverse(l, x, y, whole + 1);
    return inverse > 0.0 ? 1.0 / inverse : 0.0;
}

/* ---- Flicker ---- */

/* Into noise: each pixel's relative error. */
static bool make_flicker(const struct lidar *l) {
    const size_t count = (size_t)l->width * (size_t)l->height;
    const double fine = pixels(l, 12.0), coarse = pixels(l, 48.0);
    memset(l->noise, 0, count * sizeof *l->noise);
    for (int i = 0; i < FLICKERS; i++) {
        const double age =
            flickers[i].seconds > 0.0 ? l->frame->seconds / flickers[i].seconds : (double)l->frame->number;
        const double common = flickers[i].common * smooth_noise_at(age, key_of(l, STREAM_COMMON + i));
        memset(l->scratch, 0, count * sizeof *l->scratch);
        if (!smooth_noise_add(l->scratch, l->width, l->height, fine, age, sqrt(0.8),
                              key_of(l, STREAM_FINE + i)) ||
            !smooth_noise_add(l->scratch, l->width, l->height, coarse, age, sqrt(0.2),
                              key_of(l, STREAM_COARSE + i)))
            return false;
        for (size_t at = 0; at < count; at++) {
            const double slant =
                flickers[i].slanted * (1.0 - (double)l->frame->cosine[at] * l->frame->cosine[at]);
            l->noise[at] += (float)(common + hypot(flickers[i].facing, slant) * l->scratch[at]);
        }
    }
    return true;
}

/* ---- What comes out ---- */

/* The nearest 16-bit float: eleven bits. */
static float as_half(double value) {
    int exponent;
    const double mantissa = frexp(value, &exponent);
    return (float)ldexp(round(mantissa * 2048.0), exponent - 11);
}

/* Below 1 high, below 2 medium, else low; 0 at best. */
static double doubt(const struct lidar *l, int x, int y) {
    const size_t at = (size_t)y * (size_t)l->width + (size_t)x;
    const int across = x < l->width - 1 - x ? x : l->width - 1 - x,
              down = y < l->height - 1 - y ? y : l->height - 1 - y;
    const double z = l->frame->depth[at], border = (across < down ? across : down) / pixels(l, 20.0);
    const double contrast = l->nearest[at] > 0.0f ? l->farthest[at] / l->nearest[at] - 1.0 : 0.0;
    if (z < NEAREST_M) return 2.0;
    return 2.2 * fmax(1.0 - border, 0.0) + fmin(fmax(7.0 * (contrast - 0.1), 0.0), 2.0) +
           fmax((z - 3.7) / 0.8, 0.0) + fmax(8.0 * (0.3 - l->frame->cosine[at]), 0.0);
}

static bool measure_with(const struct lidar *l) {
    const size_t count = (size_t)l->width * (size_t)l->height;
    const int reach = (int)lround(fmax(pixels(l, STEP_REACH_PX), 1.0));
    sum_up(l);
    spread_around(l, l->nearest, reach, lesser);
    spread_around(l, l->farthest, reach, greater);
    if (!make_flicker(l)) return false;
    memset(l->smear, 0, count * sizeof *l->smear);
    if (!smooth_noise_add(l->smear, l->width, l->height, pixels(l, 16.0), l->frame->seconds / 0.25, 1.0,
                          key_of(l, STREAM_SMEAR)))
        return false;
    /* The picture before it is changed is needed by the confidence, the changed one by nothing else. */
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++) {
            const size_t at = (size_t)y * (size_t)l->width + (size_t)x;
            const double z = smeared(l, x, y) * (1.0 + l->noise[at]);
            l->scratch[at] = z > LEAST_M ? as_half(z) : 0.0f;
        }
    const int close = (int)lround(fmax(pixels(l, 3.0), 1.0));
    float *unsure = l->noise;
    memcpy(l->smear, l->scratch, count * sizeof *l->smear); /* the result, while scratch is needed */
    spread_around(l, l->nearest, close, lesser);
    spread_around(l, l->farthest, close, greater);
    memset(unsure, 0, count * sizeof *unsure);
    if (!smooth_noise_add(unsure, l->width, l->height, pixels(l, 8.0), l->frame->seconds / 0.25, 0.6,
                          key_of(l, STREAM_CONFIDENCE)))
        return false;
    for (int y = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++) {
            const size_t at = (size_t)y * (size_t)l->width + (size_t)x;
            const double d = doubt(l, x, y) + unsure[at];
            l->frame->confidence[at] = d < 1.0 ? 2 : d < 2.0 ? 1 : 0;
        }
    memcpy(l->frame->depth, l->smear, count * sizeof *l->smear);
    return true;
}

static bool measure(const struct sensor_frame *frame) {
    const int w = frame->camera->width, h = frame->camera->height;
    const size_t count = (size_t)w * (size_t)h;
    float *values = malloc(5 * count * sizeof *values);
    double *sums = malloc(((size_t)w + 1) * ((size_t)h + 1) * sizeof *sums);
    const struct lidar lidar = {.frame = frame,
                                .width = w,
                                .height = h,
                                .nearest = values,
                                .farthest = values + count,
                                .noise = values + 2 * count,
                                .smear = values + 3 * count,
                                .scratch = values + 4 * count,
                                .sums = sums};
    const bool done = values && sums && measure_with(&lidar);
    free(values);
    free(sums);
    return done;
}

/* The camera is the recording's. How long its colour camera exposes isn't known; nothing shears the depth. */
const struct sensor sensor_lidar = {.name = "lidar",
                                    .camera = {256, 192, 180.27, 180.27, 127.84, 95.95},
                                    .rate_hz = 60.0,
                                    .exposure_s = 0.008,
                                    .min_confidence = 2,
                                    .measure = measure};
