/* The rig's mounting rotation and clock offset while scanning: the settings', or refined (inertial/extrinsics.h). */
#include <math.h>
#include <string.h>

#include "inertial/inertial.h"

void inertial_rig_reset(inertial *n) {
    const fathom_config *c = n->config;
    n->refined_at_ns = INT64_MIN;
    n->awaiting = false;
    rig_refiner_start(&n->refiner, c->rig_rotation_sigma_rad, 1e-9 * (double)c->rig_clock_sigma_ns,
                      c->gyro_bias_sigma_rad_s);
}

/* Applies a correction of the rig, to the present samples as well. */
static void apply(inertial *n, const double mounting[3], double offset) {
    samples_remount(&n->samples, mounting, llround(1e9 * offset));
    if (!n->running) return;
    navigator_turn_imu(&n->now.state, mounting);
    for (int i = 0; i < n->past.count; i++) {
        navigator_turn_imu(&timeline_at(&n->past, i)->after.state, mounting);
        measurement_turn_imu(&timeline_at(&n->past, i)->by, mounting);
    }
}

void inertial_rig_add(inertial *n, const rig_interval *i, const pose *aligned, int64_t timestamp_ns) {
    double mounting[3], offset;
    if (i)
        rig_refiner_add(&n->refiner, i, 1e-9 * (double)(timestamp_ns - n->refined_at_ns));
    else
        rig_refiner_break(&n->refiner);
    n->refined_at = *aligned;
    n->refined_at_ns = timestamp_ns;
    if (rig_refiner_take(&n->refiner, mounting, &offset)) apply(n, mounting, offset);
}

void inertial_rig(const inertial *n, fathom_rig *rig) {
    const rig_refiner *r = &n->refiner;
    bool refined = n->config->refine_rig;
    double part[9], whole[9];
    so3_exp(r->mounting, part);
    so3_multiply(part, n->samples.rotation, whole);
    for (int i = 0; i < 9; i++) rig->imu_to_camera_rotation[i] = (float)whole[i];
    for (int i = 0; i < 3; i++) rig->rotation_sigma[i] = refined ? (float)rig_refiner_sigma(r, i) : 0;
    rig->imu_clock_offset_ns =
        n->config->imu_clock_offset_ns + n->samples.refined_ns + llround(1e9 * r->offset);
    rig->clock_sigma_ns = refined ? llround(1e9 * rig_refiner_sigma(r, 3)) : 0;
    rig->intervals = r->intervals;
}
