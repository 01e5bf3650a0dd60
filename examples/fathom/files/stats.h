/* The statistics file: a CSV header line, then a line a frame, on the disk as soon as it is known; and the
 * step times. */
#ifndef FATHOM_CLI_STATS_H
#define FATHOM_CLI_STATS_H

#include <stdbool.h>
#include <stdio.h>

#include "fathom.h"

struct stats {
    const char *path;
    FILE *file;
};

/* As for a trajectory: false after saying what went wrong; without a file nothing is done. */
bool stats_open(struct stats *stats, const char *path);
bool stats_add(struct stats *stats, const fathom_result *result);
bool stats_close(struct stats *stats);

/* The value that 'share' (0..1) of the values don't exceed, between neighbours linearly; NAN without values.
 * Sorts them. */
double stats_quantile(float *values, int count, double share);

#endif
