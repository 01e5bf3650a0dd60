/* Structs that cross the interface: their first field, struct_size, says how large the caller's is. Inside the library
 * everything works on whole structs; these two carry them in and out. The rules are openat2's (Linux). In a header, so
 * that the drivers' library, which sees only what fathom.h declares, has them too. */
#ifndef FATHOM_SIZED_H
#define FATHOM_SIZED_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define SIZED_MAX 16384 /* no struct will ever be larger: what claims to be wasn't initialised */

/* What struct_size says, or 0 when it can't be one. */
static inline size_t sized_of(const void *callers) {
    uint32_t size = 0;
    if (callers) memcpy(&size, callers, sizeof size);
    return size >= sizeof size && size <= SIZED_MAX ? size : 0;
}

/* Takes the caller's struct in: whole (size bytes, holding the defaults) gets the fields that the caller's covers.
 * False when struct_size can't be one, or when a struct longer than this library's has something in the rest. */
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
