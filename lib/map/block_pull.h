/* Blocks of the pool for the caller, in pieces: all, or those that have changed. */
#ifndef FATHOM_BLOCK_PULL_H
#define FATHOM_BLOCK_PULL_H

#include "map/integrate.h"

/* The next piece of a pull (lib/fathom.h); returns the number of blocks, 0 at the end. Waits for the device. */
int block_pull(volume *v, const integrator *g, device *d, fathom_block_pull *pull);

#endif
