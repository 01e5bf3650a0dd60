/* Checks of the caller's depth frames. */
#ifndef FATHOM_FRAME_CHECK_H
#define FATHOM_FRAME_CHECK_H

#include "context.h"

/* Copies the caller's frame into *frame, with its strides filled in. FATHOM_OK; FATHOM_ERROR_ARGUMENT for invalid
 * values; FATHOM_ERROR_SIZE or _TIME for a frame to be ignored. The error text has the reason. */
int frame_take(fathom *f, const fathom_depth_frame *given, fathom_depth_frame *frame);

#endif
