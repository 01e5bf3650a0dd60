/* Folders of the Stray Scanner app (an iPhone's LiDAR): camera_matrix.csv, odometry.csv, imu.csv, depth/ and
 * confidence/. */
#ifndef FATHOM_STRAY_SCANNER_H
#define FATHOM_STRAY_SCANNER_H

#include "recording/recording_internal.h"

/* Does the folder hold such a recording? */
bool stray_scanner_is(const struct recording *recording);

/* Each reads a part into the recording, as its counterpart in recording_internal.h does. The camera needs the size of
 * the frames; it fills in the phone's mounting and scale, too. */
int stray_scanner_read_frames(struct recording *recording);
int stray_scanner_read_camera(struct recording *recording);
int stray_scanner_read_imu(struct recording *recording);
int stray_scanner_read_poses(struct recording *recording);

#endif
