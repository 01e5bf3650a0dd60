/* A Kinect's errors, in the order in which they arise:
 *   - the shadow: what the projector, beside the camera, doesn't light has no depth (Khoshelham and Elberink
 * 2012, "Accuracy and Resolution of Kinect Depth Data for Indoor Mapping Applications", Sensors 12,
 * section 3.1);
 *   - edges are displaced by some 0.8 pixels (Nguyen, Izadi, Lovell 2012, lateral noise) and partly missing;
 *   - a surface at a grazing angle gets lost, between 74 and 82 degrees (the same authors could measure up to
 * about 80);
 *   - axial noise, growing with distance squared and beyond 60 degrees with the angle (the same, eq. for
 * sigma_z);
 *   - disparity comes in steps of an eighth of a pixel (Khoshelham and Elberink 2012, section 2.2). */
#include "simulate/sensor_kinect.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "simulate/sensor.h"

#define FOCAL_PX 585.0
#define BASELINE_M (KINECT_DISPARITY_PX_M / FOCAL_PX)
#define DISPARITY_STEPS 8.0 /* a pixel */
#define NEAREST_M 0.4
#define FARTHEST_M 8.0
#define LATERAL_SIGMA_PX 0.8
#define EDGE_LOSS 0.25
#define GRAZING_FROM 1.2915 /* radians: 74 degrees */
#define GRAZING_TO 1.4312   /* 82 degrees */

enum { STREAM_AXIAL, STREAM_LATERAL, STREAM_LOSS, STREAMS };

struct measurement {
    const float *cosine;
    float *depth; /* the result */
    float *truth; /* as rendered */
    float *noise; /* of unit variance, correlated */
    float *scratch;
    uint8_t *lit;
    int width, height;
    uint64_t key[STREAMS];
};

double kinect_axial_sigma(double z) {
    return 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4);
}

/* Near enough a normal number, of unit variance: the sum of four uniform 16-bit numbers. Smoothed over 3x3
 * pixels afterwards it is a sum of 36. */
static float rough_normal(uint64_t key, uint64_t counter) {
    const uint64_t bits = random_bits(key, counter);
    const uint32_t sum = (uint32_t)(bits & 0xffff) + (uint32_t)(bits >> 16 & 0xffff) +
                         (uint32_t)(bits >> 32 & 0xffff) + (uint32_t)(bits >> 48);
    return (float)(((double)sum - 131070.0) * (1.7320508075688772 / 65536.0));
}

/* The sensor compares windows of 9x9 pixels, so neighbours share their noise. How far isn't in the sources;
 * the binomial 1 2 1 in both directions is a modest choice. Its gain on white noise is 6/16. At the border
 * some far pixel stands in for the one that is missing, so that the variance stays. */
static void make_noise(struct measurement *m) {
    const int w = m->width, h = m->height;
    for (int y = 0; y < h; y++) {
        float *row = m->noise + (size_t)y * (size_t)w, *out = m->scratch + (size_t)y * (size_t)w;
        for (int x = 0; x < w; x++)
            row[x] = rough_normal(m->key[STREAM_AXIAL], (uint64_t)y * 65536u + (uint64_t)x);
        for (int x = 0; x < w; x++)
            out[x] = 0.25f * (row[x ? x - 1 : w / 2] + 2.0f * row[x] + row[x + 1 < w ? x + 1 : w / 2]);
    }
    for (int y = 0; y < h; y++) {
        const float *up = m->scratch + (size_t)(y ? y - 1 : h / 2) * (size_t)w;
        const float *here = m->scratch + (size_t)y * (size_t)w;
        const float *down = m->scratch + (size_t)(y + 1 < h ? y + 1 : h / 2) * (size_t)w;
        float *out = m->noise + (size_t)y * (size_t)w;
        for (int x = 0; x < w; x++) out[x] = (16.0f / 6.0f) * 0.25f * (up[x] + 2.0f * here[x] + down[x]);
    }
}

/* A pixel is in shadow when something farther right meets the same projector ray nearer. Seen from the
 * projector, to the right by the baseline, a pixel lies in column u - f b / z. */
void kinect_lit(const float *depth, int width, int height, double scale, uint8_t *lit) {
    const double shift = FOCAL_PX * scale * BASELINE_M;
    for (int y = 0; y < height; y++) {
        const float *z = depth + (size_t)y * (size_t)width;
        uint8_t *row = lit + (size_t)y * (size_t)width;
        double leftmost = INFINITY;
        for (int x = width - 1; x >= 0; x--) {
            row[x] = 1;
            if (z[x] <= 0.0f) continue;
            const double column = x - shift / z[x];
            row[x] = column <= leftmost + 0.5;
            leftmost = fmin(leftmost, column);
        }
    }
}

