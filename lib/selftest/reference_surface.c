#include "selftest/reference.h"

#include <math.h>
#include <string.h>

/* ---- ray-cast --------------------------------------------------------------------------------------------------- */

void ref_clear_ranges(int tiles, float *ranges) {
    for (int i = 0; i < tiles; i++) {
        ranges[2 * i] = INFINITY;
        ranges[2 * i + 1] = 0;
    }
}

/* Widens the ranges of those tiles that the rectangle touches. */
static void widen(const double low[2], const double high[2], double near_z, double far_z,
                  const kernel_camera *c, float *ranges) {
    int tiles_x = (c->width + TILE - 1) / TILE, tiles_y = (c->height + TILE - 1) / TILE;
    for (int y = 0; y < tiles_y; y++)
        for (int x = 0; x < tiles_x; x++) {
            /* whole pixels: a rectangle touches the pixels that its ends, rounded down, lie in */
            if (floor(fmin(high[0], c->width - 1)) < x * TILE || floor(fmax(low[0], 0)) >= (x + 1) * TILE)
                continue;
            if (floor(fmin(high[1], c->height - 1)) < y * TILE || floor(fmax(low[1], 0)) >= (y + 1) * TILE)
                continue;
            float *range = ranges + 2 * (y * tiles_x + x);
            range[0] = fminf(range[0], (float)near_z);
            range[1] = fmaxf(range[1], (float)far_z);
        }
}

/* A block counts in every tile that the rectangle about its corners' pictures touches, one pixel wider on each side,
 * and two voxels wider in depth. */
void ref_range_blocks(const cl_int4 *blocks, int count, const kernel_camera *c,
                      const kernel_rigid *world_to_camera, double voxel, double near_m, double far_m,
                      float *sure, float *widest) {
    for (int i = 0; i < count; i++) {
        double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}, nearest = INFINITY,
               farthest = 0;
        double slack = 0;
        for (int k = 0; k < 8; k++) {
            double world[3], p[3];
            for (int a = 0; a < 3; a++) world[a] = (blocks[i].s[a] + (k >> a & 1)) * BLOCK_EDGE * voxel;
            ref_transform(world_to_camera, world, p);
            nearest = fmin(nearest, p[2]);
            farthest = fmax(farthest, p[2]);
            double z = fmax(p[2], 0.05), pixel[2] = {p[0] / z * c->fx + c->cx, p[1] / z * c->fy + c->cy};
            slack = fmax(slack, 1e-3 + 1e-5 * (fabs(p[0]) + fabs(p[1]) + fabs(p[2])) / z * c->fx);
            for (int a = 0; a < 2; a++) {
                low[a] = fmin(low[a], pixel[a]);
                high[a] = fmax(high[a], pixel[a]);
            }
        }
        for (int unsure = 0; unsure < 2; unsure++) {
            double s = unsure ? slack : -slack, depth = unsure ? 1e-5 : -1e-5;
            if (farthest < near_m - depth || nearest > far_m + depth) continue;
            if (!(high[0] > -1 - s && high[1] > -1 - s && low[0] < c->width + s && low[1] < c->height + s))
                continue;
            double wide_low[2] = {low[0] - 1 - s, low[1] - 1 - s},
                   wide_high[2] = {high[0] + 1 + s, high[1] + 1 + s};
            widen(wide_low, wide_high, fmax(nearest - 2 * voxel, near_m), fmin(farthest + 2 * voxel, far_m),
                  c, unsure ? widest : sure);
        }
    }
}

