/* A time-of-flight camera that measures the phase of modulated light, of a Kinect v2's kind: 512 x 424 pixels, 70 by
 * 60 degrees, 30 a second. Its errors, along the ray:
 *   - noise: sigma is in proportion to sqrt(B) / A, A being the amplitude that comes back and B all the light (Lange
 *     and Seitz 2001, "Solid-state time-of-flight range camera", IEEE Journal of Quantum Electronics 37). A falls
 *     with the square of the range, with the angle of incidence and towards the picture's corners. Sigma is 1.5 mm at
 *     1 m and 8 mm at 4.5 m for a wall that is faced (Corti, Giancola, Mainetti, Sala 2016, "A metrological
 *     characterization of the Kinect V2 time-of-flight camera", Robotics and Autonomous Systems 75: from 1.5 mm to
 *     tens, growing with the depth and away from the middle; Fankhauser and others 2015, "Kinect v2 for mobile robot
 *     navigation", ICAR: with the angle of the surface). What returns too little light has no depth;
 *   - wiggling: a harmonic error of some millimetres in the range, since the modulation is no pure sine (Corti and
 *     others; Sarbolandi, Lefloch, Kolb 2015, "Kinect range sensing: structured-light versus time-of-flight Kinect",
 *     CVIU 139). Four phases leave the fourth harmonic, here of 16 and 80 MHz; the curve is no one camera's;
 *   - multipath: concave places read too far (the same authors; multipath.c);
 *   - flying pixels: where an edge passes through a pixel, its light is a mixture (Sarbolandi and others). The
 *     camera's software recognises some of them and drops them. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "simulate/multipath.h"
#include "simulate/sensor.h"

#define NEAREST_M 0.5
#define SIGMA_M 0.00146          /* at 1 m, without other light */
#define OTHER_LIGHT 0.02         /* the amplitude at 1 m is 1 */
#define LEAST_LIGHT (1.0 / 64.0) /* of a wall that is faced at 8 m */
#define EDGE 0.03                /* a step, relative to the range */
#define DROPPED 0.5              /* of the flying pixels */
#define TURN 6.283185307179586

enum { STREAM_NOISE, STREAM_EDGE, STREAMS };

struct tof {
    const struct sensor_frame *frame;
    int width, height;
    float *range, *light; /* amplitude that comes back; 0: no surface */
    float *bias;          /* by multipath */
    uint64_t key[STREAMS];
};

static double ray_length(const struct render_camera *c, int x, int y) {
    const double u = (x - c->cx) / c->fx, v = (y - c->cy) / c->fy;
    return sqrt(1.0 + u * u + v * v);
}

static void light_up(const struct tof *t) {
    for (int y = 0, i = 0; y < t->height; y++)
        for (int x = 0; x < t->width; x++, i++) {
            const double length = ray_length(t->frame->camera, x, y), range = t->frame->depth[i] * length;
            const double aside = 1.0 / (length * length); /* lamp and lens fade towards the corners */
            t->range[i] = (float)range;
            t->light[i] =
                range > 0.0 ? (float)(fmax(t->frame->cosine[i], 0.0) * aside / (range * range)) : 0.0f;
        }
}

static double wiggle(double range) {
    return 0.003 * sin(TURN * range / (9.369 / 4.0) + 0.7) + 0.002 * sin(TURN * range / (1.874 / 4.0) + 2.1);
}

/* The neighbour across an edge, or the pixel itself. */
static int across_edge(const struct tof *t, int x, int y) {
    static const int steps[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};
    const int at = y * t->width + x;
    for (int k = 0; k < 4; k++) {
        const int u = x + steps[k][0], v = y + steps[k][1], other = v * t->width + u;
        if (u < 0 || v < 0 || u >= t->width || v >= t->height || t->range[other] <= 0.0f) continue;
        if (fabsf(t->range[other] - t->range[at]) > EDGE * t->range[at]) return other;
    }
    return at;
}

/* The measured range, 0 for none. */
static double measure_pixel(const struct tof *t, int x, int y) {
    const int at = y * t->width + x;
    const int other = t->range[at] > 0.0f ? across_edge(t, x, y) : at;
    double range = t->range[at] + t->bias[at], light = t->light[at];
    if (other != at) {
        if (random_uniform(t->key[STREAM_EDGE], 2 * (uint64_t)at) < DROPPED) return 0.0;
        const double part = 0.5 * random_uniform(t->key[STREAM_EDGE], 2 * (uint64_t)at + 1);
        const double own = (1.0 - part) * light, others = part * t->light[other];
        light = own + others;
        if (light > 0.0) range = (own * range + others * (t->range[other] + t->bias[other])) / light;
    }
    if (light < LEAST_LIGHT || range < NEAREST_M) return 0.0;
    const double sigma = SIGMA_M * sqrt(light + OTHER_LIGHT) / light;
    return range + wiggle(range) + sigma * random_normal(t->key[STREAM_NOISE], (uint64_t)at);
}

static bool measure(const struct sensor_frame *frame) {
    const int w = frame->camera->width, h = frame->camera->height;
    const size_t count = (size_t)w * (size_t)h;
    float *values = malloc(3 * count * sizeof *values);
    if (!values) return false;
    struct tof t = {frame, w, h, values, values + count, values + 2 * count, {0}};
    for (uint64_t i = 0; i < STREAMS; i++)
        t.key[i] = random_key(frame->seed, 0x70f00000u + (uint64_t)frame->number * STREAMS + i);
    light_up(&t);
    const bool done = multipath_bias(frame->camera, frame->depth, frame->cosine, t.bias);
    for (int y = 0, i = 0; done && y < h; y++)
        for (int x = 0; x < w; x++, i++)
            frame->depth[i] = (float)(measure_pixel(&t, x, y) / ray_length(frame->camera, x, y));
    free(values);
    return done;
}

/* All rows expose at once. How long isn't stated. */
const struct sensor sensor_tof = {.name = "tof",
                                  .camera = {512, 424, 365.0, 365.0, 255.5, 211.5},
                                  .rate_hz = 30.0,
                                  .exposure_s = 0.008,
                                  .measure = measure};
