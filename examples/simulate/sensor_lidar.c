/* A phone's LiDAR as its depth maps come out. It times some hundreds of laser dots (Luetzenburg, Kroon, Bjork 2021,
 * "Evaluation of the Apple iPhone 12 Pro LiDAR for an application in geosciences", Scientific Reports 11, 22221), and
 * a picture guides what fills the 256 x 192 pixels between them, 60 times a second, each with a confidence of 0 to 2
 * (Apple's documentation of ARDepthData). No paper gives the errors of these maps; the figures here are fitted to a
 * recording of an office, and tests/unit/examples/test_lidar.c compares the two:
 *   - there is depth everywhere; an edge is smeared over 0 to 20 pixels, in stretches along it, and the more the
 *     weaker the step is; relief lower than an eighth of the depth gets lost between the dots;
 *   - the error is smooth over some ten pixels, grows about in proportion to the depth, and changes from frame to
 *     frame, within a fifteenth of a second, and more slowly: flicker. Surfaces that are seen nearly face on hardly
 *     flicker, those at 50 degrees or more do, as if the dots were not where they are thought to be. A small part is
 *     common to the whole frame;
 *   - depth is held in 16-bit floats, whose steps are 1 mm from 1 m on, 2 mm from 2 m on, 4 mm from 4 m on;
 *   - confidence falls towards the border of the picture, near steps of depth, beyond some four metres, and where a
 *     surface is grazed. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "simulate/sensor.h"
#include "simulate/smooth_noise.h"
#include "simulate/window.h"

/* A step of depth, relative to the near side: a picture shows nothing of it, and all of one twice as high. */
#define FAINT 0.12
#define NEAREST_M 0.2     /* nearer, the confidence is low */
#define LEAST_M 0.05      /* nearer, there is no depth */
#define DOTS_PX 10.0      /* from one dot to the next */
#define WIDEST_PX 20.0    /* of a smeared step */
#define STEP_REACH_PX 8.0 /* steps are looked for this near */

/* Relative errors at 2 m: what is common to the frame, what a surface has anyway, what a slanted one has besides. They
 * change within so many seconds; 0: with each frame. The slow common part is the most it can be: the recording's poses,
 * which drift too, don't tell it from their own error. */
static const struct {
    double seconds, common, facing, slanted;
} flickers[] = {
    {0.0, 0.0002, 0.0003, 0.0032}, {1.0 / 15.0, 0.0003, 0.0005, 0.0020}, {0.5, 0.0020, 0.0012, 0.0042}};
#define FLICKERS 3

enum { STREAM_COMMON, STREAM_FINE = 3, STREAM_COARSE = 6, STREAM_SMEAR = 9, STREAM_DOUBT };

/* Of one frame; of arrays, a value a pixel. */
struct lidar {
    const struct sensor_frame *frame;
    int width, height;
    size_t count;
    double pixel; /* pixels of this picture for one of the sensor's own size */
    /* 1 / depth, of which a plane's is linear in the picture: a mean leaves it as it is. 0: no depth */
    float *inverse;
    float *steps;  /* the highest step nearby, relative to its near side */
    float *smooth; /* inverse, smeared */
    float *noise, *scratch;
    struct window_sums sums;
};

static bool add_noise(const struct lidar *l, float *values, double pitch_px, double age, double scale,
                      int stream) {
    return smooth_noise_add(values, l->width, l->height, fmax(pitch_px * l->pixel, 1.0), age, scale,
                            random_key(l->frame->seed, 0x11da0000u + (uint64_t)stream));
}

/* ---- Smear ---- */

static void find_steps(const struct lidar *l) {
    const int reach = (int)lround(fmax(STEP_REACH_PX * l->pixel, 1.0));
    for (size_t i = 0; i < l->count; i++)
        l->inverse[i] = l->frame->depth[i] > 0.0f ? 1.0f / l->frame->depth[i] : 0.0f;
    window_greatest(l->inverse, l->width, l->height, reach, l->scratch, l->steps);
    window_least(l->inverse, l->width, l->height, reach, l->scratch, l->smooth);
    for (size_t i = 0; i < l->count; i++)
        l->steps[i] = l->steps[i] > 0.0f ? l->steps[i] / fmaxf(l->smooth[i], 0.05f) - 1.0f : 0.0f;
}

/* 1 where the picture shows nothing of the highest step, 0 where it shows all. */
static double faintness(double step) {
    return fmin(fmax(2.0 - step / FAINT, 0.0), 1.0);
}

/* How many pixels a step takes, from a normal number. */
static double width_of(double step, double normal) {
    const double share = 0.5 * erfc(-normal * 0.7071067811865476); /* uniform in 0..1 */
    const double usual = share < 0.2 ? 0.0 : share < 0.4 ? 1.0 : 1.0 + 22.0 * pow((share - 0.4) / 0.6, 1.5);
    return fmin(fmax(usual * fmin(0.85 / step, 1.6), DOTS_PX * faintness(step)), WIDEST_PX);
}

