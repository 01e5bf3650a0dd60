/* The sources of a live scan: a depth camera, and an inertial sensor whose samples a thread of its own pushes. */
#ifndef FATHOM_CLI_SCAN_RIG_H
#define FATHOM_CLI_SCAN_RIG_H

#include <pthread.h>

#include "fathom_drivers.h"
#include "log.h"
#include "scan_options.h"

struct scan_rig {
    fathom_source *depth, *imu; /* imu NULL: none */
    bool unpaced;               /* recordings as fast as they can be scanned: no thread, nothing is dropped */
    fathom *scan;               /* gets the samples */
    int64_t clock_offset_ns;    /* added to a sample's stamp to get the depth clock */

    pthread_t thread;
    bool threaded;
    pthread_mutex_t lock;
    pthread_cond_t pushed; /* a sample was, or there will be no more */
    int64_t newest_ns;     /* depth clock; INT64_MIN: none yet */
    int64_t period_ns;     /* between samples, lately */
    int ended;             /* what ended the samples; FATHOM_OK: they go on */
    int64_t samples;       /* pushed */

    fathom_imu_sample kept[64]; /* unpaced: read, and not yet due */
    int kept_count, kept_next;
};

/* Opens the sources. Returns a CLI_ status after saying what went wrong. */
int scan_rig_open(struct scan_rig *rig, const struct scan_options *options, struct cli_log *log);

/* Size, intrinsics, mounting into *config. As above. */
int scan_rig_configure(struct scan_rig *rig, const struct scan_options *options, fathom_config *config,
                       struct cli_log *log);

/* Starts the sources; from now on samples go to the context. As above. */
int scan_rig_start(struct scan_rig *rig, const fathom_config *config, fathom *scan, struct cli_log *log);

/* Waits until the samples around a frame's stamp have been pushed, a few milliseconds at most unless unpaced. */
void scan_rig_push_until(struct scan_rig *rig, int64_t stamp_ns);

/* Stops and closes what is open. Nothing need be. */
void scan_rig_close(struct scan_rig *rig);

#endif
