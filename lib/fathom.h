/*
 * fathom: depth and inertial samples in, camera pose and surface out, in memory fixed at start.
 *
 * The library carries out Niessner, Dai, Fisher: "Combining Inertial Navigation and ICP for Real-time 3D Surface
 * Reconstruction" (Eurographics 2014 short papers), called "the paper" below; its loop (Figure 2) is fathom_step().
 *
 *     fathom_config config = fathom_config_default();        // edit what differs on your rig
 *     int64_t bytes = fathom_memory_required(&config);       // negative: a fathom_error
 *     fathom *scan;
 *     fathom_init(&scan, &config, malloc(bytes), bytes);     // or a static array
 *     fathom_push_imu(scan, &sample);                        // from any one thread, as samples arrive
 *     fathom_step(scan, &frame, &result);                    // from one thread, once for each depth frame
 *     fathom_close(scan);                                    // the block is the caller's again
 *
 * Frames and units
 *   Camera axes: x right, y down, z forward (the optical axis). A pixel's centre has integer coordinates.
 *   A pose maps camera to world: a row-major 4x4 float matrix, pose[4 * row + column], x_world = pose * x_camera.
 *   The world is the camera frame of the first depth frame, unless fathom_config.first_pose says otherwise.
 *   Metres, seconds, radians; stamps are int64 nanoseconds on one monotonic clock of the caller's choice.
 *   A 6-vector or 6x6 covariance of a pose is ordered rotation (3, radians) then translation (3, metres) and lives in
 *   the axes of the camera at that pose: true pose = pose * exp(error).
 *
 * Threads
 *   One thread may call fathom_push_imu while another calls everything else. A context is never shared by two
 *   stepping threads. Contexts are independent of each other; there is no global state.
 *
 * Memory
 *   Every host byte lives in the caller's block; after fathom_init no call takes memory from the heap by the library's
 *   own code (the OpenCL runtime and the caller's callbacks are their own masters). Where the OpenCL device shares the
 *   host's memory (PoCL on a CPU) its buffers lie in the block as well.
 *
 * Errors
 *   Functions return FATHOM_OK (0) or a positive result, or a negative fathom_error. The log callback gets the details.
 */
#ifndef FATHOM_H
#define FATHOM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define FATHOM_VERSION_MAJOR 0
#define FATHOM_VERSION_MINOR 1
#define FATHOM_VERSION_PATCH 0

#if defined(__GNUC__)
#define FATHOM_API __attribute__((visibility("default")))
#else
#define FATHOM_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* A scanning context. Opaque; lives inside the block given to fathom_init. */
typedef struct fathom fathom;

/* The version of the library that is running, as "major.minor.patch". Any thread. */
FATHOM_API const char *fathom_version(void);

/* ---- errors ------------------------------------------------------------------------------------------------------ */

typedef enum {
    FATHOM_OK = 0,
    FATHOM_ERROR_ARGUMENT = -1, /* an argument is NULL, not finite or out of range; the log names it */
    FATHOM_ERROR_CONFIG = -2,   /* a setting is out of range or two disagree; the log names it */
    FATHOM_ERROR_MEMORY = -3,   /* the block is short or misaligned, or max_memory_bytes can't hold the settings */
    FATHOM_ERROR_DEVICE = -4,   /* no OpenCL platform or device, or an OpenCL call failed; the log has its code */
    FATHOM_ERROR_KERNEL = -5,   /* a kernel didn't build; the log has the compiler's words */
    FATHOM_ERROR_TIME = -6,     /* a depth frame's stamp doesn't come after the one before; the frame was ignored */
    FATHOM_ERROR_SIZE = -7,     /* a depth frame has another size than the settings; the frame was ignored */
    FATHOM_ERROR_STOPPED = -8,  /* a callback of the caller asked to stop */
    FATHOM_ERROR_NO_DATA = -9   /* nothing there to answer with: no IMU samples in the range, no frame yet */
} fathom_error;

/* A short name, such as "FATHOM_ERROR_MEMORY", for any value. Never NULL; static storage. Any thread. */
FATHOM_API const char *fathom_error_name(int error);

typedef enum { FATHOM_LOG_ERROR = 0, FATHOM_LOG_WARNING = 1, FATHOM_LOG_INFO = 2 } fathom_log_level;

/* Gets one message, without a newline at its end (a kernel's build log may have several lines). text is valid during
 * the call only. Called from the thread that called the library. */
typedef void (*fathom_log)(void *user, fathom_log_level level, const char *text);

/* ---- inertial samples and estimates ------------------------------------------------------------------------------ */

