#include "api/settings.h"

#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/se3.h"
#include "base/stamps.h"

fathom_config fathom_config_default(void) {
    fathom_config c;
    memset(&c, 0, sizeof c);
    c.struct_size = sizeof c;
    c.depth_width = 640;
    c.depth_height = 480;
    c.fx = c.fy = 525;
    c.cx = 319.5f;
    c.cy = 239.5f;
    c.depth_units_per_metre = 1000;
    c.min_depth_m = 0.3f;
    c.max_depth_m = 5;
    c.depth_noise_base_m = 0.0001f;
    c.depth_noise_growth_per_m = 0.003f;
    c.max_align_width = 320;
    c.against = FATHOM_AGAINST_MODEL;
    c.prior = FATHOM_PRIOR_INFORMATION;
    const int iterations[FATHOM_LEVELS] = {10, 5, 4}, seeded[FATHOM_LEVELS] = {0, 0, 4};
    memcpy(c.max_iterations, iterations, sizeof iterations);
    memcpy(c.max_seeded_iterations, seeded, sizeof seeded);
    c.max_seed_sigma_m = 0.02f;
    c.max_model_reuse_m = 0.04f;
    c.max_model_reuse_rad = 0.06f;
    c.max_pair_distance_m = 0.10f;
    c.max_pair_angle_rad = 0.7f;
    c.huber_m = 0.003f;
    c.min_update_rad = c.min_update_m = c.min_error_decrease = 1e-4f;
    c.min_overlap = 0.35f;
    c.max_rms_m = 0.01f;
    c.max_condition = 22;
    c.max_innovation_sigmas = 6;
    c.min_agreement = 0.75f;
    c.max_see_through = 0.015f;
    c.min_evident_fraction = 0.6f;
    c.max_evident_sigmas = 1.5f;
    c.agreement_tolerance_m = 0.02f;
    c.max_sigma_m = 0.02f;
    c.max_sigma_rad = 0.02f;
    c.voxel_m = 0.01f;
    c.max_weight = 100;
    c.max_memory_bytes = (int64_t)128 << 20;
    c.imu = c.imu_translation = c.imu_check = true;
    c.imu_to_camera_rotation[0] = c.imu_to_camera_rotation[4] = c.imu_to_camera_rotation[8] = 1;
    c.rig_rotation_sigma_rad = 0.05f;
    c.rig_clock_sigma_ns = 20000000;
    c.gravity_m_s2 = 9.80665f;
    c.gyro_noise_rad_s_sqrthz = 5e-3f;
    c.gyro_bias_sigma_rad_s = 0.02f;
    c.accel_noise_m_s2_sqrthz = 0.05f;
    c.accel_bias_sigma_m_s2 = 0.1f;
    c.seed_noise_rad = 0.012f;
    c.seed_noise_m = 0.008f;
    c.pose_noise_rad = 0.006f;
    c.pose_noise_m = 0.004f;
    c.motion_sigma_m_s2 = 1.5f;
    c.motion_sigma_rad_s2 = 3;
    c.max_reckoned_sigma_m = 0.5f;
    c.first_pose[0] = c.first_pose[5] = c.first_pose[10] = c.first_pose[15] = 1;
    return c;
}

fathom_config fathom_config_preset(fathom_preset preset) {
    fathom_config c = fathom_config_default();
    if (preset == FATHOM_PRESET_TINY) {
        c.max_align_width = 160;
        c.voxel_m = 0.02f;
        c.max_memory_bytes = (int64_t)64 << 20;
    } else if (preset == FATHOM_PRESET_LARGE) {
        c.max_align_width = 640;
        c.voxel_m = 0.008f;
        c.max_memory_bytes = (int64_t)256 << 20;
    }
    return c;
}

/* One setting with its bounds. */
typedef struct {
    const char *name;
    double value, low, high;
} bound;

