/* Estimates the extrinsics and the clock offset of an IMU from the camera's trajectory (found without the IMU) and the
 * IMU's samples. Nothing about the rig is assumed. */
#ifndef FATHOM_CLI_CALIBRATION_H
#define FATHOM_CLI_CALIBRATION_H

#include <stdbool.h>

#include "fathom/replay/path.h"

#ifdef __cplusplus
extern "C" {
#endif

struct calibration_input {
    const struct path *path; /* only first and tracked frames count; others interrupt the trajectory */
    const fathom_imu_sample *imu;
    int imu_count;
    double gravity;      /* m/s^2; 0: 9.80665 */
    double offset_start; /* seconds: the offset is searched for at offset_start +- offset_range */
    double offset_range;
};

enum calibration_outcome {
    CALIBRATION_DONE,
    CALIBRATION_MEMORY,     /* out of memory */
    CALIBRATION_FEW_FRAMES, /* fewer than CALIBRATION_LEAST_WINDOWS windows of tracked frames with samples */
    CALIBRATION_LITTLE_TURNING, /* the rotation of the rig doesn't determine the mounting: see weak_axis */
    CALIBRATION_DISAGREES,      /* rotations of camera and gyroscope disagree at any offset: see correlation */
    CALIBRATION_RANGE,          /* the best offset lies at the end of the range */
    CALIBRATION_SCALE,          /* they agree but for a scale: see gyro_scale */
    CALIBRATION_MIRRORED        /* they agree only when mirrored: left-handed axes */
};

#define CALIBRATION_LEAST_WINDOWS 20

/* Beyond these (one sigma) a value is unobservable. */
#define CALIBRATION_ROTATION_SIGMA_DEG 5.0
#define CALIBRATION_OFFSET_SIGMA_S 0.005
#define CALIBRATION_LEVER_SIGMA_M 0.02

/* Boards are mounted square, to within this (one sigma). It matters only where the data are less certain. */
#define CALIBRATION_SQUARE_DEG 2.0

/* All sigmas are one standard deviation. Values that an outcome other than DONE hasn't determined are zero. */
struct calibration {
    int windows;                   /* windows of frames used */
    int left_out;                  /* windows left out for wrong tracking */
    double turning[3];             /* rms rate about the camera's axes, rad/s, less its mean */
    double correlation;            /* of the two rates at the best offset and rotation, 0..1 */
    double rotation[9];            /* row-major: v_camera = R v_imu */
    double rotation_sigma[3];      /* radians, about the camera's axes */
    double rotation_covariance[9]; /* row-major, radians^2, about the axes of the camera */
    double weak_axis[3]; /* camera axes: the axis about which the rotation is least certain */
    double weak_sigma;   /* radians, about that axis */
    /* Where the data are compatible with a mounting in quarter turns, it is assumed to be one within
     * CALIBRATION_SQUARE_DEG; the estimate without that. */
    double data_rotation[9], data_rotation_sigma[3];
    double data_weak_axis[3], data_weak_sigma; /* as weak_axis and weak_sigma */
    double square_moved; /* from there to rotation, in sigmas of the data; 0: not assumed to be square */
    double offset, offset_sigma; /* seconds to add to an IMU stamp */
    bool offset_observable;
    double gyro_bias[3], gyro_bias_sigma[3]; /* rad/s, IMU axes */
    double gyro_scale, gyro_scale_sigma;     /* the camera's rate over the gyroscope's */
    double rotation_residual;                /* robust sigma of a window's rotation, each axis, radians */

    bool accelerometer;              /* the values below were estimated */
    double lever[3], lever_sigma[3]; /* metres, the IMU's origin in camera axes */
    bool lever_observable;
    double accel_bias[3], accel_bias_sigma[3]; /* m/s^2, IMU axes */
    double gravity[3];                         /* m/s^2, in the path's world */
};

enum calibration_outcome calibration_solve(const struct calibration_input *input, struct calibration *result);

#ifdef __cplusplus
}
#endif

#endif
