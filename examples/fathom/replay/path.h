/* The way the camera took, kept for the evaluation and the picture. */
#ifndef FATHOM_CLI_PATH_H
#define FATHOM_CLI_PATH_H

#include "fathom.h"

struct path_point {
    int64_t timestamp_ns;
    float pose[16]; /* row-major 4x4, camera to world */
    fathom_state state;
};

struct path {
    int count;
    struct path_point *points;
};

#endif
