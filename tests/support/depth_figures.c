#include "depth_figures.h"

#include <math.h>
#include <stdbool.h>
#include <stddef.h>

const double figure_depths[FIGURE_DEPTHS + 1] = {0.5, 1.0, 2.0, 3.0, 4.0};
static const double step_heights[FIGURE_STEPS + 1] = {0.15, 0.3, 0.6, 2.0};

#define FEW 2000
#define FEW_STEPS 100
#define CAP 0.003 /* of the depth */

/* Index of the interval that holds the value, or -1. */
static int interval(const double *limits, int count, double value) {
    for (int i = 0; i < count; i++)
        if (value >= limits[i] && value < limits[i + 1]) return i;
    return -1;
}

static bool sure(const struct depth_view *view, size_t pixel) {
    return view->depth[pixel] > 0.0f && (!view->confidence || view->confidence[pixel] >= 2);
}

/* ---- Flicker ---- */

#define REACH 5     /* pixels to all sides within which a surface must be plane, */
#define PLANE 0.010 /* to this share of its inverse depth */

/* The angle of incidence, degrees, from inverse depth, which is linear in the picture on a plane; -1: not plane. */
static double incidence(const struct depth_view *view, int x, int y) {
    const struct render_camera *c = view->camera;
    if (x < REACH || y < REACH || x >= c->width - REACH || y >= c->height - REACH) return -1.0;
    const float *z = view->depth + (size_t)y * (size_t)c->width + x;
    const double u = (x - c->cx) / c->fx, v = (y - c->cy) / c->fy, w = 1.0 / z[0];
    const double left = 1.0 / z[-REACH], right = 1.0 / z[REACH];
    const double up = 1.0 / z[-REACH * c->width], down = 1.0 / z[REACH * c->width];
    if (!(fmax(fabs(left - 2.0 * w + right), fabs(up - 2.0 * w + down)) < PLANE * w)) return -1.0;
    const double a = (right - left) / (2 * REACH) * c->fx, b = (down - up) / (2 * REACH) * c->fy;
    const double n = w - a * u - b * v;
    const double cosine = w / sqrt((a * a + b * b + n * n) * (1.0 + u * u + v * v));
    return acos(fmin(cosine, 1.0)) * 57.29577951308232;
}

/* The depth at a point of the picture, between four sure pixels of one surface; 0 where there are none. */
static double depth_at(const struct depth_view *view, double x, double y) {
    const int w = view->camera->width, h = view->camera->height;
    const int u = (int)floor(x), v = (int)floor(y);
    if (!(x >= 0.0 && y >= 0.0) || u >= w - 1 || v >= h - 1) return 0.0;
    const size_t at = (size_t)v * (size_t)w + (size_t)u;
    if (!sure(view, at) || !sure(view, at + 1) || !sure(view, at + (size_t)w) ||
        !sure(view, at + (size_t)w + 1))
        return 0.0;
    const float *up = view->depth + at, *down = up + w;
    const float least = fminf(fminf(up[0], up[1]), fminf(down[0], down[1]));
    const float most = fmaxf(fmaxf(up[0], up[1]), fmaxf(down[0], down[1]));
    if (most - least > 0.05f * most + 0.02f) return 0.0;
    const double s = x - u, t = y - v;
    return (1.0 - t) * ((1.0 - s) * up[0] + s * up[1]) + t * ((1.0 - s) * down[0] + s * down[1]);
}

/* Where a point of one frame's camera lies in another's. */
static void carry(const struct camera_pose *from, const struct camera_pose *to, const double p[3],
                  double out[3]) {
    double world[3];
    for (int i = 0; i < 3; i++) {
        const double *r = &from->rotation[3 * i];
        world[i] = r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + from->position[i] - to->position[i];
    }
    for (int i = 0; i < 3; i++)
        out[i] = to->rotation[i] * world[0] + to->rotation[3 + i] * world[1] + to->rotation[6 + i] * world[2];
}

void depth_figures_pair(struct depth_figures *figures, const struct depth_view *before,
                        const struct depth_view *after) {
    const struct render_camera *c = before->camera;
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            const size_t at = (size_t)y * (size_t)c->width + (size_t)x;
            if (!sure(before, at)) continue;
            const double z = before->depth[at], degrees = incidence(before, x, y);
            const int angle = degrees < 0.0                       ? -1
                              : degrees < 25.0                    ? FACING
                              : degrees >= 45.0 && degrees < 75.0 ? SLANTED
                                                                  : -1;
            const int depth = interval(figure_depths, FIGURE_DEPTHS, z);
            if (angle < 0 || depth < 0) continue;
            double moved[3];
            const double p[3] = {(x - c->cx) / c->fx * z, (y - c->cy) / c->fy * z, z};
            carry(&before->pose, &after->pose, p, moved);
            if (moved[2] < 0.1) continue;
            const double seen =
                depth_at(after, moved[0] / moved[2] * c->fx + c->cx, moved[1] / moved[2] * c->fy + c->cy);
            if (seen <= 0.0) continue;
            const double change = fabs(seen / moved[2] - 1.0) * 1e5;
            figures->changes[angle][depth][change < FIGURE_CHANGES ? (int)change : FIGURE_CHANGES]++;
        }
}

