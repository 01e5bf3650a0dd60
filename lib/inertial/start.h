/* A first state for the navigator. */
#ifndef FATHOM_START_H
#define FATHOM_START_H

#include "inertial/inertial.h"

/* Starts at an accepted pose, with gravity from the specific force before it. */
void inertial_start(inertial *n, const pose *accepted, int64_t timestamp_ns);

/* Starts again at the last accepted pose, since wrong samples have affected the whole state. */
void inertial_start_again(inertial *n);

#endif