/* One sample of the inertial sensor, in its own axes (fathom_config.imu_to_camera_* turns them). */
typedef struct {
    int64_t timestamp_ns; /* the IMU's clock; fathom_config.imu_clock_offset_ns is added to get the depth clock */
    float gyro[3];        /* angular rate, rad/s */
    float accel[3];       /* specific force, m/s^2: +9.8 along up at rest. All NaN where there is no accelerometer */
} fathom_imu_sample;

/* A relative motion: inv(M_from) * M_to, which maps coordinates in the later camera to the earlier one (the paper's
 * InertialEstimate, Section 3). */
typedef struct {
    float motion[16];     /* row-major 4x4 */
    float covariance[36]; /* row-major 6x6, rotation then translation, in the later camera's axes */
} fathom_motion;

/* What is known of a gyroscope or an accelerometer, found out while scanning: by its samples alone, and by comparing them
 * with the motion of well-aligned frames. From FATHOM_IMU_UNITS on the sensor can't be used, and isn't any more (until
 * fathom_reset): without the gyroscope the scan goes on without the IMU, without the accelerometer with rotation only (as
 * with imu_translation false). A warning in the log names the mistake with its numbers, once. */
typedef enum {
    FATHOM_IMU_UNCHECKED = 0, /* too few samples or too little motion so far (20 degrees of turning, for a gyroscope) */
    FATHOM_IMU_GOOD = 1,      /* agrees with the depth frames; still watched */
    FATHOM_IMU_SATURATED = 2, /* readings stop at a limit: the range is too small for the motion. Still used */
    FATHOM_IMU_UNITS = 3,     /* degrees/s for rad/s, g for m/s^2 and the like */
    FATHOM_IMU_SCALE = 4,     /* another factor */
    FATHOM_IMU_AXES = 5,      /* axes swapped or mirrored: no rotation explains it */
    FATHOM_IMU_MOUNTING = 6,  /* a rotation does: imu_to_camera_rotation is wrong */
    FATHOM_IMU_SIGN = 7,      /* the opposite sign in all axes; an accelerometer that points along gravity */
    FATHOM_IMU_CLOCK = 8,     /* stamps that are off by tenths of a second or more, or run too fast or too slow */
    FATHOM_IMU_STUCK = 9,     /* an axis says the same all the time while the camera turns */
    FATHOM_IMU_UNRELATED = 10 /* readings that don't follow the motion in any of these ways */
} fathom_imu_health;

/* "unchecked", "good", "saturated", "units", ... Never NULL; static storage. Any thread. */
FATHOM_API const char *fathom_imu_health_name(fathom_imu_health health);

/* The caller's own InertialEstimate: fills *motion for the camera's way from from_ns to to_ns (depth clock). Returns
 * FATHOM_OK, or FATHOM_ERROR_NO_DATA when it can't say (then the library's own estimate is used, as when what it gave is
 * not finite or not rigid). Called on the stepping thread from within fathom_step. */
typedef int (*fathom_inertial_hook)(void *user, int64_t from_ns, int64_t to_ns, fathom_motion *motion);

/* ---- settings ---------------------------------------------------------------------------------------------------- */

typedef enum {
    FATHOM_AGAINST_MODEL = 0,   /* align with the surface, ray-cast at the seed: drifts least */
    FATHOM_AGAINST_PREVIOUS = 1 /* align with the last accepted frame (the paper's Section 2) */
} fathom_against;

typedef enum {
    FATHOM_PRIOR_SEED = 0,       /* the paper's way: inertia says where to start; an ill-conditioned alignment (kappa above
                                    max_condition) is rejected (Sections 2 and 3.1) */
    FATHOM_PRIOR_INFORMATION = 1 /* beyond it: inertia's information enters the 6x6 system too, so that a direction which the
                                    geometry leaves free, as along a bare wall, is held by inertia */
} fathom_prior;

typedef enum {
    FATHOM_BUFFERS_AUTO = 0,  /* in the caller's block where the device is a CPU, else the device's own */
    FATHOM_BUFFERS_HOST = 1,  /* always in the caller's block (CL_MEM_USE_HOST_PTR) */
    FATHOM_BUFFERS_DEVICE = 2 /* always the device's own (CL_MEM_ALLOC_HOST_PTR), counted as device bytes */
} fathom_buffers;

typedef enum {
    FATHOM_FULL_STOP = 0, /* the surface stops growing; tracking goes on, and nothing that was fused is lost */
    FATHOM_FULL_DROP = 1  /* the blocks least recently seen make room (a sixteenth of the pool at a time, none that is
                             in view); block_out gets each first, block_in may give it back */
} fathom_full;

