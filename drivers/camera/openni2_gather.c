/* The thread that gathers frames from libOpenNI2. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "monotonic.h"
#include "camera/openni2_internal.h"
#include "source_log.h"

#define SLICE_MS 50         /* a wait for libOpenNI2 can't be cancelled */
#define SILENT_SLICES 20    /* then the device's presence is checked */
#define SEARCH_NS 500000000 /* between two searches for an unplugged device */
#define MOST_COMPLAINTS 3   /* maximum log lines about invalid frames */
#define MOST_MISSING 100000 /* a larger jump of the frame number is a new count, not a loss */

int openni2_start_streams(openni2_source *s, char *why, size_t size) {
    char words[256];
    openni2_device *d = &s->device;
    openni2_lock();
    const bool started =
        (!d->color || oniStreamStart(d->color) == ONI_STATUS_OK) && oniStreamStart(d->depth) == ONI_STATUS_OK;
    if (!started) snprintf(why, size, "its streams don't start: %s", openni2_words(words, sizeof words));
    openni2_unlock();
    return started ? FATHOM_OK : FATHOM_ERROR_DEVICE;
}

void openni2_watch(openni2_source *s, const char *uri) {
    pthread_mutex_lock(&s->watch_lock);
    snprintf(s->watched, sizeof s->watched, "%s", uri);
    atomic_store(&s->gone, false);
    pthread_mutex_unlock(&s->watch_lock);
}

/* ---- frames ---- */

static void complain(openni2_source *s, const char *why) {
    source_queue_count_malformed(&s->queue, 1);
    if (s->complaints >= MOST_COMPLAINTS) return;
    s->complaints++;
    source_warn(&s->base.options, "openni2: %s: a frame is left out: %s%s", s->device.name, why,
                s->complaints == MOST_COMPLAINTS ? " (more won't be told of, only counted)" : "");
}

static void count_missing(openni2_source *s, int index) {
    const int64_t missing = (int64_t)index - s->last_index - 1;
    if (s->last_index > 0 && missing > 0 && missing < MOST_MISSING)
        source_queue_count_lost(&s->queue, missing);
    s->last_index = index;
}

/* The newest colour frame goes with a depth frame taken within three quarters of a period. */
static void add_color(openni2_source *s, int64_t device_ns, source_slot *slot) {
    const int64_t apart_ns = s->color_ns - device_ns;
    slot->about.image = NULL;
    if (!slot->color || !s->has_color || s->device.mode.fps <= 0 ||
        llabs(apart_ns) > 750000000 / s->device.mode.fps)
        return;
    memcpy(slot->color, s->color,
           3 * (size_t)s->device.mode.resolutionX * (size_t)s->device.mode.resolutionY);
    slot->image.timestamp_ns = slot->about.timestamp_ns + apart_ns;
    slot->about.image = &slot->image;
}

/* The device's stamp on the host's clock. */
static int64_t stamp_of(openni2_source *s, int64_t device_ns, int64_t arrival_ns) {
    const int64_t stamp_ns = clock_map_stamp(&s->clock, device_ns, arrival_ns);
    source_queue_set_clock(&s->queue, clock_map_offset_s(&s->clock), clock_map_drift_ppm(&s->clock));
    return stamp_ns;
}

static source_slot *fill_slot(openni2_source *s, const OniFrame *frame, int64_t arrival_ns) {
    source_slot *slot = source_queue_next_frame(&s->queue);
    const int64_t device_ns = (int64_t)frame->timestamp * 1000;
    openni2_copy_depth(frame, s->device.mirrored, slot->depth);
    slot->about.timestamp_ns = stamp_of(s, device_ns, arrival_ns);
    add_color(s, device_ns, slot);
    slot->frame.device_ns = device_ns;
    slot->frame.arrival_ns = arrival_ns;
    slot->frame.index = frame->frameIndex;
    return slot;
}

static void take_color(openni2_source *s, const OniFrame *frame) {
    OniVideoMode mode = s->device.mode;
    char why[128];
    mode.pixelFormat = ONI_PIXEL_FORMAT_RGB888;
    if (!openni2_frame_is_good(frame, &mode, why, sizeof why)) {
        complain(s, why);
        return;
    }
    openni2_copy_color(frame, s->device.mirrored, s->color);
    s->color_ns = (int64_t)frame->timestamp * 1000;
    s->has_color = true;
}

/* The next frame of either stream, within a slice: ONI_STATUS_OK, then *frame is to be released; or
 * ONI_STATUS_TIME_OUT, or another status. */
