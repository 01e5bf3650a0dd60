/* A caller's fathom_config, which may be shorter or longer than this library's: copied in whole, changed, and copied
 * back. */
#ifndef FATHOM_CALLER_CONFIG_H
#define FATHOM_CALLER_CONFIG_H

#include "base/sized.h"
#include "fathom.h"

/* Copies the bytes that both structs have, and returns their number; 0: callers is NULL, or its struct_size isn't
 * set. */
static inline size_t caller_config_take(fathom_config *whole, const fathom_config *callers) {
    const size_t given = sized_of(callers), common = given < sizeof *whole ? given : sizeof *whole;
    memset(whole, 0, sizeof *whole);
    if (common) memcpy(whole, callers, common);
    whole->struct_size = sizeof *whole;
    return common;
}

/* Copies the same bytes back; those beyond stay unchanged. */
static inline void caller_config_give(fathom_config *callers, size_t common, fathom_config *whole) {
    whole->struct_size = callers->struct_size;
    memcpy(callers, whole, common);
}

#endif
