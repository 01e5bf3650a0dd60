/*
 * libfathom-drivers: where depth frames and inertial samples come from. The core (fathom.h) never needs it; a
 * rig with a camera of its own doesn't either.
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
 * Structs grow as those of fathom.h do: set struct_size. fathom_recording_frame and fathom_recording_pose never change.
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
    fathom_pose pose;
} fathom_recording_pose;

/* How to open a recording. Zero beside struct_size is usable: everything from the files, silently. */
typedef struct {
    uint32_t struct_size;
    const char *imu_file;         /* instead of imu.txt (a path as it is). "": no IMU. NULL: imu.txt */
    double depth_units_per_metre; /* instead of rig.txt's depth_scale. 0: rig.txt's */
    fathom_pinhole camera;        /* instead of calibration.txt's; its size isn't looked at. fx 0: the file's */
    fathom_log log;               /* NULL: silent. Must outlive the recording */
    void *log_user;
} fathom_recording_options;

/* An open recording. To be read only; it and what it points to live until fathom_recording_close. The library's own, so
 * struct_size says how much of it this library has. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    const char *folder;

    fathom_pinhole camera; /* of the depth; its size is the first frame's */
    double depth_units_per_metre;
    bool intrinsics_assumed;  /* no calibration.txt, no option: the TUM default was taken */
    bool depth_units_assumed; /* not in rig.txt, no option: 5000 (TUM, ETH3D) was taken */

    double imu_to_camera_rotation[9];    /* row-major: v_camera = R v_imu */
    double imu_to_camera_translation[3]; /* metres, the IMU's origin in camera axes */
    int64_t imu_clock_offset_ns;         /* added to an IMU stamp to get the depth clock */
    double gravity;                      /* m/s^2; 0: not given */

    bool has_color_camera;      /* rig.txt has it; else colour is registered or unknown */
    fathom_pinhole color_camera; /* of unknown size: 0 x 0 */
    fathom_pose color_to_depth; /* maps points in the colour camera's axes to the depth camera's */

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
 * offset, and gravity when rig.txt has it. The rest stays. FATHOM_ERROR_ARGUMENT without a struct_size. */
FATHOM_API int fathom_recording_configure(const fathom_recording *recording, fathom_config *config);

/* The same from a folder that describes a live rig: rig.txt's mounting, clock offset and gravity, and calibration.txt's
 * intrinsics for frames of *config's size; at least one of the files must be there. rig.txt's depth_scale is the
 * recording's, and isn't taken. The errors of fathom_recording_open; log may be NULL. */
FATHOM_API int fathom_rig_configure(const char *folder, fathom_config *config, fathom_log log, void *log_user);

/* Reads depth frame number index (0..frame_count-1) into width*height pixels, row by row.
 * FATHOM_ERROR_NO_DATA when the file is missing, cut short or damaged; FATHOM_ERROR_SIZE when it has another
 * size than the first frame; FATHOM_ERROR_ARGUMENT. After an error the pixels are undefined. */
FATHOM_API int fathom_recording_read_depth(const fathom_recording *recording, int index, uint16_t *pixels);

/* The reference pose at a stamp (depth clock): between two poses at most 40 ms apart it is interpolated
 * (position linearly, rotation on the sphere), else it is the nearest one within 20 ms. FATHOM_ERROR_NO_DATA
 * when there is none. */
FATHOM_API int fathom_recording_pose_at(const fathom_recording *recording, int64_t timestamp_ns,
                                        fathom_pose *pose);

/* ---- sources ------------------------------------------------------------------------------------------- */

/*
 * A source is a device, or something that takes its place, which gives depth frames, inertial samples or both:
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
 * Stamps are on the host's monotonic clock (CLOCK_MONOTONIC), except for recordings' (folder, .oni), which are their
 * own. A driver whose device has a clock of its own maps it and tracks its drift.
 *
 * One thread at a time uses a source; fathom_source_cancel and fathom_source_get_status may run beside it on any
 * other (cancel in a signal handler too), but nothing may run beside fathom_source_close. Opening and starting take
 * memory from the heap; waiting and reading don't.
 */

