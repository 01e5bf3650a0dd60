/*
 * fathom: depth and inertial samples in, camera pose and surface out, in memory fixed at start.
 *
 * The library carries out Niessner, Dai, Fisher: "Combining Inertial Navigation and ICP for Real-time 3D Surface
 * Reconstruction" (Eurographics 2014 short papers), called "the paper" below; its loop (Figure 2) is fathom_step().
 *
 *     fathom_config config;
 *     fathom_config_init(&config);                           // edit what differs on your rig
 *     char why[256];
 *     int64_t bytes = fathom_memory_required(&config, why, sizeof why); // negative: a fathom_error
 *     fathom *scan;
 *     fathom_init(&scan, &config, malloc(bytes), bytes, why, sizeof why); // or a static array
 *     fathom_push_imu(scan, &sample);                        // from any one thread, as samples arrive
 *     fathom_result result = FATHOM_STRUCT(fathom_result);
 *     fathom_step(scan, &frame, &result);                    // from one thread, once for each depth frame
 *     fathom_close(scan);                                    // the block is the caller's again
 *
 * Structs
 *   A struct whose first field is struct_size may grow at its end in later versions. The caller sets struct_size to the
 *   size that its own header gives the struct: by FATHOM_STRUCT(type), by fathom_config_init() for the settings, or by
 *   {.struct_size = sizeof s, ...}. The library reads and writes no more than that. Fields beyond a shorter struct take
 *   their defaults. In a struct that is longer than the library's, the bytes beyond must be zero where the library
 *   reads it, and are zeroed where it writes. Structs without struct_size never change.
 *   Enumerations in structs are int32_t, truth values are bool (one byte).
 *
 * Names
 *   fathom_verb_noun acts on a context, fathom_type_verb on a struct of that type or on an object such as a source.
 *
 * Frames and units
 *   Camera axes: x right, y down, z forward (the optical axis). A pixel's centre has integer coordinates.
 *   A fathom_pose maps camera to world.
 *   The world is the camera frame of the first depth frame, unless fathom_config.first_pose says otherwise.
 *   Metres, seconds, radians; stamps are int64 nanoseconds on one monotonic clock of the caller's choice.
 *   A 6-vector or 6x6 covariance of a pose is ordered rotation (3, radians) then translation (3, metres) and lives in
 *   the axes of the camera at that pose: true pose = pose * exp(error). Matrices are row-major.
 *
 * Threads
 *   Each function names its thread. "Any thread": callable at any time, touches no context. "Stepping thread": one
 *   thread at a time uses a context. "Sample thread": fathom_push_imu only; one thread may push while the stepping
 *   thread does anything but fathom_init and fathom_close. Contexts are independent of each other; there is no global
 *   state.
 *
 * Memory
 *   Every host byte lives in the caller's block; after fathom_init the library's own code takes no memory from the heap
 *   (the OpenCL runtime and the caller's callbacks may allocate). Where the OpenCL device shares the host's memory
 *   (PoCL on a CPU) its buffers lie in the block as well.
 *
 * Errors
 *   Functions return FATHOM_OK (0) or a positive result, or a negative fathom_error. fathom_last_error() and the log
 *   have the details. When OpenCL fails the context is dead: every later call on it returns FATHOM_ERROR_DEVICE until
 *   it is closed.
 */
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

/* A scanning context. Opaque; lives inside the block given to fathom_init. */
typedef struct fathom fathom;

/* The version of the library that is running, as "major.minor.patch". Any thread. */
FATHOM_API const char *fathom_version(void);

/* A zeroed struct with its struct_size set, for any struct that has one:
 *     fathom_result result = FATHOM_STRUCT(fathom_result); */
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

/* ---- errors ------------------------------------------------------------------------------------------------------ */

/* Error codes of the library and of libfathom-drivers. */
typedef enum {
    FATHOM_OK = 0,
    FATHOM_ERROR_ARGUMENT = -1,    /* an argument is NULL, not finite or out of range */
    FATHOM_ERROR_CONFIG = -2,      /* a setting is out of range, or two disagree */
    FATHOM_ERROR_MEMORY = -3,      /* the block or max_memory_bytes is too small; drivers: the heap is exhausted */
    FATHOM_ERROR_DEVICE = -4,      /* no OpenCL platform or device, or an OpenCL call failed */
    FATHOM_ERROR_KERNEL = -5,      /* a kernel didn't build; the log has the compiler's messages */
    FATHOM_ERROR_TIME = -6,        /* a depth frame's stamp isn't later than the previous one; the frame was ignored */
    FATHOM_ERROR_SIZE = -7,        /* a depth frame's size differs from the settings; the frame was ignored */
    FATHOM_ERROR_STOPPED = -8,     /* the caller's callback stopped the call */
    FATHOM_ERROR_NO_DATA = -9,     /* no IMU samples in the range, no frame, no file */
    FATHOM_ERROR_FULL = -10,       /* a ring is full; the pushed sample is dropped and counted */
    FATHOM_ERROR_NAME = -11,       /* no setting has that name */
    FATHOM_ERROR_VALUE = -12,      /* the text is not a value of the setting's type */
    FATHOM_ERROR_WRITE = -13,      /* a file or folder can't be written (disk full, no permission); the text has the
                                      details */
    FATHOM_ERROR_TIMEOUT = -20,    /* nothing arrived in time; the source goes on */
    FATHOM_ERROR_CANCELLED = -21,  /* fathom_source_cancel was called; the next wait works again */
    FATHOM_ERROR_ENDED = -22,      /* the recording has ended; everything was read */
    FATHOM_ERROR_UNPLUGGED = -23,  /* the device was unplugged, and the options don't reconnect */
    FATHOM_ERROR_PERMISSION = -24, /* the device exists, but this user may not open it; the log has the fix */
    FATHOM_ERROR_BUSY = -25,       /* another program holds the device */
    FATHOM_ERROR_NO_DEVICE = -26,  /* no such device */
    FATHOM_ERROR_NOT_BUILT = -27,  /* this build was made without the driver */
    FATHOM_ERROR_PROTOCOL = -28,   /* the device breaks its protocol */
    FATHOM_ERROR_UNSUPPORTED = -29 /* the source can't do that, or not in this mode */
} fathom_error;

/* A short name, such as "FATHOM_ERROR_MEMORY", for any value. Never NULL; static storage. Any thread. */
FATHOM_API const char *fathom_error_name(int32_t error);

/* Why the latest call on the context failed, in words: one line of a maximum of 255 bytes, "" when none has failed yet.
 * The text stays until the next failure. fathom_push_imu leaves none. NULL gives "". Stepping thread. */
FATHOM_API const char *fathom_last_error(const fathom *context);

typedef enum { FATHOM_LOG_ERROR = 0, FATHOM_LOG_WARNING = 1, FATHOM_LOG_INFO = 2 } fathom_log_level;

