/* Rewrites rig.txt: the lines of some keys are replaced, all others stay as they are, comments too. */
#ifndef FATHOM_CLI_RIG_FILE_H
#define FATHOM_CLI_RIG_FILE_H

#include <stdbool.h>

struct rig_entry {
    const char *key;
    char text[192]; /* the text after the key; empty: the key is unchanged */
};

/* Copies the file `from` (a missing one counts as empty) to `to`, with the first line of each entry's key replaced,
 * further ones left out, and missing ones added at the end. `to` is written as TO.part and renamed when whole, so it
 * may be `from`; "-" is standard output. False after an error message. */
bool rig_file_update(const char *from, const char *to, const struct rig_entry *entries, int count);

/* Checks early whether `to` can be written. False after an error message. */
bool rig_file_can_write(const char *to);

#endif
