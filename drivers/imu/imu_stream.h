/* Converts readings of a device (imu_reading) to samples on the host's clock in the source's queue: stamps them,
 * spreads batches, pairs gyroscope and accelerometer. */
#ifndef FATHOM_IMU_STREAM_H
#define FATHOM_IMU_STREAM_H

#include "clock_map.h"
#include "imu/imu_pair.h"
#include "imu/imu_reading.h"
#include "source_queue.h"

typedef struct {
    int64_t device_ns, host_ns; /* of the last sample, on either clock; 0: none yet */
} imu_stream_last;

typedef struct {
    source_queue *queue;
    bool accel_only; /* no gyroscope: its values are NaN */
    imu_pair pair;
    imu_stream_last gyro, accel, both;
    int64_t pushed_ns;
    pthread_mutex_t lock; /* of the clock, whose status other threads read */
    clock_map clock;
    bool timed;
} imu_stream;

void imu_stream_init(imu_stream *stream, source_queue *queue);
void imu_stream_free(imu_stream *stream);

/* To be called for another device, or one that was gone: forgets its clock. */
void imu_stream_restart(imu_stream *stream, bool accel_only);

/* arrival_ns: CLOCK_MONOTONIC, when the host had the report. A sample whose stamp isn't later than its sensor's last
 * one is counted as malformed and dropped. Samples without a stamp of the device's are stamped by their arrival. */
void imu_stream_take(imu_stream *stream, const imu_reading *reading, int64_t arrival_ns);

/* Sets clock_offset_s and clock_drift_ppm. Any thread. */
void imu_stream_status(imu_stream *stream, fathom_source_status *status);

#endif
