/* Rewrites rig.txt: the lines of some keys are replaced, all others stay as they are, comments too. */
#ifndef FATHOM_CLI_RIG_FILE_H
#define FATHOM_CLI_RIG_FILE_H

#include <stdbool.h>

struct rig_entry {
    const char *key;
    char text[192]; /* what follows the key; empty: the key is left as it is */
};

/* Copies the file `from` (one that isn't there counts as empty) to `to`, in which the first line of each entry's key
 * is replaced, further ones are left out, and what wasn't there is added at the end. `to` is written beside its place
 * (TO.part) and renamed when whole, so it may be `from`; "-" is standard output. False after saying what was wrong. */
bool rig_file_update(const char *from, const char *to, const struct rig_entry *entries, int count);

/* A place that can't be written to is better known early. False after saying so. */
bool rig_file_can_write(const char *to);

#endif
