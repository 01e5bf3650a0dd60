/*
 * libfathom-drivers: sources of depth frames and inertial samples. The core (fathom.h) doesn't need it, and neither
 * does a rig that reads its camera itself.
 *
 * Recording folders in the TUM RGB-D / ETH3D SLAM layout come first, then live sources.
 *
 *     fathom_recording_options options = {.struct_size = sizeof options, .log = my_log};
 *     fathom_recording *recording;
 *     fathom_recording_open(&recording, "kitchen", &options);
 *     fathom_config config;
 *     fathom_config_init(&config);
 *     fathom_recording_configure(recording, &config);        // size, intrinsics, depth scale, mounting
 *     ...                                                    // fathom_init; then, for each frame i:
 *     fathom_recording_read_depth(recording, i, pixels);
 *     ...                                                    // push recording->imu up to it, fathom_step
 *     fathom_recording_close(recording);
 *
 * Structs grow like those of fathom.h: set struct_size. fathom_recording_frame and fathom_recording_pose never change.
 *
 * Unlike the core, drivers take memory from the heap. Functions return FATHOM_OK or a negative fathom_error; the log
 * gets one line for each error and warning, which names the file and, in text files, the line: "imu.txt:12: ...".
 * Different recordings may be used by different threads.
 */
#ifndef FATHOM_DRIVERS_H
#define FATHOM_DRIVERS_H

#include "fathom.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- recording folders --------------------------------------------------------------------------------- */

/*
 * Text files hold one record per line, with numbers separated by blanks or tabs. Empty lines and text after a # are
 * comments; line ends may be CR LF. Stamps are seconds and are kept to the nanosecond.
 *
 *   depth.txt        `t file`, files relative to the folder; greyscale PNGs of 16 bits, 0 and 65535 invalid.
 *                    Needed. A line that can't be read is an error. A frame whose stamp doesn't come after
 *                    the one before it is left out with a warning.
 *   calibration.txt  `fx fy cx cy [k1 k2 p1 p2 [k3 [k4 k5 k6]]]`, pixels. Without it: 525 525 319.5 239.5 at
 *                    640x480, scaled to the size.
 *   imu.txt          `t gx gy gz ax ay az`, rad/s and m/s^2. Optional.
 *   groundtruth.txt  `t tx ty tz qx qy qz qw`, camera to world. Optional. In both, lines that can't be read,
 *                    aren't finite or go back in time are left out with one warning.
 *   rig.txt          `key values`: depth_scale, imu_to_camera_rotation, imu_to_camera_translation,
 *                    imu_clock_offset, gravity, color_intrinsics, color_to_depth_rotation,
 *                    color_to_depth_translation, depth_noise, confidence_min. Optional. A key that isn't known
 *                    gets a warning, a value that can't be read is an error.
 *   confidence.txt   `t file`, PNGs for the depth frames of those stamps; higher is surer. Optional.
 *
 * A folder of the Stray Scanner app (camera_matrix.csv, odometry.csv, imu.csv, depth/, confidence/) is read as it is.
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
    fathom_pose pose;
} fathom_recording_pose;

/* Options for opening a recording. All fields but struct_size may be zero: everything from the files, silently. */
typedef struct {
    uint32_t struct_size;
    const char *imu_file;         /* instead of imu.txt (a path, used as it is). "": no IMU. NULL: imu.txt */
    double depth_units_per_metre; /* instead of rig.txt's depth_scale. 0: rig.txt's */
    fathom_pinhole camera;        /* instead of calibration.txt's; its size is ignored. fx 0: the file's */
    fathom_log log;               /* NULL: silent. Must outlive the recording */
    void *log_user;
} fathom_recording_options;

