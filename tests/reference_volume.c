#include "reference.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- looking things up ---------------------------------------------------------------------------------------- */

static int compare_blocks(const cl_int4 *a, const cl_int4 *b) {
    for (int i = 2; i >= 0; i--)
        if (a->s[i] != b->s[i]) return a->s[i] < b->s[i] ? -1 : 1;
    return 0;
}

static int by_coordinates(const void *a, const void *b, void *blocks) {
    return compare_blocks((const cl_int4 *)blocks + *(const int *)a,
                          (const cl_int4 *)blocks + *(const int *)b);
}

void ref_volume_open(ref_volume *v, const cl_int4 *blocks, int count, const int16_t *voxels,
                     const kernel_surface *surface) {
    *v = (ref_volume){.blocks = blocks, .count = count, .voxels = voxels, .surface = *surface, .last = -1};
    v->order = malloc(((size_t)count + 1) * sizeof *v->order);
    if (!v->order) abort();
    for (int i = 0; i < count; i++) v->order[i] = i;
    qsort_r(v->order, (size_t)count, sizeof *v->order, by_coordinates, (void *)blocks);
}

void ref_volume_close(ref_volume *v) {
    free(v->order);
    v->order = NULL;
}

int ref_volume_place(ref_volume *v, int x, int y, int z) {
    cl_int4 wanted = {{x, y, z, 0}};
    if (v->last >= 0 && v->last_block[0] == x && v->last_block[1] == y && v->last_block[2] == z)
        return v->last;
    int low = 0, high = v->count;
    while (low < high) {
        int middle = (low + high) / 2, side = compare_blocks(&v->blocks[v->order[middle]], &wanted);
        if (side == 0) {
            v->last_block[0] = x;
            v->last_block[1] = y;
            v->last_block[2] = z;
            return v->last = v->blocks[v->order[middle]].s[3];
        }
        if (side < 0)
            low = middle + 1;
        else
            high = middle;
    }
    return -1;
}

static int floor_div(int a, int b) {
    return (a - (a % b + b) % b) / b;
}

double ref_volume_voxel(ref_volume *v, int x, int y, int z) {
    int bx = floor_div(x, BLOCK_EDGE), by = floor_div(y, BLOCK_EDGE), bz = floor_div(z, BLOCK_EDGE);
    int place = ref_volume_place(v, bx, by, bz);
    if (place < 0) return NAN;
    int at = ((z - BLOCK_EDGE * bz) * BLOCK_EDGE + y - BLOCK_EDGE * by) * BLOCK_EDGE + x - BLOCK_EDGE * bx;
    const int16_t *block = v->voxels + (size_t)place * 2 * BLOCK_VOXELS;
    uint16_t weight = (uint16_t)block[BLOCK_VOXELS + at];
    bool seen =
        block[at] != REF_NEVER_SEEN && !(v->surface.min_weight > 0 && weight <= v->surface.min_weight);
    return seen ? block[at] / 32767.0 : NAN;
}

double ref_volume_distance(ref_volume *v, const double p[3], double gradient[3]) {
    int low[3];
    double t[3], sum = 0, g[3] = {0, 0, 0};
    for (int i = 0; i < 3; i++) {
        low[i] = (int)floor(p[i]);
        t[i] = p[i] - low[i];
    }
    for (int k = 0; k < 8; k++) {
        int in[3] = {k & 1, k >> 1 & 1, k >> 2};
        double d = ref_volume_voxel(v, low[0] + in[0], low[1] + in[1], low[2] + in[2]);
        if (isnan(d)) return NAN;
        double share[3], slope[3];
        for (int i = 0; i < 3; i++) {
            share[i] = in[i] ? t[i] : 1 - t[i];
            slope[i] = in[i] ? 1 : -1;
        }
        sum += share[0] * share[1] * share[2] * d;
        g[0] += slope[0] * share[1] * share[2] * d;
        g[1] += share[0] * slope[1] * share[2] * d;
        g[2] += share[0] * share[1] * slope[2] * d;
    }
    if (gradient) memcpy(gradient, g, sizeof g);
    return sum;
}

/* ---- allocation ------------------------------------------------------------------------------------------------- */

/* A coordinate in blocks, after some five roundings in single precision. */
#define BLOCK_SLACK(v) (1e-4 + 4e-7 * fabs(v))

