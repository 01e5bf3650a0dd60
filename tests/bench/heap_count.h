/* Counts the process's calls of the heap: malloc, calloc, realloc, free and their aligned kin. Linked into a program, or
 * loaded before another's libraries (LD_PRELOAD). With a sanitizer, which has a heap of its own, none is seen. */
#ifndef FATHOM_BENCH_HEAP_COUNT_H
#define FATHOM_BENCH_HEAP_COUNT_H

#include <stdint.h>

/* From now on calls that return into low..high-1 count as watched. */
void heap_count_watch(uintptr_t low, uintptr_t high);

long heap_count_all(void);
long heap_count_watched(void);

#endif