/* An open recording. Read-only; it and the data behind its pointers live until fathom_recording_close. struct_size is
 * the size that the library gives the struct. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    const char *folder;

    fathom_pinhole camera; /* of the depth; its size is the first frame's */
    double depth_units_per_metre;
    bool intrinsics_assumed;  /* no calibration.txt, no option: TUM's default is used */
    bool depth_units_assumed; /* not in rig.txt, no option: 5000 (TUM, ETH3D) is used */

    double imu_to_camera_rotation[9];    /* row-major: v_camera = R v_imu */
    double imu_to_camera_translation[3]; /* metres, the IMU's origin in camera axes */
    int64_t imu_clock_offset_ns;         /* added to an IMU stamp to get the depth clock */
    double gravity;                      /* m/s^2; 0: not given */

    bool has_color_camera;      /* given in rig.txt; else colour is registered or unknown */
    fathom_pinhole color_camera; /* of unknown size: 0 x 0 */
    fathom_pose color_to_depth; /* maps points in the colour camera's axes to the depth camera's */

    int frame_count;
    const fathom_recording_frame *frames; /* by time */
    int imu_count;
    const fathom_imu_sample *imu; /* by time, IMU clock, as fathom_push_imu takes them */
    int pose_count;
    const fathom_recording_pose *poses; /* by time */
    const char *const *confidence; /* a file per frame, or NULL; NULL: there are none */
    int32_t min_confidence;        /* below it a pixel doesn't count; 0: rig.txt doesn't say */
    bool has_depth_noise;          /* rig.txt has it */
    uint8_t unused_too[3];
    double depth_noise[3];         /* sigma(z) = a + b z + c z^2, metres */
} fathom_recording;

/* Opens a folder: reads its text files, the size of its first depth frame and, where no depth scale is given, a few
 * frames to check it: a median depth below 0.5 m or above 8 m gives a warning with the likelier scale. Returns
 * FATHOM_OK; FATHOM_ERROR_NO_DATA when a file is missing or can't be read; FATHOM_ERROR_CONFIG for an impossible value
 * in a file; FATHOM_ERROR_ARGUMENT for one in the options; FATHOM_ERROR_MEMORY. On an error *recording is NULL. options
 * may be NULL. */
FATHOM_API int fathom_recording_open(fathom_recording **recording, const char *folder,
                                     const fathom_recording_options *options);

/* NULL is allowed. */
FATHOM_API void fathom_recording_close(fathom_recording *recording);

/* Sets in *config the values that the recording has: depth size, intrinsics, distortion, depth scale, mounting, clock
 * offset, and gravity when rig.txt has it. The rest stays. FATHOM_ERROR_ARGUMENT without a struct_size. */
FATHOM_API int fathom_recording_configure(const fathom_recording *recording, fathom_config *config);

/* The same from a folder that describes a live rig: rig.txt's mounting, clock offset and gravity, and calibration.txt's
 * intrinsics for frames of *config's size; at least one of the files must be there. rig.txt's depth_scale applies to
 * recordings and is ignored. The errors of fathom_recording_open; log may be NULL. */
FATHOM_API int fathom_rig_configure(const char *folder, fathom_config *config, fathom_log log,
                                    void *log_user);

/* Reads depth frame number index (0..frame_count-1) into width*height pixels, row by row. FATHOM_ERROR_NO_DATA when the
 * file is missing, cut short or damaged; FATHOM_ERROR_SIZE when its size differs from the first frame's;
 * FATHOM_ERROR_ARGUMENT. After an error the pixels are undefined. */
FATHOM_API int fathom_recording_read_depth(const fathom_recording *recording, int index, uint16_t *pixels);

/* Reads the confidences of depth frame number index, width*height bytes, row by row; higher is surer. FATHOM_ERROR_NO_DATA when
 * it has none, or the file is missing or damaged; FATHOM_ERROR_SIZE; FATHOM_ERROR_ARGUMENT. After an error the pixels are
 * undefined. */
FATHOM_API int fathom_recording_read_confidence(const fathom_recording *recording, int index, uint8_t *pixels);

/* The reference pose at a stamp (depth clock): between two poses at most 40 ms apart it is interpolated
 * (position linearly, rotation on the sphere), else it is the nearest one within 20 ms. FATHOM_ERROR_NO_DATA
 * when there is none. */
FATHOM_API int fathom_recording_pose_at(const fathom_recording *recording, int64_t timestamp_ns,
                                        fathom_pose *pose);

/* ---- sources ------------------------------------------------------------------------------------------- */

