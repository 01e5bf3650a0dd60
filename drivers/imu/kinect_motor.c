#include "imu/kinect_motor.h"

#include <stdlib.h>

/* Two bytes of tilt state, then x, y and z as int16, high byte first; angle and motor state. */
bool kinect_motor_read(const uint8_t *bytes, size_t length, imu_reading *reading) {
    if (length < KINECT_MOTOR_BYTES) return false;
    *reading = (imu_reading){.has_accel = true, .samples = 1};
    for (int i = 0; i < 3; i++) {
        const int raw = (int16_t)(bytes[2 + 2 * i] << 8 | bytes[3 + 2 * i]);
        if (abs(raw) > 3 * KINECT_MOTOR_COUNTS_PER_G) return false;
        reading->accel[0][i] = raw * (STANDARD_GRAVITY / KINECT_MOTOR_COUNTS_PER_G);
    }
    return true;
}
