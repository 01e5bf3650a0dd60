#include "imu/imu_pair.h"

#include <math.h>

void imu_pair_init(imu_pair *pair, imu_pair_sink sink, void *user) {
    *pair = (imu_pair){.sink = sink, .user = user};
}

static imu_pair_value value_of(int64_t timestamp_ns, const double value[3]) {
    return (imu_pair_value){timestamp_ns, {(float)value[0], (float)value[1], (float)value[2]}};
}

/* The accelerometer at a time: interpolated between its two newest samples, or the newest held for a while. */
static void accel_at(const imu_pair *p, int64_t t, float out[3]) {
    const imu_pair_value *a = &p->accel[0], *b = &p->accel[1];
    const bool between = p->accels == 2 && t >= a->timestamp_ns && t <= b->timestamp_ns &&
                         b->timestamp_ns - a->timestamp_ns <= IMU_PAIR_LONGEST_NS;
    const bool held = p->accels > 0 && t >= b->timestamp_ns && t - b->timestamp_ns <= IMU_PAIR_LONGEST_NS;
    for (int i = 0; i < 3; i++) {
        out[i] = NAN;
        if (held) out[i] = b->value[i];
        if (between) {
            const double part = (double)(t - a->timestamp_ns) / (double)(b->timestamp_ns - a->timestamp_ns);
            out[i] = (float)(a->value[i] + part * (b->value[i] - a->value[i]));
        }
    }
}

static void let_go(imu_pair *p) {
    const imu_pair_value *g = &p->gyro[p->first];
    fathom_imu_sample sample = {.timestamp_ns = g->timestamp_ns};
    for (int i = 0; i < 3; i++) sample.gyro[i] = g->value[i];
    accel_at(p, g->timestamp_ns, sample.accel);
    p->first = (p->first + 1) % IMU_PAIR_WAITING;
    p->waiting--;
    p->sink(p->user, &sample);
}

/* Whether the oldest gyroscope sample needn't wait any longer. */
static bool is_ripe(const imu_pair *p) {
    const int64_t oldest = p->gyro[p->first].timestamp_ns;
    const int64_t newest = p->gyro[(p->first + p->waiting - 1) % IMU_PAIR_WAITING].timestamp_ns;
    if (p->waiting == IMU_PAIR_WAITING || newest - oldest > IMU_PAIR_LONGEST_NS) return true;
    const int64_t accel = p->accel[1].timestamp_ns;
    return p->accels > 0 && (oldest <= accel || oldest - accel > IMU_PAIR_ABSENT_NS);
}

bool imu_pair_gyro(imu_pair *p, int64_t timestamp_ns, const double value[3]) {
    if (p->waiting) {
        const int last = (p->first + p->waiting - 1) % IMU_PAIR_WAITING;
        if (timestamp_ns <= p->gyro[last].timestamp_ns) return false;
    }
    p->gyro[(p->first + p->waiting++) % IMU_PAIR_WAITING] = value_of(timestamp_ns, value);
    while (p->waiting && is_ripe(p)) let_go(p);
    return true;
}

bool imu_pair_accel(imu_pair *p, int64_t timestamp_ns, const double value[3]) {
    if (p->accels && timestamp_ns <= p->accel[1].timestamp_ns) return false;
    p->accel[0] = p->accel[1];
    p->accel[1] = value_of(timestamp_ns, value);
    if (p->accels < 2) p->accels++;
    while (p->waiting && is_ripe(p)) let_go(p);
    return true;
}
