#include <errno.h>
#include <stdatomic.h>
#include <stddef.h>

#pragma GCC visibility push(default) /* seen by every library in the process */
#include "bench/heap_count.h"

void *__libc_malloc(size_t size);
void *__libc_calloc(size_t count, size_t size);
void *__libc_realloc(void *old, size_t size);
void *__libc_memalign(size_t alignment, size_t size);
void __libc_free(void *old);
void *malloc(size_t size);
void *calloc(size_t count, size_t size);
void *realloc(void *old, size_t size);
void free(void *old);
void *memalign(size_t alignment, size_t size);
void *aligned_alloc(size_t alignment, size_t size);
int posix_memalign(void **out, size_t alignment, size_t size);

static atomic_uintptr_t watched_low, watched_high;
static atomic_long all, watched;

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define ENTRY __attribute__((noinline)) /* so that the return address is the caller's */
#define COUNT count((uintptr_t)__builtin_return_address(0))
static void count(uintptr_t from) {
    atomic_fetch_add_explicit(&all, 1, memory_order_relaxed);
    if (from >= watched_low && from < watched_high)
        atomic_fetch_add_explicit(&watched, 1, memory_order_relaxed);
}

ENTRY void *malloc(size_t size) {
    COUNT;
    return __libc_malloc(size);
}
ENTRY void *calloc(size_t n, size_t size) {
    COUNT;
    return __libc_calloc(n, size);
}
ENTRY void *realloc(void *old, size_t size) {
    COUNT;
    return __libc_realloc(old, size);
}
ENTRY void free(void *old) {
    COUNT;
    __libc_free(old);
}
ENTRY void *memalign(size_t alignment, size_t size) {
    COUNT;
    return __libc_memalign(alignment, size);
}
ENTRY void *aligned_alloc(size_t alignment, size_t size) {
    COUNT;
    return __libc_memalign(alignment, size);
}
ENTRY int posix_memalign(void **out, size_t alignment, size_t size) {
    COUNT;
    *out = __libc_memalign(alignment, size);
    return *out ? 0 : ENOMEM;
}
#endif

void heap_count_watch(uintptr_t low, uintptr_t high) {
    watched_low = low;
    watched_high = high;
}

long heap_count_all(void) {
    return all;
}

long heap_count_watched(void) {
    return watched;
}
#pragma GCC visibility pop
