/* Writes a recording folder (docs/FORMATS: the TUM / ETH3D layout) frame by frame, whole at any moment. */
#ifndef FATHOM_RECORDING_WRITER_H
#define FATHOM_RECORDING_WRITER_H

#include <stdio.h>

#include "simulate/imu_model.h"

#define RECORDING_DEPTH_SCALE 5000 /* units a metre: steps of 0.2 mm, 13.1 m at most */

struct recording_writer {
    const char *folder;
    FILE *depth, *truth; /* depth.txt, groundtruth.txt; flushed with every frame */
    char error[1024];    /* one line, after a call that failed */
};

/* Makes the folder (and those above it) and clears it of a former recording. One that isn't empty is refused unless
 * `force`. These and all below: 0, or -1 with one line in writer->error. */
int recording_prepare(struct recording_writer *writer, const char *folder, bool force);

/* The same, and begins depth.txt and groundtruth.txt; a former simulation is cleared without `force`. The header stands
 * at the top of each file written, as a comment. */
int recording_open(struct recording_writer *writer, const char *folder, bool force, const char *header);

/* calibration.txt: fx fy cx cy [k1 k2 p1 p2 [k3]] */
int recording_calibration(struct recording_writer *writer, const double *values, int count);

/* rig.txt: the scale, and all other lines from another folder's; NULL, or one without it: none. */
int recording_rig(struct recording_writer *writer, const char *from, double depth_scale);

/* rig.txt of a simulated IMU, and its samples up to time `until` as imu.txt. */
int recording_imu(struct recording_writer *writer, struct imu_model *model, const struct camera_path *path,
                  double until, const char *header);

/* imu.txt and rig.txt (with this recording's depth_scale) from another folder; what isn't there is left out.
 */
int recording_copy_imu(struct recording_writer *writer, const char *from);

/* One frame: depth in units, taken at t with the camera at pose. */
int recording_frame(struct recording_writer *writer, double t, const uint16_t *depth,
                    const struct render_camera *camera, const struct camera_pose *pose);

int recording_close(struct recording_writer *writer);

#endif
