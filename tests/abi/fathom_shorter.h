/* By make_headers.py. */
#ifndef FATHOM_H
#define FATHOM_H 
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#define FATHOM_VERSION_MAJOR 0
#define FATHOM_VERSION_MINOR 2
#define FATHOM_VERSION_PATCH 0
#if defined(__GNUC__)
#define FATHOM_API __attribute__((visibility("default")))
#else
#define FATHOM_API 
#endif
#ifdef __cplusplus
extern "C" {
#endif
typedef struct fathom fathom;
FATHOM_API const char *fathom_version(void);
#ifdef __cplusplus
extern "C++" {
template <typename type> inline type fathom_struct() {
    type s = type();
    s.struct_size = static_cast<uint32_t>(sizeof s);
    return s;
}
}
#define FATHOM_STRUCT(type) fathom_struct<type>()
#else
#define FATHOM_STRUCT(type) ((type){.struct_size = sizeof(type)})
#endif
typedef enum {
    FATHOM_OK = 0,
    FATHOM_ERROR_ARGUMENT = -1,
    FATHOM_ERROR_CONFIG = -2,
    FATHOM_ERROR_MEMORY = -3,
    FATHOM_ERROR_DEVICE = -4,
    FATHOM_ERROR_KERNEL = -5,
    FATHOM_ERROR_TIME = -6,
    FATHOM_ERROR_SIZE = -7,
    FATHOM_ERROR_STOPPED = -8,
    FATHOM_ERROR_NO_DATA = -9,
    FATHOM_ERROR_FULL = -10,
    FATHOM_ERROR_NAME = -11,
    FATHOM_ERROR_VALUE = -12,
    FATHOM_ERROR_WRITE = -13,
    FATHOM_ERROR_TIMEOUT = -20,
    FATHOM_ERROR_CANCELLED = -21,
    FATHOM_ERROR_ENDED = -22,
    FATHOM_ERROR_UNPLUGGED = -23,
    FATHOM_ERROR_PERMISSION = -24,
    FATHOM_ERROR_BUSY = -25,
    FATHOM_ERROR_NO_DEVICE = -26,
    FATHOM_ERROR_NOT_BUILT = -27,
    FATHOM_ERROR_PROTOCOL = -28,
    FATHOM_ERROR_UNSUPPORTED = -29
} fathom_error;
FATHOM_API const char *fathom_error_name(int32_t error);
FATHOM_API const char *fathom_last_error(const fathom *context);
typedef enum { FATHOM_LOG_ERROR = 0, FATHOM_LOG_WARNING = 1, FATHOM_LOG_INFO = 2 } fathom_log_level;
typedef void (*fathom_log)(void *user, fathom_log_level level, const char *text);
typedef struct {
    double position[3];
    double orientation[4];
} fathom_pose;
FATHOM_API int fathom_pose_to_matrix(const fathom_pose *pose, double matrix[16]);
FATHOM_API int fathom_pose_from_matrix(const double matrix[16], fathom_pose *pose);
typedef enum {
    FATHOM_LENS_PINHOLE = 0,
    FATHOM_LENS_FIVE = 1,
    FATHOM_LENS_RATIONAL = 2
} fathom_lens;
typedef struct {
    int32_t width, height;
    double fx, fy, cx, cy;
    double coefficients[8];
    int32_t lens;
    int32_t unused;
} fathom_pinhole;
typedef struct {
    int64_t timestamp_ns;
    float gyro[3];
    float accel[3];
} fathom_imu_sample;
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    fathom_pose motion;
} fathom_motion;
typedef enum {
    FATHOM_IMU_UNCHECKED = 0,
    FATHOM_IMU_GOOD = 1,
    FATHOM_IMU_SATURATED = 2,
    FATHOM_IMU_UNITS = 3,
    FATHOM_IMU_SCALE = 4,
    FATHOM_IMU_AXES = 5,
    FATHOM_IMU_MOUNTING = 6,
    FATHOM_IMU_SIGN = 7,
    FATHOM_IMU_CLOCK = 8,
    FATHOM_IMU_STUCK = 9,
    FATHOM_IMU_UNRELATED = 10
} fathom_imu_health;
FATHOM_API const char *fathom_imu_health_name(int32_t health);
typedef int (*fathom_inertial_hook)(void *user, int64_t from_ns, int64_t to_ns, fathom_motion *motion);
typedef enum {
    FATHOM_AGAINST_MODEL = 0,
    FATHOM_AGAINST_PREVIOUS = 1
} fathom_against;
typedef enum {
    FATHOM_PRIOR_SEED = 0,
    FATHOM_PRIOR_INFORMATION = 1
} fathom_prior;
typedef enum {
    FATHOM_BUFFERS_AUTO = 0,
    FATHOM_BUFFERS_HOST = 1,
    FATHOM_BUFFERS_DEVICE = 2
} fathom_buffers;
typedef enum {
    FATHOM_FULL_STOP = 0,
    FATHOM_FULL_DROP = 1
} fathom_full;
typedef struct {
    int32_t x, y, z;
    int32_t submap;
} fathom_block_key;
#define FATHOM_BLOCK_VOXELS 512
typedef struct {
    uint32_t struct_size;
    float voxel_m;
    float truncation_m;
    uint32_t unused;
    fathom_block_key key;
    int16_t *distances;
} fathom_block;
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    void *user;
    int (*put)(void *user, const fathom_block *block);
    int (*get)(void *user, const fathom_block *block);
} fathom_block_store;
#define FATHOM_LEVELS 3
typedef struct {
    uint32_t struct_size;
    int32_t min_confidence;
    fathom_pinhole depth_camera;
    float depth_units_per_metre;
    float min_depth_m, max_depth_m;
    float depth_noise_base_m, depth_noise_growth_per_m;
    int32_t align_width, align_height;
    int32_t max_align_width;
    int32_t against;
    int32_t prior;
    int32_t max_iterations[FATHOM_LEVELS];
    int32_t max_seeded_iterations[FATHOM_LEVELS];
    float max_seed_sigma_m;
    float max_model_reuse_m, max_model_reuse_rad;
    float max_pair_distance_m;
    float max_pair_angle_rad;
    float huber_m;
    float min_update_rad, min_update_m;
    float min_error_decrease;
    float min_overlap;
    int32_t min_pairs;
    float max_rms_m;
    float max_condition;
    float max_innovation_sigmas;
    float min_agreement, max_see_through;
    float min_evident_fraction, max_evident_sigmas;
    float agreement_tolerance_m;
    float max_sigma_m, max_sigma_rad;
    float voxel_m;
    float truncation_m;
    int32_t max_blocks;
    int32_t when_full;
    const fathom_block_store *block_store;
    float max_weight;
    bool fuse_behind;
    int64_t max_memory_bytes;
    bool imu;
    bool imu_translation;
    bool imu_check;
    float imu_to_camera_rotation[9];
    float imu_to_camera_translation[3];
    int64_t imu_clock_offset_ns;
    bool refine_rig;
    float rig_rotation_sigma_rad;
    int64_t rig_clock_sigma_ns;
    float gravity_m_s2;
    float gyro_noise_rad_s_sqrthz;
    float gyro_bias_sigma_rad_s;
    float accel_noise_m_s2_sqrthz;
    float accel_bias_sigma_m_s2;
    float seed_noise_rad, seed_noise_m;
    float pose_noise_rad, pose_noise_m;
    float motion_sigma_m_s2;
    float motion_sigma_rad_s2;
    float max_reckoned_sigma_m;
    int32_t max_imu_samples;
    fathom_inertial_hook inertial_hook;
    void *inertial_user;
    fathom_pose first_pose;
    const char *device;
    int32_t buffers;
    const char *kernel_file;
    const char *cache_folder;
} fathom_config;
#define fathom_config_init(config) fathom_config_init_sized((config), sizeof *(config))
FATHOM_API int fathom_config_init_sized(fathom_config *config, size_t size);
typedef enum {
    FATHOM_PRESET_TINY = 0,
    FATHOM_PRESET_SMALL = 1,
    FATHOM_PRESET_LARGE = 2
} fathom_preset;
#define fathom_config_preset(config,preset) fathom_config_preset_sized((config), sizeof *(config), (preset))
FATHOM_API int fathom_config_preset_sized(fathom_config *config, size_t size, int32_t preset);
typedef enum {
    FATHOM_SETTING_FLOAT = 0,
    FATHOM_SETTING_DOUBLE = 1,
    FATHOM_SETTING_INT32 = 2,
    FATHOM_SETTING_INT64 = 3,
    FATHOM_SETTING_BOOL = 4,
    FATHOM_SETTING_WORD = 5,
    FATHOM_SETTING_TEXT = 6
} fathom_setting_type;
typedef struct {
    uint32_t struct_size;
    int32_t type;
    const char *name;
    const char *group;
    const char *unit;
    const char *words;
    const char *meaning;
    double min, max;
    char default_text[64];
    char range_text[64];
    int32_t zero;
} fathom_setting;
FATHOM_API int fathom_get_setting(int32_t index, fathom_setting *setting);
FATHOM_API int fathom_config_set(fathom_config *config, const char *name, const char *value);
FATHOM_API int fathom_config_get(const fathom_config *config, const char *name, char *text, size_t size);
#define FATHOM_ALIGNMENT 128
typedef struct {
    uint32_t struct_size;
    int32_t blocks;
    int32_t align_width, align_height;
    int64_t host_bytes;
    int64_t device_bytes;
} fathom_memory_plan;
FATHOM_API int64_t fathom_memory_required(const fathom_config *config, char *why, size_t why_size);
FATHOM_API int fathom_plan_memory(const fathom_config *config, fathom_memory_plan *plan, char *why,
                                  size_t why_size);
