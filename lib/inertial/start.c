#include "inertial/start.h"

#include <math.h>
#include <string.h>

#include "inertial/strapdown.h"

/* Gravity, from the specific force of the last quarter of a second, assuming no acceleration. */
void inertial_start(inertial *n, const pose *accepted, int64_t timestamp_ns) {
    const fathom_config *c = n->config;
    navigator s;
    navigator_rest(n, &s, timestamp_ns);
    double force[3] = {0, 0, 0}, length = 0, gravity[3] = {0, 0, 0};
    int used = 0;
    for (int i = samples_find(&n->samples, timestamp_ns); i >= 0; i--) {
        const inertial_sample *a = sample_at(&n->samples, (unsigned)i);
        if (timestamp_ns - a->timestamp_ns > 250000000 || !isfinite(a->accel[0] + a->accel[1] + a->accel[2]))
            break;
        navigate(n, &s, a->timestamp_ns); /* R(first)^T R(sample) */
        for (int j = 0; j < 3; j++)
            force[j] +=
                s.r[3 * j] * a->accel[0] + s.r[3 * j + 1] * a->accel[1] + s.r[3 * j + 2] * a->accel[2];
        used++;
    }
    for (int j = 0; j < 3; j++) length += force[j] * force[j];
    length = sqrt(length);
    if (used > 0 && length > 1e-6)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                gravity[j] -= accepted->r[3 * j + k] * force[k] / length * c->gravity_m_s2;
    bool still = 1e-9 * (double)n->samples.period_ns * n->samples.still.samples > 0.1;
    pose imu = inertial_imu_pose(n, accepted);
    double gravity_sigma = used == 0 ? 10 : still ? 0.03 : 1;
    n->now.state.timestamp_ns = timestamp_ns;
    navigator_start(&n->now.state, &imu, gravity, still ? 0.03 : 0.5, n->samples.still.gyro_bias_sigma,
                    c->accel_bias_sigma_m_s2, gravity_sigma);
    memcpy(n->now.state.gyro_bias, n->samples.still.gyro_bias, sizeof n->samples.still.gyro_bias);
    n->running = true;
    n->now.corrected = *accepted;
    n->now.corrected_ns = timestamp_ns;
    timeline_restart(&n->past, &n->now);
}

void inertial_start_again(inertial *n) {
    pose imu = inertial_imu_pose(n, &n->accepted);
    const double gravity[3] = {0, 0, 0};
    if (!n->usable) memset(n->samples.still.gyro_bias, 0, sizeof n->samples.still.gyro_bias);
    n->now.state.timestamp_ns = n->accepted_ns;
    navigator_start(&n->now.state, &imu, gravity, 0.3, n->samples.still.gyro_bias_sigma,
                    n->config->accel_bias_sigma_m_s2, 1);
    memcpy(n->now.state.gyro_bias, n->samples.still.gyro_bias, sizeof n->samples.still.gyro_bias);
    if (n->moving) memcpy(n->now.state.v, n->velocity, sizeof n->velocity);
    timeline_restart(&n->past, &n->now);
}