/* The first crossing from outside to inside along a ray, in metres of depth; 0: none. */
static double first_crossing(ref_volume *v, const double origin[3], const double ray[3], double near_m,
                             double far_m) {
    double length = sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]);
    double step = 0.2 * v->surface.voxel / length, before = NAN;
    for (double t = near_m; t < far_m; t += step) {
        double p[3];
        for (int i = 0; i < 3; i++) p[i] = (origin[i] + ray[i] * t) / v->surface.voxel;
        double d = ref_volume_distance(v, p, NULL);
        if (before > 0 && d <= 0) {
            double a = t - step, b = t;
            for (int k = 0; k < 30; k++) {
                double middle = (a + b) / 2;
                for (int i = 0; i < 3; i++) p[i] = (origin[i] + ray[i] * middle) / v->surface.voxel;
                if (ref_volume_distance(v, p, NULL) > 0)
                    a = middle;
                else
                    b = middle;
            }
            return b;
        }
        before = d;
    }
    return 0;
}

/* The hit of pixel x, y between two depths: normal and depth, or zeros. */
static void cast_pixel(ref_volume *v, const kernel_camera *c, const kernel_rigid *camera_to_world, int x,
                       int y, double near_m, double far_m, float out[4]) {
    double origin[3] = {camera_to_world->x.s[3], camera_to_world->y.s[3], camera_to_world->z.s[3]};
    double in_camera[3] = {(x - (double)c->cx) / c->fx, (y - (double)c->cy) / c->fy, 1};
    double ray[3], p[3], g[3], n[3];
    memset(out, 0, 4 * sizeof *out);
    ref_rotate(camera_to_world, in_camera, ray);
    double t = first_crossing(v, origin, ray, near_m, far_m);
    if (t == 0) return;
    for (int i = 0; i < 3; i++) p[i] = (origin[i] + ray[i] * t) / v->surface.voxel;
    if (isnan(ref_volume_distance(v, p, g))) return;
    double length = sqrt(g[0] * g[0] + g[1] * g[1] + g[2] * g[2]);
    /* into the camera's axes: by the transpose of its rotation */
    for (int i = 0; i < 3; i++)
        n[i] = (camera_to_world->x.s[i] * g[0] + camera_to_world->y.s[i] * g[1] +
                camera_to_world->z.s[i] * g[2]) /
               length;
    if (!(length > 1e-4 && n[0] * in_camera[0] + n[1] * in_camera[1] + n[2] < 0)) return;
    for (int i = 0; i < 3; i++) out[i] = (float)n[i];
    out[3] = (float)t;
}

void ref_raycast(ref_volume *v, const kernel_camera *c, const kernel_rigid *camera_to_world, double near_m,
                 double far_m, float *model) {
    for (int i = 0; i < c->width * c->height; i++)
        cast_pixel(v, c, camera_to_world, i % c->width, i / c->width, near_m, far_m, model + 4 * i);
}

void ref_raycast_near(ref_volume *v, const kernel_camera *c, const kernel_rigid *camera_to_world,
                      const float *scan, double reach, double slack, float *model, uint8_t *doubt) {
    memset(model, 0, (size_t)c->width * (size_t)c->height * 4 * sizeof *model);
    for (int i = 0; i < c->width * c->height; i++) {
        int x = i % c->width, y = i / c->width;
        double z = scan[ref_at(c, x, y)];
        float less[4], more[4];
        doubt[i] = false;
        if (z == 0) continue;
        cast_pixel(v, c, camera_to_world, x, y, z - reach, z + reach, model + 4 * i);
        cast_pixel(v, c, camera_to_world, x, y, z - reach + slack, z + reach - slack, less);
        cast_pixel(v, c, camera_to_world, x, y, z - reach - slack, z + reach + slack, more);
        doubt[i] = (less[3] > 0) != (more[3] > 0);
    }
}

/* ---- marching cubes ---------------------------------------------------------------------------------------------- */

/* Corner k of a cube stands at (k & 1, k >> 1 & 1, k >> 2); an edge goes up one axis from its lower corner. */
static void edge_corners(int edge, int *low, int *high) {
    int axis = edge / 4, rest = edge % 4;
    static const int others[3][2] = {{1, 2}, {0, 2}, {0, 1}};
    *low = (rest & 1) << others[axis][0] | (rest >> 1) << others[axis][1];
    *high = *low | 1 << axis;
}