FATHOM_API int fathom_init(fathom **context, const fathom_config *config, void *memory, size_t size,
                           char *why, size_t why_size);
FATHOM_API int fathom_save_kernels(fathom *context, const char *path);
FATHOM_API void fathom_close(fathom *context);
FATHOM_API int fathom_reset(fathom *context);
FATHOM_API int fathom_pause(fathom *context, bool pause);
FATHOM_API int fathom_push_imu(fathom *context, const fathom_imu_sample *sample);
typedef enum {
    FATHOM_IMAGE_GREY8 = 0,
    FATHOM_IMAGE_RGB8 = 1,
    FATHOM_IMAGE_BGR8 = 2,
    FATHOM_IMAGE_YUYV = 3,
    FATHOM_IMAGE_JPEG = 4
} fathom_image_format;
typedef struct {
    uint32_t struct_size;
    int32_t format;
    int32_t width, height;
    int64_t stride_bytes;
    int64_t size_bytes;
    int64_t timestamp_ns;
} fathom_image;
typedef struct {
    uint32_t struct_size;
    int32_t width, height;
    int32_t row_stride_bytes;
    int64_t timestamp_ns;
    int64_t exposure_ns;
    int64_t row_time_ns;
    const uint16_t *depth;
    const uint8_t *confidence;
    int64_t confidence_stride_bytes;
} fathom_depth_frame;
typedef enum {
    FATHOM_FIRST = 0,
    FATHOM_TRACKED = 1,
    FATHOM_RECKONED = 2,
    FATHOM_LOST = 3
} fathom_state;
FATHOM_API const char *fathom_state_name(int32_t state);
typedef enum {
    FATHOM_VERDICT_TRACKING = 0,
    FATHOM_VERDICT_NO_DEPTH = 1,
    FATHOM_VERDICT_FEW_PAIRS = 2,
    FATHOM_VERDICT_OVERLAP = 3,
    FATHOM_VERDICT_RESIDUAL = 4,
    FATHOM_VERDICT_CONDITION = 5,
    FATHOM_VERDICT_INNOVATION = 6,
    FATHOM_VERDICT_CONTRADICTION = 7,
    FATHOM_VERDICT_UNCERTAIN = 8,
    FATHOM_VERDICT_DEVICE = 9
} fathom_verdict;
FATHOM_API const char *fathom_verdict_name(int32_t verdict);
typedef struct {
    uint32_t struct_size;
    int32_t state;
    int64_t timestamp_ns;
    fathom_pose pose;
    double pose_covariance[36];
    fathom_pose odometry;
    double odometry_covariance[36];
    int32_t verdict;
    int32_t iterations;
    int32_t pairs;
    int32_t overlap_pixels;
    float rms_m;
    float weight;
    float singular_values[6];
    float condition;
    float prior_rotation_rad;
    float prior_translation_m;
    float innovation_sigmas;
    float agreement;
    float see_through;
    bool searched;
    bool seeded;
    bool fused;
    bool pool_full;
    bool by_velocity;
    int32_t blocks;
    int32_t blocks_dropped, blocks_restored;
    int32_t gyro_health, accel_health;
    float ms_maps, ms_align, ms_fuse, ms_raycast;
    float ms_total;
    int32_t observed_directions;
    float weakest_direction[6];
    float weakest_sigma_m;
    float shared_error_m;
} fathom_result;
FATHOM_API int fathom_step(fathom *context, const fathom_depth_frame *frame, fathom_result *result);
#define FATHOM_RECENT 60
FATHOM_API int32_t fathom_get_recent(fathom *context, fathom_result *results, int32_t capacity);
FATHOM_API int fathom_inertial_estimate(fathom *context, int64_t from_ns, int64_t to_ns,
                                        fathom_motion *motion);
