/* Reference poses between their stamps. */
#include "fathom_drivers.h"

#include <math.h>

/* Spherical linear interpolation (Shoemake 1985) from a to b; s in 0..1. */
static void slerp(const double a[4], const double b[4], double s, double out[4]) {
    double dot = 0, norm = 0;
    for (int i = 0; i < 4; i++) dot += a[i] * b[i];
    const double sign = dot < 0 ? -1 : 1; /* the shorter way round */
    const double angle = acos(fmin(fabs(dot), 1));
    double from = 1 - s, to = s;
    if (angle > 1e-6) {
        from = sin((1 - s) * angle) / sin(angle);
        to = sin(s * angle) / sin(angle);
    }
    for (int i = 0; i < 4; i++) {
        out[i] = from * a[i] + to * sign * b[i];
        norm += out[i] * out[i];
    }
    for (int i = 0; i < 4; i++) out[i] /= sqrt(norm);
}

int fathom_recording_pose_at(const fathom_recording *recording, int64_t timestamp_ns,
                             fathom_pose *pose) {
    const int64_t widest_gap_ns = 40000000, furthest_ns = 20000000;
    if (!recording || !pose) return FATHOM_ERROR_ARGUMENT;
    const fathom_recording_pose *poses = recording->poses;
    int after = 0, end = recording->pose_count; /* the first pose later than the stamp */
    while (after < end) {
        const int middle = after + (end - after) / 2;
        if (poses[middle].timestamp_ns > timestamp_ns)
            end = middle;
        else
            after = middle + 1;
    }
    const fathom_recording_pose *a = after > 0 ? &poses[after - 1] : NULL;
    const fathom_recording_pose *b = after < recording->pose_count ? &poses[after] : NULL;
    if (a && b && b->timestamp_ns - a->timestamp_ns <= widest_gap_ns) {
        const double s =
            (double)(timestamp_ns - a->timestamp_ns) / (double)(b->timestamp_ns - a->timestamp_ns);
        for (int i = 0; i < 3; i++)
            pose->position[i] = (1 - s) * a->pose.position[i] + s * b->pose.position[i];
        slerp(a->pose.orientation, b->pose.orientation, s, pose->orientation);
        return FATHOM_OK;
    }
    if (a && timestamp_ns - a->timestamp_ns > furthest_ns) a = NULL;
    if (b && b->timestamp_ns - timestamp_ns > furthest_ns) b = NULL;
    const fathom_recording_pose *nearest =
        a && b ? (timestamp_ns - a->timestamp_ns <= b->timestamp_ns - timestamp_ns ? a : b)
        : a    ? a
               : b;
    if (!nearest) return FATHOM_ERROR_NO_DATA;
    *pose = nearest->pose;
    return FATHOM_OK;
}
