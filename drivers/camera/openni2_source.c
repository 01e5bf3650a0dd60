/* Depth cameras by OpenNI2, and its recordings (.oni).
 *
 *     openni2:                     the first camera that can be opened
 *     openni2:SERIAL               the one with that serial
 *     openni2:1d27/0601@1/5        the one that libOpenNI2 calls so
 *     openni2:/path/scan.oni       a recording
 *
 * After these, ?unit=100um asks for depth in tenths of a millimetre. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "camera/field_of_view.h"
#include "camera/openni2_internal.h"
#include "camera/openni2_playback.h"
#include "source_log.h"

static const char no_camera[] = "OpenNI2 sees no depth camera";

/* ---- what there is ---- */

static void describe_device(openni2_device *d, const OniDeviceInfo *info) {
    snprintf(d->uri, sizeof d->uri, "%s", info->uri);
    snprintf(d->name, sizeof d->name, "%.40s %.50s", info->vendor, info->name);
}

/* Lists libOpenNI2's cameras, maximum `most`; returns their number. */
static int list_devices(openni2_device *devices, int most) {
    OniDeviceInfo *list = NULL;
    int count = 0;
    openni2_lock();
    if (oniGetDeviceList(&list, &count) != ONI_STATUS_OK) {
        openni2_unlock();
        return 0;
    }
    if (count > most) count = most;
    for (int i = 0; i < count; i++) {
        devices[i] = (openni2_device){.device = NULL};
        describe_device(&devices[i], &list[i]);
    }
    oniReleaseDeviceList(list);
    openni2_unlock();
    return count;
}

/* Opens it briefly, for its serial number and to see whether it can be opened. */
static int probe(openni2_device *d, char *why, size_t size) {
    int result = FATHOM_OK;
    openni2_lock();
    if (oniDeviceOpen(d->uri, &d->device) == ONI_STATUS_OK) {
        openni2_device_serial(d->device, d->serial, sizeof d->serial);
        oniDeviceClose(d->device);
    } else {
        result = openni2_open_fault(d->uri, why, size);
    }
    d->device = NULL;
    openni2_unlock();
    return result;
}

/* A camera that is plugged in, though libOpenNI2 doesn't list it. */
static int explain_usb(const openni2_usb *camera, char *why, size_t size) {
    const int error = openni2_usb_fault("", camera, why, size);
    if (error) return error;
    snprintf(why, size, "no OpenNI2 driver here takes it; it needs %s", camera->plugin);
    return FATHOM_ERROR_NO_DEVICE;
}

static bool lists_usb(const openni2_device *devices, int count, const openni2_usb *camera) {
    char place[32];
    snprintf(place, sizeof place, "@%d/%d", camera->bus, camera->address);
    for (int i = 0; i < count; i++) {
        const char *at = strchr(devices[i].uri, '@');
        if (at && strcmp(at, place) == 0) return true;
    }
    return false;
}

#define MOST_DEVICES 16

static int report_usb(fathom_source_found found, void *user, const openni2_device *devices, int count) {
    openni2_usb cameras[MOST_DEVICES];
    const int plugged = openni2_usb_list("", cameras, MOST_DEVICES);
    int seen = 0;
    for (int i = 0; i < plugged; i++) {
        fathom_source_info info = {
            .struct_size = sizeof info, .driver = "openni2", .kinds = FATHOM_SOURCE_DEPTH};
        if (lists_usb(devices, count, &cameras[i])) continue;
        snprintf(info.name, sizeof info.name, "%s (%04x:%04x)", cameras[i].name, (unsigned)cameras[i].vendor,
                 (unsigned)cameras[i].product);
        info.error = explain_usb(&cameras[i], info.problem, sizeof info.problem);
        if (found(user, &info)) return FATHOM_ERROR_STOPPED;
        seen++;
    }
    return seen;
}

