#include "fathom/files/trajectory.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
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

/* Shepperd 1978: the largest of the four is found first, so that no small number is divided by. x y z w, w
 * not negative. */
static void quaternion_from(const float pose[16], double q[4]) {
    const double m[3][3] = {
        {pose[0], pose[1], pose[2]}, {pose[4], pose[5], pose[6]}, {pose[8], pose[9], pose[10]}};
    const double trace = m[0][0] + m[1][1] + m[2][2];
    int i = 3;
    double largest = trace;
    for (int k = 0; k < 3; k++)
        if (m[k][k] > largest) largest = m[i = k][k];
    if (i == 3) {
        q[3] = 1 + trace;
        q[0] = m[2][1] - m[1][2];
        q[1] = m[0][2] - m[2][0];
        q[2] = m[1][0] - m[0][1];
    } else {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        q[i] = 1 + 2 * m[i][i] - trace;
        q[j] = m[i][j] + m[j][i];
        q[k] = m[i][k] + m[k][i];
        q[3] = m[k][j] - m[j][k];
    }
    double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    if (q[3] < 0) norm = -norm;
    for (int k = 0; k < 4; k++) q[k] /= norm;
}

bool trajectory_add(struct trajectory *trajectory, int64_t timestamp_ns, const float pose[16]) {
    if (!trajectory->file) return true;
    double q[4];
    quaternion_from(pose, q);
    /* Whole microseconds, without the detour over a double that can't hold them beside today's seconds. */
    const bool negative = timestamp_ns < 0;
    const int64_t us = ((negative ? -timestamp_ns : timestamp_ns) + 500) / 1000;
    fprintf(trajectory->file, "%s%" PRId64 ".%06" PRId64 " %.9g %.9g %.9g %.9g %.9g %.9g %.9g\n",
            negative && us ? "-" : "", us / 1000000, us % 1000000, pose[3], pose[7], pose[11], q[0], q[1],
            q[2], q[3]);
    if (fflush(trajectory->file)) return fail(trajectory);
    return true;
}

bool trajectory_close(struct trajectory *trajectory) {
    FILE *file = trajectory->file;
    trajectory->file = NULL;
    if (file && fclose(file)) return fail(trajectory);
    return true;
}
