/* A structured-light sensor's projector and camera move together, so the pattern on a smooth surface stands
 * still in the picture, but for the change of disparity. What is measured is the mean disparity over the
 * exposure, hence the mean of 1 / z. When the disparity of a pixel changes by more than a spot of the pattern,
 * the spots smear over one another and nothing matches: no depth. (Shiba and others 2017, "Temporal shape
 * super-resolution by intra-frame motion encoding using high-fps structured light", ICCV, begin with that
 * failure of a static pattern.) Two surfaces nearer to each other than that mix, and so there are a few flying
 * pixels. Time-of-flight cameras lose the pixels that an edge passes over, too ("Probabilistic modeling of
 * motion blur for time-of-flight sensors", Sensors 22, 1182, 2022).
 *
 * The other sensors are treated alike, without shadow. They match no pattern: the same step of 1 / z stands in for
 * theirs, of which no source gives the size.
 *
 * The Kinect's cameras read row by row, and its depth maps are sheared by that (Ringaby and Forssen 2011, "Scan
 * rectification for structured light range sensors with rolling shutters", ICCV). */
#include "simulate/exposure.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/sensor_kinect.h"

#define SUBFRAMES 5
#define SPOT_PX 1.0 /* at 640x480 */

/* Over the exposure from -1/2 to 1/2, and Simpson's weights. */
static const double instants[SUBFRAMES] = {-0.5, -0.25, 0.0, 0.25, 0.5};
static const double weights[SUBFRAMES] = {1.0 / 12, 4.0 / 12, 2.0 / 12, 4.0 / 12, 1.0 / 12};
#define MIDDLE (SUBFRAMES / 2)

struct subframes {
    float *depth[SUBFRAMES];
    uint8_t *lit[SUBFRAMES]; /* NULL without shadow */
};

static double row_time(const struct exposure *exposure, int row, int height) {
    return height > 1 ? exposure->rolling_s * ((double)row / (height - 1) - 0.5) : 0.0;
}

static void expose_pixel(const struct subframes *s, size_t pixel, float *depth, uint8_t *lost) {
    double mean = 0.0, least = INFINITY, most = 0.0;
    bool seen = true, shadow_moves = false;
    for (int k = 0; k < SUBFRAMES; k++) {
        const double z = s->depth[k][pixel];
        seen = seen && z > 0.0;
        if (s->lit[k]) shadow_moves |= s->lit[k][pixel] != s->lit[MIDDLE][pixel];
        if (!seen) continue;
        mean += weights[k] / z;
        least = fmin(least, 1.0 / z);
        most = fmax(most, 1.0 / z);
    }
    const bool one = seen && !shadow_moves && KINECT_DISPARITY_PX_M * (most - least) <= SPOT_PX;
    depth[pixel] = one ? (float)(1.0 / mean) : s->depth[MIDDLE][pixel];
    lost[pixel] = !one;
}

static bool render_subframe(const struct exposure *exposure, const struct scene *scene,
                            const struct render_camera *camera, const struct camera_path *path, double t,
                            double far_m, int threads, float *depth, float *cosine) {
    struct camera_pose *rows = malloc((size_t)camera->height * sizeof *rows);
    if (!rows) return false;
    for (int y = 0; y < camera->height; y++)
        camera_path_pose(path, t + row_time(exposure, y, camera->height), &rows[y]);
    const bool whole = render_rolling(scene, camera, rows, far_m, threads, depth, cosine);
    free(rows);
    return whole;
}

bool exposure_render(const struct exposure *exposure, const struct scene *scene,
                     const struct render_camera *camera, const struct camera_path *path, double t,
                     double far_m, int threads, bool shadow, float *depth, float *cosine, uint8_t *lost) {
    const size_t pixels = (size_t)camera->width * (size_t)camera->height;
    memset(lost, 0, pixels);
    if (exposure->exposure_s <= 0.0)
        return render_subframe(exposure, scene, camera, path, t, far_m, threads, depth, cosine);
    float *buffer = malloc(SUBFRAMES * pixels * (sizeof *buffer + 1));
    if (!buffer) return false;
    struct subframes subframes = {.lit = {NULL}};
    bool whole = true;
    for (int k = 0; k < SUBFRAMES && whole; k++) {
        subframes.depth[k] = buffer + (size_t)k * pixels;
        whole = render_subframe(exposure, scene, camera, path, t + instants[k] * exposure->exposure_s, far_m,
                                threads, subframes.depth[k], k == MIDDLE ? cosine : NULL);
        if (!shadow || !whole) continue;
        subframes.lit[k] = (uint8_t *)(buffer + SUBFRAMES * pixels) + (size_t)k * pixels;
        kinect_lit(subframes.depth[k], camera->width, camera->height, camera->width / 640.0,
                   subframes.lit[k]);
    }
    for (size_t pixel = 0; pixel < pixels && whole; pixel++) expose_pixel(&subframes, pixel, depth, lost);
    free(buffer);
    return whole;
}
