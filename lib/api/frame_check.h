/* Depth frames as they come from the caller. */
#ifndef FATHOM_FRAME_CHECK_H
#define FATHOM_FRAME_CHECK_H

#include "context.h"

/* Takes a frame in, with its strides filled in. FATHOM_OK; FATHOM_ERROR_ARGUMENT for what makes no sense;
 * FATHOM_ERROR_SIZE or _TIME for a frame that is to be ignored. The text says why. */
int frame_take(fathom *f, const fathom_depth_frame *given, fathom_depth_frame *frame);

#endif
