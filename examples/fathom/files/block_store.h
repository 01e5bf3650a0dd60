/* Keeps the blocks of the surface that make room in a full pool (--when-full drop) in a file, and returns them.
 *
 * The file is unlinked as soon as it is created, so that it is gone with the process, however that ends. It has one
 * place for each block that was ever dropped, with the block's last copy; memory holds 24 to 48 bytes for each. */
#ifndef FATHOM_CLI_BLOCK_STORE_H
#define FATHOM_CLI_BLOCK_STORE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fathom.h"

struct block_store {
    char *path; /* where the file was created; NULL: the store isn't open */
    int fd;
    fathom_block_store calls;
    fathom_block_key *keys; /* in the order of the blocks' places in the file */
    size_t count, capacity;
    uint32_t *table; /* place + 1 by a hash of the key; 0: free. Twice the capacity, a power of two */
    int64_t lost;    /* copies that couldn't be kept or read; the first one was reported */
};

/* If config drops blocks: creates the file, beside `beside` or, where that is NULL, in $TMPDIR or /var/tmp, and sets
 * config's block_store. The store must outlive the context. False after an error message. */
bool block_store_open(struct block_store *store, const char *beside, fathom_config *config);

/* Reports the dropped and restored blocks. False when a block was lost. */
bool block_store_report(const struct block_store *store, fathom *scan);

void block_store_close(struct block_store *store);

#endif