static int report_devices(fathom_source_found found, void *user) {
    openni2_device devices[MOST_DEVICES];
    const int count = list_devices(devices, MOST_DEVICES);
    for (int i = 0; i < count; i++) {
        fathom_source_info info = {
            .struct_size = sizeof info, .driver = "openni2", .kinds = FATHOM_SOURCE_DEPTH};
        snprintf(info.name, sizeof info.name, "%s", devices[i].name);
        info.error = probe(&devices[i], info.problem, sizeof info.problem);
        snprintf(info.uri, sizeof info.uri, "openni2:%.200s", devices[i].uri);
        snprintf(info.serial, sizeof info.serial, "%s", devices[i].serial);
        if (found(user, &info)) return FATHOM_ERROR_STOPPED;
    }
    const int others = report_usb(found, user, devices, count);
    return others < 0 ? others : count + others;
}

static int openni2_enumerate(fathom_source_found found, void *user, fathom_log log, void *log_user) {
    fathom_source_info info = {.struct_size = sizeof info, .driver = "openni2", .name = "OpenNI2"};
    (void)log, (void)log_user;
    info.error = openni2_hold(info.problem, sizeof info.problem);
    if (info.error) return found(user, &info) ? FATHOM_ERROR_STOPPED : 0;
    const int seen = report_devices(found, user);
    openni2_release();
    if (seen) return seen;
    info.error = FATHOM_ERROR_NO_DEVICE;
    snprintf(info.problem, sizeof info.problem, "%s; is one plugged in?", no_camera);
    return found(user, &info) ? FATHOM_ERROR_STOPPED : 0;
}

/* ---- operations ---- */

static void stop_streams(openni2_source *s) {
    if (s->device.depth) oniStreamStop(s->device.depth);
    if (s->device.color) oniStreamStop(s->device.color);
}

static int openni2_start(fathom_source *source) {
    openni2_source *s = (openni2_source *)source;
    openni2_device *d = &s->device;
    char why[320];
    int result = FATHOM_OK;
    if (atomic_load(&s->gone)) openni2_device_close(d); /* it may be back, but what was open stays dead */
    if (!d->device) {
        openni2_watch(s, d->uri);
        result = openni2_device_open(d, &s->wish, why, sizeof why);
    }
    if (!result && (d->mode.resolutionX != s->queue.slots[0].about.width ||
                    d->mode.resolutionY != s->queue.slots[0].about.height)) {
        snprintf(why, sizeof why, "it has another size now");
        result = FATHOM_ERROR_SIZE;
    }
    if (!result) {
        clock_map_restart(&s->clock);
        s->last_index = 0;
        s->has_color = false;
        result = openni2_start_streams(s, why, sizeof why);
    }
    if (result) return source_fail(&source->options, result, "openni2: %s: %s", d->name, why);
    source_queue_start(&s->queue);
    s->worker = openni2_hire(openni2_gather, s);
    if (!s->worker) {
        source_queue_stop(&s->queue);
        stop_streams(s);
        return source_fail(&source->options, FATHOM_ERROR_MEMORY, "openni2: no thread could be made");
    }
    return FATHOM_OK;
}

static void openni2_stop(fathom_source *source) {
    openni2_source *s = (openni2_source *)source;
    source_queue_stop(&s->queue);
    openni2_dismiss(s->worker);
    stop_streams(s);
}

static int openni2_wait(fathom_source *source, int timeout_ms) {
    return source_queue_wait(&((openni2_source *)source)->queue, timeout_ms);
}

static void openni2_cancel(fathom_source *source) {
    source_queue_cancel(&((openni2_source *)source)->queue);
}

static int openni2_read_depth(fathom_source *source, fathom_source_frame *frame) {
    return source_queue_read_depth(&((openni2_source *)source)->queue, frame);
}

static int openni2_status(fathom_source *source, fathom_source_status *status) {
    openni2_source *s = (openni2_source *)source;
    source_queue_status(&s->queue, status);
    status->kinds = FATHOM_SOURCE_DEPTH | (s->color ? FATHOM_SOURCE_COLOR : 0);
    snprintf(status->name, sizeof status->name, "%s", s->name);
    snprintf(status->serial, sizeof status->serial, "%s", s->serial);
    status->camera = s->camera;
    status->depth_units_per_metre = s->units_per_metre;
    return FATHOM_OK;
}

