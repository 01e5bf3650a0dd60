/* Measurements: everything that corrects the navigator. A measurement has a stamp, a residual and its Jacobian over the
 * error state, an information, and the gate's limit. Residual and Jacobian are functions of the state, so that a late
 * measurement, and those that came after it, can be linearised anew at the state of their time.
 *
 * A new kind of measurement is a builder here with its linearise function; nothing else changes. */
#ifndef FATHOM_MEASUREMENT_H
#define FATHOM_MEASUREMENT_H

#include <stdbool.h>
#include <stdint.h>

#include "base/se3.h"
#include "inertial/filter.h"

#ifdef __cplusplus
extern "C" {
#endif

#define MEASUREMENT_ROWS 6 /* rows that a measurement doesn't need have no information */

typedef struct {
    double residual[MEASUREMENT_ROWS];                    /* measured less predicted */
    double jacobian[MEASUREMENT_ROWS * NAVIGATOR_STATES]; /* of the measured value by the error state, row-major */
} linearisation;

struct measurement {
    int64_t timestamp_ns;
    /* Writes residual and Jacobian at a state; out is zero before. NULL: only propagates. */
    void (*linearise)(const measurement *m, const navigator *n, linearisation *out);
    double information[MEASUREMENT_ROWS * MEASUREMENT_ROWS]; /* row-major, may be singular */
    double floors[MEASUREMENT_ROWS]; /* sigmas of errors beyond the information, in units of the mismatch */
    /* for a value estimated jointly with the prior: the information times the difference from it to the measurement's
     * own optimum, so that the prior doesn't count twice */
    double pull[MEASUREMENT_ROWS];
    double max_squares;              /* maximum normalised innovation squared; beyond it the measurement is rejected.
                                        INFINITY: none */
    bool of_frame; /* an accepted frame's pose */
    bool sound;    /* and one that mismatch and doubt (inertial/correct.c) learn from */
    /* input of linearise */
    pose camera_to_world;
    double lever[3];
    double value[3];
};

/* A camera pose with its information (6x6, right perturbation, rotation then translation); directions without
 * information correct nothing; NULL: the pose is exact. pull: see above; NULL: none. lever: the IMU's origin in camera
 * axes. */
measurement measurement_of_pose(int64_t timestamp_ns, const pose *camera_to_world,
                                const double information[36], const double pull[6], const double lever[3],
                                double floor_rad, double floor_m);

/* The IMU is at rest: its velocity is zero ... */
measurement measurement_of_rest(int64_t timestamp_ns, double velocity_sigma);

/* ... and its gyroscope reads its bias, here the mean over the stillness. */
measurement measurement_of_gyro_bias(int64_t timestamp_ns, const double mean[3], double sigma);

/* No measurement: only propagates the state to that time. */
measurement measurement_of_nothing(int64_t timestamp_ns);

/* Corrects the IMU's mounting (navigator_turn_imu): turns values measured in its axes. */
void measurement_turn_imu(measurement *m, const double turn[3]);

#ifdef __cplusplus
}
#endif

#endif
