#include "selftest/reference.h"

#include <math.h>
#include <string.h>

/* ---- shared ------------------------------------------------------------------------------------------------- */

bool ref_below(double a, double b, double slack, bool *doubt) {
    if (fabs(a - b) <= slack) *doubt = true;
    return a < b;
}

int ref_floor(double v, double slack, bool *doubt) {
    if (fabs(v - rint(v)) <= slack) *doubt = true;
    return (int)floor(v);
}

int ref_at(const kernel_camera *c, int x, int y) {
    return (y + PAD_Y) * c->pitch + x + PAD_X;
}

void ref_rotate(const kernel_rigid *m, const double v[3], double out[3]) {
    const cl_float4 *rows[3] = {&m->x, &m->y, &m->z};
    for (int i = 0; i < 3; i++)
        out[i] = (double)rows[i]->s[0] * v[0] + (double)rows[i]->s[1] * v[1] + (double)rows[i]->s[2] * v[2];
}

void ref_transform(const kernel_rigid *m, const double p[3], double out[3]) {
    ref_rotate(m, p, out);
    out[0] += m->x.s[3];
    out[1] += m->y.s[3];
    out[2] += m->z.s[3];
}

double ref_sigma(kernel_noise noise, double z) {
    return noise.base + noise.slope * z + noise.growth * z * z;
}

static void mark(uint8_t *doubt, int index, bool value) {
    if (doubt) doubt[index] = value;
}

/* ---- depth ---------------------------------------------------------------------------------------------------- */

#define PIXEL_SLACK 2e-3 /* the distortion's polynomial in single precision, at 640 pixels */
#define BAND_SLACK 1e-5  /* of a depth of up to 10 m, after four operations */

/* The metric depth at a pixel of the ideal pinhole; 0: none. */
static double metric_depth(const uint16_t *raw, const kernel_depth_source *s, int x, int y, bool *doubt) {
    if (s->lens) { /* OpenCV's order */
        double u = (x - (double)s->cx) / s->fx, v = (y - (double)s->cy) / s->fy, r2 = u * u + v * v;
        double radial = 1 + s->k1 * r2 + s->k2 * r2 * r2 + s->k3 * r2 * r2 * r2;
        if (s->lens == FATHOM_LENS_RATIONAL)
            radial /= 1 + s->k4 * r2 + s->k5 * r2 * r2 + s->k6 * r2 * r2 * r2;
        double seen_u = u * radial + 2 * s->p1 * u * v + s->p2 * (r2 + 2 * u * u);
        double seen_v = v * radial + s->p1 * (r2 + 2 * v * v) + 2 * s->p2 * u * v;
        double column = seen_u * s->fx + s->cx + 0.5, row = seen_v * s->fy + s->cy + 0.5;
        if (!(fabs(column) < 1e6 && fabs(row) < 1e6)) return 0;
        x = ref_floor(column, PIXEL_SLACK, doubt);
        y = ref_floor(row, PIXEL_SLACK, doubt);
        if (x < 0 || y < 0 || x >= s->width || y >= s->height) return 0;
    }
    uint16_t units = raw[y * s->width + x];
    if (units == 0 || units == 65535) return 0;
    float z = (float)units *
              s->metres_per_unit; /* a float by definition, so that the limits themselves are in range */
    return z >= s->min_m && z <= s->max_m ? z : 0;
}

/* The mean of those depths that belong to the nearest surface among them: up to 4 sigma and a share of the depth
 * behind. */
static double mean_of_nearest(const double *z, int count, kernel_noise noise, double share, bool *doubt) {
    double nearest = INFINITY, sum = 0;
    int kept = 0;
    for (int i = 0; i < count; i++)
        if (z[i] > 0) nearest = fmin(nearest, z[i]);
    double band = nearest + 4 * ref_sigma(noise, nearest) + share * nearest;
    for (int i = 0; i < count; i++) {
        if (!(z[i] > 0) || ref_below(band, z[i], BAND_SLACK, doubt)) continue;
        sum += z[i];
        kept++;
    }
    return kept ? sum / kept : 0;
}

