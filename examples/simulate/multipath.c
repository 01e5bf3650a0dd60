/* One bounce between matt patches, as a depth image shows them (Jimenez, Pizarro, Mazo, Palazuelos 2014, "Modeling
 * and correction of multipath interference in time of flight cameras", Image and Vision Computing 32): the camera's
 * light lights patch Q, which lights patch P, which the camera sees in P's direction. What that adds to the direct
 * light at P has gone (|Q| + |PQ| - |P|) / 2 farther. The two are summed as phasors of the modulation. Walls that
 * meet in a corner read too far by a centimetre or two, and a surface that faces no other reads true. What the camera
 * doesn't see lights nothing here. */
#include "simulate/multipath.h"

#include <math.h>
#include <stddef.h>
#include <stdlib.h>

#define COLUMNS 32 /* of patches */
/* Less than a painted wall's 0.6: cameras correct some of the error (Freedman and others 2014, "SRA: fast removal of
 * general multipath for ToF sensors", ECCV), and one or two centimetres stay in a room's corner. */
#define ALBEDO 0.2
#define PHASE_M 1.874 /* a whole turn of the phase at 80 MHz */
#define TURN 6.283185307179586

struct patch {
    double point[3], normal[3];  /* towards the camera; 0 where there is none */
    double range, cosine, angle; /* solid angle seen from the camera */
};

struct grid {
    const struct render_camera *camera;
    const float *depth, *cosine;
    int columns, rows;
    double size; /* of a patch, pixels */
    struct patch *patches;
    float *bias, *smooth; /* of each patch */
};

