/* The camera's path, kept for the evaluation and the picture. */
#ifndef FATHOM_CLI_PATH_H
#define FATHOM_CLI_PATH_H

#include "fathom.h"

struct path_point {
    int64_t timestamp_ns;
    fathom_pose pose; /* camera to world */
    int32_t state;    /* fathom_state */
};

struct path {
    int count;
    struct path_point *points;
};

#endif