/* Appends the blocks that a pixel's ray meets within the truncation band and that are neither there nor asked for. */
static int request_pixel(const double origin[3], const double ray[3], double z, double block_m,
                         double truncation, ref_volume *v, cl_int4 *slots, int count, bool *doubt) {
    double reach = truncation / sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]);
    double from[3], way[3], longest = 0;
    for (int i = 0; i < 3; i++) {
        from[i] = (origin[i] + ray[i] * (z - reach)) / block_m;
        way[i] = 2 * ray[i] * reach / block_m;
        longest = fmax(longest, fabs(way[i]));
    }
    /* in steps of half a block or less along the axis that changes most */
    int steps = -ref_floor(-2 * longest, BLOCK_SLACK(longest), doubt);
    for (int k = 0; k <= steps; k++) {
        cl_int4 b = {{0, 0, 0, 0}};
        for (int i = 0; i < 3; i++) {
            double at = from[i] + way[i] * k / (steps ? steps : 1);
            /* both ends of the band round as the camera's place does */
            b.s[i] = ref_floor(at, BLOCK_SLACK(fabs(at) + fabs(origin[i] / block_m)), doubt);
        }
        bool known = count == TILE_SLOTS || ref_volume_place(v, b.s[0], b.s[1], b.s[2]) >= 0;
        for (int j = 0; j < count && !known; j++) known = compare_blocks(&slots[j], &b) == 0;
        if (!known) slots[count++] = b;
    }
    return count;
}

void ref_tile_farthest(const float *depth, const kernel_camera *c, float *farthest) {
    int tiles_x = (c->width + TILE - 1) / TILE, tiles_y = (c->height + TILE - 1) / TILE;
    memset(farthest, 0, (size_t)(tiles_x * tiles_y) * sizeof *farthest);
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            float *tile = &farthest[y / TILE * tiles_x + x / TILE];
            *tile = fmaxf(*tile, depth[ref_at(c, x, y)]);
        }
}

/* Pixels a third of a block apart are enough. */
static int pixels_apart(const kernel_camera *c, float farthest, float block_m) {
    int apart = (int)(c->fx * block_m / (3 * fmaxf(farthest, 0.01f)));
    return apart < 1 ? 1 : apart > 4 ? 4 : apart;
}

void ref_request_blocks(const float *depth, const kernel_camera *c, const kernel_rigid *camera_to_world,
                        double block_m, double truncation, ref_volume *v, cl_int4 *requests, int *counts,
                        uint8_t *doubt) {
    int tiles_x = (c->width + TILE - 1) / TILE, tiles_y = (c->height + TILE - 1) / TILE;
    double origin[3] = {camera_to_world->x.s[3], camera_to_world->y.s[3], camera_to_world->z.s[3]};
    float *farthest = malloc((size_t)(tiles_x * tiles_y) * sizeof *farthest);
    if (!farthest) abort();
    ref_tile_farthest(depth, c, farthest);
    for (int tile = 0; tile < tiles_x * tiles_y; tile++) {
        int apart = pixels_apart(c, farthest[tile], (float)block_m);
        counts[tile] = 0;
        for (int k = 0; k < TILE * TILE; k++) {
            int x = tile % tiles_x * TILE + k % TILE, y = tile / tiles_x * TILE + k / TILE;
            if (x >= c->width || y >= c->height) continue;
            double z = depth[ref_at(c, x, y)], ray[3];
            bool unsure = false;
            ref_rotate(camera_to_world,
                       (double[]){(x - (double)c->cx) / c->fx, (y - (double)c->cy) / c->fy, 1}, ray);
            if (z != 0 && k % TILE % apart == 0 && k / TILE % apart == 0)
                counts[tile] = request_pixel(origin, ray, z, block_m, truncation, v,
                                             requests + tile * TILE_SLOTS, counts[tile], &unsure);
            if (doubt) doubt[y * c->width + x] = unsure;
        }
    }
    free(farthest);
}

void ref_clear_blocks(int first, int count, int16_t *voxels) {
    for (int i = first * 2 * BLOCK_VOXELS; i < (first + count) * 2 * BLOCK_VOXELS; i++)
        voxels[i] = i % (2 * BLOCK_VOXELS) < BLOCK_VOXELS ? REF_NEVER_SEEN : 0;
}