void ref_convert_depth(const uint16_t *raw, const kernel_depth_source *s, const kernel_camera *c,
                       kernel_noise noise, float *depth, uint8_t *doubt) {
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            double z[64];
            int count = 0;
            bool unsure = false;
            for (int j = 0; j < s->factor; j++)
                for (int i = 0; i < s->factor; i++)
                    z[count++] = metric_depth(raw, s, x * s->factor + i, y * s->factor + j, &unsure);
            depth[ref_at(c, x, y)] = (float)mean_of_nearest(z, count, noise, 0.005, &unsure);
            mark(doubt, y * c->width + x, unsure);
        }
}

void ref_halve_depth(const float *fine, const kernel_camera *f, const kernel_camera *c, kernel_noise noise,
                     float *coarse, uint8_t *doubt) {
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            double z[4];
            bool unsure = false;
            for (int k = 0; k < 4; k++) z[k] = fine[ref_at(f, 2 * x + k % 2, 2 * y + k / 2)];
            coarse[ref_at(c, x, y)] = (float)mean_of_nearest(z, 4, noise, 0.01, &unsure);
            mark(doubt, y * c->width + x, unsure);
        }
}

/* A known depth, or 0 outside of the image. */
static double known(const float *depth, const kernel_camera *c, int x, int y) {
    return x >= 0 && y >= 0 && x < c->width && y < c->height ? depth[ref_at(c, x, y)] : 0;
}

void ref_smooth_depth(const float *depth, const kernel_camera *c, kernel_noise noise, double reach, int step,
                      float from_m, float *smooth) {
    static const double binomial[5] = {1, 4, 6, 4, 1};
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            double z = known(depth, c, x, y), sum = 0, weights = 0;
            for (int dy = -2; dy <= 2; dy++)
                for (int dx = -2; dx <= 2; dx++) {
                    double v = known(depth, c, x + step * dx, y + step * dy);
                    double e = (v - z) / (reach * ref_sigma(noise, z));
                    if (v == 0 || fabs(e) >= 1) continue;
                    double w = binomial[dx + 2] * binomial[dy + 2] * (1 - e * e) * (1 - e * e);
                    sum += w * v;
                    weights += w;
                }
            smooth[ref_at(c, x, y)] = z < from_m ? (float)z : z == 0 ? 0 : (float)(sum / weights);
        }
}

/* ---- normals ---------------------------------------------------------------------------------------------------- */

/* A neighbour farther off in depth is across an edge: this many sigma, plus the step of a slope of 75 degrees (4). */
#define EDGE_SIGMAS 4
/* A bend of this many sigma halves the confidence. */
#define BEND_SIGMAS 3

/* Slope and bend along an axis, from the neighbours on the same surface. Returns how many there are. */
static int slope(double before, double here, double after, double limit, double *rise, double *bend,
                 bool *doubt) {
    bool b = before > 0 && ref_below(fabs(before - here), limit, 1e-5 * limit + 1e-6 * here, doubt);
    bool a = after > 0 && ref_below(fabs(after - here), limit, 1e-5 * limit + 1e-6 * here, doubt);
    if (a && b)
        *rise = (after - before) / 2;
    else
        *rise = a ? after - here : b ? here - before : 0;
    *bend = a && b ? before + after - 2 * here : 0;
    return a + b;
}

void ref_normal_map(const float *depth, const kernel_camera *c, kernel_noise noise, float *normals,
                    uint8_t *doubt) {
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            double z = known(depth, c, x, y), sigma = ref_sigma(noise, z),
                   limit = EDGE_SIGMAS * sigma + 4 * z / c->fx;
            double gx, gy, bend_x, bend_y, out[4] = {0, 0, 0, 0};
            bool unsure = false;
            int wide =
                slope(known(depth, c, x - 1, y), z, known(depth, c, x + 1, y), limit, &gx, &bend_x, &unsure);
            int tall =
                slope(known(depth, c, x, y - 1), z, known(depth, c, x, y + 1), limit, &gy, &bend_y, &unsure);
            if (z > 0 && wide && tall) {
                /* the vertex is P = (u z, v z, z): its derivatives along the row and the column, and their product */
                double u = (x - (double)c->cx) / c->fx, v = (y - (double)c->cy) / c->fy;
                double along[3] = {z / c->fx + u * gx, v * gx, gx},
                       down[3] = {u * gy, z / c->fy + v * gy, gy};
                double n[3] = {along[1] * down[2] - along[2] * down[1],
                               along[2] * down[0] - along[0] * down[2],
                               along[0] * down[1] - along[1] * down[0]};
                double length = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
                if (n[0] * u + n[1] * v + n[2] > 0) length = -length; /* towards the camera */
                for (int i = 0; i < 3; i++) out[i] = n[i] / length;
                double sigma_1m = ref_sigma(noise, 1), bend = (bend_x * bend_x + bend_y * bend_y) /
                                                              (BEND_SIGMAS * sigma * BEND_SIGMAS * sigma);
                out[3] = sigma_1m * sigma_1m / (sigma * sigma) / (1 + bend) * (wide + tall == 4 ? 1 : 0.25);
            }
            for (int i = 0; i < 4; i++) normals[i * c->plane + ref_at(c, x, y)] = (float)out[i];
            mark(doubt, y * c->width + x, z > 0 && unsure);
        }
}

