/* Eviction in a full pool: the least recently seen blocks make room. */
#ifndef FATHOM_EVICTION_H
#define FATHOM_EVICTION_H

#include "map/integrate.h"
#include "map/store.h"

/* Drops a minimum of `wanted` blocks, or all that weren't in view lately, after putting each into the store. Places are
 * closed up, in unchanged order. Waits for the device. Returns the number of dropped blocks. */
int eviction_make_room(volume *v, device *d, integrator *g, caller_store *s, int wanted);

/* Restores from the store those blocks from place `first` on, which are new, that it has. Returns their number. */
int eviction_restore(volume *v, device *d, caller_store *s, int first);

#endif