static void point_of(const struct grid *g, int x, int y, double p[3]) {
    const struct render_camera *c = g->camera;
    const double z = g->depth[(size_t)y * (size_t)c->width + (size_t)x];
    p[0] = (x - c->cx) / c->fx * z;
    p[1] = (y - c->cy) / c->fy * z;
    p[2] = z;
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static int within(double at, int size) {
    return at < 0.0 ? 0 : at > size - 1 ? size - 1 : (int)at;
}

/* The patch about a pixel, with the plane through its neighbours. */
static void make_patch(const struct grid *g, int column, int row, struct patch *patch) {
    const struct render_camera *c = g->camera;
    const int x = within((column + 0.5) * g->size, c->width), y = within((row + 0.5) * g->size, c->height);
    const int left = within(x - 2.0, c->width), right = within(x + 2.0, c->width);
    const int up = within(y - 2.0, c->height), down = within(y + 2.0, c->height);
    double l[3], r[3], u[3], d[3], n[3];
    *patch = (struct patch){.range = 0.0};
    point_of(g, x, y, patch->point);
    point_of(g, left, y, l);
    point_of(g, right, y, r);
    point_of(g, x, up, u);
    point_of(g, x, down, d);
    if (!(patch->point[2] > 0.0 && l[2] > 0.0 && r[2] > 0.0 && u[2] > 0.0 && d[2] > 0.0)) return;
    for (int i = 0; i < 3; i++) {
        r[i] -= l[i];
        d[i] -= u[i];
    }
    for (int i = 0; i < 3; i++) n[i] = d[(i + 1) % 3] * r[(i + 2) % 3] - d[(i + 2) % 3] * r[(i + 1) % 3];
    const double length = sqrt(dot(n, n)), range = sqrt(dot(patch->point, patch->point));
    if (!(length > 0.0)) return;
    const double toward = dot(n, patch->point) > 0.0 ? -1.0 / length : 1.0 / length;
    for (int i = 0; i < 3; i++) patch->normal[i] = n[i] * toward;
    const double inclined = patch->point[2] / range;
    patch->range = range;
    patch->cosine = fmax(g->cosine[(size_t)y * (size_t)c->width + (size_t)x], 0.05);
    patch->angle = g->size * g->size / (c->fx * c->fy) * inclined * inclined * inclined;
}

/* What p reads too far. */
static double bias_at(const struct grid *g, const struct patch *p) {
    double real = 1.0, imaginary = 0.0;
    for (int i = 0; i < g->columns * g->rows; i++) {
        const struct patch *q = &g->patches[i];
        if (!(q->range > 0.0) || q == p) continue;
        double way[3];
        for (int k = 0; k < 3; k++) way[k] = q->point[k] - p->point[k];
        const double leaving = -dot(way, q->normal), arriving = dot(way, p->normal);
        if (leaving <= 0.0 || arriving <= 0.0) continue;
        /* A patch is no point: near ones count as disks. */
        const double area = q->angle * q->range * q->range / q->cosine;
        const double square = dot(way, way), distance = sqrt(square),
                     spread = square + area / 3.141592653589793;
        const double share = ALBEDO / 3.141592653589793 * q->angle * leaving * arriving / (square * spread) *
                             p->range * p->range / p->cosine;
        const double phase = TURN * 0.5 * (q->range + distance - p->range) / PHASE_M;
        real += share * cos(phase);
        imaginary += share * sin(phase);
    }
    return atan2(imaginary, real) / TURN * PHASE_M;
}

/* Over three patches each way: a patch on an edge has a chance normal. */
static void smooth(const struct grid *g, float *out) {
    for (int y = 0; y < g->rows; y++)
        for (int x = 0; x < g->columns; x++) {
            float sum = 0.0f;
            int count = 0;
            for (int v = y > 0 ? y - 1 : 0; v <= y + 1 && v < g->rows; v++)
                for (int u = x > 0 ? x - 1 : 0; u <= x + 1 && u < g->columns; u++) {
                    if (!(g->patches[v * g->columns + u].range > 0.0)) continue;
                    sum += g->bias[v * g->columns + u];
                    count++;
                }
            out[y * g->columns + x] = count ? sum / (float)count : 0.0f;
        }
}

/* Between the patches' middles. */
static float between(const struct grid *g, int x, int y) {
    const double u = fmin(fmax(x / g->size - 0.5, 0.0), g->columns - 1.0);
    const double v = fmin(fmax(y / g->size - 0.5, 0.0), g->rows - 1.0);
    const int column = u < g->columns - 1 ? (int)u : g->columns - 2,
              row = v < g->rows - 1 ? (int)v : g->rows - 2;
    const float s = (float)(u - column), t = (float)(v - row);
    const float *up = g->smooth + row * g->columns + column, *down = up + g->columns;
    return (1.0f - t) * ((1.0f - s) * up[0] + s * up[1]) + t * ((1.0f - s) * down[0] + s * down[1]);
}

bool multipath_bias(const struct render_camera *camera, const float *depth, const float *cosine,
                    float *bias) {
    const double size = camera->width / (double)COLUMNS;
    const int rows = (int)ceil(camera->height / size);
    struct grid g = {camera, depth, cosine, COLUMNS, rows > 1 ? rows : 2, size, NULL, NULL, NULL};
    const size_t count = (size_t)g.columns * (size_t)g.rows;
    g.patches = malloc(count * sizeof *g.patches);
    g.bias = malloc(2 * count * sizeof *g.bias);
    g.smooth = g.bias ? g.bias + count : NULL;
    const bool done = g.patches && g.bias;
    for (size_t i = 0; done && i < count; i++)
        make_patch(&g, (int)(i % (size_t)g.columns), (int)(i / (size_t)g.columns), &g.patches[i]);
    for (size_t i = 0; done && i < count; i++)
        g.bias[i] = g.patches[i].range > 0.0 ? (float)bias_at(&g, &g.patches[i]) : 0.0f;
    if (done) smooth(&g, g.smooth);
    for (int y = 0; done && y < camera->height; y++)
        for (int x = 0; x < camera->width; x++)
            bias[(size_t)y * (size_t)camera->width + (size_t)x] = between(&g, x, y);
    free(g.patches);
    free(g.bias);
    return done;
}
