/* What happens at the pool's bound when the surface may go on growing: the blocks least recently seen make room. */
#ifndef FATHOM_EVICTION_H
#define FATHOM_EVICTION_H

#include "map/integrate.h"
#include "map/store.h"

/* Drops at least `wanted` blocks, or as many as weren't in view lately, and hands each to the store first.
 * Places are closed up: the rest keeps its order. Waits for the device. Returns how many went. */
int eviction_make_room(volume *v, device *d, integrator *g, caller_store *s, int wanted);

/* Takes what the store has of the blocks from place `first` on, which are new. Returns how many. */
int eviction_restore(volume *v, device *d, caller_store *s, int first);

#endif
