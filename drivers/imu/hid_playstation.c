#include "imu/hid_playstation.h"

#include <math.h>
#include <stdlib.h>

/* Over Bluetooth reports carry two (DualShock 4) or one (DualSense) bytes more in front, and end in a CRC. A controller
 * sends short reports (number 0x01, without samples) there until its calibration has been requested. */
enum { INPUT_SEED = 0xA1, FEATURE_SEED = 0xA3 };

const hid_layout dualshock4_usb = {.report_id = 0x01,
                                   .length = 64,
                                   .gyro = 13,
                                   .accel = 19,
                                   .samples = 1,
                                   .time = 10,
                                   .time_bytes = 2,
                                   .tick_ns = 16000.0 / 3,
                                   .sequence = 7,
                                   .sequence_shift = 2,
                                   .sequence_bits = 6};

const hid_layout dualshock4_bluetooth = {.report_id = 0x11,
                                         .length = 78,
                                         .gyro = 15,
                                         .accel = 21,
                                         .samples = 1,
                                         .time = 12,
                                         .time_bytes = 2,
                                         .tick_ns = 16000.0 / 3,
                                         .sequence = 9,
                                         .sequence_shift = 2,
                                         .sequence_bits = 6,
                                         .crc_seed = INPUT_SEED};

const hid_layout dualsense_usb = {.report_id = 0x01,
                                  .length = 64,
                                  .gyro = 16,
                                  .accel = 22,
                                  .samples = 1,
                                  .time = 28,
                                  .time_bytes = 4,
                                  .tick_ns = 1000.0 / 3,
                                  .sequence = 7,
                                  .sequence_bits = 8};

const hid_layout dualsense_bluetooth = {.report_id = 0x31,
                                        .length = 78,
                                        .gyro = 17,
                                        .accel = 23,
                                        .samples = 1,
                                        .time = 29,
                                        .time_bytes = 4,
                                        .tick_ns = 1000.0 / 3,
                                        .sequence = 8,
                                        .sequence_bits = 8,
                                        .crc_seed = INPUT_SEED};

/* Bytes 1 to 34 of the feature report are int16: three gyroscope biases; the gyroscope at + and - the test's speed, in
 * an order that differs; the two speeds in deg/s; the accelerometer at + and - 1 g for each axis.
 *
 * The gyroscope's bias applies to the plus and minus readings, to compute their magnitudes, and isn't subtracted from
 * samples: the controller does that itself. */
static bool calibrate(const uint8_t *report, const int plus[3], const int minus[3], imu_calibration *out) {
    const double speed = (double)little_i16(report + 19) + little_i16(report + 21);
    imu_calibration c = {0};
    for (int i = 0; i < 3; i++) {
        const int bias = little_i16(report + 1 + 2 * i);
        const int gyro_span =
            abs(little_i16(report + plus[i]) - bias) + abs(little_i16(report + minus[i]) - bias);
        const int accel_plus = little_i16(report + 23 + 4 * i), accel_minus = little_i16(report + 25 + 4 * i);
        const int accel_span = accel_plus - accel_minus; /* 2 g */
        if (gyro_span == 0 || accel_span == 0) return false;
        c.gyro_scale[i] = speed / gyro_span * RADIANS_PER_DEGREE;
        c.accel_bias[i] = 0.5 * (accel_plus + accel_minus);
        c.accel_scale[i] = 2 * STANDARD_GRAVITY / accel_span;
        /* Copies of these controllers answer with zeros or noise: then nominal scales are used. */
        if (fabs(c.gyro_scale[i] / PLAYSTATION_GYRO_SCALE - 1) > 0.5) return false;
        if (fabs(c.accel_scale[i] / PLAYSTATION_ACCEL_SCALE - 1) > 0.5) return false;
        if (fabs(c.accel_bias[i] * c.accel_scale[i]) > 0.5 * STANDARD_GRAVITY) return false;
    }
    *out = c;
    return true;
}

static const int pairs_plus[3] = {7, 11, 15}, pairs_minus[3] = {9, 13, 17};
static const int triples_plus[3] = {7, 9, 11}, triples_minus[3] = {13, 15, 17};

static bool crc_holds(const uint8_t *report, size_t length) {
    return length >= PLAYSTATION_CALIBRATION_LENGTH &&
           hid_crc32(FEATURE_SEED, report, PLAYSTATION_CALIBRATION_LENGTH - 4) ==
               little_u32(report + PLAYSTATION_CALIBRATION_LENGTH - 4);
}

bool dualshock4_calibrate_usb(const uint8_t *report, size_t length, imu_calibration *calibration) {
    return length >= DUALSHOCK4_CALIBRATION_LENGTH && report[0] == DUALSHOCK4_CALIBRATION_USB &&
           calibrate(report, pairs_plus, pairs_minus, calibration);
}

bool dualshock4_calibrate_dongle(const uint8_t *report, size_t length, imu_calibration *calibration) {
    return length >= DUALSHOCK4_CALIBRATION_LENGTH && report[0] == DUALSHOCK4_CALIBRATION_USB &&
           calibrate(report, triples_plus, triples_minus, calibration);
}

bool dualshock4_calibrate_bluetooth(const uint8_t *report, size_t length, imu_calibration *calibration) {
    return crc_holds(report, length) && report[0] == DUALSHOCK4_CALIBRATION_BLUETOOTH &&
           calibrate(report, triples_plus, triples_minus, calibration);
}

bool dualsense_calibrate(const uint8_t *report, size_t length, imu_calibration *calibration) {
    return length >= DUALSHOCK4_CALIBRATION_LENGTH && report[0] == DUALSENSE_CALIBRATION &&
           calibrate(report, pairs_plus, pairs_minus, calibration);
}

bool dualsense_calibrate_bluetooth(const uint8_t *report, size_t length, imu_calibration *calibration) {
    return crc_holds(report, length) && dualsense_calibrate(report, length, calibration);
}
