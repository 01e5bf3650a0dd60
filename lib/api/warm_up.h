/* Launches every kernel once in each shape that a step may use, on empty input: PoCL compiles a kernel anew for each
 * work-group size, at the first launch with it, and that must not happen in the middle of a scan. */
#ifndef FATHOM_WARM_UP_H
#define FATHOM_WARM_UP_H

#include "context.h"

/* Leaves an empty surface and maps without a valid pixel. */
void warm_up(fathom *f);

#endif
