/* InertialEstimate (Section 3), first form: orientation by the gyroscope, translation at constant velocity. */
#ifndef FATHOM_INERTIAL_H
#define FATHOM_INERTIAL_H

#include <stdatomic.h>
#include <stdint.h>

#include "arena.h"
#include "fathom.h"
#include "pose.h"

/* A sample on the depth clock, in camera axes. */
typedef struct {
    int64_t timestamp_ns;
    double gyro[3], accel[3];
} inertial_sample;

typedef struct {
    const fathom_config *config;
    /* from the pushing thread to the stepping thread: one writer, one reader, no lock */
    fathom_imu_sample *ring;
    unsigned capacity; /* a power of two */
    _Atomic unsigned head, tail;
    _Atomic int64_t overrun, not_finite;
    /* the stepping thread's */
    inertial_sample *history; /* the latest `capacity` samples, a circle in the order of their stamps */
    unsigned first, count;
    int64_t period_ns;                    /* typical distance between samples */
    double rotation[9];                   /* v_camera = rotation * v_imu */
    double gyro_bias[3], gyro_bias_sigma; /* camera axes, rad/s */
    double velocity[3];                   /* of the camera, world axes, m/s */
    double velocity_sigma;                /* m/s */
    double turning[3];    /* rad/s in camera axes, from the last two poses: for when there is no gyroscope */
    int64_t corrected_ns; /* stamp of the last accepted pose; INT64_MIN: none yet */
    pose corrected;       /* that pose */
    int still_samples;    /* length of the stillness at hand */
    double still_sum[3], still_accel[3];
    fathom_counters counters;
} inertial;

typedef struct {
    pose motion;           /* inv(M_from) M_to */
    double covariance[36]; /* right: motion * exp(error) */
} inertial_motion;

void inertial_init(inertial *n, arena *a, const fathom_config *config);
void inertial_reset(inertial *n);

/* From one other thread, at any time. */
int inertial_push(inertial *n, const fathom_imu_sample *sample);

/* Takes what has been pushed into the history. */
void inertial_drain(inertial *n);

/* The camera's motion between two stamps by inertia alone; `at` is the world pose at from_ns. FATHOM_OK or
 * FATHOM_ERROR_NO_DATA. */
int inertial_estimate(inertial *n, const pose *at, int64_t from_ns, int64_t to_ns, inertial_motion *out);

/* An accepted pose: corrects velocity. */
void inertial_correct(inertial *n, const pose *accepted, int64_t timestamp_ns);

#endif
