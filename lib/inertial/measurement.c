#include "inertial/measurement.h"

#include <math.h>
#include <string.h>

#define EXACT 1e12            /* information, 1/rad^2 and 1/m^2, of an exact pose */
#define MAX_STILL_SQUARES 12.0 /* squared Mahalanobis distance of three values that one in a hundred exceeds */

static void linearise_pose(const measurement *m, const navigator *n, linearisation *out) {
    pose camera = navigator_camera(n, m->lever), way = pose_between(&camera, &m->camera_to_world);
    pose_log(&way, out->residual);
    navigator_camera_jacobian(n, m->lever, out->jacobian);
}

/* Three states, measured directly. */
static void linearise_states(linearisation *out, int first, const double state[3], const double value[3]) {
    for (int i = 0; i < 3; i++) {
        out->residual[i] = value[i] - state[i];
        out->jacobian[NAVIGATOR_STATES * i + first + i] = 1;
    }
}

static void linearise_velocity(const measurement *m, const navigator *n, linearisation *out) {
    linearise_states(out, NAVIGATOR_VELOCITY, n->v, m->value);
}

static void linearise_gyro_bias(const measurement *m, const navigator *n, linearisation *out) {
    linearise_states(out, NAVIGATOR_GYRO_BIAS, n->gyro_bias, m->value);
}

measurement measurement_of_nothing(int64_t timestamp_ns) {
    return (measurement){.timestamp_ns = timestamp_ns, .max_squares = INFINITY};
}

measurement measurement_of_pose(int64_t timestamp_ns, const pose *camera_to_world,
                                const double information[36], const double pull[6], const double lever[3],
                                double floor_rad, double floor_m) {
    measurement m = measurement_of_nothing(timestamp_ns);
    m.linearise = linearise_pose;
    m.camera_to_world = *camera_to_world;
    memcpy(m.lever, lever, sizeof m.lever);
    if (information) memcpy(m.information, information, sizeof m.information);
    if (pull) memcpy(m.pull, pull, sizeof m.pull);
    for (int i = 0; i < 6; i++) {
        m.floors[i] = i < 3 ? floor_rad : floor_m;
        if (!information) m.information[7 * i] = EXACT;
    }
    return m;
}

static measurement of_states(int64_t timestamp_ns, double sigma) {
    measurement m = measurement_of_nothing(timestamp_ns);
    for (int i = 0; i < 3; i++) m.information[7 * i] = 1 / (sigma * sigma);
    m.max_squares = MAX_STILL_SQUARES;
    return m;
}

measurement measurement_of_rest(int64_t timestamp_ns, double velocity_sigma) {
    measurement m = of_states(timestamp_ns, velocity_sigma);
    m.linearise = linearise_velocity;
    return m;
}

measurement measurement_of_gyro_bias(int64_t timestamp_ns, const double mean[3], double sigma) {
    measurement m = of_states(timestamp_ns, sigma);
    m.linearise = linearise_gyro_bias;
    memcpy(m.value, mean, sizeof m.value);
    return m;
}

void measurement_turn_imu(measurement *m, const double turn[3]) {
    double r[9];
    if (m->linearise != linearise_gyro_bias) return;
    so3_exp(turn, r);
    so3_apply(r, m->value, m->value);
}