/* 8x8x8 voxels of the surface. Voxel (x, y, z) of it, at [64 * z + 8 * y + x], stands at (8 * index + (x, y, z)) * voxel_m
 * in the world. The arrays are the library's, valid during the call. */
typedef struct {
    int32_t index[3];    /* the block's place in the grid of blocks; x, y, z */
    float voxel_m;       /* edge of a voxel */
    float truncation_m;  /* a distance of 32767 */
    int16_t *distances;  /* 512 signed distances, positive in front of the surface; -32768: never seen */
    uint16_t *weights;   /* 512; 64 for one observation at 1 m; 0 where never seen */
} fathom_block;

/* Gets a block that is about to be dropped (read it), or one that is new (block_in: fill in distances and weights and
 * return 1 if the block was dropped earlier; return 0 and leave it as it is if not). Called on the stepping thread from
 * within fathom_step, block_in also from within fathom_extract_whole_mesh. What it returns means nothing for block_out.
 * A caller keeps the last copy of each index, also when it has given it back: a block that is dropped again comes through
 * block_out again. After fathom_reset, what was kept is of another world. */
typedef int (*fathom_block_hook)(void *user, const fathom_block *block);

#define FATHOM_LEVELS 3 /* of the alignment pyramid: index 0 is the coarsest (a quarter), 2 the finest */

/* All settings. Get one from fathom_config_default() and change what differs; zero means "the default" where a field
 * says so. Read during fathom_memory_required and fathom_init only: the library keeps a copy (but not of what the
 * pointers lead to, which must live as long as the context where it says so). */