/* Receives one message, without a newline at its end (a kernel's build log may have several lines). text is valid
 * during the call only. Called from the thread that called the library. */
typedef void (*fathom_log)(void *user, fathom_log_level level, const char *text);

/* ---- poses and cameras ------------------------------------------------------------------------------------------- */

/* A rigid motion: x_world = orientation * x_camera + position. */
typedef struct {
    double position[3];    /* metres */
    double orientation[4]; /* unit quaternion x y z w; on input its length may be off by 1e-3 */
} fathom_pose;

/* The pose as a 4x4 matrix, row-major: matrix[4 * row + column]. FATHOM_ERROR_ARGUMENT for a pose that isn't finite or
 * whose orientation isn't of unit length. Any thread. */
FATHOM_API int fathom_pose_to_matrix(const fathom_pose *pose, double matrix[16]);

/* The inverse. FATHOM_ERROR_ARGUMENT unless the matrix is finite and a right-handed rigid motion, to 1e-3. Any
 * thread. */
FATHOM_API int fathom_pose_from_matrix(const double matrix[16], fathom_pose *pose);

/* Lens distortion (OpenCV's formulas), with x, y on the plane at depth 1 and r^2 = x^2 + y^2:
 *     x' = x radial + 2 p1 x y + p2 (r^2 + 2 x^2),  y' = y radial + p1 (r^2 + 2 y^2) + 2 p2 x y */
typedef enum {
    FATHOM_LENS_PINHOLE = 0,   /* no distortion; the coefficients are ignored */
    FATHOM_LENS_FIVE = 1,      /* k1 k2 p1 p2 k3: radial = 1 + k1 r^2 + k2 r^4 + k3 r^6 (Brown-Conrady) */
    FATHOM_LENS_RATIONAL = 2   /* k1 k2 p1 p2 k3 k4 k5 k6: the same over 1 + k4 r^2 + k5 r^4 + k6 r^6 */
} fathom_lens;

/* A camera's intrinsics. */
typedef struct {
    int32_t width, height;  /* pixels */
    double fx, fy, cx, cy;  /* pixels, at that size */
    double coefficients[8]; /* in the lens's order; unused ones are 0 */
    int32_t lens;           /* fathom_lens */
    int32_t unused;         /* 0 */
} fathom_pinhole;

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
    uint32_t struct_size;
    uint32_t unused;
    fathom_pose motion;
    double covariance[36]; /* 6x6, rotation then translation, in the later camera's axes */
} fathom_motion;

/* Health of a gyroscope or an accelerometer, determined while scanning: from its samples alone, and by comparing them
 * with the motion of well-aligned frames. From FATHOM_IMU_UNITS on the sensor is unusable and no longer used (until
 * fathom_reset): without the gyroscope the scan goes on without the IMU, without the accelerometer with rotation only
 * (as with imu_translation false). One warning in the log describes the fault, with figures. */
typedef enum {
    FATHOM_IMU_UNCHECKED = 0, /* too few samples or too little motion so far (20 degrees of turning, for a gyroscope) */
    FATHOM_IMU_GOOD = 1,      /* agrees with the depth frames; still watched */
    FATHOM_IMU_SATURATED = 2, /* readings stop at a limit: the range is too small for the motion. Still used */
    FATHOM_IMU_UNITS = 3,     /* degrees/s for rad/s, g for m/s^2 and the like */
    FATHOM_IMU_SCALE = 4,     /* a wrong scale factor */
    FATHOM_IMU_AXES = 5,      /* axes swapped or mirrored: no rotation explains it */
    FATHOM_IMU_MOUNTING = 6,  /* a rotation does: imu_to_camera_rotation is wrong */
    FATHOM_IMU_SIGN = 7,      /* the opposite sign in all axes; an accelerometer that reads along gravity */
    FATHOM_IMU_CLOCK = 8,     /* stamps that are off by tenths of a second or more, or run too fast or too slow */
    FATHOM_IMU_STUCK = 9,     /* an axis reads a constant value while the camera turns */
    FATHOM_IMU_UNRELATED = 10 /* readings unrelated to the motion, none of the above */
} fathom_imu_health;

/* "unchecked", "good", "saturated", "units", ... Never NULL; static storage. Any thread. */
FATHOM_API const char *fathom_imu_health_name(int32_t health);

/* The caller's InertialEstimate: fills motion->motion and motion->covariance, zeroed on entry, for the camera's motion
 * from from_ns to to_ns (depth clock). Returns FATHOM_OK, or FATHOM_ERROR_NO_DATA when it has no estimate; then, and
 * when the estimate isn't finite or rigid, the library's estimate is used. Called on the stepping thread from within
 * fathom_step. */
typedef int (*fathom_inertial_hook)(void *user, int64_t from_ns, int64_t to_ns, fathom_motion *motion);

/* ---- settings ---------------------------------------------------------------------------------------------------- */

typedef enum {
    FATHOM_AGAINST_MODEL = 0,   /* align with the surface, ray-cast at the seed: drifts least */
    FATHOM_AGAINST_PREVIOUS = 1 /* align with the last accepted frame (the paper's Section 2) */
} fathom_against;

typedef enum {
    FATHOM_PRIOR_SEED = 0,       /* the paper's method: inertia gives the start; an ill-conditioned alignment (kappa
                                    above max_condition) is rejected (Sections 2 and 3.1) */
    FATHOM_PRIOR_INFORMATION = 1 /* beyond the paper: inertia's information enters the 6x6 system too, so that inertia
                                    holds a direction that geometry leaves free, as along a bare wall */
} fathom_prior;

typedef enum {
    FATHOM_BUFFERS_AUTO = 0,  /* in the caller's block where the device is a CPU, else the device's own */
    FATHOM_BUFFERS_HOST = 1,  /* always in the caller's block (CL_MEM_USE_HOST_PTR) */
    FATHOM_BUFFERS_DEVICE = 2 /* always the device's own (CL_MEM_ALLOC_HOST_PTR), counted as device bytes */
} fathom_buffers;

typedef enum {
    FATHOM_FULL_STOP = 0, /* the surface stops growing; tracking goes on, and nothing that was fused is lost */
    FATHOM_FULL_DROP = 1  /* the least recently seen blocks make room (a sixteenth of the pool at a time, none that is
                             in view); the block store keeps them and returns them when they are in view again */
} fathom_full;

/* ---- blocks of the surface --------------------------------------------------------------------------------------- */

/* The key of a block of 8x8x8 voxels: its position in the grid of blocks, and its submap. Voxel (i, j, k) lies at
 * (8 * x + i, 8 * y + j, 8 * z + k) * voxel_m in the submap's frame. */
