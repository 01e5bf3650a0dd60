/* The arguments of `fathom scan`. */
#ifndef FATHOM_CLI_SCAN_OPTIONS_H
#define FATHOM_CLI_SCAN_OPTIONS_H

#include "settings.h"

struct scan_options {
    const char *depth; /* address of the depth source; NULL: the first that can be opened */
    const char *imu;   /* the same of the inertial one; "": none */
    const char *rig;   /* folder with rig.txt and calibration.txt, or NULL */
    const char *trajectory, *mesh, *stats; /* files to write, or NULL */
    int width, height;                     /* of the depth; 0: the source's usual */
    double rate;                           /* frames a second; 0: the source's usual */
    double speed;                          /* of recordings; 0: as fast as they can be scanned */
    double duration;                       /* seconds; 0: no end */
    long frames;                           /* 0: no end */
    bool reconnect, json, progress, verbose;
    bool help; /* help was asked for and printed: nothing else to do */
    struct settings settings;
};

/* Returns CLI_DONE, or CLI_USAGE after saying what was wrong. */
int scan_options_read(struct scan_options *options, int argc, char **argv);

#endif
