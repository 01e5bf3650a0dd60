/* A first state for the navigator. */
#ifndef FATHOM_START_H
#define FATHOM_START_H

#include "inertial/inertial.h"

/* At an accepted pose, gravity by the specific force before it. */
void inertial_start(inertial *n, const pose *accepted, int64_t timestamp_ns);

/* Anew at the last accepted pose: what was made of wrong samples is in all of the state. */
void inertial_start_again(inertial *n);

#endif
