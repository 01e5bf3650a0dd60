/* See imu_model.h. White noise on each sample, a constant bias drawn once, and its random walk: the usual
 * model of a MEMS part (e.g. Woodman 2007, "An introduction to inertial navigation", section 3). */
#include "simulate/imu_model.h"

#include <math.h>
#include <string.h>

#include "simulate/counter_random.h"

#define RADIANS 0.017453292519943295

static const struct imu_grade grades[] = {
    {.name = "ideal", .part = "no noise, no bias, no steps"},
    /* Bosch BMI270, data sheet BST-BMI270-DS000: noise density 0.007 dps/sqrt(Hz) and 160 ug/sqrt(Hz), zero-rate offset
     * 0.5 dps (typical values, which Bosch gives as one sigma), 16 bits over 2000 dps and 8 g. The zero-g offset is
     * taken as 20 mg. The sheet has no random walk; those two are typical of Allan plots of this class of parts. */
    {.name = "consumer",
     .part = "Bosch BMI270",
     .gyro_noise = 0.007 * RADIANS,
     .accel_noise = 160e-6 * STANDARD_GRAVITY,
     .gyro_bias = 0.5 * RADIANS,
     .accel_bias = 0.020 * STANDARD_GRAVITY,
     .gyro_walk = 2e-5,
     .accel_walk = 3e-4,
     .gyro_step = RADIANS / 16.384,
     .accel_step = STANDARD_GRAVITY / 4096.0,
     .gyro_range = 2000.0 * RADIANS,
     .accel_range = 8.0 * STANDARD_GRAVITY},
    /* Ten times the gyroscope noise, as after a phone's own filtering and resampling. */
    {.name = "phone",
     .part = "a phone's part, pessimistic",
     .gyro_noise = 1.5e-3,
     .accel_noise = 3e-3,
     .gyro_bias = 0.01,
     .accel_bias = 0.08,
     .gyro_walk = 1e-4,
     .accel_walk = 1e-3,
     .gyro_step = RADIANS / 16.384,
     .accel_step = STANDARD_GRAVITY / 4096.0,
     .gyro_range = 2000.0 * RADIANS,
     .accel_range = 8.0 * STANDARD_GRAVITY},
};

const struct imu_grade *imu_grade_of(const char *name) {
    for (size_t i = 0; i < sizeof grades / sizeof grades[0]; i++)
        if (!strcmp(name, grades[i].name)) return &grades[i];
    return NULL;
}

void imu_model_make(struct imu_model *model, const struct imu_grade *grade,
                    const struct imu_mounting *mounting, double rate, uint64_t seed) {
    double vector[3];
    memset(model, 0, sizeof *model);
    model->grade = *grade;
    model->mounting = *mounting;
    model->rate = rate;
    model->key = random_key(seed, 0x1a0);
    for (int i = 0; i < 3; i++) vector[i] = mounting->rotation_deg[i] * RADIANS;
    rotation_of_vector(vector, model->rotation);
    const uint64_t key = random_key(seed, 0x1a1);
    for (int i = 0; i < 3; i++) {
        model->gyro_bias[i] = grade->gyro_bias * random_normal(key, (uint64_t)i);
        model->accel_bias[i] = grade->accel_bias * random_normal(key, (uint64_t)(3 + i));
    }
}

static double in_counts(double value, double step, double range) {
    if (range > 0.0) value = fmin(fmax(value, -range), range);
    return step > 0.0 ? step * round(value / step) : value;
}

void imu_model_next(struct imu_model *model, const struct camera_path *path, struct imu_sample *sample) {
    const struct imu_grade *g = &model->grade;
    const double white = sqrt(model->rate), walk = sqrt(1.0 / model->rate);
    const uint64_t counter = 12 * model->next;
    /* The path is evaluated at the rounded stamp's time. */
    sample->stamp = round(1e6 * ((double)model->next / model->rate - model->mounting.clock_offset)) * 1e-6;
    const double t = sample->stamp + model->mounting.clock_offset;

    struct camera_pose pose;
    double rate[3], force[3], in_camera[3];
    camera_path_pose(path, t, &pose);
    camera_path_rate(path, t, rate);
    camera_path_acceleration(path, t, model->mounting.translation, force);
    force[2] += STANDARD_GRAVITY; /* specific force: acceleration minus gravity, which points down */
    for (int i = 0; i < 3; i++)
        in_camera[i] =
            pose.rotation[i] * force[0] + pose.rotation[3 + i] * force[1] + pose.rotation[6 + i] * force[2];
    for (int i = 0; i < 3; i++) {
        const double *r = model->rotation; /* v_imu = R^T v_camera */
        const double turn = r[i] * rate[0] + r[3 + i] * rate[1] + r[6 + i] * rate[2];
        const double push = r[i] * in_camera[0] + r[3 + i] * in_camera[1] + r[6 + i] * in_camera[2];
        const uint64_t draw = counter + 4 * (uint64_t)i;
        sample->gyro[i] =
            in_counts(turn + model->gyro_bias[i] + white * g->gyro_noise * random_normal(model->key, draw),
                      g->gyro_step, g->gyro_range);
        sample->accel[i] = in_counts(push + model->accel_bias[i] +
                                         white * g->accel_noise * random_normal(model->key, draw + 1),
                                     g->accel_step, g->accel_range);
        model->gyro_bias[i] += walk * g->gyro_walk * random_normal(model->key, draw + 2);
        model->accel_bias[i] += walk * g->accel_walk * random_normal(model->key, draw + 3);
    }
    model->next++;
}