typedef struct {
    int32_t x, y, z; /* -2^27..2^27 */
    int32_t submap;  /* 0: the only one in this version, in the world's frame */
} fathom_block_key;

#define FATHOM_BLOCK_VOXELS 512

/* A block (Niessner et al. 2013) with its truncated signed distances (Curless and Levoy 1996). Voxel (i, j, k) is
 * element 64 * k + 8 * j + i of the arrays, which are the library's and valid during the call. */
typedef struct {
    uint32_t struct_size; /* the library's */
    float voxel_m;        /* edge of a voxel */
    float truncation_m;   /* a distance of 32767 */
    uint32_t unused;
    fathom_block_key key;
    /* FATHOM_BLOCK_VOXELS signed distances, positive in front of the surface; -32768: never seen */
    int16_t *distances;
    uint16_t *weights; /* FATHOM_BLOCK_VOXELS; 64 for one observation at 1 m; 0 where never seen */
} fathom_block;

/* Storage for blocks outside of the pool: FATHOM_FULL_DROP puts dropped blocks there, and gets them when the camera
 * returns. The caller supplies the functions; each may be NULL (without put, dropped blocks are gone; without get, they
 * never return; without enumerate, the mesh is that of the pool). They run on the stepping thread, within a call of the
 * library, and must not call the context. The store keeps one copy per key, the last that was put, even after get. It
 * holds the blocks of one scan: fathom_reset begins another world, so the caller empties the store. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    void *user; /* passed to each function; must outlive the context */
    /* Keeps a copy of the block. Called by fathom_step. Returns 0, or a negative number on failure: the block is gone
     * and counted as lost. */
    int (*put)(void *user, const fathom_block *block);
    /* Fills in distances and weights of the block with that key (on entry: never seen). Called by fathom_step and by
     * calls that make the whole mesh. Returns 1, 0 when nothing was put under that key, or a negative number on
     * failure: the block counts as lost. */
    int (*get)(void *user, const fathom_block *block);
    /* Writes the key at a position of the store's list, 0 being the first. A key keeps its position; new ones are added
     * at the end. Called by calls that make the whole mesh. Returns 1, or 0 beyond the end. */
    int (*enumerate)(void *user, int64_t position, fathom_block_key *key);
} fathom_block_store;

#define FATHOM_LEVELS 3 /* of the alignment pyramid: index 0 is the coarsest (a quarter), 2 the finest */

/* All settings. Fill one by fathom_config_init() and change what differs. Ranges, both ends allowed, and defaults stand
 * beside the fields; fathom_get_setting() and `fathom info --settings` have them, too. Read during
 * fathom_memory_required and fathom_init only: the library copies the struct, but not the data behind its pointers,
 * which must live as long as their comments say. */
