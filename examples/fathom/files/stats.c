#include "fathom/files/stats.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

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
          "blocks,ms_maps,ms_align,ms_fuse,ms_raycast,ms_total\n",
          stats->file);
    return !fflush(stats->file) || fail(stats);
}

bool stats_add(struct stats *stats, const fathom_result *r) {
    if (!stats->file) return true;
    const double degrees = 180 / acos(-1.0);
    const bool negative = r->timestamp_ns < 0;
    const int64_t us = ((negative ? -r->timestamp_ns : r->timestamp_ns) + 500) / 1000;
    fprintf(stats->file,
            "%s%" PRId64 ".%06" PRId64 ",%s,%d,%d,%.6g,%.6g,%.6g,%.6g,%.6g,%d,%.3f,%.3f,%.3f,%.3f,%.3f\n",
            negative && us ? "-" : "", us / 1000000, us % 1000000, fathom_state_name(r->state), r->iterations,
            r->pairs, r->rms_m, r->weight, r->condition, r->prior_rotation_rad * degrees,
            r->prior_translation_m, r->blocks, r->ms_maps, r->ms_align, r->ms_fuse, r->ms_raycast,
            r->ms_total);
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