/*
 * A source is a device or a recording that supplies depth frames, inertial samples or both:
 *
 *     fathom_source *camera;
 *     fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
 *     fathom_source_open(&camera, "openni2:", NULL);             // the first one that can be opened
 *     fathom_source_start(camera);
 *     while (fathom_source_wait(camera, 1000) == FATHOM_OK)      // or FATHOM_ERROR_TIMEOUT, _CANCELLED, _ENDED
 *         while (fathom_source_read_depth(camera, &frame) == FATHOM_OK)
 *             fathom_step(scan, frame.depth, &result);
 *     fathom_source_close(camera);
 *
 * Stamps are on the host's monotonic clock (CLOCK_MONOTONIC); recordings (folder, .oni) keep their own stamps. A driver
 * maps the device's clock, where it has one, to the host's and tracks its drift.
 *
 * One thread at a time uses a source; fathom_source_cancel and fathom_source_get_status may run concurrently on any
 * other thread (cancel in a signal handler too), but nothing may run concurrently with fathom_source_close. Opening and
 * starting take memory from the heap; waiting and reading don't.
 */

/* Kinds of data of a source; or-ed. */
enum { FATHOM_SOURCE_DEPTH = 1, FATHOM_SOURCE_IMU = 2, FATHOM_SOURCE_COLOR = 4 };

typedef enum {
    FATHOM_SOURCE_STOPPED = 0,   /* open, not started */
    FATHOM_SOURCE_RUNNING = 1,
    FATHOM_SOURCE_STALLED = 2,   /* started, and silent for ten periods (minimum half a second) */
    FATHOM_SOURCE_UNPLUGGED = 3, /* the device is gone; with reconnect it is searched for twice per second */
    FATHOM_SOURCE_AT_END = 4     /* a recording has been read to its end */
} fathom_source_state;

/* "stopped", "running", ... Never NULL. */
FATHOM_API const char *fathom_source_state_name(int32_t state);

/* A driver, built in or not. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    const char *name; /* as in uris */
    const char *what; /* a description */
    bool built;       /* this build has it */
} fathom_source_driver_info;

/* Driver number index, from 0 on; false: beyond the last, or info's struct_size isn't set. Any thread. */
FATHOM_API bool fathom_source_driver(int index, fathom_source_driver_info *info);

/* A device that a driver has found, or the reason why a driver can find none. */
typedef struct {
    uint32_t struct_size; /* the library's: the callback may read that much */
    uint32_t kinds;     /* FATHOM_SOURCE_DEPTH, ...; 0: no device but a problem of the driver */
    const char *driver; /* "folder", "openni2", "hid", "usb", "iio", "udp" */
    char uri[256];      /* the uri for fathom_source_open */
    char name[96];      /* maker and model */
    char serial[64];    /* "" where there is none */
    int32_t error;      /* FATHOM_OK: it can be opened; else the reason why not */
    char problem[256];  /* a description, with the fix ("" when FATHOM_OK) */
} fathom_source_info;

/* Receives one device; valid during the call. Returns 0 to go on. */
typedef int (*fathom_source_found)(void *user, const fathom_source_info *info);

/* Enumerates the devices that each driver finds; a driver that isn't built in or lacks something is reported with kinds
 * 0. driver: one of the names above, or NULL for all. Returns the number of devices, or an error. Any thread. */
FATHOM_API int fathom_sources_enumerate(const char *driver, fathom_source_found found, void *user,
                                        fathom_log log, void *log_user);

/* Options for opening a source. All fields but struct_size may be zero. */
typedef struct {
    uint32_t struct_size;
    uint32_t kinds;              /* kinds of data to gather: FATHOM_SOURCE_DEPTH, ...; 0: all */
    bool reconnect;              /* after unplugging, wait for the same device and go on */
    int32_t width, height;       /* depth: requested pixels; 0: 640x480, or the nearest mode */
    double rate_hz;              /* requested frames or samples per second; 0: the driver's default */
    double speed;                /* recordings: 1 as recorded, 2 twice as fast, 0: as fast as they are read */
    bool color;                  /* also colour, registered to the depth, where the device has it */
    int32_t imu_capacity;        /* samples kept between reads; 0: 2048. When full, the oldest is dropped and counted */
    /* depth frames kept between reads; 0: 3. When full, the oldest is dropped and counted */
    int32_t frame_capacity;
    fathom_log log; /* NULL: silent. Called from the source's own threads too. Must outlive the source */
    void *log_user;
} fathom_source_options;

typedef struct fathom_source fathom_source;

/* Opens the device that uri names: `driver:rest`, where the driver defines rest (docs/DRIVERS.md); empty: its first
 * device. A folder's path is short for `folder:path`. On an error *source is NULL, and the log has the fix. */
FATHOM_API int fathom_source_open(fathom_source **source, const char *uri,
                                  const fathom_source_options *options);