double depth_figures_flicker(const struct depth_figures *figures, int angle, int depth) {
    const long *changes = figures->changes[angle][depth];
    long count = 0, below = 0;
    for (int i = 0; i <= FIGURE_CHANGES; i++) count += changes[i];
    if (count < FEW) return NAN;
    for (int i = 0; i <= FIGURE_CHANGES; i++)
        if (2 * (below += changes[i]) >= count) return (i + 0.5) * 1e-5;
    return NAN;
}

/* ---- Second differences ---- */

static void second_along(struct depth_figures *figures, const struct depth_view *view, size_t at,
                         size_t stride) {
    if (!sure(view, at - stride) || !sure(view, at + stride)) return;
    const float *z = view->depth + at;
    const int depth = interval(figure_depths, FIGURE_DEPTHS, z[0]);
    if (depth < 0) return;
    const double second = fabs((double)*(z - stride) - 2.0 * z[0] + z[stride]);
    figures->second_sum[depth] += fmin(second, CAP * z[0]);
    figures->second_count[depth]++;
}

void depth_figures_second(struct depth_figures *figures, const struct depth_view *view) {
    const int w = view->camera->width, h = view->camera->height;
    for (int y = 1; y < h - 1; y++)
        for (int x = 1; x < w - 1; x++) {
            const size_t at = (size_t)y * (size_t)w + (size_t)x;
            if (!sure(view, at)) continue;
            second_along(figures, view, at, 1);
            second_along(figures, view, at, (size_t)w);
        }
}

double depth_figures_second_difference(const struct depth_figures *figures, int depth) {
    const long count = figures->second_count[depth];
    return count < FEW ? NAN : figures->second_sum[depth] / (double)count;
}

/* ---- Smear ---- */

#define HALF 12   /* pixels from a step's middle to either end of what is looked at */
#define PLATEAU 4 /* pixels of that at each end must be flat */

struct step {
    double near, height;
    int width;
};

/* The step whose middle is at *z, if there is one. */
static bool step_at(const float *z, ptrdiff_t stride, struct step *step) {
    double low[2], high[2], mean[2] = {0.0, 0.0};
    for (int side = 0; side < 2; side++) {
        low[side] = INFINITY;
        high[side] = 0.0;
        for (int i = 0; i < PLATEAU; i++) {
            const double value = z[(side ? HALF - i : i - HALF) * stride];
            low[side] = fmin(low[side], value);
            high[side] = fmax(high[side], value);
            mean[side] += value / PLATEAU;
        }
    }
    step->near = fmin(mean[0], mean[1]);
    step->height = fabs(mean[1] - mean[0]);
    if (low[0] <= 0.0 || low[1] <= 0.0 || step->height < step_heights[0] * step->near) return false;
    if (fmax(high[0] - low[0], high[1] - low[1]) > 0.08 * step->height) return false;
    int nearer = 0;
    step->width = 0;
    for (int i = -HALF; i <= HALF; i++) {
        const double share = (z[i * stride] - step->near) / step->height;
        if (z[i * stride] <= 0.0f) return false;
        nearer += share < 0.5;
        step->width += share > 0.1 && share < 0.9;
    }
    return nearer == HALF || nearer == HALF + 1;
}

static void edge_along(struct depth_figures *figures, const struct depth_view *view, size_t at,
                       size_t stride) {
    struct step step, sharp;
    if (!step_at(view->depth + at, (ptrdiff_t)stride, &step)) return;
    if (view->truth && (!step_at(view->truth + at, (ptrdiff_t)stride, &sharp) || sharp.width > 0)) return;
    const int depth = interval(figure_depths, FIGURE_DEPTHS, step.near);
    const int height = interval(step_heights, FIGURE_STEPS, step.height / step.near);
    if (depth < 0 || height < 0) return;
    figures->width_sum[depth][height] += step.width;
    figures->width_count[depth][height]++;
}

void depth_figures_edges(struct depth_figures *figures, const struct depth_view *view) {
    const int w = view->camera->width, h = view->camera->height;
    for (int y = 0; y < h; y++)
        for (int x = 0; x < w; x++) {
            const size_t at = (size_t)y * (size_t)w + (size_t)x;
            if (x >= HALF && x < w - HALF) edge_along(figures, view, at, 1);
            if (y >= HALF && y < h - HALF) edge_along(figures, view, at, (size_t)w);
        }
}

double depth_figures_width(const struct depth_figures *figures, int depth, const struct depth_figures *like) {
    double sum = 0.0;
    long count = 0;
    for (int height = 0; height < FIGURE_STEPS; height++) {
        const long n = figures->width_count[depth][height], weight = like->width_count[depth][height];
        if (n < FEW_STEPS || weight < FEW_STEPS) continue;
        sum += (double)weight * figures->width_sum[depth][height] / (double)n;
        count += weight;
    }
    return count ? sum / (double)count : NAN;
}
