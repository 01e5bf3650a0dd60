/* Shared by the parts of the OpenNI2 driver. */
#ifndef FATHOM_OPENNI2_INTERNAL_H
#define FATHOM_OPENNI2_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

/* OniCTypes.h uses these names as C++ does. */
typedef struct _OniDevice _OniDevice;
typedef struct _OniStream _OniStream;
typedef struct _OniRecorder _OniRecorder;
#include <OniCAPI.h>
#include <OniCProperties.h>

#include "clock_map.h"
#include "source.h"
#include "source_queue.h"

/* ---- openni2_library.c: libOpenNI2 itself ---- */

/* Starts it if necessary; each source and each enumeration holds it. It is shut down when the program ends: each start
 * and end loses memory (2.2.0.33 with Debian's drivers: 138 kB). FATHOM_OK, or an error with the reason in `why`. */
int openni2_hold(char *why, size_t size);
void openni2_release(void);

/* Serialises opening, closing and listing of devices within the process. */
void openni2_lock(void);
void openni2_unlock(void);

/* A thread that runs job(user), an idle one or a new one; NULL: none could be created. Threads that have waited for
 * frames may not end: libOpenNI2 2.2 remembers each of them and asks by pthread_kill(thread, 0) whether it still lives,
 * which crashes when it doesn't. */
typedef struct openni2_worker openni2_worker;
openni2_worker *openni2_hire(void (*job)(void *user), void *user);

/* Waits until the job has returned. */
void openni2_dismiss(openni2_worker *worker);

/* libOpenNI2's last error message on this thread, as one line. */
const char *openni2_words(char *text, size_t size);

/* ---- openni2_usb.c: depth cameras on the USB, whether OpenNI2 finds them or not ---- */

typedef struct {
    int vendor, product, bus, address;
    const char *name;   /* from the table of cameras; NULL: not in the table */
    const char *plugin; /* name of OpenNI2's driver for it */
    char path[128];     /* in sysfs */
} openni2_usb;

/* root: "" (a folder that holds sys and dev, for tests). Returns their number, maximum `most`. */
int openni2_usb_list(const char *root, openni2_usb *cameras, int most);

/* FATHOM_OK, FATHOM_ERROR_PERMISSION, _BUSY, or _NO_DEVICE; the reason and the fix in `why`. */
int openni2_usb_fault(const char *root, const openni2_usb *camera, char *why, size_t size);

/* ---- openni2_device.c: an open device with its streams ---- */

typedef struct {
    char uri[ONI_MAX_STR]; /* libOpenNI2's name of it */
    char name[96], serial[64];
    OniDeviceHandle device;       /* NULL: not open */
    OniStreamHandle depth, color; /* color NULL: none */
    OniVideoMode mode;
    bool mirrored; /* its frames are mirrored, and mirroring can't be switched off */
    float fov[2];  /* radians, horizontal and vertical */
} openni2_device;

/* The requested mode of a device. */
typedef struct {
    int width, height; /* pixels */
    double rate_hz;
    OniPixelFormat format; /* of depth */
    bool color;
} openni2_wish;

/* The mode nearest to the wish: by size, then rate, then format. NULL: no mode has depth in known units. */
const OniVideoMode *openni2_choose_mode(const OniVideoMode *modes, int count, const openni2_wish *wish);

/* Opens device->uri. FATHOM_OK, or an error with its reason in `why`; then nothing stays open. */
int openni2_device_open(openni2_device *device, const openni2_wish *wish, char *why, size_t size);
void openni2_device_close(openni2_device *device);

/* The serial number of an open device; "" when it has none. */
void openni2_device_serial(OniDeviceHandle device, char *serial, size_t size);

/* The error code and reason of a failed oniDeviceOpen. */
int openni2_open_fault(const char *uri, char *why, size_t size);

/* ---- openni2_frame.c ---- */

/* Whether every field of the frame agrees with the mode; else `why` has the difference. */
bool openni2_frame_is_good(const OniFrame *frame, const OniVideoMode *mode, char *why, size_t size);

/* Copy pixels row by row, reversed when mirrored. */
void openni2_copy_depth(const OniFrame *frame, bool mirrored, uint16_t *depth);
void openni2_copy_color(const OniFrame *frame, bool mirrored, uint8_t *color);

/* ---- openni2_gather.c: the thread ---- */

typedef struct {
    fathom_source base;
    openni2_wish wish;
    openni2_device device;                 /* owned by the worker while there is one */
    char name[96], serial[64];             /* of the device */
    fathom_pinhole camera; /* as first opened */
    double units_per_metre;
    source_queue queue;
    openni2_worker *worker; /* NULL: stopped */
    OniCallbackHandle watch;
    pthread_mutex_t watch_lock;
    char watched[ONI_MAX_STR]; /* the last opened device's uri, under watch_lock */
    atomic_bool gone;          /* libOpenNI2 has reported that it was unplugged */
    clock_map clock;
    int last_index;   /* of the device's frames; 0: none yet */
    uint8_t *color;   /* the newest colour frame */
    int64_t color_ns; /* its stamp, device's clock */
    bool has_color;
    int complaints; /* of bad frames, written to the log */
} openni2_source;

/* Starts the open device's streams. */
int openni2_start_streams(openni2_source *source, char *why, size_t size);

/* Makes `gone` refer to this device from now on. */
void openni2_watch(openni2_source *source, const char *uri);

/* user: an openni2_source whose streams have been started. */
void openni2_gather(void *user);

#endif
