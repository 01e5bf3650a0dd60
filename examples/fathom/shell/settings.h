/* The options that settle a fathom_config; replay and info share them. */
#ifndef FATHOM_CLI_SETTINGS_H
#define FATHOM_CLI_SETTINGS_H

#include <stdbool.h>

#include "fathom.h"
#include "fathom/shell/options.h"

struct settings {
    fathom_config config;
    double depth_scale;   /* 0: not given */
    double intrinsics[4]; /* all 0: not given */
    double voxel;         /* 0: not given */
    double memory;        /* MB; 0: not given */
    bool preset;          /* given */
};

void settings_start(struct settings *settings);

/* Takes the present option if it is one of these: 1. 0: it is none of them. -1: it is wrong, and that was
 * said. */
int settings_take(struct settings *settings, struct options *options);

/* Their lines of the help. */
extern const char settings_help[];

#endif