FATHOM_API int fathom_get_pose(fathom *context, fathom_pose *pose, double covariance[36]);
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    int64_t from_ns, to_ns;
    fathom_pose motion;
} fathom_span;
FATHOM_API int fathom_get_span(fathom *context, fathom_span *span);
typedef struct {
    uint32_t struct_size;
    int32_t intervals;
    float imu_to_camera_rotation[9];
    float rotation_sigma[3];
    int64_t imu_clock_offset_ns;
} fathom_rig;
FATHOM_API int fathom_get_rig(fathom *context, fathom_rig *rig);
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    int64_t imu_accepted;
    int64_t imu_not_finite;
    int64_t imu_out_of_order;
    int64_t imu_overrun;
    int64_t imu_implausible;
    int64_t imu_gaps;
    int64_t imu_clock_leaps;
    int64_t imu_doubts;
    int64_t frames_ignored;
    int64_t blocks_dropped, blocks_restored;
    int64_t blocks_refused;
} fathom_counters;
FATHOM_API int fathom_get_counters(fathom *context, fathom_counters *counters);
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    fathom_pinhole camera;
    fathom_pose pose;
} fathom_view;
FATHOM_API int fathom_cast_view(fathom *context, const fathom_view *view, float *depth, float *normals);
typedef struct {
    float position[3];
    float normal[3];
} fathom_vertex;
typedef int (*fathom_triangles)(void *user, const fathom_vertex *vertices, size_t triangle_count);
FATHOM_API int64_t fathom_extract_mesh(fathom *context, float min_weight, fathom_triangles triangles,
                                       void *user);
