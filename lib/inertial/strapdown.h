/* Strapdown integration of the history (Section 3): the navigator from one time to another. */
#ifndef FATHOM_STRAPDOWN_H
#define FATHOM_STRAPDOWN_H

#include "inertial/inertial.h"

/* Propagates a state forward or back to another time over the samples of the history; without samples at constant
 * velocity, for as long as hand-held motion allows. */
void navigate(inertial *n, navigator *s, int64_t to_ns);

/* A state to integrate from when there is none: at rest, at an arbitrary pose. */
void navigator_rest(inertial *n, navigator *s, int64_t timestamp_ns);

#endif
