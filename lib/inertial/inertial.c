#include "inertial/inertial.h"

#include <math.h>
#include <string.h>

void inertial_init(inertial *n, arena *a, const fathom_config *config) {
    imu_samples *s = &n->samples;
    memset(n, 0, sizeof *n);
    n->config = config;
    samples_init(s, a, config);
    timeline_init(&n->past, a);
    if (!s->history || !n->past.moments) return;
    for (int i = 0; i < 3; i++) n->lever[i] = config->imu_to_camera_translation[i];
    inertial_reset(n);
}

void inertial_reset(inertial *n) {
    samples_reset(&n->samples);
    n->running = false;
    n->now = (navigation){.mismatch = 1, .corrected_ns = INT64_MIN, .corrected = pose_identity()};
    inertial_rig_reset(n);
    inertial_check_reset(n);
}

int inertial_push(inertial *n, const fathom_imu_sample *sample) {
    return samples_push(&n->samples, sample);
}

void inertial_drain(inertial *n) {
    for (unsigned i = samples_waiting(&n->samples); i > 0; i--) { /* only those present now: pushing may go on */
        fathom_imu_sample raw;
        if (!samples_pop(&n->samples, &raw)) continue;
        plausibility_sample(&n->check, raw.timestamp_ns, raw.gyro, raw.accel);
        samples_take(&n->samples, &raw);
    }
}

void inertial_follow_clock(inertial *n, int64_t frame_ns) {
    samples_follow_clock(&n->samples, frame_ns);
}

pose inertial_imu_pose(const inertial *n, const pose *camera) {
    pose imu = *camera;
    pose_apply(camera, n->lever, imu.t);
    return imu;
}

void inertial_count(const inertial *n, fathom_counters *counters) {
    const imu_samples *s = &n->samples;
    counters->imu_accepted = s->accepted;
    counters->imu_out_of_order = s->out_of_order;
    counters->imu_gaps = s->gaps;
    counters->imu_clock_leaps = s->clock_leaps;
    counters->imu_doubts = n->doubts;
    counters->imu_not_finite = atomic_load(&s->not_finite);
    counters->imu_implausible = s->implausible + atomic_load(&s->absurd);
    counters->imu_overrun = atomic_load(&s->overrun);
}