static bool smear(const struct lidar *l) {
    memset(l->noise, 0, l->count * sizeof *l->noise);
    if (!add_noise(l, l->noise, 16.0, l->frame->seconds / 0.25, 1.0, STREAM_SMEAR)) return false;
    window_sum(&l->sums, l->inverse);
    for (int y = 0, i = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++, i++)
            l->smooth[i] =
                l->steps[i] < 1e-4f
                    ? l->inverse[i]
                    : (float)window_mean(&l->sums, x, y, 1.0 + l->pixel * width_of(l->steps[i], l->noise[i]));
    /* A second mean, so that faint relief doesn't show the window's ends. */
    window_sum(&l->sums, l->smooth);
    for (int y = 0, i = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++, i++)
            l->smooth[i] = l->steps[i] < 1e-4f
                               ? l->smooth[i]
                               : (float)window_mean(&l->sums, x, y,
                                                    1.0 + l->pixel * 0.6 * DOTS_PX * faintness(l->steps[i]));
    return true;
}

/* ---- Flicker ---- */

/* 0 for a surface seen within 23 degrees of face on, 1 beyond 54. */
static double slantness(double cosine) {
    const double s = fmin(fmax((1.0 - cosine * cosine - 0.15) / 0.5, 0.0), 1.0);
    return s * s * (3.0 - 2.0 * s);
}

/* Into noise: each pixel's relative error. */
static bool flicker(const struct lidar *l) {
    memset(l->noise, 0, l->count * sizeof *l->noise);
    for (int k = 0; k < FLICKERS; k++) {
        const double age =
            flickers[k].seconds > 0.0 ? l->frame->seconds / flickers[k].seconds : (double)l->frame->number;
        const double common =
            flickers[k].common *
            smooth_noise_at(age, random_key(l->frame->seed, 0x11da0000u + (uint64_t)(STREAM_COMMON + k)));
        memset(l->scratch, 0, l->count * sizeof *l->scratch);
        if (!add_noise(l, l->scratch, 12.0, age, sqrt(0.8), STREAM_FINE + k) ||
            !add_noise(l, l->scratch, 48.0, age, sqrt(0.2), STREAM_COARSE + k))
            return false;
        for (size_t i = 0; i < l->count; i++) {
            const double z = fmax(l->frame->depth[i], 0.3), slant = slantness(l->frame->cosine[i]);
            const double scale = hypot(flickers[k].facing * (0.9 + 0.6 / z),
                                       flickers[k].slanted * slant * (0.8 + 0.1 * z) / fmin(z, 1.0));
            l->noise[i] += (float)(common + scale * l->scratch[i]);
        }
    }
    return true;
}

/* ---- What comes out ---- */

/* The nearest 16-bit float, of eleven bits. */
static float as_half(double value) {
    int exponent;
    const double mantissa = frexp(value, &exponent);
    return (float)ldexp(round(mantissa * 2048.0), exponent - 11);
}

/* Of the pixel at x, y: below 1 the confidence is high, below 2 medium, else low. */
static double doubt(const struct lidar *l, int x, int y) {
    const size_t i = (size_t)y * (size_t)l->width + (size_t)x;
    const int across = x < l->width - 1 - x ? x : l->width - 1 - x;
    const int down = y < l->height - 1 - y ? y : l->height - 1 - y;
    const double z = l->frame->depth[i], border = (across < down ? across : down) / (20.0 * l->pixel);
    if (!(z >= NEAREST_M)) return 3.0;
    /* What rises from the plane about it, relative to the depth. */
    const double relief = fabs(z * window_mean(&l->sums, x, y, 1.0 + DOTS_PX * l->pixel) - 1.0);
    return 2.2 * fmax(1.0 - border, 0.0) + fmin(40.0 * relief, 2.5) + fmax((z - 3.7) / 0.8, 0.0) +
           fmax(8.0 * (0.3 - l->frame->cosine[i]), 0.0);
}

static bool judge(const struct lidar *l) {
    memset(l->scratch, 0, l->count * sizeof *l->scratch);
    if (!add_noise(l, l->scratch, 8.0, l->frame->seconds / 0.25, 0.6, STREAM_DOUBT)) return false;
    window_sum(&l->sums, l->inverse);
    for (int y = 0, i = 0; y < l->height; y++)
        for (int x = 0; x < l->width; x++, i++) {
            const double d = doubt(l, x, y) + l->scratch[i];
            l->frame->confidence[i] = d < 1.0 ? 2 : d < 2.0 ? 1 : 0;
        }
    return true;
}

static bool measure_with(const struct lidar *l) {
    find_steps(l);
    if (!smear(l) || !flicker(l) || !judge(l)) return false;
    for (size_t i = 0; i < l->count; i++) {
        const double z = l->smooth[i] > 0.0f ? (1.0 + l->noise[i]) / l->smooth[i] : 0.0;
        l->frame->depth[i] = z > LEAST_M ? as_half(z) : 0.0f;
    }
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
                                .count = count,
                                .pixel = w / (double)sensor_lidar.camera.width,
                                .inverse = values,
                                .steps = values + count,
                                .smooth = values + 2 * count,
                                .noise = values + 3 * count,
                                .scratch = values + 4 * count,
                                .sums = {w, h, sums}};
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