#define FATHOM_BLOCK_TRIANGLES 2560
typedef enum {
    FATHOM_MESH_WHOLE = 0,
    FATHOM_MESH_POOL = 1
} fathom_mesh_part;
typedef struct {
    uint32_t struct_size;
    int32_t capacity;
    fathom_vertex *vertices;
    int64_t next_stored, next_made;
    float min_weight;
} fathom_mesh_pull;
FATHOM_API int64_t fathom_pull_mesh(fathom *context, fathom_mesh_pull *pull);
typedef struct {
    uint32_t struct_size;
    int32_t capacity;
    int64_t since;
    int64_t generation;
    int64_t next;
    fathom_block_key *keys;
    int16_t *distances;
} fathom_block_pull;
FATHOM_API int32_t fathom_pull_blocks(fathom *context, fathom_block_pull *pull);
typedef enum {
    FATHOM_CHECK_PASSED = 0,
    FATHOM_CHECK_FAILED = 1,
    FATHOM_CHECK_SKIPPED = 2
} fathom_check;
typedef int (*fathom_selftest_report)(void *user, const char *kernel, fathom_check outcome, const char *why);
FATHOM_API int fathom_selftest(const fathom_config *config, fathom_selftest_report report, void *user);
#ifdef __cplusplus
}
#endif
#endif
