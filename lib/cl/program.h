/* The kernels of a device: built once from the embedded sources, kept in a cache, or read from a file of built ones. */
#ifndef FATHOM_PROGRAM_H
#define FATHOM_PROGRAM_H

#include "cl/device.h"

/* Builds the program on an open context. FATHOM_OK or FATHOM_ERROR_KERNEL, after a log message. */
int program_build(device *d);

/* Writes the built program, with every kernel that was launched, to a file for config->kernel_file. */
bool program_save(device *d, const char *path);

/* Writes a program that was built from source to the cache. To be called after each kernel has been launched: only then
 * has PoCL built them for their work-groups, and the program contains these. */
void program_to_cache(device *d);

#endif