typedef struct {
    uint32_t struct_size; /* set by fathom_config_init */

    /* ---- depth camera ---- */

    /* Minimum confidence of a valid pixel, in frames with a confidence plane. 0..255; default 0: any. */
    int32_t min_confidence;
    /* Of the depth frames; 16..4096 pixels each way, any lens. Default 640x480; 525, 525, 319.5, 239.5; no
     * distortion. */
    fathom_pinhole depth_camera;
    /* 1000 for millimetres, 5000 in TUM recordings. 0.001..1e7; default 1000. */
    float depth_units_per_metre;
    /* Depths outside are invalid. 0..100 and 0..1000 m; default 0.3 and 5. The values 0 and 65535 are always
     * invalid, and so is depth whose sigma is more than two truncations. */
    float min_depth_m, max_depth_m;
    /* Depth error: sigma(z) = base + slope z + growth z^2 (depth_noise_slope below). Pairs and fusion are weighted by 1/sigma^2 relative to that at 1 m.
     * 1e-6..1 m and 0..1 1/m; default 0.0001 and 0.003: a step of a Kinect 360's disparity (Khoshelham and Elberink
     * 2012, Section 3.2: 2.85 mm at 1 m). */
    float depth_noise_base_m, depth_noise_growth_per_m;

    /* ---- alignment (Section 2) ---- */

    /* Size of the maps: the depth size over a whole number. 0..4096 pixels; default 0, 0: the largest up to
     * max_align_width. */
    int32_t align_width, align_height;
    int32_t max_align_width; /* 16..4096 pixels; default 320 */
    int32_t against;         /* fathom_against; default FATHOM_AGAINST_MODEL */
    int32_t prior;           /* fathom_prior; default FATHOM_PRIOR_INFORMATION */
    /* Maximum iterations, coarsest to finest level, without a usable seed. 0..100 each, one of them at least 1;
     * default 10, 5, 4. */
    int32_t max_iterations[FATHOM_LEVELS];
    /* The same from a usable seed. Default 0, 0, 4. With FATHOM_PRIOR_INFORMATION either may be exceeded fourfold, while
     * an iteration moves the pose by more than its sigma. */
    int32_t max_seeded_iterations[FATHOM_LEVELS];
    /* A seed is usable when the sigma of its translation is at most this. 0..100 m; default 0.02. */
    float max_seed_sigma_m;
    /* Maps ray-cast from the surface serve further frames until the camera has moved or turned more than this, or a
     * tenth of the pairs is gone. 0..1e9; default 0.04 m and 0.06 rad; 0: a ray-cast per frame. */
    float max_model_reuse_m, max_model_reuse_rad;
    /* Maximum distance of a pair at the finest level; doubled at each coarser one; widened to three sigma of the seed.
     * 1e-4..10 m; default 0.1. */
    float max_pair_distance_m;
    /* maximum angle between the normals of a pair. 0.01..3.15 rad; default 0.7 (40 degrees) */
    float max_pair_angle_rad;
    float huber_m; /* residual beyond which a pair's weight falls off as 1/|r|. 1e-6..100 m; default 0.003 */
    /* an update below both ends a level. 0..1; default 1e-4 rad and 1e-4 m */
    float min_update_rad, min_update_m;
    float min_error_decrease; /* a smaller relative decrease of the error ends a level. -1e9..1; default 1e-4 */

    /* ---- verdict "tracking" (Section 2, last paragraph; docs/DESIGN.md gives the reasons for the defaults) ---- */

    float min_overlap; /* kept pairs over pixels where both scan and model have a surface. 0..1; default 0.35 */
    int32_t min_pairs; /* kept pairs at the finest level used. 0..1e9; default 0: one in 100 pixels */
    float max_rms_m;   /* weighted rms residual. 1e-6..1e9 m; default 0.01 */
    /* Condition number, centred and scaled, beyond which FATHOM_PRIOR_SEED rejects an alignment, and half of which is
     * sound enough to check the IMU by (by noise alone a bare wall has 30, rooms 2 to 8, a corridor up to 20).
     * 1..1e30; default 22. */
    float max_condition;
    float max_innovation_sigmas; /* distance from seed to result in sigmas of the seed. 0.1..1e30; default 6 */
    /* Of the pixels where the surface should be seen from the found pose and the frame has depth: the fraction that
     * agrees within agreement_tolerance_m, and the fraction that sees further, through the surface. 0..1; default
     * 0.75, 0.015. */
    float min_agreement, max_see_through;
    /* An alignment from a usable seed is evident when this fraction of the frame's valid pixels found pairs, and result
     * and seed agree within max_evident_sigmas; then no predicted view is ray-cast for comparison. 0..1e9; default 0.6
     * and 1.5; a fraction above 1: always compared. */
    float min_evident_fraction, max_evident_sigmas;
    /* across the surface, in addition to a voxel and three sigma of the depth. 1e-4..100 m; default 0.02 */
    float agreement_tolerance_m;
    /* Maximum sigma of a fused pose, inertia included, in the map or relative to the last tracked frame, whose surface is
     * in view: along a bare wall geometry gives no information, and a pose that inertia doesn't hold either isn't fused. 1e-4..1000; default 0.02 m and 0.02 rad. */
    float max_sigma_m, max_sigma_rad;

    /* ---- surface and memory ---- */

    float voxel_m;      /* edge of a voxel. 0.001..1 m; default 0.01 */
    float truncation_m; /* the signed distance is kept within this. 0..10 m; default 0: four voxels */
    int32_t max_blocks; /* blocks of 8x8x8 voxels, 2 KB each. 64..16777216; default 0: as many as max_memory_bytes
                           allows */
    int32_t when_full;  /* fathom_full: behaviour when no block is left. Default FATHOM_FULL_STOP */
    const fathom_block_store *block_store; /* with FATHOM_FULL_DROP. NULL: dropped blocks are gone. fathom_init copies
                                              the struct; the data behind its user pointer must outlive the context */
    float max_weight; /* observations, at 1 m, that a voxel averages; older ones fade. 1..1000; default 100 */
    /* fathom_step returns as soon as the pose is known, and the frame is fused while the next one is on its way: the
     * same poses, sooner. Calls that read the surface wait. A device that fails meanwhile is reported by the next call.
     * Default false. */
    bool fuse_behind;
    int64_t max_memory_bytes; /* host and device together. 1048576..1e15; default 128 MB (128 << 20) */

    /* ---- inertial sensor (Section 3) ---- */

    bool imu;             /* use inertial samples. Default true; without samples it does no harm */
    bool imu_translation; /* use the accelerometer; else constant velocity is assumed. Default true */
    /* Compare the IMU with the depth frames' motion and stop using it when it is wrong (fathom_imu_health). While it is
     * unchecked, alignment is also tried from the last velocity. Default true. */
    bool imu_check;
    float imu_to_camera_rotation[9];    /* row-major: v_camera = R v_imu. Default identity */
    float imu_to_camera_translation[3]; /* lever arm: the IMU's origin in camera axes. -10..10 m; default 0, 0, 0 */
    int64_t imu_clock_offset_ns;        /* added to an IMU stamp to get the depth clock. +-4e18 ns; default 0 */
    /* Refine that rotation and that offset while scanning, by comparing the gyroscope with the turning of well-
     * aligned frames (fathom_get_rig): for a rig whose values are a little wrong, or drift. Default false: they are
     * exact. */
    bool refine_rig;
    float rig_rotation_sigma_rad; /* sigma of the rotation about each axis, for refine_rig. 1e-6..1 rad; default 0.05 */
    int64_t rig_clock_sigma_ns;   /* and of the offset. 1000..1e9 ns; default 20e6 */
    float gravity_m_s2;           /* 0..100 m/s^2; default 9.80665 */
    /* Noise density of the gyroscope, scale errors included (a phone's noise alone: 1e-4). 0..10 rad/s/sqrt(Hz);
     * default 0.005. */
    float gyro_noise_rad_s_sqrthz;
    float gyro_bias_sigma_rad_s; /* of the bias before it is known. 0..10 rad/s; default 0.02 */
    /* Noise density of the accelerometer, scale errors and vibration included. 0..100 m/s^2/sqrt(Hz); default 0.05. */
    float accel_noise_m_s2_sqrthz;
    float accel_bias_sigma_m_s2; /* of the bias before it is known. 0..100 m/s^2; default 0.1 */
    /* Error of a seed per step beyond the sensors' noise (clock jitter, mounting, rolling shutter). 1e-6..10; default
     * 0.012 rad and 0.008 m. */
    float seed_noise_rad, seed_noise_m;
    /* Error of an accepted pose in addition to alignment's covariance, and of the navigator's motion from one to the
     * next. 0..1; default 0.006 rad and 0.004 m. */
    float pose_noise_rad, pose_noise_m;
    /* sigma of a hand-held camera's acceleration, where there is no accelerometer. 0..1000 m/s^2; default 1.5 */
    float motion_sigma_m_s2;
    float motion_sigma_rad_s2; /* of its angular acceleration, without a gyroscope. 0..1000 rad/s^2; default 3 */
    /* maximum position sigma of dead reckoning; beyond it the state is lost. 0.001..1000 m; default 0.5 */
    float max_reckoned_sigma_m;
    int32_t max_imu_samples; /* samples kept. 0..16777216; default 0: 4096 */
    /* replaces the library's InertialEstimate. Default NULL. Must outlive the context */
    fathom_inertial_hook inertial_hook;
    void *inertial_user;

    /* ---- start ---- */

    fathom_pose first_pose; /* of the first frame's camera; within 1e6 m. Default identity */

    /* ---- OpenCL ---- */

    /* "", or a part of a platform's or device's name, or "cpu", "gpu". Default NULL: as "", the first GPU that
     * shares the host's memory, else the first device. Read during init only. */
    const char *device;
    int32_t buffers; /* fathom_buffers; default FATHOM_BUFFERS_AUTO */
    /* Kernels that fathom_save_kernels wrote on a machine of the same kind; another device, driver or library version
     * gives FATHOM_ERROR_KERNEL. Default NULL: built from source, or from the cache. Read during init only. */
    const char *kernel_file;
    /* Where built kernels are kept. Default NULL: $XDG_CACHE_HOME/fathom or ~/.cache/fathom; "": no cache. Read
     * during init only. */
    const char *cache_folder;

    /* ---- log ---- */

    fathom_log log; /* default NULL: silent. Must outlive the context */
    void *log_user;

    /* ---- depth camera, further settings ---- */

    /* Depth error in proportion to the depth: sigma(z) = base + slope z + growth z^2. 0..1; default 0. */
    float depth_noise_slope;
    /* How the depth error grows with the depth is estimated from the frames, from the first one on. The settings then
     * give its scale, and its growth beyond the depths that were seen. Default true. */
    bool refine_depth_noise;
    uint8_t unused[3];
} fathom_config;