static bool at_edge(const struct measurement *m, int x, int y, float z) {
    static const int near[8][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}, {-2, 0}, {2, 0}, {0, -2}, {0, 2}};
    const float step = 0.02f + 0.03f * z; /* more than a surface at 80 degrees falls over two pixels */
    for (int i = 0; i < 8; i++) {
        const int u = x + near[i][0], v = y + near[i][1];
        if (u < 0 || v < 0 || u >= m->width || v >= m->height) continue;
        if (fabsf(m->truth[(size_t)v * (size_t)m->width + (size_t)u] - z) > step) return true;
    }
    return false;
}

static int displaced(int at, double by, int size) {
    const int moved = at + (int)lround(by);
    return moved < 0 ? 0 : (moved >= size ? size - 1 : moved);
}

static float measure_pixel(const struct measurement *m, int x, int y) {
    const uint64_t counter = (uint64_t)y * 65536u + (uint64_t)x;
    size_t at = (size_t)y * (size_t)m->width + (size_t)x;
    if (at_edge(m, x, y, m->truth[at])) {
        if (random_uniform(m->key[STREAM_LOSS], 2 * counter) < EDGE_LOSS) return 0.0f;
        const int u =
            displaced(x, LATERAL_SIGMA_PX * rough_normal(m->key[STREAM_LATERAL], 2 * counter), m->width);
        const int v =
            displaced(y, LATERAL_SIGMA_PX * rough_normal(m->key[STREAM_LATERAL], 2 * counter + 1), m->height);
        at = (size_t)v * (size_t)m->width + (size_t)u;
    }
    const double z = m->truth[at];
    if (!m->lit[at] || z < NEAREST_M || z > FARTHEST_M) return 0.0f;

    double sigma = kinect_axial_sigma(z);
    if (m->cosine[at] < 0.5f) {
        const double angle = acos(fmax(m->cosine[at], 0.0)), left = fmax(1.5707963267948966 - angle, 0.02);
        const double loss = (angle - GRAZING_FROM) / (GRAZING_TO - GRAZING_FROM);
        if (loss > 0.0 && random_uniform(m->key[STREAM_LOSS], 2 * counter + 1) < loss) return 0.0f;
        sigma += 0.0001 / sqrt(z) * angle * angle / (left * left);
    }
    /* The authors measured what the sensor gives out, its steps included: their part (step^2 / 12) is taken
     * off here. */
    const double step = z * z / (FOCAL_PX * BASELINE_M * DISPARITY_STEPS);
    const double before_steps = sqrt(fmax(sigma * sigma - step * step / 12.0, 0.0));
    const double noisy = z + before_steps * m->noise[at];
    if (noisy <= 0.0) return 0.0f;
    const double disparity = round(DISPARITY_STEPS * FOCAL_PX * BASELINE_M / noisy) / DISPARITY_STEPS;
    const double measured = disparity > 0.0 ? FOCAL_PX * BASELINE_M / disparity : 0.0;
    return measured >= NEAREST_M && measured <= FARTHEST_M ? (float)measured : 0.0f;
}

bool kinect_measure(float *depth, const float *cosine, int width, int height, double scale, uint64_t seed,
                    uint64_t frame) {
    const size_t pixels = (size_t)width * (size_t)height;
    float *buffers = malloc(3 * pixels * sizeof(float) + pixels);
    if (!buffers) return false;
    struct measurement m = {.cosine = cosine,
                            .depth = depth,
                            .truth = buffers,
                            .noise = buffers + pixels,
                            .scratch = buffers + 2 * pixels,
                            .lit = (uint8_t *)(buffers + 3 * pixels),
                            .width = width,
                            .height = height};
    for (uint64_t i = 0; i < STREAMS; i++) m.key[i] = random_key(seed, 0x5e500000u + frame * STREAMS + i);
    memcpy(m.truth, depth, pixels * sizeof(float));
    make_noise(&m);
    kinect_lit(m.truth, width, height, scale, m.lit);
    for (int y = 0; y < height; y++)
        for (int x = 0; x < width; x++)
            depth[(size_t)y * (size_t)width + (size_t)x] = measure_pixel(&m, x, y);
    free(buffers);
    return true;
}

static bool measure(const struct sensor_frame *frame) {
    const struct render_camera *c = frame->camera;
    return kinect_measure(frame->depth, frame->cosine, c->width, c->height, c->width / 640.0, frame->seed,
                          (uint64_t)frame->number);
}

const struct sensor sensor_kinect = {.name = "kinect",
                                     .camera = {640, 480, 585.0, 585.0, 320.0, 240.0},
                                     .rate_hz = 30.0,
                                     .exposure_s =
                                         0.008, /* in a room without daylight; no one sensor's figure */
                                     .rolling_s = 0.010,
                                     .has_shadow = true,
                                     .measure = measure};
