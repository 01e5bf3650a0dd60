/* Structs that cross the interface: their first field, struct_size, is the size of the caller's. The library's code
 * works on whole structs; these functions copy them in and out, by the rules of Linux's openat2. They are in a header
 * for the drivers' library, which can link only what fathom.h declares. */
#ifndef FATHOM_SIZED_H
#define FATHOM_SIZED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define SIZED_MAX 16384 /* no struct will ever be larger: what claims to be wasn't initialised */

/* The caller's struct_size, or 0 when it is invalid. */
static inline size_t sized_of(const void *callers) {
    uint32_t size = 0;
    if (callers) memcpy(&size, callers, sizeof size);
    return size >= sizeof size && size <= SIZED_MAX ? size : 0;
}

/* Copies the caller's struct in: whole (size bytes, holding the defaults) gets the fields that the caller's struct has.
 * False when struct_size is invalid, or when a struct longer than this library's isn't zero beyond it. */
static inline bool sized_in(void *whole, size_t size, const void *callers) {
    const size_t given = sized_of(callers);
    if (given == 0) return false;
    for (size_t i = size; i < given; i++)
        if (((const unsigned char *)callers)[i] != 0) return false;
    memcpy(whole, callers, given < size ? given : size);
    const uint32_t own = (uint32_t)size;
    memcpy(whole, &own, sizeof own);
    return true;
}

/* Writes whole (size bytes) to a caller's struct whose size is given (from sized_of), and zeros beyond. */
static inline void sized_out(void *callers, size_t given, const void *whole, size_t size) {
    const uint32_t own = (uint32_t)given;
    memcpy(callers, whole, given < size ? given : size);
    if (given > size) memset((unsigned char *)callers + size, 0, given - size);
    memcpy(callers, &own, sizeof own);
}

#endif
