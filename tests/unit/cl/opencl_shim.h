/* OpenCL calls that fail when a test wants them to. The linker leads the library's calls here (--wrap, see the Makefile). */
#ifndef OPENCL_SHIM_H
#define OPENCL_SHIM_H

#include <stdbool.h>

typedef enum {
    SHIM_CONTEXT,
    SHIM_QUEUE,
    SHIM_SOURCE,
    SHIM_BUILD,
    SHIM_KERNEL,
    SHIM_BUFFER,
    SHIM_ARGUMENT,
    SHIM_LAUNCH,
    SHIM_MAP,
    SHIM_UNMAP,
    SHIM_FILL,
    SHIM_FINISH,
    SHIM_FLUSH,
    SHIM_KINDS
} shim_kind;

extern const char *const shim_names[SHIM_KINDS];

/* Counts from zero again; nothing fails. */
void shim_start(void);

/* The same, and the call number nth of that kind, from 0, fails: it isn't made, except that a buffer is unmapped and
 * finishing waits, so that the context can be used again afterwards. */
void shim_fail(shim_kind kind, int nth);

/* Calls of that kind since shim_start or shim_fail. */
int shim_count(shim_kind kind);

/* Whether the call that should fail has been made. */
bool shim_failed(void);

/* Launches, mappings, fillings and flushes after it. */
int shim_later(void);

#endif
