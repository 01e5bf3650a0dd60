#include "base/arena.h"

void *arena_take(arena *a, size_t size) {
    size_t start = a->used;
    a->used += (size + ARENA_ALIGNMENT - 1) / ARENA_ALIGNMENT * ARENA_ALIGNMENT;
    if (!a->base || a->used > a->size) return NULL;
    return a->base + start;
}

unsigned char *arena_align(void *memory, size_t *lost) {
    *lost = (ARENA_ALIGNMENT - (uintptr_t)memory % ARENA_ALIGNMENT) % ARENA_ALIGNMENT;
    return (unsigned char *)memory + *lost;
}