/* ---- model maps -------------------------------------------------------------------------------------------------- */

static const double most[3] = {1023, 1023, 511.5};
static const int bits[3] = {11, 11, 10}, from[3] = {21, 10, 0};

cl_uint ref_pack_normal(const double n[3]) {
    cl_uint packed = 0;
    for (int i = 0; i < 3; i++) {
        double v = rint(most[i] * (isfinite(n[i]) && fabs(n[i]) <= 1 ? n[i] : -1));
        packed |= ((cl_uint)(int)v & ((1u << bits[i]) - 1)) << from[i];
    }
    return packed;
}

void ref_unpack_normal(cl_uint packed, double n[3]) {
    for (int i = 0; i < 3; i++) {
        cl_uint v = packed >> from[i] & ((1u << bits[i]) - 1);
        n[i] = (v >> (bits[i] - 1) ? (double)v - (double)(1u << bits[i]) : (double)v) / most[i];
    }
}

void ref_pack_model(const float *model, int count, cl_uint2 *packed) {
    for (int i = 0; i < count; i++) {
        double n[3] = {model[4 * i], model[4 * i + 1], model[4 * i + 2]};
        packed[i].s[0] = ref_pack_normal(n);
        memcpy(&packed[i].s[1], &model[4 * i + 3], sizeof(float));
    }
}

void ref_unpack_model(const cl_uint2 *packed, int count, float *model) {
    for (int i = 0; i < count; i++) {
        double n[3];
        ref_unpack_normal(packed[i].s[0], n);
        for (int k = 0; k < 3; k++) model[4 * i + k] = (float)n[k];
        memcpy(&model[4 * i + 3], &packed[i].s[1], sizeof(float));
    }
}

void ref_pack_map(const float *depth, const float *normals, const kernel_camera *c, float *packed) {
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            float *out = packed + 4 * (y * c->width + x);
            for (int i = 0; i < 3; i++) out[i] = normals[i * c->plane + ref_at(c, x, y)];
            out[3] = depth[ref_at(c, x, y)];
        }
}

void ref_halve_map(const float *fine, const kernel_camera *f, const kernel_camera *c, float *coarse,
                   uint8_t *doubt) {
    for (int y = 0; y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            const float *four[4];
            double nearest = INFINITY, sum[4] = {0, 0, 0, 0};
            int kept = 0;
            bool unsure = false;
            for (int k = 0; k < 4; k++) {
                four[k] = fine + 4 * ((2 * y + k / 2) * f->width + 2 * x + k % 2);
                if (four[k][3] > 0) nearest = fmin(nearest, four[k][3]);
            }
            for (int k = 0; k < 4; k++) {
                if (!(four[k][3] > 0) || ref_below(nearest * 1.02 + 0.01, four[k][3], BAND_SLACK, &unsure))
                    continue;
                for (int i = 0; i < 4; i++) sum[i] += four[k][i];
                kept++;
            }
            /* normals that point apart have no mean */
            double length2 = sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2];
            bool good = kept && ref_below(0.01, length2, 1e-5, &unsure);
            float *out = coarse + 4 * (y * c->width + x);
            for (int i = 0; i < 3; i++) out[i] = good ? (float)(sum[i] / sqrt(length2)) : 0;
            out[3] = good ? (float)(sum[3] / kept) : 0;
            mark(doubt, y * c->width + x, unsure);
        }
}