static void free_source(openni2_source *s) {
    if (s->watch) oniUnregisterDeviceCallbacks(s->watch);
    openni2_device_close(&s->device);
    openni2_release();
    pthread_mutex_destroy(&s->watch_lock);
    free(s->color);
    free(s);
}

static void openni2_close(fathom_source *source) {
    openni2_source *s = (openni2_source *)source;
    source_queue_free(&s->queue);
    free_source(s);
}

static const source_operations openni2_operations = {
    .start = openni2_start,
    .stop = openni2_stop,
    .wait = openni2_wait,
    .cancel = openni2_cancel,
    .read_depth = openni2_read_depth,
    .status = openni2_status,
    .close = openni2_close,
};

/* ---- opening ---- */

static void ONI_CALLBACK_TYPE on_disconnected(const OniDeviceInfo *info, void *user) {
    openni2_source *s = user;
    pthread_mutex_lock(&s->watch_lock);
    if (strcmp(info->uri, s->watched) == 0) atomic_store(&s->gone, true);
    pthread_mutex_unlock(&s->watch_lock);
}

static void ONI_CALLBACK_TYPE on_connected(const OniDeviceInfo *info, void *user) {
    (void)info, (void)user;
}

static void ONI_CALLBACK_TYPE on_state(const OniDeviceInfo *info, OniDeviceState state, void *user) {
    (void)info, (void)state, (void)user;
}

/* Takes ?unit= from the end of the address. */
static int read_wish(openni2_source *s, char *address) {
    const fathom_source_options *o = &s->base.options;
    char *query = strchr(address, '?');
    s->wish = (openni2_wish){.width = o->width ? o->width : 640,
                             .height = o->height ? o->height : 480,
                             .rate_hz = o->rate_hz,
                             .format = ONI_PIXEL_FORMAT_DEPTH_1_MM,
                             .color = o->color && (o->kinds & FATHOM_SOURCE_COLOR)};
    if (!query) return FATHOM_OK;
    if (strcmp(query, "?unit=100um") == 0)
        s->wish.format = ONI_PIXEL_FORMAT_DEPTH_100_UM;
    else if (strcmp(query, "?unit=mm") != 0)
        return source_fail(o, FATHOM_ERROR_ARGUMENT, "openni2:%s: only ?unit=mm or ?unit=100um may follow",
                           address);
    *query = 0;
    return FATHOM_OK;
}

static bool is_file(const char *address) {
    struct stat status;
    const size_t length = strlen(address);
    return (length > 4 && strcmp(address + length - 4, ".oni") == 0) ||
           (stat(address, &status) == 0 && S_ISREG(status.st_mode));
}

/* The error for a missing camera. */
static int explain_absence(openni2_source *s, const char *address, int listed) {
    openni2_usb cameras[MOST_DEVICES];
    char why[256];
    const int plugged = openni2_usb_list("", cameras, MOST_DEVICES);
    if (!listed && plugged) {
        const int error = explain_usb(&cameras[0], why, sizeof why);
        return source_fail(&s->base.options, error, "openni2:%s: %s, but a %s is plugged in: %s", address,
                           no_camera, cameras[0].name, why);
    }
    if (!listed)
        return source_fail(&s->base.options, FATHOM_ERROR_NO_DEVICE, "openni2:%s: %s", address, no_camera);
    return source_fail(&s->base.options, FATHOM_ERROR_NO_DEVICE,
                       "openni2:%s: no camera of that name or serial; fathom devices lists them", address);
}

