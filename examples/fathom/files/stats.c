#include "fathom/files/stats.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#define DEGREES (180 / acos(-1.0)) /* a radian */

static bool fail(struct stats *stats) {
    cli_error(CLI_FAILED, "%s: %s", stats->path, strerror(errno));
    if (stats->file) fclose(stats->file);
    stats->file = NULL;
    return false;
}

bool stats_open(struct stats *stats, const char *path) {
    *stats = (struct stats){.path = path, .file = fopen(path, "w")};
    if (!stats->file) return fail(stats);
    fputs("t,state,iterations,pairs,rms_m,weight,condition,prior_rotation_deg,prior_translation_m,"
          "blocks,ms_maps,ms_align,ms_fuse,ms_raycast,ms_total,"
          "sigma_x_m,sigma_y_m,sigma_z_m,sigma_rx_deg,sigma_ry_deg,sigma_rz_deg,observed,"
          "span_s,span_sigma_x_m,span_sigma_y_m,span_sigma_z_m,span_sigma_rx_deg,span_sigma_ry_deg,span_sigma_rz_deg\n",
          stats->file);
    return !fflush(stats->file) || fail(stats);
}

/* A pose's variances about and along the world's axes: the covariance is in the camera's. */
static void world_variances(const fathom_pose *at, const double covariance[36], double variances[6]) {
    double m[16];
    fathom_pose_to_matrix(at, m);
    for (int i = 0; i < 6; i++) {
        const double *row = &m[4 * (i % 3)], *block = &covariance[i < 3 ? 0 : 21];
        variances[i] = 0;
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) variances[i] += row[j] * row[k] * block[6 * j + k];
    }
}

/* Of rotation and translation: six columns, translation first. */
static void add_sigmas(FILE *file, const double variances[6]) {
    for (int i = 3; i < 6; i++) fprintf(file, ",%.6g", sqrt(fmax(variances[i], 0)));
    for (int i = 0; i < 3; i++) fprintf(file, ",%.6g", sqrt(fmax(variances[i], 0)) * DEGREES);
}

bool stats_add(struct stats *stats, const fathom_result *r, const fathom_span *span) {
    if (!stats->file) return true;
    double variances[6];
    const bool negative = r->timestamp_ns < 0;
    const int64_t us = ((negative ? -r->timestamp_ns : r->timestamp_ns) + 500) / 1000;
    fprintf(stats->file,
            "%s%" PRId64 ".%06" PRId64 ",%s,%d,%d,%.6g,%.6g,%.6g,%.6g,%.6g,%d,%.3f,%.3f,%.3f,%.3f,%.3f",
            negative && us ? "-" : "", us / 1000000, us % 1000000, fathom_state_name(r->state), r->iterations,
            r->pairs, r->rms_m, r->weight, r->condition, r->prior_rotation_rad * DEGREES,
            r->prior_translation_m, r->blocks, r->ms_maps, r->ms_align, r->ms_fuse, r->ms_raycast,
            r->ms_total);
    world_variances(&r->pose, r->pose_covariance, variances);
    add_sigmas(stats->file, variances);
    fprintf(stats->file, ",%d,%.6g", r->observed_directions, 1e-9 * (double)(span->to_ns - span->from_ns));
    for (int i = 0; i < 6; i++) variances[i] = span->covariance[7 * i];
    add_sigmas(stats->file, variances);
    fputc('\n', stats->file);
    return !fflush(stats->file) || fail(stats);
}

bool stats_close(struct stats *stats) {
    FILE *file = stats->file;
    stats->file = NULL;
    if (file && fclose(file)) return fail(stats);
    return true;
}

static int compare(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

double stats_quantile(float *values, int count, double share) {
    if (count < 1) return NAN;
    qsort(values, (size_t)count, sizeof *values, compare);
    const double place = share * (count - 1);
    const int below = (int)place;
    if (below >= count - 1) return values[count - 1];
    return values[below] + (place - below) * (values[below + 1] - values[below]);
}
