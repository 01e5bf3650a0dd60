/* Sony DualShock 4 and DualSense: the layouts of their reports and their factory calibration. */
#ifndef FATHOM_HID_PLAYSTATION_H
#define FATHOM_HID_PLAYSTATION_H

#include "imu/hid_models.h"

/* x to the right, y up out of the face, z towards the player. */
#define PLAYSTATION_AXES "x right, y out of the face, z to the player"

/* Feature reports with the calibration; over Bluetooth both end in a CRC. */
enum {
    DUALSHOCK4_CALIBRATION_USB = 0x02,
    DUALSHOCK4_CALIBRATION_BLUETOOTH = 0x05,
    DUALSENSE_CALIBRATION = 0x05,
    DUALSHOCK4_CALIBRATION_LENGTH = 37,
    PLAYSTATION_CALIBRATION_LENGTH = 41
};

extern const hid_layout dualshock4_usb, dualshock4_bluetooth, dualsense_usb, dualsense_bluetooth;

/* Nominal scales: 2000 deg/s and 4 g over 15 bits. */
#define PLAYSTATION_GYRO_SCALE (2000.0 / 32768 * RADIANS_PER_DEGREE)
#define PLAYSTATION_ACCEL_SCALE (4.0 / 32768 * STANDARD_GRAVITY)

bool dualshock4_calibrate_usb(const uint8_t *report, size_t length, imu_calibration *calibration);
bool dualshock4_calibrate_dongle(const uint8_t *report, size_t length, imu_calibration *calibration);
bool dualshock4_calibrate_bluetooth(const uint8_t *report, size_t length, imu_calibration *calibration);
bool dualsense_calibrate(const uint8_t *report, size_t length, imu_calibration *calibration);
bool dualsense_calibrate_bluetooth(const uint8_t *report, size_t length, imu_calibration *calibration);

#endif