typedef struct {
    uint32_t struct_size; /* sizeof(fathom_config), set by fathom_config_default: tells the library the caller's version */

    /* depth camera */
    int depth_width, depth_height; /* pixels of the depth frames; 16..4096. Default 640x480 */
    float fx, fy, cx, cy;          /* pinhole intrinsics at that size, pixels. Default 525, 525, 319.5, 239.5 */
    float distortion[5];           /* k1 k2 p1 p2 k3 (Brown-Conrady, OpenCV's order); all zero: none. Default none */
    float depth_units_per_metre;   /* e.g. 1000 for millimetres, 5000 in TUM recordings. Default 1000 */
    float min_depth_m, max_depth_m; /* depths outside are invalid. Default 0.3 and 5. 0 and 65535 are always invalid, and depth
                                      whose sigma is more than two truncations */
    float depth_noise_base_m;      /* depth error: sigma(z) = base + growth * z^2. Pairs and fusion are weighted by */
    float depth_noise_growth_per_m;      /* 1/sigma^2 relative to that at 1 m. Defaults 0.0001 m and 0.003 1/m: a step of a
                                      Kinect 360's disparity (Khoshelham and Elberink 2012, Section 3.2: 2.85 mm at 1 m) */

    /* alignment (Section 2) */
    int align_width, align_height; /* size of the maps; depth size over a whole number. 0: the largest up to max_align_width wide */
    int max_align_width;                /* default 320; 16..4096 */
    fathom_against against;        /* default FATHOM_AGAINST_MODEL */
    fathom_prior prior;            /* default FATHOM_PRIOR_INFORMATION */
    int max_iterations[FATHOM_LEVELS]; /* most iterations, coarsest to finest, without a usable seed. Default 10, 5, 4 */
    int max_seeded_iterations[FATHOM_LEVELS]; /* the same with one. Default 0, 0, 4. 0..100 each; the last may be 0 only when
                                             another level has some */
    float max_seed_sigma_m;          /* a seed is usable when its translation's sigma is below this. Default 0.02 */
    float max_model_reuse_m, max_model_reuse_rad; /* maps ray-cast from the surface serve the next frames too, until the camera has moved
                                      so far, or a tenth of the pairs is gone. Defaults 0.04 and 0.06; 0: a ray-cast each frame */
    float max_pair_distance_m;         /* a pair further apart is rejected, at the finest level (doubled at each coarser one).
                                      Default 0.10; widened to three sigma of the seed */
    float max_pair_angle_rad;          /* a pair whose normals differ by more is rejected. Default 0.7 (40 degrees) */
    float huber_m;                 /* residual beyond which a pair's weight falls off as 1/|r|. Default 0.003 */
    float min_update_rad, min_update_m; /* an update smaller than both ends a level. Default 1e-4 and 1e-4 */
    float min_error_decrease;         /* a relative fall of the error below this ends a level. Default 1e-4 */

    /* verdict "tracking" (Section 2, last paragraph; docs/DESIGN.md gives the reasons for the defaults) */
    float min_overlap;             /* kept pairs / pixels where both scan and model have a surface. Default 0.35 */
    int min_pairs;                 /* kept pairs at the finest level used; 0: one in 100 pixels. Default 0 */
    float max_rms_m;               /* weighted rms residual. Default 0.01 */
    float max_condition;           /* kappa(A), centred and scaled, beyond which the weakest direction says nothing (a bare
                                      wall reads 30 by its noise, rooms 2 to 8, a corridor up to 20). Default 22 */
    float max_innovation_sigmas;   /* distance from seed to result in units of the seed's sigma. Default 6 */
    float min_agreement;           /* of the pixels where the surface should be seen from the found pose and the frame sees
                                      something: the part that agrees within agreement_tolerance_m. Default 0.75 */
    float max_see_through;         /* the part of them that sees further, through the surface. Default 0.015 */
    float min_evident_fraction;           /* an alignment from a usable seed is evident, and what the surface should look like isn't
                                      ray-cast to be compared, when this part of the frame's valid pixels found pairs, and
                                      result and seed agree within max_evident_sigmas. Default 0.6; above 1: never */
    float max_evident_sigmas;          /* Default 1.5 */
    float agreement_tolerance_m;             /* tolerance across the surface, beside a voxel and three sigma of the depth. Default 0.02 */
    float max_sigma_m, max_sigma_rad; /* sigma of the found pose, inertia counted in: along a bare wall geometry says
                                      nothing, and a pose that inertia doesn't hold either isn't fused. Default 0.02, 0.02 */

    /* surface */
    float voxel_m;                 /* edge of a voxel. Default 0.01; 0.001..1 */
    float truncation_m;            /* the signed distance is kept within this. 0: four voxels */
    int max_blocks;                    /* blocks of 8x8x8 voxels in the pool, 2 KB each; 64 at least. 0: what
                                      max_memory_bytes leaves */
    fathom_full when_full;         /* what happens when the pool has no block left. Default FATHOM_FULL_STOP */
    fathom_block_hook block_out, block_in; /* with FATHOM_FULL_DROP; NULL: dropped blocks are gone. Must outlive the context */
    void *block_user;
    float max_weight;              /* observations a voxel averages over, at 1 m; older ones fade. Default 100 */
    bool fuse_behind;              /* fathom_step returns as soon as the pose is known, and the frame goes into the surface while
                                      the next one is on its way: the same poses, sooner. Whatever asks for the surface waits.
                                      A device that fails meanwhile is told of by the next call. Default false */

    /* memory */
    int64_t max_memory_bytes;      /* most bytes, host and device together. Default 128 MB (128 << 20) */

    /* inertial sensor (Section 3) */
    bool imu;                      /* use inertial samples. Default true; without samples it does no harm */
    bool imu_translation;          /* use the accelerometer (else translation goes on at constant velocity). Default true */
    bool imu_check;                /* compare the IMU with the depth frames' motion and stop using it when it is wrong
                                      (fathom_imu_health). Until it is known to be right, alignment is also tried from the
                                      last velocity. Default true */
    float imu_to_camera_rotation[9];    /* row-major: v_camera = R v_imu. Default identity */
    float imu_to_camera_translation[3]; /* the IMU's origin in camera axes, metres. Default zero */
    int64_t imu_clock_offset_ns;   /* added to an IMU stamp to get the depth clock. Default 0 */
    bool refine_rig;               /* refine that rotation and that offset while scanning, by comparing the gyroscope with the
                                      turning of well-aligned frames (fathom_get_rig): for a rig whose values are a little
                                      wrong, or drift. Default false: they are exact */
    float rig_rotation_sigma_rad;      /* how wrong they may be then: about each axis, radians; 1e-6..1. Default 0.05 */
    int64_t rig_clock_sigma_ns;    /* and the offset; 1000..1e9. Default 20 ms */
    float gravity_m_s2;                 /* m/s^2. Default 9.80665 */
    float gyro_noise_rad_s_sqrthz;              /* noise density, rad/s/sqrt(Hz), with what scale errors add (a phone's alone: 1e-4).
                                      Default 5e-3 */
    float gyro_bias_sigma_rad_s;         /* sigma of the bias before it is known, rad/s. Default 0.02 */
    float accel_noise_m_s2_sqrthz;             /* noise density, m/s^2/sqrt(Hz), with what scale errors and vibration add. Default 0.05 */
    float accel_bias_sigma_m_s2;        /* sigma of the bias before it is known, m/s^2. Default 0.1 */
    float seed_noise_rad, seed_noise_m; /* error of a seed that no noise figure explains (clock jitter, mounting, rolling
                                      shutter), a step. Default 0.012 and 0.008 */
    float pose_noise_rad, pose_noise_m; /* error of an accepted pose, beside what alignment says, and of the navigator's way
                                      from one to the next. Default 0.006 and 0.004 */
    float motion_sigma_m_s2;      /* how much a hand-held camera's velocity wanders, m/s^2, without an accelerometer.
                                      Default 1.5 */
    float motion_sigma_rad_s2;       /* the same for its turning rate without a gyroscope, rad/s^2. Default 3 */
    float max_reckoned_sigma_m;            /* dead reckoning whose position sigma passes this is called lost. Default 0.5 */
    int max_imu_samples;              /* samples kept; 0: 4096 */
    fathom_inertial_hook inertial_hook; /* replaces the library's InertialEstimate. Default NULL. Must outlive the context */
    void *inertial_user;

    /* start */
    float first_pose[16];          /* the first frame's pose, camera to world. Default identity */

    /* OpenCL */
    const char *device;            /* "", or a part of a platform's or device's name, or "cpu", "gpu". NULL: "": the first
                                      GPU that shares the host's memory, else the first device. Read during init only */
    fathom_buffers buffers;        /* default FATHOM_BUFFERS_AUTO */
    const char *kernel_file;       /* kernels that fathom_save_kernels wrote on a machine of the same kind; another device,
                                      driver or library version than theirs is FATHOM_ERROR_KERNEL. NULL: built from source, or
                                      from the cache. Read during init only */
    const char *cache_folder;      /* where built kernels are kept; NULL: $XDG_CACHE_HOME/fathom or ~/.cache/fathom;
                                      "": no cache. Read during init only */

    /* log */
    fathom_log log;                /* NULL: silent. Must outlive the context */
    void *log_user;
} fathom_config;