int config_check(const fathom_config *c) {
    if (c->struct_size != sizeof *c) {
        log_write(c, FATHOM_LOG_ERROR,
                  "struct_size is %u, this library's is %zu: start from fathom_config_default()",
                  c->struct_size, sizeof *c);
        return FATHOM_ERROR_CONFIG;
    }
    const bound bounds[] = {
        {"depth_width", c->depth_width, 16, 4096},
        {"depth_height", c->depth_height, 16, 4096},
        {"fx", c->fx, 1, 1e5},
        {"fy", c->fy, 1, 1e5},
        {"cx", c->cx, -1e5, 1e5},
        {"cy", c->cy, -1e5, 1e5},
        {"distortion[0]", c->distortion[0], -100, 100},
        {"distortion[1]", c->distortion[1], -100, 100},
        {"distortion[2]", c->distortion[2], -100, 100},
        {"distortion[3]", c->distortion[3], -100, 100},
        {"distortion[4]", c->distortion[4], -100, 100},
        {"depth_units_per_metre", c->depth_units_per_metre, 1e-3, 1e7},
        {"min_depth_m", c->min_depth_m, 0, 100},
        {"max_depth_m", c->max_depth_m, c->min_depth_m, 1000},
        {"depth_noise_base_m", c->depth_noise_base_m, 1e-6, 1},
        {"depth_noise_growth_per_m", c->depth_noise_growth_per_m, 0, 1},
        {"align_width", c->align_width, 0, 4096},
        {"align_height", c->align_height, 0, 4096},
        {"max_align_width", c->max_align_width, 16, 4096},
        {"against", c->against, 0, 1},
        {"prior", c->prior, 0, 1},
        {"max_iterations[0]", c->max_iterations[0], 0, 100},
        {"max_iterations[1]", c->max_iterations[1], 0, 100},
        {"max_iterations[2]", c->max_iterations[2], 0, 100},
        {"max_seeded_iterations[0]", c->max_seeded_iterations[0], 0, 100},
        {"max_seeded_iterations[1]", c->max_seeded_iterations[1], 0, 100},
        {"max_seeded_iterations[2]", c->max_seeded_iterations[2], 0, 100},
        {"max_iterations in all", c->max_iterations[0] + c->max_iterations[1] + c->max_iterations[2], 1, 300},
        {"max_seeded_iterations in all",
         c->max_seeded_iterations[0] + c->max_seeded_iterations[1] + c->max_seeded_iterations[2], 1, 300},
        {"max_seed_sigma_m", c->max_seed_sigma_m, 0, 100},
        {"max_model_reuse_m", c->max_model_reuse_m, 0, 1e9},
        {"max_model_reuse_rad", c->max_model_reuse_rad, 0, 1e9},
        {"max_pair_distance_m", c->max_pair_distance_m, 1e-4, 10},
        {"max_pair_angle_rad", c->max_pair_angle_rad, 0.01, 3.15},
        {"huber_m", c->huber_m, 1e-6, 100},
        {"min_update_rad", c->min_update_rad, 0, 1},
        {"min_update_m", c->min_update_m, 0, 1},
        {"min_error_decrease", c->min_error_decrease, -1e9, 1},
        {"min_overlap", c->min_overlap, 0, 1},
        {"min_pairs", c->min_pairs, 0, 1e9},
        {"max_rms_m", c->max_rms_m, 1e-6, 1e9},
        {"max_condition", c->max_condition, 1, 1e30},
        {"max_innovation_sigmas", c->max_innovation_sigmas, 0.1, 1e30},
        {"min_agreement", c->min_agreement, 0, 1},
        {"max_see_through", c->max_see_through, 0, 1},
        {"min_evident_fraction", c->min_evident_fraction, 0, 1e9},
        {"max_evident_sigmas", c->max_evident_sigmas, 0, 1e9},
        {"agreement_tolerance_m", c->agreement_tolerance_m, 1e-4, 100},
        {"max_sigma_m", c->max_sigma_m, 1e-4, 1000},
        {"max_sigma_rad", c->max_sigma_rad, 1e-4, 1000},
        {"voxel_m", c->voxel_m, 0.001, 1},
        {"truncation_m", c->truncation_m, 0, 10},
        {"max_blocks", c->max_blocks == 0 ? CONFIG_BLOCKS_LEAST : c->max_blocks, CONFIG_BLOCKS_LEAST, CONFIG_BLOCKS_MOST},
        {"when_full", c->when_full, 0, 1},
        {"max_weight", c->max_weight, 1, 1000},
        {"max_memory_bytes", (double)c->max_memory_bytes, 1 << 20, 1e15},
        {"imu_to_camera_translation[0]", c->imu_to_camera_translation[0], -10, 10},
        {"imu_to_camera_translation[1]", c->imu_to_camera_translation[1], -10, 10},
        {"imu_to_camera_translation[2]", c->imu_to_camera_translation[2], -10, 10},
        {"imu_clock_offset_ns", (double)c->imu_clock_offset_ns, -STAMP_MAX, STAMP_MAX},
        {"rig_rotation_sigma_rad", c->rig_rotation_sigma_rad, 1e-6, 1},
        {"rig_clock_sigma_ns", (double)c->rig_clock_sigma_ns, 1e3, 1e9},
        {"gravity_m_s2", c->gravity_m_s2, 0, 100},
        {"gyro_noise_rad_s_sqrthz", c->gyro_noise_rad_s_sqrthz, 0, 10},
        {"gyro_bias_sigma_rad_s", c->gyro_bias_sigma_rad_s, 0, 10},
        {"accel_noise_m_s2_sqrthz", c->accel_noise_m_s2_sqrthz, 0, 100},
        {"accel_bias_sigma_m_s2", c->accel_bias_sigma_m_s2, 0, 100},
        {"seed_noise_rad", c->seed_noise_rad, 1e-6, 10},
        {"seed_noise_m", c->seed_noise_m, 1e-6, 10},
        {"pose_noise_rad", c->pose_noise_rad, 0, 1},
        {"pose_noise_m", c->pose_noise_m, 0, 1},
        {"motion_sigma_m_s2", c->motion_sigma_m_s2, 0, 1000},
        {"motion_sigma_rad_s2", c->motion_sigma_rad_s2, 0, 1000},
        {"max_reckoned_sigma_m", c->max_reckoned_sigma_m, 1e-3, 1000},
        {"max_imu_samples", c->max_imu_samples, 0, 1 << 24},
        {"buffers", c->buffers, 0, 2},
    };
    for (size_t i = 0; i < sizeof bounds / sizeof *bounds; i++)
        if (!(bounds[i].value >= bounds[i].low && bounds[i].value <= bounds[i].high)) { /* false for NaN */
            log_write(c, FATHOM_LOG_ERROR, "setting %s is %g; it must lie within %g and %g", bounds[i].name,
                      bounds[i].value, bounds[i].low, bounds[i].high);
            return FATHOM_ERROR_CONFIG;
        }
    pose p;
    float mounting[16] = {0};
    mounting[15] = 1;
    for (int i = 0; i < 9; i++) mounting[i / 3 * 4 + i % 3] = c->imu_to_camera_rotation[i];
    if (!pose_from_matrix(c->first_pose, &p) || !pose_from_matrix(mounting, &p)) {
        log_write(c, FATHOM_LOG_ERROR,
                  "first_pose or imu_to_camera_rotation is not a right-handed rigid motion");
        return FATHOM_ERROR_CONFIG;
    }
    return FATHOM_OK;
}