/* ---- fusion ------------------------------------------------------------------------------------------------------- */

#define PLACE_SLACK 1e-6 /* a voxel's place in camera axes, metres; of that, what it makes in the picture */

static double clamp(double v, double low, double high) {
    return fmin(fmax(v, low), high);
}

/* One voxel's running average (Curless and Levoy 1996, eq. 1 and 2) of its distance to the plane through the pixel's
 * surface point; without a normal, of the distance along the ray, at a quarter of the weight. False where the frame says
 * nothing about the voxel. */
static bool fuse_voxel(const float *scan, const kernel_camera *c, cl_float2 noise, const double p[3],
                       double truncation, double max_weight, int16_t *distance, uint16_t *weight,
                       bool *doubt) {
    if (!ref_below(0.1, p[2], 1e-5, doubt)) return false;
    double slack = c->fx * PLACE_SLACK * (1 + fabs(p[0]) + fabs(p[1]) + fabs(p[2])) / p[2] * 4 + 1e-4;
    double ray[3] = {p[0] / p[2], p[1] / p[2], 1}, length = sqrt(ray[0] * ray[0] + ray[1] * ray[1] + 1);
    double column = ray[0] * c->fx + c->cx + 0.5, row = ray[1] * c->fy + c->cy + 0.5;
    if (!(fabs(column) < 1e6 && fabs(row) < 1e6)) return false;
    int x = ref_floor(column, slack, doubt), y = ref_floor(row, slack, doubt);
    if (x < 0 || y < 0 || x >= c->width || y >= c->height) return false;
    const float *n = scan + 4 * (y * c->width + x);
    double z = n[3], s = (z - p[2]) * length, squarely = 0.25;
    if (!(z > 0) || !ref_below(-truncation, s, 2e-5, doubt)) return false;
    if (n[2] != 0) {
        double surface[3] = {(x - (double)c->cx) / c->fx * z, (y - (double)c->cy) / c->fy * z, z};
        s = squarely = 0;
        for (int i = 0; i < 3; i++) {
            s += n[i] * (p[i] - surface[i]);
            squarely -= n[i] * ray[i] / length;
        }
        if (!ref_below(-truncation, s, 2e-5, doubt)) return false;
    }
    /* inverse variance, 64 at 1 m */
    double ratio = ref_sigma(noise, 1) / ref_sigma(noise, z), w = WEIGHT_ONE * ratio * ratio * squarely;
    (void)ref_floor(w + 0.5, 1e-5 + 1e-5 * fabs(w), doubt);
    w = clamp(rint(w), 1, 4 * WEIGHT_ONE);
    double mean = ((*weight ? *distance * (double)*weight : 0) + clamp(s / truncation, -1, 1) * 32767 * w) /
                  (*weight + w);
    *distance = (int16_t)rint(mean);
    *weight = (uint16_t)fmin(*weight + w, max_weight * WEIGHT_ONE);
    return true;
}

void ref_fuse_blocks(const float *scan, const kernel_camera *c, cl_float2 noise,
                     const kernel_rigid *world_to_camera, double voxel, double truncation, double max_weight,
                     const cl_int4 *blocks, int count, int settled, int turn, int16_t *voxels,
                     uint8_t *doubt) {
    for (int i = 0; i < count * BLOCK_VOXELS; i++) {
        int block = i / BLOCK_VOXELS, k = i % BLOCK_VOXELS;
        int in[3] = {k % BLOCK_EDGE, k / BLOCK_EDGE % BLOCK_EDGE, k / (BLOCK_EDGE * BLOCK_EDGE)};
        int16_t *data = voxels + (size_t)block * 2 * BLOCK_VOXELS + k;
        double world[3], p[3];
        bool unsure = false;
        if (doubt) doubt[i] = false;
        if (block < settled && block % 2 != turn) continue;
        for (int a = 0; a < 3; a++) world[a] = (blocks[block].s[a] * BLOCK_EDGE + in[a]) * voxel;
        ref_transform(world_to_camera, world, p);
        fuse_voxel(scan, c, noise, p, truncation, max_weight, data, (uint16_t *)data + BLOCK_VOXELS, &unsure);
        if (doubt) doubt[i] = unsure;
    }
}
