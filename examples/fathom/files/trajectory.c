#include "fathom/files/trajectory.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <inttypes.h>
#include <string.h>

static bool fail(struct trajectory *trajectory) {
    cli_error(CLI_FAILED, "%s: %s", trajectory->path, strerror(errno));
    if (trajectory->file) fclose(trajectory->file);
    trajectory->file = NULL;
    return false;
}

bool trajectory_open(struct trajectory *trajectory, const char *path) {
    *trajectory = (struct trajectory){.path = path};
    trajectory->file = fopen(path, "w");
    return trajectory->file || fail(trajectory);
}

bool trajectory_add(struct trajectory *trajectory, int64_t timestamp_ns, const fathom_pose *pose) {
    if (!trajectory->file) return true;
    const double *p = pose->position, *q = pose->orientation;
    /* Whole microseconds, in integers, since a double can't represent them for present-day stamps. */
    const bool negative = timestamp_ns < 0;
    const int64_t us = ((negative ? -timestamp_ns : timestamp_ns) + 500) / 1000;
    fprintf(trajectory->file, "%s%" PRId64 ".%06" PRId64 " %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n",
            negative && us ? "-" : "", us / 1000000, us % 1000000, p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
    if (fflush(trajectory->file)) return fail(trajectory);
    return true;
}

bool trajectory_close(struct trajectory *trajectory) {
    FILE *file = trajectory->file;
    trajectory->file = NULL;
    if (file && fclose(file)) return fail(trajectory);
    return true;
}