/* NULL is allowed; stops first. */
FATHOM_API void fathom_source_close(fathom_source *source);

/* Begins to gather. FATHOM_ERROR_ARGUMENT for a source that is started, which goes on as before; also for one at its
 * end or unplugged: stop it first. After fathom_source_stop it starts anew, a recording from its beginning. */
FATHOM_API int fathom_source_start(fathom_source *source);

/* Ends gathering, within half a second whatever the device does. Data that arrived before can still be read. FATHOM_OK
 * also for a source that isn't started. */
FATHOM_API int fathom_source_stop(fathom_source *source);

/* Waits until a depth frame or a sample can be read: FATHOM_OK, or FATHOM_ERROR_TIMEOUT (timeout_ms; negative: no
 * limit), _CANCELLED, _ENDED, _UNPLUGGED, or the error that ended it; FATHOM_ERROR_ARGUMENT when it isn't started and
 * nothing is left to read. */
FATHOM_API int fathom_source_wait(fathom_source *source, int timeout_ms);

/* Makes the running fathom_source_wait, or the next one, return FATHOM_ERROR_CANCELLED at once (within 50 ms). Any
 * thread; safe in a signal handler. */
FATHOM_API void fathom_source_cancel(fathom_source *source);

/* A depth frame of a source. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    const fathom_depth_frame *depth; /* for fathom_step; with the colour image of that time, if there is one, where
                                        options.color is set; the source's, valid until the next read, stop or close */
    int64_t arrival_ns;       /* CLOCK_MONOTONIC, when the host had all of it */
    int64_t device_ns;        /* the device's own stamp; 0: none */
    int64_t index;            /* the device's frame number; jumps where frames were lost */
} fathom_source_frame;

/* The oldest unread frame; FATHOM_ERROR_TIMEOUT when there is none. Never waits. */
FATHOM_API int fathom_source_read_depth(fathom_source *source, fathom_source_frame *frame);

/* Up to capacity samples, oldest first; returns their number, 0 when there is none. Never waits. gyro is NaN for a
 * sensor without a gyroscope (Kinect for Xbox 360). */
FATHOM_API int fathom_source_read_imu(fathom_source *source, fathom_imu_sample *samples, int capacity);

/* Properties and state of a source. */
typedef struct {
    uint32_t struct_size;
    int32_t state;                /* fathom_source_state */
    uint32_t kinds;               /* FATHOM_SOURCE_DEPTH, ... */
    char name[96], serial[64];
    /* of the depth; computed from the field of view where the device has no intrinsics. 0 x 0: no depth */
    fathom_pinhole camera;
    double depth_units_per_metre;
    double rate_hz;               /* measured over about the last second; 0: not yet */
    int64_t frames, samples;      /* received whole */
    int64_t frames_dropped, samples_dropped; /* because they weren't read in time */
    int64_t lost;                 /* missing by the device's numbering */
    int64_t malformed;            /* invalid reports, packets or frames, which were dropped */
    int64_t unplugged, reconnects, stalls; /* number of times */
    double clock_offset_s;        /* host minus device, where the device has a clock */
    double clock_drift_ppm;       /* of the device's clock against the host's */
} fathom_source_status;

/* Any thread. */
FATHOM_API int fathom_source_get_status(fathom_source *source, fathom_source_status *status);

/* Sets in *config the values that the source has: size, intrinsics, depth scale; for a folder, and for IMUs with a
 * known mounting, the mounting too. The rest stays. FATHOM_ERROR_ARGUMENT without a struct_size. */
FATHOM_API int fathom_source_configure(fathom_source *source, fathom_config *config);

/* ---- sinks --------------------------------------------------------------------------------------------- */

/*
 * A sink writes a recording, which a folder source reads:
 *
 *     fathom_sink *sink;
 *     fathom_sink_open(&sink, "folder:kitchen", NULL);
 *     fathom_sink_write_rig(sink, &rig);                       // calibration.txt, rig.txt
 *     fathom_sink_write_depth(sink, &frame);                   // for each frame, and from a thread of its own:
 *     fathom_sink_write_imu(sink, samples, count);
 *     if (fathom_sink_close(sink)) ...                         // something couldn't be written
 *
 * A folder grows as it is written, and can be read whenever the writing stops (a kill, a full disk): its lists name
 * only complete files, and every text file ends with a whole line. At most half a second of samples waits in memory.
 *
 * Errors: FATHOM_ERROR_WRITE, with the file and the system's reason in the log and in fathom_sink_last_error. Data
 * written before stays whole and counted, and other kinds can still be written; fathom_sink_close returns the first
 * error.
 * Threads: one thread uses a sink; fathom_sink_write_imu may run concurrently on another one, but not concurrently with
 * fathom_sink_copy_imu, _flush and _close. fathom_sink_get_status and _last_error: any thread until _close.
 * Stamps are the caller's, on one clock; those of samples are on the IMU's.
 */