/* The default settings. Any thread. */
FATHOM_API fathom_config fathom_config_default(void);

/* Complete settings for boards of three kinds; they differ in the four fields named here alone. docs/PORTING.md has what
 * each takes in time and memory, and how exact it is. */
typedef enum {
    FATHOM_PRESET_TINY = 0,  /* maps up to 160 wide, 2 cm voxels, 64 MB: a slow processor, a whole flat */
    FATHOM_PRESET_SMALL = 1, /* maps up to 320 wide, 1 cm voxels, 128 MB: the default settings */
    FATHOM_PRESET_LARGE = 2  /* maps up to 640 wide, 8 mm voxels, 256 MB: fine detail */
} fathom_preset;

/* A preset that doesn't exist gives the default settings. Any thread. */
FATHOM_API fathom_config fathom_config_preset(fathom_preset preset);

/* ---- memory and life --------------------------------------------------------------------------------------------- */

#define FATHOM_ALIGNMENT 128 /* of the block; an unaligned one will do too: the size includes the padding */

typedef struct {
    int64_t host_bytes;   /* size of the block fathom_init needs */
    int64_t device_bytes; /* what the OpenCL device must hold beside it; 0 where buffers lie in the block */
    int blocks;           /* blocks in the pool */
    int align_width, align_height; /* the maps' size */
    char device[128];     /* name of the OpenCL device that was planned for */
} fathom_memory_plan;

/* Bytes of the block that fathom_init needs, for the device it would choose; or FATHOM_ERROR_CONFIG, _MEMORY, _DEVICE.
 * Any thread. */
FATHOM_API int64_t fathom_memory_required(const fathom_config *config);

/* The same with its parts. Returns FATHOM_OK or an error. */
FATHOM_API int fathom_memory_plan_for(const fathom_config *config, fathom_memory_plan *plan);

/* Builds a context inside memory (size bytes, the caller's, until fathom_close). Opens the OpenCL device and builds the
 * kernels (a second or so, once; then from the cache), and runs each once on nothing. A block that is too small by one byte is refused with
 * FATHOM_ERROR_MEMORY and not touched. On any error *context is NULL and nothing stays open. */
FATHOM_API int fathom_init(fathom **context, const fathom_config *config, void *memory, size_t size);

/* Writes the built kernels, in every shape that these settings use, to a file for fathom_config.kernel_file: on a board of
 * the same kind, with the same runtime and settings, no compiler runs then. FATHOM_ERROR_KERNEL when the file can't be
 * written; the log says why. */