/* What a source gives; or-ed. */
enum { FATHOM_SOURCE_DEPTH = 1, FATHOM_SOURCE_IMU = 2, FATHOM_SOURCE_COLOR = 4 };

typedef enum {
    FATHOM_SOURCE_STOPPED = 0,   /* open, not started */
    FATHOM_SOURCE_RUNNING = 1,
    FATHOM_SOURCE_STALLED = 2,   /* started, and silent for ten periods (half a second at least) */
    FATHOM_SOURCE_UNPLUGGED = 3, /* the device is gone; with reconnect it is looked for twice a second */
    FATHOM_SOURCE_AT_END = 4     /* a recording has been read to its end */
} fathom_source_state;

/* "stopped", "running", ... Never NULL. */
FATHOM_API const char *fathom_source_state_name(int32_t state);

/* A driver that there could be. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    const char *name; /* as in uris */
    const char *what; /* in words */
    bool built;       /* this build has it */
} fathom_source_driver_info;

/* The drivers by number, from 0; false: there is no such number, or info's struct_size isn't set. Any thread. */
FATHOM_API bool fathom_source_driver(int index, fathom_source_driver_info *info);

/* A device that a driver sees, or what keeps a driver from seeing any. */
typedef struct {
    uint32_t struct_size; /* the library's: what the callback may read */
    uint32_t kinds;     /* FATHOM_SOURCE_DEPTH, ...; 0: not a device but a remark on the driver (problem) */
    const char *driver; /* "folder", "openni2", "hid", "usb", "iio", "udp" */
    char uri[256];      /* what fathom_source_open takes */
    char name[96];      /* maker and model */
    char serial[64];    /* "" where there is none */
    int32_t error;      /* FATHOM_OK: it can be opened; else why it can't */
    char problem[256];  /* in words, with the fix ("" when FATHOM_OK) */
} fathom_source_info;

/* Gets one device; valid during the call. Returns 0 to go on. */
typedef int (*fathom_source_found)(void *user, const fathom_source_info *info);

/* Names what each driver sees; drivers that aren't built in or lack something say so (kinds 0). driver: one of the
 * names above, or NULL for all. Returns the number of devices, or an error. Any thread. */
FATHOM_API int fathom_sources_enumerate(const char *driver, fathom_source_found found, void *user,
                                        fathom_log log, void *log_user);

/* How to open a source. Zero beside struct_size is usable. */
typedef struct {
    uint32_t struct_size;
    uint32_t kinds;              /* what is wanted of it: FATHOM_SOURCE_DEPTH, ... Only that is gathered; 0: all it has */
    bool reconnect;              /* look for the same device again when it was unplugged */
    int32_t width, height;       /* depth: pixels wanted; 0: 640x480, or the nearest there is */
    double rate_hz;              /* frames or samples a second wanted; 0: the driver's usual */
    double speed;                /* recordings: 1 as recorded, 2 twice as fast, 0: as fast as they are read */
    bool color;                  /* depth with colour registered to it, where there is any */
    int32_t imu_capacity;        /* samples kept between reads; 0: 2048. When full, the oldest is dropped and counted */
    int32_t frame_capacity;      /* depth frames kept between reads; 0: 3. When full, the oldest is dropped and counted */
    fathom_log log;              /* NULL: silent. Called from the source's own threads too. Must outlive the source */
    void *log_user;
} fathom_source_options;

typedef struct fathom_source fathom_source;

/* Opens the device that uri names: `driver:rest`, where rest is the driver's (docs/DRIVERS.md); empty: its first. A path
 * of a folder is short for `folder:path`. On an error *source is NULL, and the log says what to do. */
FATHOM_API int fathom_source_open(fathom_source **source, const char *uri, const fathom_source_options *options);

/* NULL is allowed; stops first. */
FATHOM_API void fathom_source_close(fathom_source *source);

/* Begins to gather. A source that is started refuses (FATHOM_ERROR_ARGUMENT) and goes on as before, also when it has come to
 * its end or was unplugged: stop it first. After fathom_source_stop it starts anew, a recording from its beginning. */
FATHOM_API int fathom_source_start(fathom_source *source);

