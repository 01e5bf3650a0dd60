/* The arguments of `fathom replay`. */
#ifndef FATHOM_CLI_REPLAY_OPTIONS_H
#define FATHOM_CLI_REPLAY_OPTIONS_H

#include "fathom/files/outputs.h"
#include "fathom/shell/option_values.h"
#include "fathom/shell/settings.h"

struct replay_options {
    const char *folder;
    struct outputs outputs;
    const char *picture; /* a file to write, or NULL */
    const char *imu;                                 /* instead of imu.txt; "": none; NULL: imu.txt */
    long first, stride; /* frames: where to begin; 1: every one */
    struct frame_ranges outages, walls, cards;
    bool progress, verbose;
    struct settings settings;
};

/* As options_read, from the defaults on. */
int replay_options_read(struct replay_options *options, const struct command *command, int argc, char **argv);

extern const struct option_group replay_groups[];

#endif
