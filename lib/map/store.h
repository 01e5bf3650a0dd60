/* The caller's block store: storage for blocks outside of the pool. */
#ifndef FATHOM_STORE_H
#define FATHOM_STORE_H

#include "cl/kernel_types.h"

typedef struct {
    fathom_block_store calls; /* a NULL call: the store doesn't do that */
    int64_t put, restored, lost; /* blocks */
} caller_store;

/* Takes config's store; without one, no block is kept. False when its struct_size is invalid, or a later library's. */
bool store_init(caller_store *s, const fathom_config *config);

/* Puts a block into the store. */
void store_put(caller_store *s, const fathom_block *block);

/* Fills a new block's voxels, or leaves them unchanged. False: the store doesn't have it. */
bool store_get(caller_store *s, const fathom_block *block);

/* The key at a position of the store's list. False beyond its end. */
bool store_key(const caller_store *s, int64_t position, cl_int4 *key);

#endif
