/* The common parts of inertial sources: a thread that polls the device, reconnecting, and the queue behind
 * fathom_source_*. A driver supplies functions that open its device, make it stream, poll it and close it. */
#ifndef FATHOM_IMU_SOURCE_H
#define FATHOM_IMU_SOURCE_H

#include "imu/imu_stream.h"
#include "source.h"

#define IMU_SOURCE_SLICE_MS 50 /* the longest that a poll may wait: the thread looks for a stop in between */

/* The fix for a device that may not be opened. */
#define IMU_UDEV_FIX                                                                                         \
    "copy drivers/udev/60-fathom-imu.rules to /etc/udev/rules.d ('make install' does the like), then "       \
    "'udevadm control --reload' and plug it in again"

typedef struct imu_source imu_source;

typedef struct {
    /* Finds and opens the device. quiet: reconnecting; no messages. FATHOM_OK or an error. */
    int (*open)(imu_source *source, bool quiet);
    /* Makes it stream. Called by start and after a reconnect; NULL: nothing to do. */
    int (*begin)(imu_source *source);
    /* Waits for a maximum of IMU_SOURCE_SLICE_MS and passes readings to source->stream: FATHOM_OK,
     * FATHOM_ERROR_TIMEOUT, or the error that ends it: FATHOM_ERROR_UNPLUGGED, ... */
    int (*poll)(imu_source *source);
    /* Undoes begin; the device is still open. NULL: nothing to do. */
    void (*end)(imu_source *source);
    /* Closes it; may be called when it isn't open. */
    void (*shut)(imu_source *source);
} imu_device;

struct imu_source {
    fathom_source base;
    const imu_device *device;
    source_queue queue;
    imu_stream stream;
    pthread_t thread;
    bool is_open, accel_only;
    pthread_mutex_t lock; /* of the names, which a reconnect may change */
    char name[96], serial[64];
};

/* size: of the driver's structure, which begins with an imu_source. Zeroed otherwise; the driver fills in its part and
 * calls imu_source_open. NULL: no memory, after a log message. */
imu_source *imu_source_make(size_t size, const imu_device *device, const fathom_source_options *options);

/* Opens the device for the first time; on an error everything is freed and *source is NULL. */
int imu_source_open(fathom_source **source, imu_source *made);

/* To be called from open: describes the device. */
void imu_source_describe(imu_source *source, const char *name, const char *serial, bool accel_only);

/* Reports a driver that finds no device; returns the callback's result. */
int imu_source_sees_none(const char *driver, const char *name, const char *problem, fathom_source_found found,
                         void *user);

#endif
