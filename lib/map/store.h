/* The caller's block store: where blocks of the surface are kept outside of the pool. */
#ifndef FATHOM_STORE_H
#define FATHOM_STORE_H

#include "cl/kernel_types.h"

typedef struct {
    fathom_block_store calls; /* a NULL call: the store doesn't do that */
    int64_t put, restored, lost; /* blocks */
} caller_store;

/* Takes what config names; without a store, nothing is kept. False when its struct_size is no size, or a later
 * library's. */
bool store_init(caller_store *s, const fathom_config *config);

/* Hands a block over. */
void store_put(caller_store *s, const fathom_block *block);

/* Fills a new block's voxels, or leaves them new. False: the store hasn't got it. */
bool store_get(caller_store *s, const fathom_block *block);

/* The key at a position of the store's list. False beyond its end. */
bool store_key(const caller_store *s, int64_t position, cl_int4 *key);

#endif