/* Fills *config with the default settings and sets its struct_size: fathom_config_init(&config). Returns FATHOM_OK, or
 * FATHOM_ERROR_ARGUMENT for NULL or an impossible size. Any thread. */
#define fathom_config_init(config) fathom_config_init_sized((config), sizeof *(config))
FATHOM_API int fathom_config_init_sized(fathom_config *config, size_t size);

/* Complete settings for three kinds of boards, which differ in the fields named here only. docs/PORTING.md gives the
 * time, memory and accuracy of each. */
typedef enum {
    FATHOM_PRESET_TINY = 0,  /* maps up to 160 wide, 2 cm voxels, 64 MB: a slow processor, a whole flat */
    FATHOM_PRESET_SMALL = 1, /* maps up to 320 wide, 1 cm voxels, 128 MB: the default settings */
    FATHOM_PRESET_LARGE = 2  /* maps up to 640 wide, 8 mm voxels, 256 MB: fine detail */
} fathom_preset;

/* Fills *config with a preset: fathom_config_preset(&config, FATHOM_PRESET_TINY). Returns FATHOM_OK, or
 * FATHOM_ERROR_ARGUMENT for NULL, an impossible size or a preset that doesn't exist (then *config has the default
 * settings). Any thread. */
#define fathom_config_preset(config, preset) fathom_config_preset_sized((config), sizeof *(config), (preset))
FATHOM_API int fathom_config_preset_sized(fathom_config *config, size_t size, int32_t preset);

/* ---- settings by name -------------------------------------------------------------------------------------------- */

typedef enum {
    FATHOM_SETTING_FLOAT = 0,
    FATHOM_SETTING_DOUBLE = 1,
    FATHOM_SETTING_INT32 = 2,
    FATHOM_SETTING_INT64 = 3,
    FATHOM_SETTING_BOOL = 4, /* "off" or "on"; "false" and "true" are read, too */
    FATHOM_SETTING_WORD = 5, /* an int32_t enumeration; one of words */
    FATHOM_SETTING_TEXT = 6  /* a const char *; "default" stands for NULL */
} fathom_setting_type;

/* Description of a setting. Every field of fathom_config has one, and so has every element of an array, except
 * struct_size, callbacks and their user pointers. Texts are static. */
typedef struct {
    uint32_t struct_size;
    int32_t type;          /* fathom_setting_type */
    const char *name;      /* as in C: "voxel_m", "max_iterations[0]", "depth_camera.fx" */
    const char *group;     /* "Alignment" */
    const char *unit;      /* "m", "rad/s"; "" for numbers without one */
    const char *words;     /* of a word or a bool, in order of value, separated by bars: "model|previous"; else "" */
    const char *meaning;   /* one line in English */
    double min, max;       /* the range, both ends allowed; 0, 0 for a text */
    char default_text[64]; /* as fathom_config_set takes it */
    char range_text[64];   /* "0.001..1", "model|previous", "text" */
    int32_t zero;          /* 1: the value 0 is allowed outside that range, too */
    int32_t unused;
} fathom_setting;

/* Setting number index, from 0 on, in the order of the manual. FATHOM_ERROR_NO_DATA beyond the last. Any thread. */
FATHOM_API int fathom_get_setting(int32_t index, fathom_setting *setting);

/* Sets one setting from text: fathom_config_set(&config, "voxel_m", "0.02"). Numbers are written as in C, with a
 * decimal point in every locale and nothing else around them. A text is not copied: it must live as long as
 * fathom_config says of its field. Returns FATHOM_OK; FATHOM_ERROR_NAME when there is no such setting, or the caller's
 * struct is too old to have it; FATHOM_ERROR_VALUE when the text is not a value of its type; FATHOM_ERROR_CONFIG when
 * the value is out of range. On an error *config is unchanged. fathom_init checks whether settings agree with each
 * other. Any thread. */
FATHOM_API int fathom_config_set(fathom_config *config, const char *name, const char *value);

/* Writes a setting's value as text from which fathom_config_set restores the same bits; truncated to size and
 * zero-terminated. Returns the length of the whole text (size or more: it was truncated), or FATHOM_ERROR_NAME. Any
 * thread. */
FATHOM_API int fathom_config_get(const fathom_config *config, const char *name, char *text, size_t size);

/* ---- memory and life --------------------------------------------------------------------------------------------- */

#define FATHOM_ALIGNMENT 128 /* of the block; an unaligned one works too: the size includes the padding */

typedef struct {
    uint32_t struct_size;
    int32_t blocks;                    /* blocks in the pool */
    int32_t align_width, align_height; /* the maps' size */
    int64_t host_bytes;                /* size of the block fathom_init needs */
    int64_t device_bytes;              /* memory of the OpenCL device in addition; 0 where buffers lie in the block */
    char device[128];                  /* name of the OpenCL device that the plan is for */
} fathom_memory_plan;

/* Bytes of the block that fathom_init needs, for the device it would choose; or FATHOM_ERROR_ARGUMENT, _CONFIG,
 * _MEMORY, _DEVICE. A failure writes its text into why (why_size bytes, zero-terminated; "" on success); NULL, 0: no
 * text. Any thread. */
FATHOM_API int64_t fathom_memory_required(const fathom_config *config, char *why, size_t why_size);

/* The same, itemised. Returns FATHOM_OK or an error. Any thread. */
FATHOM_API int fathom_plan_memory(const fathom_config *config, fathom_memory_plan *plan, char *why,
                                  size_t why_size);

/* Builds a context inside memory (size bytes, the caller's, until fathom_close). Opens the OpenCL device, builds the
 * kernels (about a second the first time, then from the cache) and runs each once on empty input. A block too small by
 * one byte is refused with FATHOM_ERROR_MEMORY and not touched. On any error *context is NULL, nothing stays open, and
 * the text is in why, as in fathom_memory_required. Any thread. */
FATHOM_API int fathom_init(fathom **context, const fathom_config *config, void *memory, size_t size,
                           char *why, size_t why_size);

/* Writes the built kernels, in every shape that these settings use, to a file for fathom_config.kernel_file: on a board
 * of the same kind, with the same runtime and settings, no compiler runs then. FATHOM_ERROR_KERNEL when the file can't
 * be written. Stepping thread. */
FATHOM_API int fathom_save_kernels(fathom *context, const char *path);

/* Waits for the device, releases it, forgets everything. The block is the caller's again. NULL is allowed. Stepping
 * thread, when no other thread pushes any more. */
FATHOM_API void fathom_close(fathom *context);

/* Forgets surface, pose and inertial history, and ends a pause, as after fathom_init. Counters and settings stay.
 * Stepping thread. */
FATHOM_API int fathom_reset(fathom *context);

