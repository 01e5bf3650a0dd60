/* The statistics file: a CSV header line, then one line per frame, written at once; and quantiles of step times. */
#ifndef FATHOM_CLI_STATS_H
#define FATHOM_CLI_STATS_H

#include <stdbool.h>
#include <stdio.h>

#include "fathom.h"

struct stats {
    const char *path;
    FILE *file;
};

/* As for a trajectory: false after an error message; without a file they do nothing. */
bool stats_open(struct stats *stats, const char *path);
bool stats_add(struct stats *stats, const fathom_result *result, const fathom_span *span);
bool stats_close(struct stats *stats);

/* The quantile 'share' (0..1) of the values, interpolated linearly; NAN without values. Sorts them. */
double stats_quantile(float *values, int count, double share);

#endif