FATHOM_API int fathom_save_kernels(fathom *context, const char *path);

/* Waits for the device, releases it, forgets everything. The block is the caller's again. NULL is allowed. */
FATHOM_API void fathom_close(fathom *context);

/* Forgets surface, pose and inertial history, as after fathom_init. Counters and settings stay. */
FATHOM_API int fathom_reset(fathom *context);

/* With pause true, steps go on finding the pose but fuse nothing (localise only), until called with false. A scan that
 * is paused before its first frame has no surface yet and stays without. */
FATHOM_API int fathom_pause(fathom *context, bool pause);

/* ---- input ------------------------------------------------------------------------------------------------------- */

/* Hands over samples as they arrive; may be called from one other thread at any time, never waits. Late, repeated,
 * out-of-order, non-finite and implausible samples are counted (fathom_counters) and dropped. When the ring is full the
 * new sample is dropped and counted: step often, or give a larger max_imu_samples. When either clock leaps by more than 0.1 s
 * the order of arrival shows it: after 0.2 s stamps are moved to go on from where they were, and the log is told. Returns
 * FATHOM_OK, or FATHOM_ERROR_ARGUMENT for NULL, a sample that isn't finite or stamped more than 126 years from zero
 * (counted as not finite), or one beyond 100 rad/s or 2000 m/s^2 (implausible). */
FATHOM_API int fathom_push_imu(fathom *context, const fathom_imu_sample *sample);

/* A depth frame. */
typedef struct {
    int64_t timestamp_ns;  /* the depth clock, when the middle of the frame was exposed; must increase; +-126 years */
    const uint16_t *depth; /* height rows of width pixels, the caller's, read during the call only */
    int width, height;     /* must be the settings' depth_width, depth_height */
} fathom_depth_frame;

/* ---- a step ------------------------------------------------------------------------------------------------------ */

typedef enum {
    FATHOM_FIRST = 0,    /* the first frame with a surface: fused at the first pose */
    FATHOM_TRACKED = 1,  /* aligned and trusted: fused, unless paused */
    FATHOM_RECKONED = 2, /* alignment not trusted: the pose is the inertial estimate's; nothing fused */
    FATHOM_LOST = 3      /* the same, and the pose's sigma has passed max_reckoned_sigma_m */
} fathom_state;

/* "first", "tracked", "reckoned", "lost". Never NULL. */
FATHOM_API const char *fathom_state_name(fathom_state state);

/* Why a frame wasn't trusted (Section 2, "empirically determined error thresholds"). */
typedef enum {
    FATHOM_VERDICT_TRACKING = 0,
    FATHOM_VERDICT_NO_DEPTH = 1,   /* too few valid pixels in the frame */
    FATHOM_VERDICT_FEW_PAIRS = 2,  /* below min_pairs; or not looked for: lost for long, one frame in 30 is */
    FATHOM_VERDICT_OVERLAP = 3,    /* below min_overlap */
    FATHOM_VERDICT_RESIDUAL = 4,   /* above max_rms_m */
    FATHOM_VERDICT_CONDITION = 5,  /* above max_condition */
    FATHOM_VERDICT_INNOVATION = 6, /* further from the seed than max_innovation_sigmas */
    FATHOM_VERDICT_CONTRADICTION = 7, /* the surface should look otherwise from there: min_agreement, max_see_through */
    FATHOM_VERDICT_UNCERTAIN = 8   /* above max_sigma_m or max_sigma_rad: the pose is given, and what geometry knows of it is
                                      used, but nothing is fused */
} fathom_verdict;

FATHOM_API const char *fathom_verdict_name(fathom_verdict verdict);

/* What a step found. Alignment figures are those of the last iteration at the finest level used; they are zero for a
 * first frame and where no pair was found. */
