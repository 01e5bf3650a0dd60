/* Poses as matrices. */
#include "base/se3.h"

int fathom_pose_to_matrix(const fathom_pose *given, double matrix[16]) {
    pose p;
    if (!given || !matrix || !pose_take(given, &p)) return FATHOM_ERROR_ARGUMENT;
    pose_to_matrix(&p, matrix);
    return FATHOM_OK;
}

int fathom_pose_from_matrix(const double matrix[16], fathom_pose *out) {
    pose p;
    if (!matrix || !out || !pose_from_matrix(matrix, &p)) return FATHOM_ERROR_ARGUMENT;
    *out = pose_give(&p);
    return FATHOM_OK;
}
