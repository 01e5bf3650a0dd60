/* The folder that a recording is written into. */
#ifndef FATHOM_FOLDER_CLEAR_H
#define FATHOM_FOLDER_CLEAR_H

#include <stdbool.h>
#include <stddef.h>

/* Creates the folder (and those above it) and removes the files of a previous recording from it, and only those.
 * Refuses a folder that isn't empty unless `force`. False with one line in `why`. */
bool folder_clear(const char *folder, bool force, char *why, size_t size);

/* Creates folder/name if necessary. False with errno. */
bool folder_make(const char *folder, const char *name);

#endif
