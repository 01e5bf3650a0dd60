/* A recording folder on its way into the library, as it would have come from the rig. */
#ifndef FATHOM_CLI_PLAYBACK_H
#define FATHOM_CLI_PLAYBACK_H

#include "fathom_drivers.h"
#include "fathom/shell/library.h"
#include "fathom/shell/settings.h"

/* The library, and how far the samples have gone into it. */
struct playback {
    struct library library;
    int next_imu;                /* the first sample that hasn't been pushed */
    int64_t imu_clock_offset_ns; /* of the settings, from which --refine-rig starts */
};

/* Opens a folder and says on stderr what had to be assumed. Returns a CLI_ status, after saying what went wrong. */
int playback_open(fathom_recording **recording, const char *folder, const char *imu_file,
                  const struct settings *settings, struct cli_log *log);

/* Where no voxel size was given: a small one for a near scene, such as a face or an object on a table. Says so. */
void playback_choose_voxel(const fathom_recording *recording, struct settings *settings);

/* Starts the library for every stride-th frame of the recording; completes *config. As above. */
int playback_start(struct playback *playback, const fathom_recording *recording, int stride,
                   const struct settings *settings, fathom_config *config, struct cli_log *log);

/* Pushes the samples up to frame 'index', and one beyond its stamp, so that it can be interpolated at. */
void playback_push_imu(struct playback *playback, const fathom_recording *recording, int index);

/* Nothing need have been started. */
void playback_stop(struct playback *playback);

#endif
