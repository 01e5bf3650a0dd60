/* Error-state Kalman filter for inertial navigation (Sola 2017, "Quaternion kinematics for the error-state Kalman
 * filter", Sections 5.3 to 6.3), in C++ with Eigen's fixed-size types behind a C header.
 *
 * The state is that of the IMU, its axes turned parallel to the camera's. Its error is ordered rotation (right: R
 * exp(e)), position, velocity, gyro bias, accelerometer bias, gravity; position, velocity and gravity in world axes. */
#ifndef FATHOM_FILTER_H
#define FATHOM_FILTER_H

#include <stdbool.h>
#include <stdint.h>

#include "base/se3.h"

#ifdef __cplusplus
extern "C" {
#endif

#define NAVIGATOR_STATES 18

/* Where the parts of the error begin, three states each. */
enum {
    NAVIGATOR_ROTATION = 0,
    NAVIGATOR_POSITION = 3,
    NAVIGATOR_VELOCITY = 6,
    NAVIGATOR_GYRO_BIAS = 9,
    NAVIGATOR_ACCEL_BIAS = 12,
    NAVIGATOR_GRAVITY = 15
};

typedef struct {
    int64_t timestamp_ns;
    double r[9], p[3], v[3];            /* orientation, position, velocity: IMU to world */
    double gyro_bias[3], accel_bias[3]; /* rad/s, m/s^2, IMU (camera-parallel) axes */
    double gravity[3];                  /* m/s^2, world: acceleration of free fall */
    double covariance[NAVIGATOR_STATES * NAVIGATOR_STATES];
} navigator;

/* Noise during one step. */
typedef struct {
    double gyro;       /* rad/s/sqrt(Hz) */
    double accel;      /* m/s^2/sqrt(Hz) */
    double gyro_walk;  /* rad/s/sqrt(s) */
    double accel_walk; /* m/s^2/sqrt(s) */
    double turn;       /* rad, in addition, for a step without samples */
    double rotation_walk,
        position_walk; /* rad/sqrt(s), m/sqrt(s): drift of the poses that correct the state */
} navigator_noise;

/* Starts with these sigmas of velocity, biases and gravity; rotation and position are exact, as the first pose defines
 * the world. gravity_sigma is the part that the accelerometer's bias doesn't explain: gravity is initialised from the
 * measured specific force. */
void navigator_start(navigator *n, const pose *imu_to_world, const double gravity[3], double velocity_sigma,
                     double gyro_bias_sigma, double accel_bias_sigma, double gravity_sigma);

/* Propagates by dt seconds (negative: back, the covariance stays) with the mean angular rate and specific force of that
 * time, biases included. accel NULL: unknown; constant velocity. */
void navigator_step(navigator *n, double dt, const double gyro[3], const double accel[3],
                    const navigator_noise *noise);

typedef struct measurement measurement; /* inertial/measurement.h */

/* Corrects the state, which is at the measurement's time. mismatch scales the measurement's floors. False: it was
 * rejected, being beyond its gate or not finite. */
bool navigator_correct(navigator *n, const measurement *m, double mismatch);

/* Normalised innovation squared of a measurement before it corrects the state, relative to the part that the state's
 * covariance and the floors, but not the information, explain; 1 is expected. Negative: the measurement carries too
 * little information. */
double navigator_misfit(const navigator *n, const measurement *m, double mismatch);

/* Adds an error to the state, in the order of the covariance. */
void navigator_perturb(navigator *n, const double error[NAVIGATOR_STATES]);

/* Corrects the IMU's mounting: a vector taken for v is exp(turn) v. The biases turn with it, and the uncertainty of
 * biases and gravity grows by the error that the wrong axes caused. */
void navigator_turn_imu(navigator *n, const double turn[3]);

/* The camera's pose, and the covariance of it (right perturbation). */
pose navigator_camera(const navigator *n, const double lever[3]);
void navigator_camera_covariance(const navigator *n, const double lever[3], double covariance[36]);

/* Jacobian of the camera's pose (right perturbation) by the error state: 6 rows, row-major. */
void navigator_camera_jacobian(const navigator *n, const double lever[3],
                               double jacobian[6 * NAVIGATOR_STATES]);

/* Takes the present pose as exact, for the covariance of a motion from here on. */
void navigator_forget_pose_error(navigator *n);

#ifdef __cplusplus
}
#endif

#endif
