/* The sources of a live rig: a depth camera, and an inertial sensor whose samples a separate thread passes on. */
#ifndef FATHOM_CLI_LIVE_RIG_H
#define FATHOM_CLI_LIVE_RIG_H

#include <pthread.h>

#include "fathom_drivers.h"
#include "fathom/shell/log.h"
#include "fathom/live/live_options.h"

/* Receives samples, oldest first; from the rig's thread, or, unpaced, from live_rig_push_until. */
typedef void (*live_rig_take)(void *user, const fathom_imu_sample *samples, int count);

struct live_rig {
    fathom_source *depth, *imu; /* imu NULL: none */
    bool unpaced;               /* recordings as fast as frames are processed: no thread, nothing is dropped */
    live_rig_take take;         /* gets the samples */
    void *user;
    int64_t clock_offset_ns; /* added to a sample's stamp to get the depth clock */

    pthread_t thread;
    bool threaded;
    pthread_mutex_t lock;
    pthread_cond_t pushed; /* a sample was taken, or there will be no more */
    int64_t newest_ns;     /* depth clock; INT64_MIN: none yet */
    int64_t period_ns;     /* between recent samples */
    int ended;             /* the error that ended the samples; FATHOM_OK: they go on */
    int64_t samples;       /* taken */

    fathom_imu_sample kept[64]; /* unpaced: read but not yet due */
    int kept_count, kept_next;
};

/* Opens the sources. Returns a CLI_ status, after a message on errors. */
int live_rig_open(struct live_rig *rig, const struct live_options *options, struct cli_log *log);

/* Size, intrinsics, mounting into *config, from the sources and --rig. As above. */
int live_rig_configure(struct live_rig *rig, const struct live_options *options, fathom_config *config,
                       struct cli_log *log);

/* The folder whose rig.txt has the IMU's mounting; NULL: none. */
const char *live_rig_mounting(const struct live_rig *rig, const struct live_options *options);

/* Starts the sources; from now on samples go to take(user, ...). clock_offset_ns: added to their stamps to get the
 * depth clock. As above. */
int live_rig_start(struct live_rig *rig, int64_t clock_offset_ns, live_rig_take take, void *user,
                   struct cli_log *log);

/* Waits until the samples around a frame's stamp have been taken, maximum a few milliseconds unless unpaced. */
void live_rig_push_until(struct live_rig *rig, int64_t stamp_ns);

/* Waits until a sample beyond the last frame's stamp has been taken, maximum 0.1 s. */
void live_rig_settle(struct live_rig *rig, int64_t stamp_ns);

/* Passes the last samples on; take isn't called any more afterwards. */
void live_rig_stop(struct live_rig *rig);

/* The CLI_ status for the result of the depth source's last wait, after a message on errors. */
int live_rig_end(int waited, const struct cli_log *log);

/* Stops and closes the open sources, if any. */
void live_rig_close(struct live_rig *rig);

#endif
