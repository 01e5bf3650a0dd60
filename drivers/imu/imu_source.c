#include "imu/imu_source.h"

#include <stdio.h>
#include <stdlib.h>

#include "monotonic.h"
#include "source_log.h"

#define LOOK_AGAIN_NS 500000000

static imu_source *of(fathom_source *source) {
    return (imu_source *)source;
}

static void shut(imu_source *s) {
    s->device->shut(s);
    s->is_open = false;
}

static int open_device(imu_source *s, bool quiet) {
    const int result = s->device->open(s, quiet);
    s->is_open = result == FATHOM_OK;
    if (!s->is_open) s->device->shut(s);
    return result;
}

static int begin(imu_source *s) {
    imu_stream_restart(&s->stream, s->accel_only);
    return s->device->begin ? s->device->begin(s) : FATHOM_OK;
}

/* False: stopped before the device was back. */
static bool wait_for_device(imu_source *s) {
    for (;;) {
        if (!source_queue_sleep_until(&s->queue, monotonic_now_ns() + LOOK_AGAIN_NS)) return false;
        if (open_device(s, true) != FATHOM_OK) continue;
        if (begin(s) == FATHOM_OK) return true;
        shut(s);
    }
}

static void *run(void *user) {
    imu_source *s = user;
    while (source_queue_is_running(&s->queue)) {
        const int result = s->device->poll(s);
        if (result == FATHOM_OK || result == FATHOM_ERROR_TIMEOUT) continue;
        shut(s);
        if (result != FATHOM_ERROR_UNPLUGGED || !s->base.options.reconnect) {
            source_queue_end(&s->queue, result);
            return NULL;
        }
        source_warn(&s->base.options, "%s is unplugged; waiting for it to come back", s->name);
        source_queue_unplugged(&s->queue);
        if (!wait_for_device(s)) return NULL;
        source_queue_replugged(&s->queue);
    }
    return NULL;
}

static int start(fathom_source *source) {
    imu_source *s = of(source);
    int result = s->is_open ? FATHOM_OK : open_device(s, false);
    if (result) return result;
    if ((result = begin(s)) != FATHOM_OK) return result;
    source_queue_start(&s->queue);
    if (pthread_create(&s->thread, NULL, run, s)) {
        source_queue_stop(&s->queue);
        if (s->device->end) s->device->end(s);
        return source_fail(&s->base.options, FATHOM_ERROR_MEMORY, "%s: no thread to be had", s->name);
    }
    return FATHOM_OK;
}

static void stop(fathom_source *source) {
    imu_source *s = of(source);
    source_queue_stop(&s->queue);
    pthread_join(s->thread, NULL);
    if (s->is_open && s->device->end) s->device->end(s);
}

static int wait_for_samples(fathom_source *source, int timeout_ms) {
    return source_queue_wait(&of(source)->queue, timeout_ms);
}

static void cancel(fathom_source *source) {
    source_queue_cancel(&of(source)->queue);
}

static int read_imu(fathom_source *source, fathom_imu_sample *samples, int capacity) {
    return source_queue_read_imu(&of(source)->queue, samples, capacity);
}

static int status(fathom_source *source, fathom_source_status *out) {
    imu_source *s = of(source);
    source_queue_status(&s->queue, out);
    imu_stream_status(&s->stream, out);
    out->kinds = FATHOM_SOURCE_IMU;
    pthread_mutex_lock(&s->lock);
    snprintf(out->name, sizeof out->name, "%s", s->name);
    snprintf(out->serial, sizeof out->serial, "%s", s->serial);
    pthread_mutex_unlock(&s->lock);
    return FATHOM_OK;
}

static void close_source(fathom_source *source) {
    imu_source *s = of(source);
    shut(s);
    imu_stream_free(&s->stream);
    source_queue_free(&s->queue);
    pthread_mutex_destroy(&s->lock);
    free(s);
}

static const source_operations operations = {.start = start,
                                             .stop = stop,
                                             .wait = wait_for_samples,
                                             .cancel = cancel,
                                             .read_imu = read_imu,
                                             .status = status,
                                             .close = close_source};

imu_source *imu_source_make(size_t size, const imu_device *device, const fathom_source_options *options) {
    imu_source *s = calloc(1, size);
    if (s && source_queue_make(&s->queue, options->imu_capacity, 0, 0, 0, false)) {
        free(s);
        s = NULL;
    }
    if (!s) {
        source_fail(options, FATHOM_ERROR_MEMORY, "no memory for a source");
        return NULL;
    }
    s->base = (fathom_source){.does = &operations, .options = *options};
    s->device = device;
    pthread_mutex_init(&s->lock, NULL);
    imu_stream_init(&s->stream, &s->queue);
    return s;
}

int imu_source_open(fathom_source **source, imu_source *made) {
    const int result = open_device(made, false);
    if (result)
        close_source(&made->base);
    else
        *source = &made->base;
    return result;
}

void imu_source_describe(imu_source *source, const char *name, const char *serial, bool accel_only) {
    pthread_mutex_lock(&source->lock);
    snprintf(source->name, sizeof source->name, "%s", name);
    snprintf(source->serial, sizeof source->serial, "%s", serial);
    pthread_mutex_unlock(&source->lock);
    source->accel_only = accel_only;
}

int imu_source_sees_none(const char *driver, const char *name, const char *problem, fathom_source_found found,
                         void *user) {
    fathom_source_info info = {.struct_size = sizeof info, .driver = driver, .error = FATHOM_ERROR_NO_DEVICE};
    snprintf(info.name, sizeof info.name, "%s", name);
    snprintf(info.problem, sizeof info.problem, "%s", problem);
    return found(user, &info);
}
