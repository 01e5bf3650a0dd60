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
    double gravity[3];                  /* m/s^2, world: what a free fall accelerates by */
    double covariance[NAVIGATOR_STATES * NAVIGATOR_STATES];
} navigator;

/* Noise of one stretch of time. */
typedef struct {
    double gyro;       /* rad/s/sqrt(Hz) */
    double accel;      /* m/s^2/sqrt(Hz) */
    double gyro_walk;  /* rad/s/sqrt(s) */
    double accel_walk; /* m/s^2/sqrt(s) */
    double turn;       /* rad more, for a stretch without samples */
    double rotation_walk,
        position_walk; /* rad/sqrt(s), m/sqrt(s): drift of the poses that the state is held to */
} navigator_noise;

/* Sigmas of a start: of velocity, biases, gravity; rotation and position are known, for the first pose is the world.
 * gravity_sigma counts what the accelerometer's bias doesn't explain: gravity comes from the force that it measured. */
void navigator_start(navigator *n, const pose *imu_to_world, const double gravity[3], double velocity_sigma,
                     double gyro_bias_sigma, double accel_bias_sigma, double gravity_sigma);

/* Goes on by dt seconds (negative: back, the covariance stays) at the mean angular rate and specific force of the
 * stretch, biases still in them. accel NULL: unknown, so at constant velocity. */
void navigator_step(navigator *n, double dt, const double gyro[3], const double accel[3],
                    const navigator_noise *noise);

typedef struct measurement measurement; /* inertial/measurement.h */

/* The measurement corrects the state, whose time is the measurement's. mismatch: scales its floors. False: it was left
 * out, for it is beyond its gate or not finite. */
bool navigator_correct(navigator *n, const measurement *m, double mismatch);

/* How a measurement fits to the state, before it corrects it: the squared innovation in units of what the state's
 * covariance and the floors, but not the information, explain of it; 1 is expected. Negative: it says too little to
 * tell. */
double navigator_misfit(const navigator *n, const measurement *m, double mismatch);

/* Adds an error to the state, in the order of the covariance. */
void navigator_perturb(navigator *n, const double error[NAVIGATOR_STATES]);

/* The IMU turns out to be mounted otherwise: what was taken for v is exp(turn) v. The biases turn with it, and what
 * they and gravity have learnt by the wrong axes is as uncertain as the turn makes it. */
void navigator_turn_imu(navigator *n, const double turn[3]);

/* The camera's pose, and the covariance of it (right perturbation). */
pose navigator_camera(const navigator *n, const double lever[3]);
void navigator_camera_covariance(const navigator *n, const double lever[3], double covariance[36]);

/* How an error of the state moves the camera's pose (right perturbation): 6 rows, row-major. */
void navigator_camera_jacobian(const navigator *n, const double lever[3],
                               double jacobian[6 * NAVIGATOR_STATES]);

/* Calls the pose of this moment exact, for the covariance of a motion from here on. */
void navigator_forget_pose_error(navigator *n);

#ifdef __cplusplus
}
#endif

#endif