typedef struct fathom_sink fathom_sink;

/* Options for opening a sink. */
typedef struct {
    uint32_t struct_size;
    bool force;         /* write into a folder that isn't empty, after removing the recording in it (only that) */
    const char *header; /* comment lines for the top of each list; NULL: none. Copied */
    fathom_log log;     /* NULL: silent. Called on the thread that called the sink. Must outlive it */
    void *log_user;
} fathom_sink_options;

/* Description of the rig. */
typedef struct {
    uint32_t struct_size;
    bool has_imu;                          /* the imu_* fields and gravity hold */
    fathom_pinhole camera;                 /* of the depth */
    double depth_units_per_metre;
    double imu_to_camera_rotation_deg[3];  /* rotation vector: v_camera = R v_imu */
    double imu_to_camera_translation_m[3]; /* the IMU's origin in camera axes */
    int64_t imu_clock_offset_ns;           /* added to an IMU stamp to get the depth clock */
    double gravity;                        /* m/s^2; 0: left out */
    const char *lines_of; /* without has_imu: a folder whose rig.txt is copied, except its depth_scale; NULL: none */
    int32_t min_confidence; /* the frames' confidence below which a pixel doesn't count; 0: left out */
    uint32_t unused;
} fathom_sink_rig;

/* Counts of data written: complete on the disk, as far as the system reports. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    int64_t frames, images, poses, samples;
    int64_t first_ns, last_ns;      /* stamps of the frames */
    int64_t frame_bytes, imu_bytes; /* frames, images and poses with their lists; samples */
} fathom_sink_status;

/* Opens the recording that uri names for writing: `folder:PATH`, or a path alone. Creates the folder and those above
 * it. options may be NULL. On an error *sink is NULL, and the log has the reason. */
FATHOM_API int fathom_sink_open(fathom_sink **sink, const char *uri, const fathom_sink_options *options);

/* calibration.txt and rig.txt; a later call replaces them. */
FATHOM_API int fathom_sink_write_rig(fathom_sink *sink, const fathom_sink_rig *rig);

/* A depth frame and its confidence, if any (confidence.txt), as PNGs of 16 and 8 bits. Its image isn't written. */
FATHOM_API int fathom_sink_write_depth(fathom_sink *sink, const fathom_depth_frame *frame);

/* A colour image (rgb.txt). FATHOM_ERROR_UNSUPPORTED for formats other than FATHOM_IMAGE_RGB8. */
FATHOM_API int fathom_sink_write_image(fathom_sink *sink, const fathom_image *image);

/* Samples, in order of time (imu.txt, created with the first one). Floats are read back exactly. */
FATHOM_API int fathom_sink_write_imu(fathom_sink *sink, const fathom_imu_sample *samples, int count);

/* Copies imu.txt of another recording folder, line by line, in place of samples; does nothing where it has none. */
FATHOM_API int fathom_sink_copy_imu(fathom_sink *sink, const char *folder);

/* A reference pose at a stamp of the depth clock (groundtruth.txt). Write it before its frame: then each frame has one
 * whenever the writing stops. */
FATHOM_API int fathom_sink_write_pose(fathom_sink *sink, int64_t timestamp_ns, const fathom_pose *pose);

/* Writes the samples that wait; all other data is written at once. (Nothing is forced out of the system's cache.) */
FATHOM_API int fathom_sink_flush(fathom_sink *sink);

FATHOM_API int fathom_sink_get_status(fathom_sink *sink, fathom_sink_status *status);

/* The first error's text, "" without one; lives as long as the sink. */
FATHOM_API const char *fathom_sink_last_error(fathom_sink *sink);

/* Writes waiting data and closes. NULL is allowed. FATHOM_OK, or the first error that any call on the sink returned. */
FATHOM_API int fathom_sink_close(fathom_sink *sink);

#ifdef __cplusplus
}
#endif

#endif
