/* Feeds a recording folder to the library as the rig would have done. */
#ifndef FATHOM_CLI_PLAYBACK_H
#define FATHOM_CLI_PLAYBACK_H

#include "fathom_drivers.h"
#include "fathom/shell/library.h"
#include "fathom/shell/settings.h"

/* The library, and the position in the samples. */
struct playback {
    struct library library;
    int next_imu;                /* the next sample to push */
    int64_t imu_clock_offset_ns; /* of the settings, from which --refine-rig starts */
    uint8_t *confidence; /* of the frame at hand; NULL: the recording has none */
};

/* Opens a folder, with notes on stderr about assumptions. Returns a CLI_ status, after a message on errors. */
int playback_open(fathom_recording **recording, const char *folder, const char *imu_file,
                  const struct settings *settings, struct cli_log *log);

/* Where no voxel size is given: sets a small one for a near scene, such as a face or an object on a table, with a
 * note. */
void playback_choose_voxel(const fathom_recording *recording, struct settings *settings);

/* Starts the library for every stride-th frame of the recording, from frame `first` on; completes *config. As above. */
int playback_start(struct playback *playback, const fathom_recording *recording, int first, int stride,
                   const struct settings *settings, fathom_config *config, struct cli_log *log);

/* Pushes the samples up to frame 'index', and one beyond its stamp, so that it can be interpolated at. */
void playback_push_imu(struct playback *playback, const fathom_recording *recording, int index);

/* The confidences of frame `index`, until the next call; NULL where it has none (the log says why one can't be read). */
const uint8_t *playback_confidence(struct playback *playback, const fathom_recording *recording, int index);

/* Allowed when it wasn't started. */
void playback_stop(struct playback *playback);

#endif