/* With pause true, steps find the pose but fuse nothing (localisation only), until called with false. A scan that is
 * paused before its first frame has no surface yet and stays without. Stepping thread. */
FATHOM_API int fathom_pause(fathom *context, bool pause);

/* ---- input ------------------------------------------------------------------------------------------------------- */

/* Pushes a sample as it arrives; never blocks. Late, repeated, out-of-order, non-finite and implausible samples are
 * counted (fathom_counters) and dropped. A leap of either clock by more than 0.1 s is detected by the order of arrival:
 * after 0.2 s stamps are shifted to continue from where they were, with a message in the log. Returns FATHOM_OK;
 * FATHOM_ERROR_FULL when the ring has no room (the sample is dropped and counted: step more often, or raise
 * max_imu_samples); FATHOM_ERROR_ARGUMENT for NULL, a sample that isn't finite or stamped more than 126 years from zero
 * (counted as not finite), or one beyond 100 rad/s or 2000 m/s^2 (implausible); FATHOM_ERROR_DEVICE when the context is
 * dead. Sample thread. */
FATHOM_API int fathom_push_imu(fathom *context, const fathom_imu_sample *sample);

typedef enum {
    FATHOM_IMAGE_GREY8 = 0, /* 1 byte per pixel */
    FATHOM_IMAGE_RGB8 = 1,  /* 3 bytes (R, G, B) per pixel */
    FATHOM_IMAGE_BGR8 = 2,
    FATHOM_IMAGE_YUYV = 3,  /* 4 bytes (Y, U, Y, V) per 2 pixels; an even width */
    FATHOM_IMAGE_JPEG = 4   /* compressed: size_bytes of a JPEG stream */
} fathom_image_format;

/* An image that came with a depth frame. */
typedef struct {
    uint32_t struct_size;
    int32_t format;        /* fathom_image_format */
    int32_t width, height; /* pixels; 1..16384 */
    int64_t stride_bytes;  /* from row to row; 0: tight. 0 for a compressed image */
    int64_t size_bytes;    /* of data; 0: rows times stride. Required for a compressed image */
    int64_t timestamp_ns;  /* depth clock, middle of the exposure */
    const uint8_t *data;   /* the caller's, read during the call only */
} fathom_image;

/* A depth frame. Depth, its stride, size and stamp and confidence are used; exposure, row time and image are checked now
 * and used by later versions. */
typedef struct {
    uint32_t struct_size;
    int32_t width, height;        /* must be the settings' depth_camera.width, .height */
    int32_t row_stride_bytes;     /* of depth, from row to row: an even number from 2 * width on; 0: 2 * width */
    int64_t timestamp_ns;         /* depth clock, middle of the exposure; must increase; +-126 years */
    int64_t exposure_ns;          /* exposure time of each row; 0: unknown; maximum 1 s */
    int64_t row_time_ns;          /* from one row's exposure to the next one's (rolling shutter), negative from the
                                     bottom up; 0: unknown, or all at once; maximum 1 s for all rows */
    const uint16_t *depth;        /* height rows of width pixels, the caller's, read during the call only */
    const uint8_t *confidence;    /* height rows of width values, higher is surer; NULL: none */
    int64_t confidence_stride_bytes; /* from row to row, minimum width; 0: width */
    const fathom_image *image;    /* NULL: none */
} fathom_depth_frame;

/* ---- a step ------------------------------------------------------------------------------------------------------ */

typedef enum {
    FATHOM_FIRST = 0,    /* the first frame with a surface: fused at the first pose */
    FATHOM_TRACKED = 1,  /* aligned and trusted: fused, unless paused */
    FATHOM_RECKONED = 2, /* alignment not trusted: the pose is the inertial estimate's; nothing fused */
    FATHOM_LOST = 3      /* the same, and the pose's sigma exceeds max_reckoned_sigma_m */
} fathom_state;

/* "first", "tracked", "reckoned", "lost". Never NULL; static storage. Any thread. */
FATHOM_API const char *fathom_state_name(int32_t state);

/* Why a frame wasn't trusted (Section 2, "empirically determined error thresholds"). */
typedef enum {
    FATHOM_VERDICT_TRACKING = 0,
    FATHOM_VERDICT_NO_DEPTH = 1,   /* too few valid pixels in the frame */
    FATHOM_VERDICT_FEW_PAIRS = 2,  /* below min_pairs; or no search: when lost for long, one frame in 30 is searched */
    FATHOM_VERDICT_OVERLAP = 3,    /* below min_overlap */
    FATHOM_VERDICT_RESIDUAL = 4,   /* above max_rms_m */
    FATHOM_VERDICT_CONDITION = 5,  /* above max_condition */
    FATHOM_VERDICT_INNOVATION = 6, /* further from the seed than max_innovation_sigmas */
    FATHOM_VERDICT_CONTRADICTION = 7, /* the predicted view disagrees with the frame: min_agreement, max_see_through */
    FATHOM_VERDICT_UNCERTAIN = 8,  /* above max_sigma_m or max_sigma_rad, in the map and since the last tracked frame: the
                                      pose is returned, and the directions that geometry determines are used, but
                                      nothing is fused */
    FATHOM_VERDICT_DEVICE = 9      /* OpenCL failed in this step or before it: nothing is known of the frame */
} fathom_verdict;

/* "tracking", "no depth", "few pairs", ... Never NULL; static storage. Any thread. */
FATHOM_API const char *fathom_verdict_name(int32_t verdict);

/* The result of a step. Alignment figures are those of the last iteration at the finest level used; they are zero for a
 * first frame and where no pair was found. */