static OniStatus next_frame(openni2_source *s, OniFrame **frame, int64_t *arrival_ns) {
    OniStreamHandle streams[2] = {s->device.depth, s->device.color};
    int which = 0;
    OniStatus status = oniWaitForAnyStream(streams, s->device.color ? 2 : 1, &which, SLICE_MS);
    *arrival_ns = monotonic_now_ns();
    *frame = NULL;
    if (status == ONI_STATUS_OK) status = oniStreamReadFrame(streams[which], frame);
    return status == ONI_STATUS_OK && !*frame ? ONI_STATUS_ERROR : status;
}

/* ---- unplugging ---- */

static bool is_listed(const char *uri) {
    OniDeviceInfo *list = NULL;
    int count = 0;
    bool listed = false;
    openni2_lock();
    if (oniGetDeviceList(&list, &count) == ONI_STATUS_OK) {
        for (int i = 0; i < count; i++) listed |= strcmp(list[i].uri, uri) == 0;
        oniReleaseDeviceList(list);
    }
    openni2_unlock();
    return listed;
}

/* Opens `uri` if it is the device that was lost. */
static bool reopen(openni2_source *s, const char *uri) {
    char why[256];
    openni2_device *d = &s->device;
    const openni2_device before = *d;
    snprintf(d->uri, sizeof d->uri, "%s", uri);
    openni2_watch(s, uri);
    if (openni2_device_open(d, &s->wish, why, sizeof why) == FATHOM_OK &&
        strcmp(before.serial, d->serial) == 0 && d->mode.resolutionX == before.mode.resolutionX &&
        d->mode.resolutionY == before.mode.resolutionY && d->mode.pixelFormat == before.mode.pixelFormat &&
        openni2_start_streams(s, why, sizeof why) == FATHOM_OK)
        return true;
    openni2_device_close(d);
    *d = before;
    return false;
}

static bool find_again(openni2_source *s) {
    char name[96];
    OniDeviceInfo *list = NULL;
    int count = 0;
    bool found = false;
    openni2_lock();
    const OniStatus listed = oniGetDeviceList(&list, &count);
    openni2_unlock();
    if (listed != ONI_STATUS_OK) return false;
    for (int i = 0; i < count && !found; i++) {
        snprintf(name, sizeof name, "%.40s %.50s", list[i].vendor, list[i].name);
        if (strcmp(name, s->device.name) == 0) found = reopen(s, list[i].uri);
    }
    oniReleaseDeviceList(list);
    return found;
}

/* Waits for an unplugged device. False: the thread is to end. */
static bool wait_for_return(openni2_source *s) {
    openni2_device_close(&s->device);
    if (!s->base.options.reconnect) {
        source_queue_end(&s->queue, FATHOM_ERROR_UNPLUGGED);
        return false;
    }
    source_queue_unplugged(&s->queue);
    source_warn(&s->base.options, "openni2: %s was unplugged; it is looked for", s->device.name);
    while (source_queue_sleep_until(&s->queue, monotonic_now_ns() + SEARCH_NS))
        if (find_again(s)) {
            clock_map_restart(&s->clock);
            s->last_index = 0;
            s->has_color = false;
            source_queue_replugged(&s->queue);
            source_warn(&s->base.options, "openni2: %s is back", s->device.name);
            return true;
        }
    return false;
}

static void take_live(openni2_source *s, const OniFrame *frame, int64_t arrival_ns) {
    char why[128];
    if (frame->sensorType == ONI_SENSOR_COLOR) {
        take_color(s, frame);
    } else if (openni2_frame_is_good(frame, &s->device.mode, why, sizeof why)) {
        count_missing(s, frame->frameIndex);
        source_queue_push_frame(&s->queue, fill_slot(s, frame, arrival_ns));
    } else {
        complain(s, why);
    }
}

void openni2_gather(void *user) {
    openni2_source *s = user;
    int silent = 0;
    bool go_on = true;
    while (go_on && source_queue_is_running(&s->queue)) {
        OniFrame *frame;
        int64_t arrival_ns;
        const OniStatus status = next_frame(s, &frame, &arrival_ns);
        if (status == ONI_STATUS_OK) {
            take_live(s, frame, arrival_ns);
            oniFrameRelease(frame);
            silent = 0;
        } else if (status != ONI_STATUS_TIME_OUT) {
            go_on = source_queue_sleep_until(&s->queue, monotonic_now_ns() + SLICE_MS * 1000000);
        }
        const bool ask = status != ONI_STATUS_OK && ++silent % SILENT_SLICES == 0;
        if (atomic_load(&s->gone) || (ask && !is_listed(s->device.uri))) {
            go_on = wait_for_return(s);
            silent = 0;
        }
    }
}
