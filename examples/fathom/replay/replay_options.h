/* The arguments of `fathom replay`. */
#ifndef FATHOM_CLI_REPLAY_OPTIONS_H
#define FATHOM_CLI_REPLAY_OPTIONS_H

#include "fathom/shell/settings.h"

struct replay_options {
    const char *folder;
    const char *trajectory, *mesh, *stats, *picture; /* files to write, or NULL */
    const char *imu;                                 /* instead of imu.txt; "": none; NULL: imu.txt */
    int stride;                                      /* 1: every frame */
    struct frame_ranges outages, walls, cards;
    bool progress, verbose;
    bool help; /* help was asked for and printed: nothing else to do */
    struct settings settings;
};

/* Returns CLI_DONE, or CLI_USAGE after saying what was wrong. */
int replay_options_read(struct replay_options *options, int argc, char **argv);

#endif
