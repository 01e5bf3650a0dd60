/* The options of a live rig; scan and log share them. */
#ifndef FATHOM_CLI_LIVE_OPTIONS_H
#define FATHOM_CLI_LIVE_OPTIONS_H

#include "fathom/shell/option_values.h"
#include "fathom/shell/options.h"

struct live_options {
    const char *depth;       /* address of the depth source; NULL: the first that can be opened */
    const char *imu;         /* address of the inertial source; "": none */
    const char *rig;         /* folder with rig.txt and calibration.txt, or NULL */
    struct option_size size; /* of the depth; 0: the source's default */
    double rate;             /* frames per second; 0: the source's default */
    double speed;            /* of recordings; 0: as fast as frames are processed */
    double duration;         /* seconds; 0: no end */
    long frames;             /* 0: no end */
    bool reconnect, json, progress, verbose;
    int frame_capacity, imu_capacity; /* kept between reads, as in fathom_source_options */
};

void live_options_start(struct live_options *live);

/* Their table, for structs live_options. */
extern const struct option_row live_options_rig[], live_options_said[];

#endif
