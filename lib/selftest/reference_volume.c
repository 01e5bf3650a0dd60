#include "selftest/reference.h"

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
            return v->last = v->order[middle];
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

/* Neighbouring samples of a ray mostly lie in the same cube. */
static void look_up_cube(ref_volume *v, const int low[3]) {
    if (v->has_cube && memcmp(low, v->cube, sizeof v->cube) == 0) return;
    memcpy(v->cube, low, sizeof v->cube);
    v->has_cube = true;
    for (int k = 0; k < 8; k++) {
        v->corner[k] = ref_volume_voxel(v, low[0] + (k & 1), low[1] + (k >> 1 & 1), low[2] + (k >> 2));
        if (isnan(v->corner[k])) {
            v->corner[0] = NAN;
            return;
        }
    }
}

double ref_volume_distance(ref_volume *v, const double p[3], double gradient[3]) {
    int low[3];
    double t[3], sum = 0, g[3] = {0, 0, 0};
    for (int i = 0; i < 3; i++) {
        low[i] = (int)floor(p[i]);
        t[i] = p[i] - low[i];
    }
    look_up_cube(v, low);
    if (isnan(v->corner[0])) return NAN;
    for (int k = 0; k < 8; k++) {
        int in[3] = {k & 1, k >> 1 & 1, k >> 2};
        double d = v->corner[k];
        double share[3], slope[3];
        for (int i = 0; i < 3; i++) {
            share[i] = in[i] ? t[i] : 1 - t[i];
            slope[i] = in[i] ? 1 : -1;
        }
        sum += share[0] * share[1] * share[2] * d;
        if (!gradient) continue;
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
#define STEP_SLACK 0.01 /* a band as long as a whole number of steps mustn't become one more by rounding */

/* Adds the results of rounding a coordinate triple: each axis is one of low, high. */
static int add_met(const int low[3], const int high[3], bool sure, cl_int4 *met, int count, int most) {
    for (int k = 0; k < 8 && count >= 0; k++) {
        cl_int4 b = {{0, 0, 0, 0}};
        bool twice = false;
        for (int i = 0; i < 3; i++) {
            b.s[i] = k >> i & 1 ? high[i] : low[i];
            twice |= (k >> i & 1) && high[i] == low[i];
        }
        int j = count - 1;
        if (twice) continue;
        b.s[3] = sure && memcmp(low, high, 3 * sizeof *low) == 0;
        while (j >= 0 && compare_blocks(&met[j], &b) != 0) j--;
        if (j >= 0)
            met[j].s[3] |= b.s[3];
        else if (count == most)
            count = -1;
        else
            met[count++] = b;
    }
    return count;
}

/* Adds the blocks that a ray meets within the truncation band, at points half a block or less apart. */
static int met_by_ray(const double origin[3], const double ray[3], double z, double block_m,
                      double truncation, bool sure, cl_int4 *met, int count, int most) {
    double reach = truncation / sqrt(ray[0] * ray[0] + ray[1] * ray[1] + ray[2] * ray[2]);
    int steps = (int)fmax(ceil(4 * truncation / block_m - STEP_SLACK), 1);
    for (int k = 0; k <= steps && count >= 0; k++) {
        int low[3], high[3];
        for (int i = 0; i < 3; i++) {
            double at = (origin[i] + ray[i] * (z + reach * (2.0 * k / steps - 1))) / block_m;
            /* both ends of the band round as the camera's place does */
            double slack = BLOCK_SLACK(fabs(at) + fabs(origin[i] / block_m));
            low[i] = (int)floor(at - slack);
            high[i] = (int)floor(at + slack);
        }
        count = add_met(low, high, sure, met, count, most);
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

/* Rows a third of a block apart are enough. */
static int rows_apart(const kernel_camera *c, double farthest, double block_m) {
    int apart = (int)(c->fx * block_m / (3 * fmax(farthest, 0.01)));
    return apart < 1 ? 1 : apart > 4 ? 4 : apart;
}

int ref_met_blocks(const float *depth, const kernel_camera *c, const kernel_rigid *camera_to_world,
                   double block_m, double truncation, int tile, cl_int4 *met, int most) {
    int tiles_x = (c->width + TILE - 1) / TILE, x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
    double origin[3] = {camera_to_world->x.s[3], camera_to_world->y.s[3], camera_to_world->z.s[3]}, far = 0;
    int count = 0;
    for (int y = y0; y < y0 + TILE && y < c->height; y++)
        for (int x = x0; x < x0 + TILE && x < c->width; x++) far = fmax(far, depth[ref_at(c, x, y)]);
    int fewest = rows_apart(c, far * (1 - 1e-6), block_m), closest = rows_apart(c, far * (1 + 1e-6), block_m);
    for (int y = y0; y < y0 + TILE && y < c->height; y++) {
        bool one = (y - y0) % fewest == 0, other = (y - y0) % closest == 0;
        for (int x = x0; (one || other) && x < x0 + TILE && x < c->width; x++) {
            double z = depth[ref_at(c, x, y)], ray[3];
            ref_rotate(camera_to_world,
                       (double[]){(x - (double)c->cx) / c->fx, (y - (double)c->cy) / c->fy, 1}, ray);
            if (z > 0 && count >= 0)
                count = met_by_ray(origin, ray, z, block_m, truncation, one && other, met, count, most);
        }
    }
    return count;
}

void ref_clear_blocks(int first, int count, int16_t *voxels) {
    for (int i = first * 2 * BLOCK_VOXELS; i < (first + count) * 2 * BLOCK_VOXELS; i++)
        voxels[i] = i % (2 * BLOCK_VOXELS) < BLOCK_VOXELS ? REF_NEVER_SEEN : 0;
}

/* ---- planes ------------------------------------------------------------------------------------------------------ */

#define MOST_WEIGHT (4 * WEIGHT_ONE)

static double clamp(double v, double low, double high) {
    return fmin(fmax(v, low), high);
}

ref_plane ref_plane_of(const float *depth, const float *normals, const kernel_camera *c, kernel_noise noise,
                       int x, int y) {
    int at = ref_at(c, x, y);
    double z = depth[at], ray[3] = {(x - (double)c->cx) / c->fx, (y - (double)c->cy) / c->fy, 1};
    double length = sqrt(ray[0] * ray[0] + ray[1] * ray[1] + 1), squarely = 0;
    ref_plane p = {{0, 0, 0}, INFINITY, 0};
    if (!(z > 0)) return p;
    bool flat = normals[2 * c->plane + at] != 0;
    for (int i = 0; i < 3; i++) {
        p.n[i] = flat ? normals[i * c->plane + at] : -ray[i] / length;
        squarely -= p.n[i] * ray[i] / length;
    }
    p.w = -z * length * squarely;
    /* inverse variance, 64 at 1 m */
    double ratio = ref_sigma(noise, 1) / ref_sigma(noise, z);
    p.weight = clamp(WEIGHT_ONE * ratio * ratio * (flat ? squarely : 0.25), 1, MOST_WEIGHT);
    return p;
}

cl_uint2 ref_pack_plane(const ref_plane *plane) {
    cl_uint2 packed;
    packed.s[0] = ref_pack_normal(plane->n);
    float w = (float)plane->w;
    memcpy(&packed.s[1], &w, sizeof w);
    packed.s[1] =
        (packed.s[1] + REF_WEIGHT_BITS / 2 + 1) & ~REF_WEIGHT_BITS; /* the nearest; infinity stays */
    packed.s[1] |= (cl_uint)rint(plane->weight);
    return packed;
}

ref_plane ref_unpack_plane(cl_uint2 packed) {
    ref_plane p = {{0}, 0, packed.s[1] & REF_WEIGHT_BITS};
    cl_uint bits = packed.s[1] & ~REF_WEIGHT_BITS;
    float w;
    memcpy(&w, &bits, sizeof w);
    p.w = w;
    ref_unpack_normal(packed.s[0], p.n);
    return p;
}

void ref_pack_planes(const float *depth, const float *normals, const kernel_camera *c, kernel_noise noise,
                     cl_uint2 *planes) {
    for (int i = 0; i < c->width * c->height; i++) {
        int x = i % c->width, y = i / c->width;
        double z = depth[ref_at(c, x, y)];
        ref_plane p = ref_plane_of(depth, normals, c, noise, x, y);
        ref_plane rough = ref_unpack_plane(ref_pack_plane(&p));
        if (z > 0)
            p.w = z * (rough.n[0] * (x - (double)c->cx) / c->fx + rough.n[1] * (y - (double)c->cy) / c->fy +
                       rough.n[2]);
        planes[i] = ref_pack_plane(&p);
    }
}

/* ---- what is in view --------------------------------------------------------------------------------------------- */

/* `more` metres are added to the radius, `pixels` to the circle's rectangle. */
static bool sphere_in_view(const float *farthest, const kernel_camera *c, const double m[3], double radius,
                           double truncation, double more, double pixels) {
    const double f[2] = {c->fx, c->fy}, middle[2] = {c->cx, c->cy};
    const int size[2] = {c->width, c->height}, tiles_x = (c->width + TILE - 1) / TILE;
    int low[2], high[2];
    radius += more;
    if (m[2] < -radius) return false;
    for (int i = 0; i < 2; i++) /* outside the plane through the camera and the picture's side? In front of it only */
        for (int side = -1; side <= 1; side += 2) {
            double edge = side < 0 ? middle[i] + 0.5 : size[i] - 0.5 - middle[i];
            double off = (side * m[i] * f[i] - edge * fmax(m[2], 0)) / sqrt(f[i] * f[i] + edge * edge);
            if (off > radius) return false;
        }
    double nearest = m[2] - radius, far = 0;
    if (nearest < 0.1) return true;
    for (int i = 0; i < 2; i++) {
        double slope = sqrt(m[0] * m[0] + m[1] * m[1] + m[2] * m[2]) / m[2],
               at = m[i] / m[2] * f[i] + middle[i] + 0.5;
        double reach = f[i] * radius / nearest * slope + pixels * (1 + 0.01 * fabs(at));
        low[i] = (int)fmax(floor((at - reach) / TILE), 0);
        high[i] = (int)fmin(floor((at + reach) / TILE), (size[i] + TILE - 1) / TILE - 1);
    }
    for (int y = low[1]; y <= high[1]; y++)
        for (int x = low[0]; x <= high[0]; x++) far = fmax(far, farthest[y * tiles_x + x]);
    return nearest <= far + truncation;
}

void ref_in_view(const float *farthest, const kernel_camera *c, const kernel_rigid *world_to_camera,
                 const kernel_surface *f, const cl_int4 *blocks, int count, uint8_t *outcomes) {
    const double radius = 3.5 * sqrt(3) * f->voxel;
    for (int i = 0; i < count; i++) {
        double world[3], m[3];
        for (int k = 0; k < 3; k++) world[k] = (blocks[i].s[k] * BLOCK_EDGE + 3.5) * f->voxel;
        ref_transform(world_to_camera, world, m);
        bool surely = sphere_in_view(farthest, c, m, radius, f->truncation, -1e-5, -1e-3);
        bool perhaps = sphere_in_view(farthest, c, m, radius, f->truncation, 1e-5, 1e-3);
        outcomes[i] = blocks[i].s[3] != f->submap ? REF_OUT
                      : surely != perhaps         ? REF_DOUBTFUL
                      : surely                    ? REF_IN_VIEW
                                                  : REF_OUT;
    }
}

/* ---- fusion ------------------------------------------------------------------------------------------------------ */

/* rounding of a voxel's position in camera axes, metres; and the error that it causes in the image */
#define PLACE_SLACK 1e-6

/* One voxel's running average (Curless and Levoy 1996, eq. 1 and 2) of its distance to its pixel's plane, unless it
 * lies a truncation or more behind that, straight or along its own ray. False where the frame says nothing about the
 * voxel. */
static bool fuse_voxel(const cl_uint2 *planes, const kernel_camera *c, const double p[3], double truncation,
                       double max_weight, int16_t *distance, uint16_t *weight, bool *doubt) {
    if (!ref_below(0.1, p[2], 1e-5, doubt)) return false;
    double slack = c->fx * PLACE_SLACK * (1 + fabs(p[0]) + fabs(p[1]) + fabs(p[2])) / p[2] * 4 + 1e-4;
    double ray[3] = {p[0] / p[2], p[1] / p[2], 1}, length = sqrt(ray[0] * ray[0] + ray[1] * ray[1] + 1);
    double column = ray[0] * c->fx + c->cx + 0.5, row = ray[1] * c->fy + c->cy + 0.5;
    if (!(fabs(column) < 1e6 && fabs(row) < 1e6)) return false;
    int x = ref_floor(column, slack, doubt), y = ref_floor(row, slack, doubt);
    if (x < 0 || y < 0 || x >= c->width || y >= c->height) return false;
    ref_plane n = ref_unpack_plane(planes[y * c->width + x]);
    double s = n.n[0] * p[0] + n.n[1] * p[1] + n.n[2] * p[2] - n.w;
    double slope = fabs(n.n[0] * ray[0] + n.n[1] * ray[1] + n.n[2] * ray[2]) / length;
    if (isinf(n.w) || !ref_below(-truncation, s, 2e-5, doubt)) return false;
    if (!ref_below(-truncation * slope, s, 2e-5, doubt)) return false;
    double mean =
        ((*weight ? *distance * (double)*weight : 0) + clamp(s / truncation, -1, 1) * 32767 * n.weight) /
        (*weight + n.weight);
    *distance = (int16_t)rint(mean);
    *weight = (uint16_t)fmin(*weight + n.weight, max_weight * WEIGHT_ONE);
    return true;
}

void ref_fuse_blocks(const cl_uint2 *planes, const kernel_camera *c, const kernel_rigid *world_to_camera,
                     double voxel, double truncation, double max_weight, const cl_int4 *blocks, int count,
                     int settled, int turn, int16_t *voxels, uint8_t *outcomes) {
    for (int i = 0; i < count * BLOCK_VOXELS; i++) {
        int block = i / BLOCK_VOXELS, k = i % BLOCK_VOXELS;
        int in[3] = {k % BLOCK_EDGE, k / BLOCK_EDGE % BLOCK_EDGE, k / (BLOCK_EDGE * BLOCK_EDGE)};
        int16_t *data = voxels + (size_t)block * 2 * BLOCK_VOXELS + k;
        double world[3], p[3];
        bool unsure = false;
        outcomes[i] = REF_LEFT;
        if (block < settled && block % 2 != turn) continue;
        for (int a = 0; a < 3; a++) world[a] = (blocks[block].s[a] * BLOCK_EDGE + in[a]) * voxel;
        ref_transform(world_to_camera, world, p);
        bool fused =
            fuse_voxel(planes, c, p, truncation, max_weight, data, (uint16_t *)data + BLOCK_VOXELS, &unsure);
        outcomes[i] = unsure ? REF_DOUBTFUL : fused ? REF_FUSED : REF_LEFT;
    }
}
