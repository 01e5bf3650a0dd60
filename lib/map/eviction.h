/* What happens at the pool's bound when the surface may go on growing: the blocks least recently seen make room. */
#ifndef FATHOM_EVICTION_H
#define FATHOM_EVICTION_H

#include "map/volume.h"

/* Drops at least `wanted` blocks, or as many as weren't in view lately, and hands each to the caller's block_out first.
 * Places are closed up: the rest keeps its order. Waits for the device. Returns how many went. */
int eviction_make_room(volume *v, device *d, const fathom_config *config, int wanted);

/* Asks the caller's block_in for the blocks from place first on, which are new, and takes what it has. Returns how many. */
int eviction_restore(volume *v, device *d, const fathom_config *config, int first);

#endif