/* Ends gathering, within half a second whatever the device does. What arrived before can still be read. FATHOM_OK also for a
 * source that isn't started. */
FATHOM_API int fathom_source_stop(fathom_source *source);

/* Waits until a depth frame or a sample can be read: FATHOM_OK, or FATHOM_ERROR_TIMEOUT (timeout_ms; negative: no limit),
 * _CANCELLED, _ENDED, _UNPLUGGED, or what else ended it; FATHOM_ERROR_ARGUMENT when it isn't started and nothing is left to
 * read. */
FATHOM_API int fathom_source_wait(fathom_source *source, int timeout_ms);

/* Lets a fathom_source_wait that is under way, or the next one, return FATHOM_ERROR_CANCELLED at once (50 ms at most). Any
 * thread; safe in a signal handler. */
FATHOM_API void fathom_source_cancel(fathom_source *source);

/* A depth frame of a source. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    const fathom_depth_frame *depth; /* as fathom_step takes it, with the colour image where options.color asked for it and one
                                 was taken at that time; the source's, valid until the next read, stop or close */
    int64_t arrival_ns;       /* CLOCK_MONOTONIC, when the host had it whole */
    int64_t device_ns;        /* the device's own stamp; 0: none */
    int64_t index;            /* the device's frame number; jumps where frames were lost */
} fathom_source_frame;

/* The oldest frame that wasn't read yet; FATHOM_ERROR_TIMEOUT when there is none. Never waits. */
FATHOM_API int fathom_source_read_depth(fathom_source *source, fathom_source_frame *frame);

/* Up to capacity samples, oldest first; returns their number, 0 when there is none. Never waits. gyro is NaN for a sensor
 * without a gyroscope (Kinect for Xbox 360). */
FATHOM_API int fathom_source_read_imu(fathom_source *source, fathom_imu_sample *samples, int capacity);

/* What a source is and how it fares. */
typedef struct {
    uint32_t struct_size;
    int32_t state;                /* fathom_source_state */
    uint32_t kinds;               /* FATHOM_SOURCE_DEPTH, ... */
    char name[96], serial[64];
    fathom_pinhole camera;        /* of the depth; from the field of view where the device doesn't know it. 0 x 0: no depth */
    double depth_units_per_metre;
    double rate_hz;               /* as measured over the last second or so; 0: not yet */
    int64_t frames, samples;      /* received whole */
    int64_t frames_dropped, samples_dropped; /* because nobody read them in time */
    int64_t lost;                 /* that the device's own numbers show to be missing */
    int64_t malformed;            /* reports, packets or frames that made no sense and were dropped */
    int64_t unplugged, reconnects, stalls; /* times */
    double clock_offset_s;        /* host minus device, where the device has a clock */
    double clock_drift_ppm;       /* of the device's clock against the host's */
} fathom_source_status;

/* Any thread. */
FATHOM_API int fathom_source_get_status(fathom_source *source, fathom_source_status *status);

/* Sets what the source knows in *config: size, intrinsics, depth scale; for a folder and for IMUs with a known mounting that
 * too. The rest stays. FATHOM_ERROR_ARGUMENT without a struct_size. */
FATHOM_API int fathom_source_configure(fathom_source *source, fathom_config *config);

/* ---- sinks --------------------------------------------------------------------------------------------- */

/*
 * A sink writes a recording, the counterpart of what a source of recordings reads:
 *
 *     fathom_sink *sink;
 *     fathom_sink_open(&sink, "folder:kitchen", NULL);
 *     fathom_sink_write_rig(sink, &rig);                       // calibration.txt, rig.txt
 *     fathom_sink_write_depth(sink, &frame);                   // for each frame, and from a thread of its own:
 *     fathom_sink_write_imu(sink, samples, count);
 *     if (fathom_sink_close(sink)) ...                         // something couldn't be written
 *
 * A folder grows as it is written, and whenever the writing stops (a kill, a full disk) what is there can be read: depth.txt
 * and rgb.txt name files that are whole, every text file ends with a line's end. At most half a second of samples waits
 * in memory.
 *
 * Errors: FATHOM_ERROR_WRITE, with the file and the system's reason in the log and in fathom_sink_last_error. What was
 * written before stays whole and counted, and other kinds can still be written; fathom_sink_close returns the first error.
 * Threads: one thread uses a sink; fathom_sink_write_imu may run on another one beside it, but not beside
 * fathom_sink_copy_imu, _flush and _close. fathom_sink_get_status and _last_error: any thread until _close.
 * Stamps are the caller's, of one clock; those of samples the IMU's.
 */
