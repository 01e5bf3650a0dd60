/* The ring of IMU samples from the pushing thread to the stepping thread, and their history: in the order of their
 * stamps, on the depth camera's clock, in camera axes. */
#ifndef FATHOM_SAMPLES_H
#define FATHOM_SAMPLES_H

#include <stdatomic.h>
#include <stdint.h>

#include "base/arena.h"
#include "fathom.h"
#include "inertial/clock_watch.h"
#include "inertial/stillness.h"

/* A sample on the depth clock, in camera axes. */
typedef struct {
    int64_t timestamp_ns;
    double gyro[3], accel[3];
} inertial_sample;

typedef struct {
    const fathom_config *config;
    /* one writer, one reader, no lock */
    fathom_imu_sample *ring;
    unsigned capacity; /* a power of two */
    _Atomic unsigned head, tail;
    _Atomic int64_t overrun, not_finite, absurd;
    /* of the stepping thread */
    inertial_sample *history; /* the latest `capacity` samples, a circle */
    unsigned first, count;
    int64_t period_ns;  /* typical distance between samples */
    double rotation[9]; /* v_camera = rotation * v_imu */
    int64_t refined_ns; /* added to stamps in addition to the setting's offset: by the refined rig ... */
    int64_t shift_ns;   /* ... and because the clocks leapt apart */
    int late;           /* consecutive samples out of order */
    int64_t late_ns;    /* stamp of the first of them */
    bool doubtful;      /* `doubt` differs so much from its predecessor that the next one decides */
    inertial_sample doubt;
    clock_watch clocks;
    int64_t watched; /* samples that had been accepted at the last frame */
    stillness still;
    int64_t accepted, out_of_order, gaps, implausible, clock_leaps;
} imu_samples;

void samples_init(imu_samples *s, arena *a, const fathom_config *config);

/* Empties the history, not the ring; mounting and clock are the settings' again. Counters stay. */
void samples_reset(imu_samples *s);

/* From one other thread, at any time. FATHOM_OK, or FATHOM_ERROR_ARGUMENT for impossible values. */
int samples_push(imu_samples *s, const fathom_imu_sample *sample);

/* Number of samples in the ring. */
unsigned samples_waiting(const imu_samples *s);

/* Takes the oldest sample out of the ring, its stamp on the depth clock, its axes still the IMU's. One must be waiting.
 * False: the converted stamp is impossible, and the sample is dropped. */
bool samples_pop(imu_samples *s, fathom_imu_sample *raw);

/* Takes a popped sample into the history. */
void samples_take(imu_samples *s, const fathom_imu_sample *raw);

/* To be called before a frame, after the samples that arrived before it: corrects the stamps after a leap of a
 * clock. */
void samples_follow_clock(imu_samples *s, int64_t frame_ns);

/* Turns the mounting by exp(mounting) and moves stamps later by later_ns, in the history as well. */
void samples_remount(imu_samples *s, const double mounting[3], int64_t later_ns);

/* The i-th of the history, 0 the oldest. */
static inline inertial_sample *sample_at(const imu_samples *s, unsigned i) {
    return &s->history[(s->first + i) & (s->capacity - 1)];
}

/* Index of the last sample at or before t, or -1. */
int samples_find(const imu_samples *s, int64_t t);

/* Rate and specific force at t, interpolated; held before the first and after the last sample. i: samples_find(t). */
void samples_between(const imu_samples *s, int64_t t, int i, double gyro[3], double accel[3]);

#endif
