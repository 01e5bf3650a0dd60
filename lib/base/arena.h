/* A block of memory given once and handed out in order; nothing is ever given back.
 *
 * The same layout code runs twice: with base NULL it only counts (fathom_memory_required), then with the caller's
 * block. */
#ifndef FATHOM_ARENA_H
#define FATHOM_ARENA_H

#include <stddef.h>
#include <stdint.h>

typedef struct {
    unsigned char *base; /* NULL: only count */
    size_t size;         /* of the block; ignored when counting */
    size_t used;
} arena;

#define ARENA_ALIGNMENT 128

/* Room for size bytes, aligned to ARENA_ALIGNMENT from the base on. NULL when counting, or when the block is too short
 * (used still grows, so that the caller can tell by used > size). */
void *arena_take(arena *a, size_t size);

/* The first aligned address within memory, and how many bytes of it that costs (0..ARENA_ALIGNMENT-1). */
unsigned char *arena_align(void *memory, size_t *lost);

#endif