/* The corners that are inside, one bit each; 0 when one was never seen. */
static int cube_kind(ref_volume *v, const int i[3], double d[8]) {
    int kind = 0;
    for (int k = 0; k < 8; k++) {
        d[k] = ref_volume_voxel(v, i[0] + (k & 1), i[1] + (k >> 1 & 1), i[2] + (k >> 2));
        if (isnan(d[k])) return 0;
        kind |= (d[k] <= 0) << k;
    }
    return kind;
}

static void voxel_of(const ref_volume *v, int block, int k, int out[3]) {
    const cl_int4 *b = &v->blocks[block];
    out[0] = b->s[0] * BLOCK_EDGE + k % BLOCK_EDGE;
    out[1] = b->s[1] * BLOCK_EDGE + k / BLOCK_EDGE % BLOCK_EDGE;
    out[2] = b->s[2] * BLOCK_EDGE + k / (BLOCK_EDGE * BLOCK_EDGE);
}

void ref_count_triangles(ref_volume *v, const uint8_t *cases, int first, int count, int *counts) {
    for (int block = 0; block < count; block++) {
        counts[block] = 0;
        for (int k = 0; k < BLOCK_VOXELS; k++) {
            int i[3];
            double d[8];
            voxel_of(v, first + block, k, i);
            const uint8_t *edges = cases + 16 * cube_kind(v, i, d);
            for (int j = 0; j < 15 && edges[j] != 255; j += 3) counts[block]++;
        }
    }
}

/* Central differences; one-sided beside unseen voxels. */
static void voxel_gradient(ref_volume *v, const int i[3], double g[3]) {
    double here = ref_volume_voxel(v, i[0], i[1], i[2]);
    for (int a = 0; a < 3; a++) {
        int e[3] = {a == 0, a == 1, a == 2};
        double up = ref_volume_voxel(v, i[0] + e[0], i[1] + e[1], i[2] + e[2]);
        double down = ref_volume_voxel(v, i[0] - e[0], i[1] - e[1], i[2] - e[2]);
        if (isnan(up) && isnan(down))
            g[a] = 0;
        else
            g[a] = isnan(up) ? 2 * (here - down) : isnan(down) ? 2 * (up - here) : up - down;
    }
}

/* The crossing of an edge with the surface, and the normal there. */
static void edge_vertex(ref_volume *v, const int i[3], int edge, const double d[8], float out[6]) {
    int low, high, at_low[3], at_high[3];
    double g_low[3], g_high[3], n[3];
    edge_corners(edge, &low, &high);
    double t = fmin(fmax(d[low] / (d[low] - d[high]), CORNER_MARGIN), 1 - CORNER_MARGIN);
    for (int a = 0; a < 3; a++) {
        at_low[a] = i[a] + (low >> a & 1);
        at_high[a] = i[a] + (high >> a & 1);
        out[a] = (float)((at_low[a] + t * (at_high[a] - at_low[a])) * v->surface.voxel);
    }
    voxel_gradient(v, at_low, g_low);
    voxel_gradient(v, at_high, g_high);
    for (int a = 0; a < 3; a++) n[a] = (1 - t) * g_low[a] + t * g_high[a];
    double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    for (int a = 0; a < 3; a++) out[3 + a] = (float)(length > 1e-6 ? n[a] / length : a == 2);
}

void ref_emit_triangles(ref_volume *v, const uint8_t *cases, int first, int count, float *vertices) {
    for (int block = 0; block < count; block++)
        for (int k = 0; k < BLOCK_VOXELS; k++) {
            int i[3];
            double d[8];
            voxel_of(v, first + block, k, i);
            const uint8_t *edges = cases + 16 * cube_kind(v, i, d);
            for (int j = 0; j < 15 && edges[j] != 255; j++, vertices += 6)
                edge_vertex(v, i, edges[j], d, vertices);
        }
}
