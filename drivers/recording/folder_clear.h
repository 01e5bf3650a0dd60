/* The folder that a recording is written into. */
#ifndef FATHOM_FOLDER_CLEAR_H
#define FATHOM_FOLDER_CLEAR_H

#include <stdbool.h>
#include <stddef.h>

/* Makes the folder (and those above it) and clears it of a former recording, of which it removes nothing but its own
 * files. One that isn't empty is refused unless `force`. False with one line in `why`. */
bool folder_clear(const char *folder, bool force, char *why, size_t size);

/* Makes folder/name where it isn't there. False with errno. */
bool folder_make(const char *folder, const char *name);

#endif
