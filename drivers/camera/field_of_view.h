/* Intrinsics of a camera from its field of view. */
#ifndef FATHOM_FIELD_OF_VIEW_H
#define FATHOM_FIELD_OF_VIEW_H

#include <math.h>

#include "fathom.h"

/* Angles in radians; the principal point in the middle. */
static inline fathom_pinhole camera_of_view(int width, int height, double horizontal, double vertical) {
    return (fathom_pinhole){.width = width,
                            .height = height,
                            .fx = width / (2 * tan(horizontal / 2)),
                            .fy = height / (2 * tan(vertical / 2)),
                            .cx = (width - 1) / 2.0,
                            .cy = (height - 1) / 2.0};
}

#endif
