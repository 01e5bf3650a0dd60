/* The tracked frames of a path as the calibration's parts take them. */
#ifndef FATHOM_CLI_CALIBRATION_FRAMES_HPP
#define FATHOM_CLI_CALIBRATION_FRAMES_HPP

#include <memory>

#include "calibrate/calibration.h"
#include "calibrate/gyro_path.hpp"

struct CalibrationFrame {
    double t; /* depth clock, seconds from the path's first frame */
    Eigen::Quaterniond rotation;
    Eigen::Vector3d position;
    int run; /* of frames without one between them that wasn't tracked */
};

struct CalibrationFrames {
    std::unique_ptr<CalibrationFrame[]> frame;
    int count = 0;
    int64_t origin_ns = 0;

    bool read(const struct path *path); /* false: out of memory */

    /* The first frame of i's run that comes at least `seconds` after frame i, and not after twice that; -1: none. */
    int after(int i, double seconds) const;
};

/* Lever arm, accelerometer bias and gravity by double integration, given rotation and clock offset (in result);
 * gyro is integrated with the bias and scale found. False when there is no memory. */
bool calibrate_lever(const CalibrationFrames &frames, const GyroPath &gyro, double gravity,
                     struct calibration *result);

#endif
