/* The content of a report, packet or datagram of an inertial sensor, independent of the device: parsers fill it in,
 * imu_stream takes it. */
#ifndef FATHOM_IMU_READING_H
#define FATHOM_IMU_READING_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define IMU_BATCH 16 /* most samples in one report */

#define STANDARD_GRAVITY 9.80665 /* m/s^2 */
#define RADIANS_PER_DEGREE 0.017453292519943295

typedef struct {
    bool has_gyro, has_accel;
    int samples;                  /* 1 to IMU_BATCH, oldest first */
    int times;                    /* number of valid device_ns: samples, 1 (the last sample's), or 0 */
    int64_t period_ns;            /* between samples; 0: the distance of the reports */
    int64_t lost;                 /* samples missing before these by the device's numbering */
    int64_t device_ns[IMU_BATCH]; /* the device's clock, wraps undone */
    double gyro[IMU_BATCH][3];    /* rad/s */
    double accel[IMU_BATCH][3];   /* m/s^2, specific force: +9.8 along up at rest */
} imu_reading;

/* Extends a device's counter that wraps. All zero: no value yet. */
typedef struct {
    bool known;
    uint64_t count;
    uint64_t seen_count; /* at the last value whose arrival was known */
    int64_t seen_ns;
} whole_counter;

/* The next value of a counter of bits bits (1 to 63) that ticks every tick_ns. Of all counts that are congruent to raw
 * it is the one nearest to the prediction by the host's clock, so that pauses longer than a wrap are counted, and a
 * repeated or late value doesn't become a wrap. arrival_ns: time of arrival at the host; 0: unknown (it may have waited
 * in a queue), then less than 7/8 of a wrap forward, else back. Never below zero. */
uint64_t whole_counter_next(whole_counter *counter, uint64_t raw, int bits, double tick_ns,
                            int64_t arrival_ns);

static inline uint16_t little_u16(const uint8_t *bytes) {
    return (uint16_t)(bytes[0] | bytes[1] << 8);
}

static inline int16_t little_i16(const uint8_t *bytes) {
    return (int16_t)little_u16(bytes);
}

static inline uint32_t little_u32(const uint8_t *bytes) {
    return (uint32_t)little_u16(bytes) | (uint32_t)little_u16(bytes + 2) << 16;
}

#endif
