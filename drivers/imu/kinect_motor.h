/* The accelerometer of Microsoft's first Kinect (for the Xbox 360), which is part of its motor device: without a
 * gyroscope it serves for levelling, not for a scan. */
#ifndef FATHOM_KINECT_MOTOR_H
#define FATHOM_KINECT_MOTOR_H

#include "imu/imu_reading.h"

enum {
    KINECT_VENDOR = 0x045E,
    KINECT_MOTOR_PRODUCT = 0x02B0,
    KINECT_MOTOR_REQUEST_TYPE = 0xC0, /* vendor, device to host */
    KINECT_MOTOR_REQUEST = 0x32,
    KINECT_MOTOR_BYTES = 10,
    KINECT_MOTOR_USUAL_HZ = 50,
    KINECT_MOTOR_COUNTS_PER_G = 819
};

/* Parses the answer; false: too short, or beyond the sensor's range (2 g). y points up out of the Kinect. */
bool kinect_motor_read(const uint8_t *bytes, size_t length, imu_reading *reading);

#endif
