/* Strapdown integration of the history (Section 3): the navigator from one time to another. */
#ifndef FATHOM_STRAPDOWN_H
#define FATHOM_STRAPDOWN_H

#include "inertial/inertial.h"

/* Takes a state forward or back to another time over the samples of the history; where there are none the last velocity
 * is kept for as long as a hand keeps it. */
void navigate(inertial *n, navigator *s, int64_t to_ns);

/* A state for when there is none: at rest somewhere, to be integrated from. */
void navigator_rest(inertial *n, navigator *s, int64_t timestamp_ns);

#endif