typedef struct {
    int64_t timestamp_ns;      /* of the frame */
    fathom_state state;
    fathom_verdict verdict;
    float pose[16];            /* row-major 4x4, camera to world; always finite */
    float covariance[36];      /* row-major 6x6 of the pose: alignment's where tracked, grown while reckoning */
    int iterations;            /* spent, over all levels */
    int pairs;                 /* n: kept correspondences */
    int overlap_pixels;        /* pixels where scan and model both had a surface */
    float rms_m;               /* sqrt(sum w r^2 / sum w), of the linear model after the update (Section 2: r = ||Ax - b||^2) */
    float weight;              /* sum of the pairs' weights; a perfect pair at 1 m weighs 1 */
    float singular_values[6];  /* of A, centred on the pairs and scaled by their spread, largest first */
    float condition;           /* kappa = largest / smallest singular value; INFINITY when the smallest is 0 */
    float prior_rotation_rad;  /* angle between the seed and the result */
    float prior_translation_m; /* distance between the seed and the result */
    float innovation_sigmas;   /* the same as a Mahalanobis distance under the seed's covariance */
    float agreement;           /* part of the pixels where the surface should be seen that agree; NAN: not looked at */
    float see_through;         /* part of them that sees through it */
    bool searched;             /* the frame was looked for about the seed, for alignment from the seed alone had failed */
    bool seeded;               /* the seed was good enough for max_seeded_iterations */
    bool fused;                /* the frame went into the surface */
    int blocks_dropped, blocks_restored; /* by when_full, in this step */
    bool pool_full;            /* some of the surface had no room left in the pool (tracking goes on) */
    int blocks;                /* blocks in use */
    fathom_imu_health gyro_health, accel_health; /* of the inertial sensor so far */
    float ms_maps, ms_align, ms_fuse, ms_raycast, ms_total; /* wall time of the stages; with fuse_behind, ms_fuse is what the
                                  step itself took, and ms_maps may hold the rest of the frame before */
} fathom_result;

/* One turn of the paper's loop (Figure 2): maps of the depth frame, seed from the inertial estimate, alignment, verdict,
 * fusion or dead reckoning. Push the IMU samples up to the frame's stamp before; where they end early the last rate is
 * held. Returns FATHOM_OK also for frames that aren't tracked (see result->state); FATHOM_ERROR_TIME or _SIZE for a frame
 * that was ignored (then *result repeats the last pose); FATHOM_ERROR_DEVICE if OpenCL failed. One stepping thread. */
FATHOM_API int fathom_step(fathom *context, const fathom_depth_frame *frame, fathom_result *result);

/* The relative camera motion between two stamps of the depth clock by inertial navigation alone (Section 3,
 * InertialEstimate): an error-state Kalman filter (Sola 2017, Section 5 and 6) integrates gyroscope and accelerometer
 * between interpolated samples, from the state that the accepted poses have corrected: orientation, velocity, position,
 * both biases, gravity. to_ns may lie before from_ns. FATHOM_ERROR_NO_DATA when there are neither samples nor a tracked
 * frame. Stepping thread. */
FATHOM_API int fathom_inertial_estimate(fathom *context, int64_t from_ns, int64_t to_ns, fathom_motion *motion);

/* The latest pose (row-major 4x4, camera to world) and, where not NULL, its 6x6 covariance. Stepping thread. */
FATHOM_API int fathom_pose(fathom *context, float pose[16], float covariance[36]);

/* The IMU's place on the rig, as the library takes it to be: the settings, or, with refine_rig, the best estimate so far.
 * Turns that were never made tell nothing: about their axis the sigma stays as it was. */
typedef struct {
    float imu_to_camera_rotation[9]; /* row-major: v_camera = R v_imu */
    float rotation_sigma[3];         /* rad, about the camera's axes; 0 without refine_rig */
    int64_t imu_clock_offset_ns;     /* what an IMU stamp needs to be on the depth clock; without the leaps that were
                                        noticed (imu_clock_leaps) */
    int64_t clock_sigma_ns;          /* of that; 0 without refine_rig */
    int intervals;                   /* pairs of frames that were compared; 0 without refine_rig */
} fathom_rig;

/* fathom_reset goes back to the settings. A later scan may start from these values as its settings. Stepping thread. */
FATHOM_API int fathom_get_rig(fathom *context, fathom_rig *rig);

/* What has been counted since fathom_init. */
typedef struct {
    int64_t imu_accepted;   /* samples taken into the history */
    int64_t imu_not_finite; /* dropped: NaN or infinite */
    int64_t imu_out_of_order; /* dropped: repeated stamp or one that goes back */
    int64_t imu_overrun;    /* dropped: the ring was full */
    int64_t imu_implausible; /* dropped: no sensor's value (beyond 100 rad/s or 2000 m/s^2), or a glitch of one sample
                                (5 rad/s or 100 m/s^2 away from both its neighbours) */
    int64_t imu_gaps;       /* pauses of more than five sample periods */
    int64_t imu_clock_leaps; /* times that the IMU's clock and the frames' leapt apart and the stamps were moved back */
    int64_t imu_doubts;     /* times that the gyroscope began to contradict the poses and was left aside */
    int64_t frames_ignored; /* depth frames refused for their stamp or size */
    int64_t blocks_dropped, blocks_restored; /* by when_full */
    int64_t blocks_refused; /* blocks that found the pool full */
} fathom_counters;

