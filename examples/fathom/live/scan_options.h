/* The arguments of `fathom scan`. */
#ifndef FATHOM_CLI_SCAN_OPTIONS_H
#define FATHOM_CLI_SCAN_OPTIONS_H

#include "fathom/live/live_options.h"
#include "fathom/shell/settings.h"

struct scan_options {
    struct live_options live;
    const char *trajectory, *mesh, *stats; /* files to write, or NULL */
    bool help;                             /* help was asked for and printed: nothing else to do */
    struct settings settings;
};

/* Returns CLI_DONE, or CLI_USAGE after saying what was wrong. */
int scan_options_read(struct scan_options *options, int argc, char **argv);

#endif
