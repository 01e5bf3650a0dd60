/* Merges gyroscope and accelerometer samples with separate stamps into one stream: a sample for each of the
 * gyroscope's, with the accelerometer interpolated to its stamp. No heap. */
#ifndef FATHOM_IMU_PAIR_H
#define FATHOM_IMU_PAIR_H

#include "fathom.h"

#define IMU_PAIR_WAITING 64 /* most gyroscope samples that wait for an accelerometer sample after them */
#define IMU_PAIR_LONGEST_NS 100000000 /* ... and how long; also the longest gap that is interpolated across */
#define IMU_PAIR_ABSENT_NS 1000000000 /* an accelerometer silent for so long isn't waited for */

typedef struct {
    int64_t timestamp_ns;
    float value[3];
} imu_pair_value;

typedef void (*imu_pair_sink)(void *user, const fathom_imu_sample *sample);

typedef struct {
    imu_pair_sink sink;
    void *user;
    imu_pair_value gyro[IMU_PAIR_WAITING]; /* a ring */
    int first, waiting;
    imu_pair_value accel[2]; /* the two newest */
    int accels;
} imu_pair;

void imu_pair_init(imu_pair *pair, imu_pair_sink sink, void *user);

/* Each takes samples in the order of their stamps; false: this one isn't later than its predecessor, and was dropped.
 * The sink gets samples in order. Where the accelerometer is silent, or before its first sample, its values are NaN. */
bool imu_pair_gyro(imu_pair *pair, int64_t timestamp_ns, const double value[3]);
bool imu_pair_accel(imu_pair *pair, int64_t timestamp_ns, const double value[3]);

#endif
