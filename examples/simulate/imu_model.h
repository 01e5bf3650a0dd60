/* Samples of a simulated IMU on a camera path. */
#ifndef FATHOM_IMU_MODEL_H
#define FATHOM_IMU_MODEL_H

#include "simulate/camera_path.h"

#define STANDARD_GRAVITY 9.80665 /* m/s^2, along -z of the world */

/* The quality of a part. Densities are such that a sample's standard deviation is density * sqrt(rate). Zero:
 * none. */
struct imu_grade {
    const char *name, *part;
    double gyro_noise, accel_noise; /* rad/s/sqrt(Hz), m/s^2/sqrt(Hz) */
    double gyro_bias, accel_bias;   /* rad/s, m/s^2: standard deviation of the constant bias of each axis */
    double gyro_walk, accel_walk;   /* rad/s/sqrt(s), m/s^2/sqrt(s): the bias's random walk */
    double gyro_step, accel_step;   /* rad/s, m/s^2 per count */
    double gyro_range, accel_range; /* rad/s, m/s^2: the limit of saturation */
};

/* "ideal", "consumer" (a Bosch BMI270) or "phone" (an older phone's part); NULL: no grade has that name. */
const struct imu_grade *imu_grade_of(const char *name);

/* The IMU's mounting, in the terms of rig.txt. */
struct imu_mounting {
    double rotation_deg[3]; /* rotation vector: v_camera = R v_imu */
    double translation[3];  /* metres, the IMU's origin in camera axes */
    double clock_offset;    /* seconds to add to an IMU stamp to get the depth clock */
};

struct imu_model {
    struct imu_grade grade;
    struct imu_mounting mounting;
    double rate; /* samples per second */
    double rotation[9];
    double gyro_bias[3], accel_bias[3]; /* the present biases, a random walk */
    uint64_t key, next;
};

struct imu_sample {
    double stamp;    /* on the IMU's clock, seconds, in whole microseconds */
    double gyro[3];  /* rad/s, IMU axes */
    double accel[3]; /* specific force, m/s^2, IMU axes: +9.8 along up at rest */
};

void imu_model_make(struct imu_model *model, const struct imu_grade *grade,
                    const struct imu_mounting *mounting, double rate, uint64_t seed);

/* The next sample; the first is taken at time 0 of the depth clock. */
void imu_model_next(struct imu_model *model, const struct camera_path *path, struct imu_sample *sample);

#endif
