#include "api/settings_table.h"

#include <string.h>

#include "api/settings.h"
#include "base/stamps.h"

#define FIELD(field) (((fathom_config *)0)->field)
#define TYPE(field)                                                                                          \
    _Generic(FIELD(field),                                                                                   \
        float: FATHOM_SETTING_FLOAT,                                                                         \
        double: FATHOM_SETTING_DOUBLE,                                                                       \
        int32_t: FATHOM_SETTING_INT32,                                                                       \
        int64_t: FATHOM_SETTING_INT64,                                                                       \
        bool: FATHOM_SETTING_BOOL,                                                                           \
        const char *: FATHOM_SETTING_TEXT)
#define PLACE(field) offsetof(fathom_config, field), sizeof FIELD(field)
#define ROW(field, unit, low, high, value, meaning)                                                          \
    {GROUP, #field, unit, TYPE(field), PLACE(field), low, high, false, value, "", meaning}
#define ROW_OR_ZERO(field, unit, low, high, meaning)                                                         \
    {GROUP, #field, unit, TYPE(field), PLACE(field), low, high, true, 0, "", meaning}
#define SWITCH(field, value, meaning)                                                                        \
    {GROUP, #field, "", TYPE(field), PLACE(field), 0, 1, false, value, "off|on", meaning}
#define WORDS(field, words, last, value, meaning)                                                            \
    {GROUP, #field, "", FATHOM_SETTING_WORD, PLACE(field), 0, last, false, value, words, meaning}
#define TEXT(field, meaning) {GROUP, #field, "", TYPE(field), PLACE(field), 0, 0, false, 0, "", meaning}

const setting_row settings_table[] = {
#define GROUP "Depth camera"
    ROW(min_confidence, "", 0, 255, 0,
        "Minimum confidence of a valid pixel, in frames with a confidence plane"),
    ROW(depth_camera.width, "px", 16, 4096, 640, "Width of the depth frames"),
    ROW(depth_camera.height, "px", 16, 4096, 480, "Height of the depth frames"),
    ROW(depth_camera.fx, "px", 1, 1e5, 525, "Focal length along x"),
    ROW(depth_camera.fy, "px", 1, 1e5, 525, "Focal length along y"),
    ROW(depth_camera.cx, "px", -1e5, 1e5, 319.5, "Principal point, x; the first pixel's centre is 0"),
    ROW(depth_camera.cy, "px", -1e5, 1e5, 239.5, "Principal point, y"),
    ROW(depth_camera.coefficients[0], "", -1e3, 1e3, 0, "Lens distortion k1 (OpenCV's model and order)"),
    ROW(depth_camera.coefficients[1], "", -1e3, 1e3, 0, "Lens distortion k2"),
    ROW(depth_camera.coefficients[2], "", -1e3, 1e3, 0, "Lens distortion p1"),
    ROW(depth_camera.coefficients[3], "", -1e3, 1e3, 0, "Lens distortion p2"),
    ROW(depth_camera.coefficients[4], "", -1e3, 1e3, 0, "Lens distortion k3"),
    ROW(depth_camera.coefficients[5], "", -1e3, 1e3, 0, "Lens distortion k4, of the rational lens"),
    ROW(depth_camera.coefficients[6], "", -1e3, 1e3, 0, "Lens distortion k5, of the rational lens"),
    ROW(depth_camera.coefficients[7], "", -1e3, 1e3, 0, "Lens distortion k6, of the rational lens"),
    WORDS(depth_camera.lens, "pinhole|five|rational", 2, 0,
          "Distortion model: none, five coefficients, or eight; coefficients beyond it must be 0"),
    ROW(depth_units_per_metre, "1/m", 1e-3, 1e7, 1000,
        "Depth units per metre: 1000 for millimetres, 5000 in TUM recordings"),
    ROW(min_depth_m, "m", 0, 100, 0.3, "Minimum valid depth"),
    ROW(max_depth_m, "m", 0, 1000, 5, "Maximum valid depth; at least min_depth_m"),
    ROW(depth_noise_base_m, "m", 1e-6, 1, 0.0001,
        "Constant part of the depth error: sigma(z) = base + slope z + growth z^2"),
    ROW(depth_noise_slope, "", 0, 1, 0, "Part of the depth error in proportion to the depth"),
    SWITCH(refine_depth_noise, 1, "The growth of the depth error with the depth is estimated from the frames; the settings give its scale"),
    ROW(depth_noise_growth_per_m, "1/m", 0, 1, 0.003,
        "Growth of the depth error with the square of the depth"),
#undef GROUP
#define GROUP "Alignment"
    ROW(align_width, "px", 0, 4096, 0,
        "Width of the maps: depth size over a whole number. 0: the largest up to max_align_width"),
    ROW(align_height, "px", 0, 4096, 0, "Height of the maps; 0 together with align_width"),
    ROW(max_align_width, "px", 16, 4096, 320, "Maximum width of the maps where align_width is 0"),
    WORDS(against, "model|previous", 1, FATHOM_AGAINST_MODEL,
          "What a frame is aligned with: the ray-cast surface, or the last accepted frame"),
    WORDS(prior, "seed|information", 1, FATHOM_PRIOR_INFORMATION,
          "What inertia gives alignment: only where it starts (the paper's way), or its information too"),
    ROW(max_iterations[0], "", 0, 100, 10, "Maximum iterations at the coarsest level, without a usable seed"),
    ROW(max_iterations[1], "", 0, 100, 5, "Maximum iterations at the middle level, without a usable seed"),
    ROW(max_iterations[2], "", 0, 100, 4, "Maximum iterations at the finest level, without a usable seed"),
    ROW(max_seeded_iterations[0], "", 0, 100, 0,
        "Maximum iterations at the coarsest level, from a usable seed"),
    ROW(max_seeded_iterations[1], "", 0, 100, 0,
        "Maximum iterations at the middle level, from a usable seed"),
    ROW(max_seeded_iterations[2], "", 0, 100, 4,
        "Maximum iterations at the finest level, from a usable seed"),
    ROW(max_seed_sigma_m, "m", 0, 100, 0.02, "Maximum sigma of a usable seed's translation"),
    ROW(max_model_reuse_m, "m", 0, 1e9, 0.04,
        "Maximum camera motion over which ray-cast maps serve further frames; 0: a ray-cast per frame"),
    ROW(max_model_reuse_rad, "rad", 0, 1e9, 0.06,
        "Maximum camera rotation over which ray-cast maps serve further frames"),
    ROW(max_pair_distance_m, "m", 1e-4, 10, 0.10,
        "Maximum distance of a pair at the finest level; doubled at each coarser one, widened to three seed "
        "sigmas"),
    ROW(max_pair_angle_rad, "rad", 0.01, 3.15, 0.7, "Maximum angle between a pair's normals"),
    ROW(huber_m, "m", 1e-6, 100, 0.003, "Residual beyond which a pair's weight falls off as 1/|r|"),
    ROW(min_update_rad, "rad", 0, 1, 1e-4,
        "Minimum rotation of an update; a level ends below this and min_update_m"),
    ROW(min_update_m, "m", 0, 1, 1e-4,
        "Minimum translation of an update; a level ends below this and min_update_rad"),
    ROW(min_error_decrease, "", -1e9, 1, 1e-4,
        "Minimum relative decrease of the error; a level ends below it"),
#undef GROUP
#define GROUP "Verdict"
    ROW(min_overlap, "", 0, 1, 0.35,
        "Minimum of kept pairs over pixels where both scan and model have a surface"),
    ROW(min_pairs, "", 0, 1e9, 0,
        "Minimum number of kept pairs at the finest level used. 0: one in 100 pixels"),
    ROW(max_rms_m, "m", 1e-6, 1e9, 0.01, "Maximum weighted rms residual"),
    ROW(max_condition, "", 1, 1e30, 22, "Maximum condition number of a well-conditioned alignment"),
    ROW(max_innovation_sigmas, "sigma", 0.1, 1e30, 6,
        "Maximum distance from seed to result, in sigmas of the seed"),
    ROW(min_agreement, "", 0, 1, 0.75,
        "Minimum fraction of the predicted surface's pixels that the frame agrees with"),
    ROW(max_see_through, "", 0, 1, 0.015,
        "Maximum fraction of them where the frame sees through the surface"),
    ROW(min_evident_fraction, "", 0, 1e9, 0.6,
        "Minimum fraction of valid pixels with pairs for an alignment that isn't compared. Above 1: always "
        "compared"),
    ROW(max_evident_sigmas, "sigma", 0, 1e9, 1.5,
        "Maximum distance from seed to result of such an alignment, in sigmas"),
    ROW(agreement_tolerance_m, "m", 1e-4, 100, 0.02,
        "Tolerance across the surface, beside a voxel and three sigma of the depth"),
    ROW(max_sigma_m, "m", 1e-4, 1000, 0.02, "Maximum sigma of a fused pose's position, inertia counted in"),
    ROW(max_sigma_rad, "rad", 1e-4, 1000, 0.02,
        "Maximum sigma of a fused pose's rotation, inertia counted in"),
#undef GROUP
#define GROUP "Surface and memory"
    ROW(voxel_m, "m", 0.001, 1, 0.01, "Edge of a voxel"),
    ROW(truncation_m, "m", 0, 10, 0, "Truncation of the signed distance. 0: four voxels"),
    ROW_OR_ZERO(max_blocks, "", CONFIG_MIN_BLOCKS, CONFIG_MAX_BLOCKS,
                "Maximum number of blocks of 8x8x8 voxels, 2 KB each. 0: what max_memory_bytes leaves"),
    WORDS(when_full, "stop|drop", 1, FATHOM_FULL_STOP,
          "When no block is left: the surface stops growing, or the blocks least recently seen make room"),
    ROW(max_weight, "", 1, 1000, 100,
        "Maximum number of observations, at 1 m, that a voxel averages; older ones fade"),
    SWITCH(fuse_behind, 0,
           "Return as soon as the pose is known, and fuse while the next frame is on its way"),
    ROW(max_memory_bytes, "bytes", 1 << 20, 1e15, 128 << 20, "Maximum memory, host and device together"),
#undef GROUP
#define GROUP "Inertial sensor"
    SWITCH(imu, 1, "Use inertial samples"),
    SWITCH(imu_translation, 1, "Use the accelerometer; else translation goes on at constant velocity"),
    SWITCH(imu_check, 1,
           "Compare the IMU with the motion of the depth frames, and stop using it when it is wrong"),
    ROW(imu_to_camera_rotation[0], "", -1.001, 1.001, 1,
        "Mounting: row 1, column 1 of R in v_camera = R v_imu"),
    ROW(imu_to_camera_rotation[1], "", -1.001, 1.001, 0, "Mounting: row 1, column 2"),
    ROW(imu_to_camera_rotation[2], "", -1.001, 1.001, 0, "Mounting: row 1, column 3"),
    ROW(imu_to_camera_rotation[3], "", -1.001, 1.001, 0, "Mounting: row 2, column 1"),
    ROW(imu_to_camera_rotation[4], "", -1.001, 1.001, 1, "Mounting: row 2, column 2"),
    ROW(imu_to_camera_rotation[5], "", -1.001, 1.001, 0, "Mounting: row 2, column 3"),
    ROW(imu_to_camera_rotation[6], "", -1.001, 1.001, 0, "Mounting: row 3, column 1"),
    ROW(imu_to_camera_rotation[7], "", -1.001, 1.001, 0, "Mounting: row 3, column 2"),
    ROW(imu_to_camera_rotation[8], "", -1.001, 1.001, 1, "Mounting: row 3, column 3"),
    ROW(imu_to_camera_translation[0], "m", -10, 10, 0, "Lever arm: the IMU's origin in camera axes, x"),
    ROW(imu_to_camera_translation[1], "m", -10, 10, 0, "Lever arm: y"),
    ROW(imu_to_camera_translation[2], "m", -10, 10, 0, "Lever arm: z"),
    ROW(imu_clock_offset_ns, "ns", -STAMP_MAX, STAMP_MAX, 0, "Added to an IMU stamp to get the depth clock"),
    SWITCH(refine_rig, 0, "Refine mounting rotation and clock offset while scanning"),
    ROW(rig_rotation_sigma_rad, "rad", 1e-6, 1, 0.05,
        "Sigma of the mounting rotation about each axis, for refine_rig"),
    ROW(rig_clock_sigma_ns, "ns", 1e3, 1e9, 20e6, "Sigma of the clock offset, for refine_rig"),
    ROW(gravity_m_s2, "m/s^2", 0, 100, 9.80665, "Gravity"),
    ROW(gyro_noise_rad_s_sqrthz, "rad/s/sqrt(Hz)", 0, 10, 5e-3,
        "Noise density of the gyroscope, with what scale errors add"),
    ROW(gyro_bias_sigma_rad_s, "rad/s", 0, 10, 0.02, "Sigma of the gyroscope's bias before it is known"),
    ROW(accel_noise_m_s2_sqrthz, "m/s^2/sqrt(Hz)", 0, 100, 0.05,
        "Noise density of the accelerometer, with what scale errors and vibration add"),
    ROW(accel_bias_sigma_m_s2, "m/s^2", 0, 100, 0.1, "Sigma of the accelerometer's bias before it is known"),
    ROW(seed_noise_rad, "rad", 1e-6, 10, 0.012,
        "Rotation error of a seed, per step, beside what the noise figures explain"),
    ROW(seed_noise_m, "m", 1e-6, 10, 0.008,
        "Translation error of a seed, per step, beside what the noise figures explain"),
    ROW(pose_noise_rad, "rad", 0, 1, 0.006, "Rotation error of an accepted pose, beside what alignment says"),
    ROW(pose_noise_m, "m", 0, 1, 0.004, "Position error of an accepted pose, beside what alignment says"),
    ROW(motion_sigma_m_s2, "m/s^2", 0, 1000, 1.5,
        "Sigma of the camera's acceleration, without an accelerometer"),
    ROW(motion_sigma_rad_s2, "rad/s^2", 0, 1000, 3, "Sigma of its angular acceleration, without a gyroscope"),
    ROW(max_reckoned_sigma_m, "m", 1e-3, 1000, 0.5,
        "Maximum position sigma of dead reckoning; beyond it the camera is lost"),
    ROW(max_imu_samples, "", 0, 1 << 24, 0, "Maximum number of samples kept. 0: 4096"),
#undef GROUP
#define GROUP "Start"
    ROW(first_pose.position[0], "m", -1e6, 1e6, 0, "Position of the first frame's camera in the world, x"),
    ROW(first_pose.position[1], "m", -1e6, 1e6, 0, "Position of the first frame's camera in the world, y"),
    ROW(first_pose.position[2], "m", -1e6, 1e6, 0, "Position of the first frame's camera in the world, z"),
    ROW(first_pose.orientation[0], "", -1.001, 1.001, 0,
        "Orientation of the first frame's camera: unit quaternion, x"),
    ROW(first_pose.orientation[1], "", -1.001, 1.001, 0, "Orientation of the first frame's camera: y"),
    ROW(first_pose.orientation[2], "", -1.001, 1.001, 0, "Orientation of the first frame's camera: z"),
    ROW(first_pose.orientation[3], "", -1.001, 1.001, 1, "Orientation of the first frame's camera: w"),
#undef GROUP
#define GROUP "OpenCL device"
    TEXT(device, "A part of a platform's or device's name, or cpu, or gpu. Default: a GPU that shares "
                 "memory, else the first"),
    WORDS(buffers, "auto|host|device", 2, FATHOM_BUFFERS_AUTO,
          "Where buffers lie: in the caller's block on a CPU; always there; always the device's own"),
    TEXT(kernel_file,
         "Built kernels, as fathom_save_kernels wrote them. Default: built from source, or from the cache"),
    TEXT(cache_folder,
         "Where built kernels are kept; empty: nowhere. Default: $XDG_CACHE_HOME/fathom or ~/.cache/fathom"),
};
const int settings_count = sizeof settings_table / sizeof *settings_table;

const setting_row *settings_find(const char *name) {
    for (int i = 0; i < settings_count; i++)
        if (strcmp(settings_table[i].name, name) == 0) return &settings_table[i];
    return NULL;
}

double setting_value(const setting_row *row, const fathom_config *config) {
    const void *at = (const char *)config + row->at;
    switch (row->type) {
    case FATHOM_SETTING_FLOAT: return *(const float *)at;
    case FATHOM_SETTING_DOUBLE: return *(const double *)at;
    case FATHOM_SETTING_INT32:
    case FATHOM_SETTING_WORD: return *(const int32_t *)at;
    case FATHOM_SETTING_INT64: return (double)*(const int64_t *)at;
    case FATHOM_SETTING_BOOL: return *(const bool *)at;
    default: return 0;
    }
}

void setting_store(const setting_row *row, fathom_config *config, double value) {
    void *at = (char *)config + row->at;
    switch (row->type) {
    case FATHOM_SETTING_FLOAT: *(float *)at = (float)value; break;
    case FATHOM_SETTING_DOUBLE: *(double *)at = value; break;
    case FATHOM_SETTING_INT32:
    case FATHOM_SETTING_WORD: *(int32_t *)at = (int32_t)value; break;
    case FATHOM_SETTING_INT64: *(int64_t *)at = (int64_t)value; break;
    case FATHOM_SETTING_BOOL: *(bool *)at = value != 0; break;
    default: *(const char **)at = NULL; break;
    }
}

bool setting_allows(const setting_row *row, double value) {
    if (row->type == FATHOM_SETTING_TEXT || (row->zero && value == 0)) return true;
    if (row->type == FATHOM_SETTING_FLOAT) /* a limit in the field's precision */
        return value >= (float)row->low && value <= (float)row->high;
    return value >= row->low && value <= row->high;
}