/* Stepping thread. */
FATHOM_API int fathom_get_counters(fathom *context, fathom_counters *counters);

/* ---- surface ----------------------------------------------------------------------------------------------------- */

/* A pinhole view for the two functions below. */
typedef struct {
    int width, height;    /* pixels, 1..16384 each */
    float fx, fy, cx, cy; /* pixels */
    float pose[16];       /* row-major 4x4, camera to world */
    float near_m, far_m;  /* the surface is looked for between these depths; 0: 0.1 and 20 */
} fathom_view;

/* Ray-casts the surface (Newcombe et al. 2011, Section 3.3) into the caller's buffers of width*height pixels, row by row:
 * depth in metres along the optical axis (0: nothing there), normals as 3 floats in the view's camera axes, pointing to
 * the camera, of length 1, rounded to a tenth of a degree. Either may be NULL. Only fronts of surfaces are seen, so that a
 * room can be looked at from outside. */
FATHOM_API int fathom_model_maps(fathom *context, const fathom_view *view, float *depth, float *normals);

/* The same as a shaded picture, 3 bytes (R G B) a pixel. */
FATHOM_API int fathom_shaded_view(fathom *context, const fathom_view *view, uint8_t *rgb);

/* A corner of a triangle. */
typedef struct {
    float position[3]; /* world, metres */
    float normal[3];   /* world, unit length, pointing out of the surface (to where the camera was) */
} fathom_vertex;

/* Gets triangle_count triangles, three vertices each, counter-clockwise seen from outside. Corners that triangles share
 * are bit-equal. Valid during the call. Returns 0 to go on; anything else stops (FATHOM_ERROR_STOPPED). */
typedef int (*fathom_triangles)(void *user, const fathom_vertex *vertices, size_t triangle_count);

/* Streams the surface's triangles (marching cubes, Lorensen and Cline 1987) to the callback in batches, in bounded memory,
 * in the order in which the blocks were made. Voxels seen with a summed weight below min_weight are left out (0: all).
 * Returns the number of triangles, or an error. */
FATHOM_API int64_t fathom_extract_mesh(fathom *context, float min_weight, fathom_triangles triangles, void *user);

/* The same with what was dropped (when_full): triangles of `dropped` and of the pool, without seams. dropped: the indices
 * of the blocks that block_out got, three int32 each, count blocks, each once; the caller's, read during the call only.
 * Listed blocks come first, in that order, then the pool's. A listed block that is in the pool again is taken from there;
 * any other is asked for by block_in, as are neighbours, up to 20 times in all (least when the list goes along the
 * surface), and left out where that returns 0. The pool and what the caller keeps stay as they are, so the scan may go on.
 * Works in a pool of 512 blocks of its own, in bounded memory (with FATHOM_FULL_DROP it takes 1 MB of max_memory_bytes).
 * FATHOM_ERROR_ARGUMENT for an index beyond +-2^27, or for count > 0 without FATHOM_FULL_DROP and block_in. Stepping
 * thread. Returns the number of triangles, or an error. */
FATHOM_API int64_t fathom_extract_whole_mesh(fathom *context, float min_weight, const int32_t *dropped, size_t count,
                                             fathom_triangles triangles, void *user);

/* ---- self-test --------------------------------------------------------------------------------------------------- */

typedef enum {
    FATHOM_CHECK_PASSED = 0,
    FATHOM_CHECK_FAILED = 1, /* the kernel writes something else than the reference, or an OpenCL call failed */
    FATHOM_CHECK_SKIPPED = 2
} fathom_check;

/* Gets one check's outcome: the kernel's name, and one line on what failed or why it was skipped, else "". The texts are
 * valid during the call. Returns 0 to go on; anything else stops (FATHOM_ERROR_STOPPED). */
typedef int (*fathom_selftest_report)(void *user, const char *kernel, fathom_check outcome, const char *why);

/* Runs every OpenCL kernel on the device that the settings choose and compares what it writes with a plain C reference: on
 * random images of odd sizes, on frames without any depth, at edges and limits. Of the settings only the device, the
 * buffers, the log, cache_folder and kernel_file matter. Takes some seconds, and some tens of megabytes from the heap,
 * which it gives back. Any thread. Returns the number of checks that failed, or an error. */
FATHOM_API int fathom_selftest(const fathom_config *config, fathom_selftest_report report, void *user);

#ifdef __cplusplus
}
#endif

#endif