static int open_camera(openni2_source *s, const char *address) {
    openni2_device devices[MOST_DEVICES];
    char why[320];
    int failure = FATHOM_OK;
    const int count = list_devices(devices, MOST_DEVICES);
    for (int i = 0; i < count; i++) {
        const bool wanted = !*address || strcmp(devices[i].uri, address) == 0;
        if (!wanted && (probe(&devices[i], why, sizeof why) || strcmp(devices[i].serial, address) != 0))
            continue;
        s->device = devices[i];
        const int result = openni2_device_open(&s->device, &s->wish, why, sizeof why);
        if (!result) return FATHOM_OK;
        failure =
            source_fail(&s->base.options, result, "openni2:%s: %s: %s", devices[i].uri, devices[i].name, why);
    }
    return failure ? failure : explain_absence(s, address, count);
}

static void find_camera(openni2_source *s) {
    const openni2_device *d = &s->device;
    s->camera =
        camera_of_view(d->mode.resolutionX, d->mode.resolutionY, (double)d->fov[0], (double)d->fov[1]);
    s->units_per_metre = d->mode.pixelFormat == ONI_PIXEL_FORMAT_DEPTH_100_UM ? 10000 : 1000;
}

static void say_differences(const openni2_source *s) {
    const fathom_source_options *o = &s->base.options;
    const OniVideoMode *mode = &s->device.mode;
    if (mode->pixelFormat != s->wish.format)
        source_warn(o, "openni2: %s gives no depth in that unit", s->device.name);
    if (o->width && (o->width != mode->resolutionX || o->height != mode->resolutionY))
        source_warn(o, "openni2: %s has no %dx%d: taking %dx%d", s->device.name, o->width, o->height,
                    mode->resolutionX, mode->resolutionY);
    if (o->rate_hz > 0 && fabs(o->rate_hz - mode->fps) > 0.5)
        source_warn(o, "openni2: %s has no %g frames a second at that size: taking %d", s->device.name,
                    o->rate_hz, mode->fps);
    if (s->wish.color && !s->device.color)
        source_warn(o, "openni2: %s gives no colour that is registered to the depth", s->device.name);
}

static int finish_opening(openni2_source *s) {
    static OniDeviceCallbacks callbacks = {on_connected, on_disconnected, on_state};
    const int width = s->device.mode.resolutionX, height = s->device.mode.resolutionY;
    find_camera(s);
    say_differences(s);
    snprintf(s->name, sizeof s->name, "%s", s->device.name);
    snprintf(s->serial, sizeof s->serial, "%s", s->device.serial);
    if (s->device.color && !(s->color = malloc(3 * (size_t)width * (size_t)height)))
        return FATHOM_ERROR_MEMORY;
    openni2_watch(s, s->device.uri);
    if (oniRegisterDeviceCallbacks(&callbacks, s, &s->watch) != ONI_STATUS_OK) s->watch = NULL;
    return source_queue_make(&s->queue, 0, s->base.options.frame_capacity, width, height, s->color != NULL);
}

static int openni2_open(fathom_source **source, const char *address, const fathom_source_options *options) {
    char why[320], place[512];
    if (!(options->kinds & FATHOM_SOURCE_DEPTH))
        return source_fail(options, FATHOM_ERROR_UNSUPPORTED, "openni2: gives only depth");
    if (strlen(address) >= sizeof place)
        return source_fail(options, FATHOM_ERROR_ARGUMENT, "openni2: the address is too long");
    if (is_file(address)) return openni2_play(source, address, options);
    snprintf(place, sizeof place, "%s", address);
    openni2_source *s = calloc(1, sizeof *s);
    if (!s) return FATHOM_ERROR_MEMORY;
    s->base = (fathom_source){.does = &openni2_operations, .options = *options};
    int result = read_wish(s, place);
    if (!result && (result = openni2_hold(why, sizeof why))) source_fail(options, result, "openni2: %s", why);
    if (result) {
        free(s);
        return result;
    }
    pthread_mutex_init(&s->watch_lock, NULL);
    result = open_camera(s, place);
    if (!result) result = finish_opening(s);
    if (result) {
        free_source(s);
        return result;
    }
    *source = &s->base;
    return FATHOM_OK;
}

const source_driver openni2_driver = {"openni2", openni2_enumerate, openni2_open};