typedef struct {
    uint32_t struct_size;
    int32_t state;             /* fathom_state */
    int64_t timestamp_ns;      /* of the frame */
    fathom_pose pose;          /* camera to world, in the map. Jumps after relocalisation, or when the map corrects it.
                                  Always finite */
    double pose_covariance[36]; /* 6x6: alignment's where tracked, growing during dead reckoning */
    fathom_pose odometry;      /* the product of the motions from frame to frame, from first_pose on: drifts but never
                                  jumps, as a robot's control needs it */
    double odometry_covariance[36]; /* 6x6, growing from the first frame on: by the map's drift (1 mm and 0.1 degrees
                                       per root second) and during dead reckoning */
    int32_t verdict;           /* fathom_verdict */
    int32_t iterations;        /* over all levels and attempts, failed ones included */
    int32_t pairs;             /* n: kept correspondences */
    int32_t overlap_pixels;    /* pixels where scan and model both had a surface */
    /* sqrt(sum w r^2 / sum w), of the linear model after the update (Section 2: r = ||Ax - b||^2) */
    float rms_m;
    float weight;              /* sum of the pairs' weights; a perfect pair at 1 m weighs 1 */
    float singular_values[6];  /* of A, centred on the pairs and scaled by their spread, largest first */
    float condition;           /* kappa = largest / smallest singular value; INFINITY when the smallest is 0 */
    float prior_rotation_rad;  /* angle between the inertial seed and the result, also where alignment started elsewhere
                                  (searched) */
    float prior_translation_m; /* distance between the two */
    float innovation_sigmas;   /* Mahalanobis distance between the two under the seed's covariance */
    float agreement;           /* fraction of the pixels that should see the surface and agree with it; NAN: not
                                  compared */
    float see_through;         /* fraction of them that sees through it */
    bool searched;             /* alignment from the seed alone had failed, and poses around it were tried */
    bool seeded;               /* the seed was good enough for max_seeded_iterations */
    bool fused;                /* the frame was fused into the surface */
    bool pool_full;            /* some of the surface had no room left in the pool (tracking goes on) */
    bool by_velocity;          /* alignment started from the pose that the last velocity predicts (while the IMU is
                                  unchecked); prior_* and innovation_sigmas refer to that pose */
    int32_t blocks;            /* blocks in use */
    int32_t blocks_dropped, blocks_restored; /* by when_full, in this step */
    int32_t gyro_health, accel_health; /* fathom_imu_health of the inertial sensor so far */
    /* wall time of the stages; with fuse_behind, ms_fuse is the step's own part, and ms_maps may hold the rest of the
     * frame before */
    float ms_maps, ms_align, ms_fuse, ms_raycast;
    float ms_total;
    int32_t observed_directions; /* number of directions, of six, that the pairs alone determine to max_sigma_m (rotations
                                    about their centroid, times their spread); 0 where alignment wasn't used, and with
                                    FATHOM_PRIOR_SEED. The others are inertia's */
    float weakest_direction[6]; /* the direction that the pairs determine least, a twist in the camera's axes: rotation
                                   in rad, then translation in metres; zero where observed_directions isn't counted */
    float weakest_sigma_m;      /* sigma of the pose along it by the pairs alone (1 m at most): of so many times that
                                   twist */
    float shared_error_m;       /* sigma of the error that the pixels of a frame share, estimated while scanning: no
                                   alignment is surer. 0: unknown yet */
    int32_t contradicted;       /* 1: the surface contradicts a pose that inertia confirms, now or within the last half
                                   second: something moved, or the sensor sees what isn't there, as in glass. Fused once
                                   that has lasted 0.1 s */
} fathom_result;

/* One pass of the paper's loop (Figure 2): maps of the depth frame, seed from the inertial estimate, alignment,
 * verdict, fusion or dead reckoning. Push the IMU samples up to the frame's stamp first; where they end earlier, the
 * last rate is held. Returns FATHOM_OK also for frames that aren't tracked (see result->state); FATHOM_ERROR_TIME or
 * _SIZE for a frame that was ignored (then *result repeats the last pose); FATHOM_ERROR_DEVICE if OpenCL failed, now or
 * in an earlier call: *result repeats the last good pose and its stamp, with FATHOM_LOST and FATHOM_VERDICT_DEVICE, and
 * nothing is fused. Stepping thread. */
FATHOM_API int fathom_step(fathom *context, const fathom_depth_frame *frame, fathom_result *result);

#define FATHOM_RECENT 60 /* results that are kept */

/* Copies the latest results, up to FATHOM_RECENT and capacity, oldest first: the history of the current state. The
 * caller's array starts at *results; results->struct_size is the size of each element, and is set in all that are
 * written. Ignored frames are not among them; fathom_reset forgets them. Returns their number, or an error. Stepping
 * thread. */
FATHOM_API int32_t fathom_get_recent(fathom *context, fathom_result *results, int32_t capacity);

/* The relative camera motion between two stamps of the depth clock by inertial navigation alone (Section 3,
 * InertialEstimate): an error-state Kalman filter (Sola 2017, Section 5 and 6) integrates gyroscope and accelerometer
 * between interpolated samples, from the state that the accepted poses have corrected: orientation, velocity, position,
 * both biases, gravity. to_ns may lie before from_ns. FATHOM_ERROR_NO_DATA when there are neither samples nor a tracked
 * frame. Stepping thread. */
FATHOM_API int fathom_inertial_estimate(fathom *context, int64_t from_ns, int64_t to_ns,
                                        fathom_motion *motion);

/* The latest pose, camera to world, and, where not NULL, its 6x6 covariance. Stepping thread. */
FATHOM_API int fathom_get_pose(fathom *context, fathom_pose *pose, double covariance[36]);

/* The camera's motion over the last second: from the last frame that is at least 1 s older than the latest one, or from
 * the first frame while the scan is younger, to the latest one. Unlike two poses' covariances it says what is known of
 * the one relative to the other. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    int64_t from_ns, to_ns; /* the stamps of the two frames; the same in the first frame */
    fathom_pose motion;     /* inv(M_from) M_to, of the poses in the map */
    double covariance[36];  /* 6x6, rotation then translation, in the later camera's axes */
} fathom_span;

/* FATHOM_ERROR_NO_DATA before the first frame. Stepping thread. */
FATHOM_API int fathom_get_span(fathom *context, fathom_span *span);

/* Extrinsics and clock offset of the IMU as the library uses them: the settings or, with refine_rig, the best estimate
 * so far. About an axis without any turns the sigma keeps its initial value. */
typedef struct {
    uint32_t struct_size;
    int32_t intervals;               /* pairs of frames that were compared; 0 without refine_rig */
    float imu_to_camera_rotation[9]; /* row-major: v_camera = R v_imu */
    float rotation_sigma[3];         /* rad, about the camera's axes; 0 without refine_rig */
    int64_t imu_clock_offset_ns;     /* added to an IMU stamp to get the depth clock; without detected leaps
                                        (imu_clock_leaps) */
    int64_t clock_sigma_ns;          /* of that; 0 without refine_rig */
} fathom_rig;

/* fathom_reset goes back to the settings. A later scan may start from these values as its settings. Stepping thread. */
FATHOM_API int fathom_get_rig(fathom *context, fathom_rig *rig);

/* Counts since fathom_init. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    int64_t imu_accepted;   /* samples taken into the history */
    int64_t imu_not_finite; /* dropped: NaN or infinite */
    int64_t imu_out_of_order; /* dropped: a stamp that repeats or goes back */
    int64_t imu_overrun;    /* dropped: the ring was full */
    int64_t imu_implausible; /* dropped: an impossible value (beyond 100 rad/s or 2000 m/s^2), or a glitch of one sample
                                (5 rad/s or 100 m/s^2 from both neighbours) */
    int64_t imu_gaps;       /* pauses of more than five sample periods */
    int64_t imu_clock_leaps; /* leaps between the IMU's clock and the frames', after which stamps were shifted back */
    int64_t imu_doubts;     /* times that the gyroscope began to contradict the poses and was ignored */
    int64_t frames_ignored; /* depth frames refused for their stamp or size */
    int64_t blocks_dropped, blocks_restored; /* by when_full */
    int64_t blocks_refused; /* blocks that found the pool full */
    int64_t blocks_lost;    /* blocks that the block store couldn't keep or read back */
} fathom_counters;

