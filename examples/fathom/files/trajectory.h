/* The trajectory file: TUM lines, `t tx ty tz qx qy qz qw`, camera to world, each written at once. */
#ifndef FATHOM_CLI_TRAJECTORY_H
#define FATHOM_CLI_TRAJECTORY_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "fathom.h"

struct trajectory {
    const char *path;
    FILE *file;
};

/* Each returns false after an error message; then the file is closed, complete up to the last good line. Without a file
 * they do nothing. */
bool trajectory_open(struct trajectory *trajectory, const char *path);
bool trajectory_add(struct trajectory *trajectory, int64_t timestamp_ns, const fathom_pose *pose);
bool trajectory_close(struct trajectory *trajectory);

#endif