typedef struct fathom_sink fathom_sink;

/* How to open a sink. */
typedef struct {
    uint32_t struct_size;
    bool force;         /* write into a folder that isn't empty, after removing a recording that is in it (and nothing else) */
    const char *header; /* lines that stand as comments at the top of each list; NULL: none. Copied */
    fathom_log log;     /* NULL: silent. Called on the thread that called the sink. Must outlive it */
    void *log_user;
} fathom_sink_options;

/* What is known of the rig. */
typedef struct {
    uint32_t struct_size;
    bool has_imu;                          /* the imu_* fields and gravity hold */
    fathom_pinhole camera;                 /* of the depth */
    double depth_units_per_metre;
    double imu_to_camera_rotation_deg[3];  /* rotation vector: v_camera = R v_imu */
    double imu_to_camera_translation_m[3]; /* the IMU's origin in camera axes */
    int64_t imu_clock_offset_ns;           /* added to an IMU stamp to get the depth clock */
    double gravity;                        /* m/s^2; 0: left out */
    const char *lines_of; /* without has_imu: a folder whose rig.txt is copied, all but its depth_scale; NULL: none */
} fathom_sink_rig;

/* What has been written: whole on the disk, as far as the system tells. */
typedef struct {
    uint32_t struct_size;
    uint32_t unused;
    int64_t frames, images, poses, samples;
    int64_t first_ns, last_ns;      /* stamps of the frames */
    int64_t frame_bytes, imu_bytes; /* frames, images and poses with their lists; samples */
} fathom_sink_status;

/* Opens the recording that uri names for writing: `folder:PATH`, or a path alone. The folder and those above it are made.
 * options may be NULL. On an error *sink is NULL, and the log says why. */
FATHOM_API int fathom_sink_open(fathom_sink **sink, const char *uri, const fathom_sink_options *options);

/* calibration.txt and rig.txt; a later call replaces them. */
FATHOM_API int fathom_sink_write_rig(fathom_sink *sink, const fathom_sink_rig *rig);

/* A frame of depth, as a 16-bit PNG that is named by its stamp. Its confidence and image aren't written. */
FATHOM_API int fathom_sink_write_depth(fathom_sink *sink, const fathom_depth_frame *frame);

/* A colour image (rgb.txt). FATHOM_ERROR_UNSUPPORTED for another format than FATHOM_IMAGE_RGB8. */
FATHOM_API int fathom_sink_write_image(fathom_sink *sink, const fathom_image *image);

/* Samples, in order of time (imu.txt, made at the first one). A float is read back as it was. */
FATHOM_API int fathom_sink_write_imu(fathom_sink *sink, const fathom_imu_sample *samples, int count);

/* imu.txt of another recording folder, line by line, in place of samples; a folder without one has none. */
FATHOM_API int fathom_sink_copy_imu(fathom_sink *sink, const char *folder);

/* A reference pose at a stamp of the depth clock (groundtruth.txt). Written before its frame, each frame has one whenever the
 * writing stops. */
FATHOM_API int fathom_sink_write_pose(fathom_sink *sink, int64_t timestamp_ns, const fathom_pose *pose);

/* Hands the samples that wait to the system; all else is written at once. (Nothing is forced out of the system's cache.) */
FATHOM_API int fathom_sink_flush(fathom_sink *sink);

FATHOM_API int fathom_sink_get_status(fathom_sink *sink, fathom_sink_status *status);

/* The first error's text, "" without one; lives as long as the sink. */
FATHOM_API const char *fathom_sink_last_error(fathom_sink *sink);

/* Writes what waits and closes. NULL is allowed. FATHOM_OK, or the first error that any call on the sink returned. */
FATHOM_API int fathom_sink_close(fathom_sink *sink);

#ifdef __cplusplus
}
#endif

#endif
