/* Writes what a live rig gives into a recording folder that is whole at any moment: a line stands in depth.txt when the
 * frame's file is there. */
#ifndef FATHOM_CLI_LIVE_RECORDER_H
#define FATHOM_CLI_LIVE_RECORDER_H

#include <stdatomic.h>

#include "fathom_drivers.h"
#include "fathom/line_file.h"
#include "fathom/recording_writer.h"

struct live_recorder {
    struct recording_writer folder;
    struct line_file depth, imu; /* imu is not open without an IMU */
    int64_t frames;              /* on the disk */
    int64_t first_ns, last_ns;   /* stamps of the frames */
    int64_t frame_bytes;
    atomic_llong samples, imu_bytes; /* on the disk */
    atomic_bool imu_failed;          /* imu.txt couldn't be written */
    bool incomplete;                 /* said that samples lack something */
    char error[1200];                /* one line, after a call that failed */
};

/* Makes the folder, and in it calibration.txt and rig.txt from *config; the mounting from rig.txt in the folder
 * `mounting`, unless that is NULL. A folder that isn't empty is refused unless `force`, which clears it of a recording.
 * header: comment lines for depth.txt and imu.txt. False after an error. */
bool live_recorder_open(struct live_recorder *recorder, const char *folder, bool force,
                        const fathom_config *config, const char *mounting, const char *header);

/* On one thread. False after an error. */
bool live_recorder_frame(struct live_recorder *recorder, const fathom_depth_frame *frame);

/* A live_rig_take; user is the recorder. May be on another thread than the frames. */
void live_recorder_take(void *user, const fathom_imu_sample *samples, int count);

/* Of frames and samples; on the frames' thread. */
long long live_recorder_bytes(const struct live_recorder *recorder);

/* False when something that came before couldn't be written. */
bool live_recorder_close(struct live_recorder *recorder);

#endif
