/* The options of a live rig; scan and log share them. */
#ifndef FATHOM_CLI_LIVE_OPTIONS_H
#define FATHOM_CLI_LIVE_OPTIONS_H

#include <stdbool.h>

#include "fathom/shell/options.h"

struct live_options {
    const char *depth; /* address of the depth source; NULL: the first that can be opened */
    const char *imu;   /* the same of the inertial one; "": none */
    const char *rig;   /* folder with rig.txt and calibration.txt, or NULL */
    int width, height; /* of the depth; 0: the source's usual */
    double rate;       /* frames a second; 0: the source's usual */
    double speed;      /* of recordings; 0: as fast as they are taken */
    double duration;   /* seconds; 0: no end */
    long frames;       /* 0: no end */
    bool reconnect, json, progress, verbose;
    int frame_capacity, imu_capacity; /* kept between reads, as in fathom_source_options */
};

void live_options_start(struct live_options *live);

/* Takes the present option if it is one of these: 1. 0: it is none of them. -1: it is wrong, and that was
 * said. */
int live_options_take(struct live_options *live, struct options *options);

/* The present option's value, which may not be empty. */
bool live_options_text(struct options *options, const char **text);

/* Their lines of the help: what to record or scan, and how it is shown. */
extern const char live_options_source_help[], live_options_progress_help[];

#endif
