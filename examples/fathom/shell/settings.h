/* The options that set a fathom_config; shared by all commands with settings. */
#ifndef FATHOM_CLI_SETTINGS_H
#define FATHOM_CLI_SETTINGS_H

#include "fathom.h"
#include "fathom/shell/options.h"

#define MAX_SET 128

struct settings {
    fathom_config config;
    double depth_scale;   /* 0: not given */
    double intrinsics[4]; /* all 0: not given */
    double voxel;         /* 0: not given */
    double memory;        /* MB; 0: not given */
    bool preset;          /* given */
    int set_count;        /* of --set */
    const char *set[MAX_SET]; /* NAME=VALUE, in the order given */
};

void settings_start(struct settings *settings);

/* Applies the --set options to *config again, over values of a recording or a rig. */
void settings_apply_set(const struct settings *settings, fathom_config *config);

/* Their tables, for structs settings. */
extern const struct option_row settings_camera[], settings_alignment[], settings_surface[], settings_device[],
    settings_any[];

/* Their groups, in a command whose struct has its settings at `at`. */
#define SETTINGS_GROUPS(at)                                                                                  \
    {"Depth camera", settings_camera, at}, {"Alignment", settings_alignment, at},                            \
        {"Surface", settings_surface, at}, {"OpenCL device", settings_device, at}, {                         \
        "Any setting", settings_any, at                                                                      \
    }

#endif
