/* Where the caller keeps blocks of the surface outside of memory: of blocks that were dropped. */
#ifndef FATHOM_STORE_H
#define FATHOM_STORE_H

#include "fathom.h"

typedef struct {
    const fathom_config *config; /* whose hooks these are */
    int64_t dropped, restored;   /* blocks */
} caller_store;

void store_init(caller_store *s, const fathom_config *config);

/* Hands the block over. */
void store_put(caller_store *s, const fathom_block *block);

/* Fills a new block's voxels. False: the store hasn't got it. */
bool store_get(caller_store *s, const fathom_block *block);

#endif
