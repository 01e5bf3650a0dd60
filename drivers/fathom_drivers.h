/*
 * libfathom-drivers: where depth frames and inertial samples come from. The core (fathom.h) never needs it; a
 * rig with a camera of its own doesn't either.
 *
 * So far: recording folders in the TUM RGB-D / ETH3D SLAM layout.
 *
 *     fathom_recording_options options = {.log = my_log};
 *     fathom_recording *recording;
 *     fathom_recording_open(&recording, "kitchen", &options);
 *     fathom_config config = fathom_config_default();
 *     fathom_recording_configure(recording, &config);        // size, intrinsics, depth scale, mounting
 *     ...                                                    // fathom_init; then, for each frame i:
 *     fathom_recording_read_depth(recording, i, pixels);
 *     ...                                                    // push recording->imu up to it, fathom_step
 *     fathom_recording_close(recording);
 *
 * Unlike the core, drivers take memory from the heap. Functions return FATHOM_OK or a negative fathom_error;
 * the log gets one line for each error and warning, which names the file and, in text files, the line:
 * "imu.txt:12: ...". Different recordings may be used by different threads.
 */
#ifndef FATHOM_DRIVERS_H
#define FATHOM_DRIVERS_H

#include "fathom.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- recording folders --------------------------------------------------------------------------------- */

/*
 * Text files hold one record a line, numbers apart by blanks or tabs. Empty lines and what follows a # are
 * comments; line ends may be CR LF. Stamps are seconds and are kept to the nanosecond.
 *
 *   depth.txt        `t file`, files relative to the folder; greyscale PNGs of 16 bits, 0 and 65535 invalid.
 *                    Needed. A line that can't be read is an error. A frame whose stamp doesn't come after
 *                    the one before it is left out with a warning.
 *   calibration.txt  `fx fy cx cy [k1 k2 p1 p2 [k3]]`, pixels. Without it: 525 525 319.5 239.5 at 640x480,
 *                    scaled to the size.
 *   imu.txt          `t gx gy gz ax ay az`, rad/s and m/s^2. Optional.
 *   groundtruth.txt  `t tx ty tz qx qy qz qw`, camera to world. Optional. In both, lines that can't be read,
 *                    aren't finite or go back in time are left out with one warning.
 *   rig.txt          `key values`: depth_scale, imu_to_camera_rotation, imu_to_camera_translation,
 *                    imu_clock_offset, gravity, color_intrinsics, color_to_depth_rotation,
 *                    color_to_depth_translation. Optional. A key that isn't known gets a warning, a value
 *                    that can't be read is an error.
 */

/* A depth frame of a recording. */
typedef struct {
    int64_t timestamp_ns; /* depth clock */
    const char *file;     /* as depth.txt has it */
    int line;             /* of depth.txt, from 1 */
} fathom_recording_frame;

/* A reference pose, camera to world. */
typedef struct {
    int64_t timestamp_ns; /* depth clock */
    double position[3];   /* metres */
    double quaternion[4]; /* x y z w, unit length */
} fathom_recording_pose;

/* How to open a recording. All zero is usable: everything from the files, silently. */
typedef struct {
    const char *imu_file;         /* instead of imu.txt (a path as it is). "": no IMU. NULL: imu.txt */
    double depth_units_per_metre; /* instead of rig.txt's depth_scale. 0: rig.txt's */
    double intrinsics[4];         /* fx fy cx cy instead of calibration.txt's. All 0: the file's */
    fathom_log log;               /* NULL: silent. Must outlive the recording */
    void *log_user;
} fathom_recording_options;

/* An open recording. To be read only; it and what it points to live until fathom_recording_close. */
typedef struct {
    const char *folder;

    int width, height;    /* pixels, of the first depth frame */
    double intrinsics[4]; /* fx fy cx cy, pixels */
    double distortion[5]; /* k1 k2 p1 p2 k3 (Brown-Conrady, OpenCV's order) */
    double depth_units_per_metre;
    bool intrinsics_assumed;  /* no calibration.txt, no option: the TUM default was taken */
    bool depth_units_assumed; /* not in rig.txt, no option: 5000 (TUM, ETH3D) was taken */

    double imu_to_camera_rotation[9];    /* row-major: v_camera = R v_imu */
    double imu_to_camera_translation[3]; /* metres, the IMU's origin in camera axes */
    int64_t imu_clock_offset_ns;         /* added to an IMU stamp to get the depth clock */
    double gravity;                      /* m/s^2; 0: not given */

    bool has_color_intrinsics;            /* rig.txt has them; else colour is registered or unknown */
    double color_intrinsics[4];           /* fx fy cx cy, pixels */
    double color_to_depth_rotation[9];    /* row-major: v_depth = R v_color + t */
    double color_to_depth_translation[3]; /* metres */

    int frame_count;
    const fathom_recording_frame *frames; /* by time */
    int imu_count;
    const fathom_imu_sample *imu; /* by time, IMU clock, as fathom_push_imu takes them */
    int pose_count;
    const fathom_recording_pose *poses; /* by time */
} fathom_recording;

/* Opens a folder: reads its text files, the size of its first depth frame and, when nobody stated the depth
 * scale, a few frames to judge it: a median depth under 0.5 m or over 8 m gets a warning that names the
 * likelier scale. Returns FATHOM_OK; FATHOM_ERROR_NO_DATA when a file is missing or can't be read;
 * FATHOM_ERROR_CONFIG when one says something impossible; FATHOM_ERROR_ARGUMENT when the options do;
 * FATHOM_ERROR_MEMORY. On an error *recording is NULL. options may be NULL. */
FATHOM_API int fathom_recording_open(fathom_recording **recording, const char *folder,
                                     const fathom_recording_options *options);

/* NULL is allowed. */
FATHOM_API void fathom_recording_close(fathom_recording *recording);

/* Sets what the recording knows in *config: depth size, intrinsics, distortion, depth scale, mounting, clock
 * offset, and gravity when rig.txt has it. The rest stays. */
FATHOM_API void fathom_recording_configure(const fathom_recording *recording, fathom_config *config);

/* Reads depth frame number index (0..frame_count-1) into width*height pixels, row by row.
 * FATHOM_ERROR_NO_DATA when the file is missing, cut short or damaged; FATHOM_ERROR_SIZE when it has another
 * size than the first frame; FATHOM_ERROR_ARGUMENT. After an error the pixels are undefined. */
FATHOM_API int fathom_recording_read_depth(const fathom_recording *recording, int index, uint16_t *pixels);

/* The reference pose at a stamp (depth clock): between two poses at most 40 ms apart it is interpolated
 * (position linearly, rotation on the sphere), else it is the nearest one within 20 ms. FATHOM_ERROR_NO_DATA
 * when there is none. */
FATHOM_API int fathom_recording_pose_at(const fathom_recording *recording, int64_t timestamp_ns,
                                        fathom_recording_pose *pose);

#ifdef __cplusplus
}
#endif

#endif