/* The counters so far. Stepping thread. */
FATHOM_API int fathom_get_counters(fathom *context, fathom_counters *counters);

/* ---- surface ----------------------------------------------------------------------------------------------------- */

/* A view of the surface. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    fathom_pinhole camera; /* 1..16384 pixels each way; FATHOM_LENS_PINHOLE */
    fathom_pose pose;      /* camera to world */
    float near_m, far_m;   /* range of the ray-cast depths, metres; 0: 0.1 and 20 */
} fathom_view;

/* Ray-casts the surface (Newcombe et al. 2011, Section 3.3) into the caller's buffers of width*height pixels, row by
 * row: depth in metres along the optical axis (0: nothing there), normals as 3 floats in the view's camera axes,
 * pointing to the camera, of length 1, rounded to a tenth of a degree. Either may be NULL. Only the fronts of surfaces
 * are visible, so that a room can be viewed from outside. Stepping thread. */
FATHOM_API int fathom_cast_view(fathom *context, const fathom_view *view, float *depth, float *normals);

/* A corner of a triangle. */
typedef struct {
    float position[3]; /* world, metres */
    float normal[3];   /* world, unit length, pointing out of the surface (to where the camera was) */
} fathom_vertex;

/* Receives triangle_count triangles, three vertices each, counter-clockwise seen from outside. Corners that triangles
 * share are bit-equal. Up to 16,000 voxels from the origin a triangle has three different corners, and no two triangles
 * have the same three: corners keep 1/256 of a voxel from voxel centres. Valid during the call. Returns 0 to go on;
 * anything else stops (FATHOM_ERROR_STOPPED). */
typedef int (*fathom_triangles)(void *user, const fathom_vertex *vertices, size_t triangle_count);

/* Streams the surface's triangles (marching cubes, Lorensen and Cline 1987) to the callback in batches, in bounded
 * memory: those of the block store's blocks in the order of its list, then those of the pool's in the order in which
 * they were made. A stored block that is in the pool again comes with the pool's. There are no seams between the two,
 * and neither the pool nor the store is changed, so that the scan may go on; stored blocks are read into a patch of 512
 * blocks (1 MB, which FATHOM_FULL_DROP takes from max_memory_bytes), each up to 20 times, fewest when the list goes
 * along the surface. Voxels with a summed weight below min_weight, in observations at 1 m, are left out (0: all that
 * were seen count). Returns the number of triangles, or an error. Stepping thread. */
FATHOM_API int64_t fathom_extract_mesh(fathom *context, float min_weight, fathom_triangles triangles,
                                       void *user);

#define FATHOM_BLOCK_TRIANGLES 2560 /* maximum of a block */

typedef enum {
    FATHOM_MESH_WHOLE = 0, /* the block store's blocks and the pool's, as fathom_extract_mesh */
    FATHOM_MESH_POOL = 1   /* the pool's only */
} fathom_mesh_part;

/* State of pulling the same mesh in pieces. Zeroed fields begin a pull; one that has come to its end may be used
 * again. */
typedef struct {
    uint32_t struct_size;
    int32_t capacity;           /* triangles that vertices has room for; at least FATHOM_BLOCK_TRIANGLES */
    fathom_vertex *vertices;    /* the caller's: three per triangle */
    int64_t next_stored, next_made; /* the library's: where the next piece begins */
    float min_weight;           /* as in fathom_extract_mesh */
    int32_t part;               /* fathom_mesh_part */
} fathom_mesh_pull;

/* Writes the triangles of the next blocks, as many as fit. Returns their number; 0 at the end; or an error, after which
 * the pull begins anew. Without steps in between, the pieces are those of fathom_extract_mesh. Steps are allowed: the
 * pull then goes on along the surface as it is by then, with seams where it has changed, and blocks that moved between
 * pool and store meanwhile may be missing or come twice. Stepping thread. */
FATHOM_API int64_t fathom_pull_mesh(fathom *context, fathom_mesh_pull *pull);

/* State of pulling the blocks of the pool in pieces: all of them, or those that have changed, to save a map or to show
 * it while it grows. Zeroed fields begin a pull. */
typedef struct {
    uint32_t struct_size;
    int32_t capacity; /* blocks that the arrays have room for; at least 1 */
    /* only blocks that may have changed after this generation of the surface; 0: all. At the end it becomes the
     * generation in which the pull began: the next pull returns the changes since */
    int64_t since;
    /* the library's: the generation in which the pull began; rises with each frame that is fused */
    int64_t generation;
    int64_t next;           /* the library's: where the next piece begins */
    fathom_block_key *keys; /* the caller's: one per block */
    int16_t *distances;     /* the caller's: FATHOM_BLOCK_VOXELS per block, as in fathom_block; NULL: not wanted */
    uint16_t *weights;      /* the same */
} fathom_block_pull;

/* Writes the next blocks, in the order in which they were made, as many as fit. Returns their number; 0 at the end; or
 * an error. Steps may come between pieces: a block that changes meanwhile is returned in its new state, and again by
 * the next pull; a dropped one isn't returned (the block store has it). After fathom_reset all blocks are new. Stepping
 * thread. */
FATHOM_API int32_t fathom_pull_blocks(fathom *context, fathom_block_pull *pull);

/* ---- self-test --------------------------------------------------------------------------------------------------- */

typedef enum {
    FATHOM_CHECK_PASSED = 0,
    FATHOM_CHECK_FAILED = 1, /* the kernel's output differs from the reference, or an OpenCL call failed */
    FATHOM_CHECK_SKIPPED = 2
} fathom_check;

/* Receives the outcome of a check: the kernel's name, and one line on the failure or the reason for skipping, else "".
 * The texts are valid during the call. Returns 0 to go on; anything else stops (FATHOM_ERROR_STOPPED). */
typedef int (*fathom_selftest_report)(void *user, const char *kernel, fathom_check outcome, const char *why);

/* Runs every OpenCL kernel on the device that the settings choose and compares its output with a plain C reference: on
 * random images of odd sizes, on frames without any depth, at edges and limits. Of the settings only the device, the
 * buffers, the log, cache_folder and kernel_file matter. Takes some seconds, and some tens of megabytes of the heap,
 * which it frees. Any thread. Returns the number of checks that failed, or an error. */
FATHOM_API int fathom_selftest(const fathom_config *config, fathom_selftest_report report, void *user);

#ifdef __cplusplus
}
#endif

#endif
