/* A recording folder in place of a depth camera and an inertial sensor. A thread feeds the queue: at the pace of the
 * stamps, dropping unread data as a device would, or, with speed 0, at the reader's pace, without dropping. */
#include <stdio.h>
#include <stdlib.h>

#include "monotonic.h"
#include "source.h"
#include "source_log.h"
#include "source_queue.h"

#define LEAD_IN_NS INT64_C(10000000000) /* maximum time of samples before the first frame; earlier ones are left out */

typedef struct {
    fathom_source base;
    fathom_recording *recording;
    source_queue queue;
    pthread_t thread;
    bool opened;   /* errors from now on concern a frame, not the source */
    unsigned kinds;
    int64_t zero_ns, start_ns; /* the recording's first event, of either kind, and when it was played */
    uint8_t *confidence; /* of the frame being read; NULL: the recording has none */
} folder_source;

/* ---- the feeding thread ---- */

static int64_t imu_ns(const folder_source *s, int i) {
    return s->recording->imu[i].timestamp_ns + s->recording->imu_clock_offset_ns;
}

/* Waits until the event at `stamp` is due and there is room for it; false: to stop. */
static bool wait_for(folder_source *s, int64_t stamp_ns, bool for_frame) {
    if (s->base.options.speed == 0) return source_queue_wait_for_room(&s->queue, for_frame);
    const double passed_ns = (double)(stamp_ns - s->zero_ns) / s->base.options.speed;
    return source_queue_sleep_until(&s->queue, s->start_ns + (int64_t)passed_ns);
}

/* Pushes samples up to a stamp, and one beyond it, so that the motion at it is known. */
static bool feed_samples(folder_source *s, int *next, int64_t until_ns) {
    const fathom_recording *r = s->recording;
    if (!(s->kinds & FATHOM_SOURCE_IMU)) return true;
    while (*next < r->imu_count && (*next == 0 || imu_ns(s, *next - 1) <= until_ns)) {
        if (!wait_for(s, imu_ns(s, *next), false)) return false;
        source_queue_push_imu(&s->queue, &r->imu[(*next)++]);
    }
    return true;
}

/* Pixels below the recording's least confidence become invalid. */
static void blank_unsure(folder_source *s, int index, uint16_t *depth) {
    const size_t count = (size_t)s->recording->camera.width * (size_t)s->recording->camera.height;
    if (fathom_recording_read_confidence(s->recording, index, s->confidence) != FATHOM_OK) return;
    for (size_t i = 0; i < count; i++)
        if (s->confidence[i] < s->recording->min_confidence) depth[i] = 0;
}

/* When paced, the frame is decoded before it is due. */
static bool feed_frame(folder_source *s, int index, int *next) {
    const fathom_recording *r = s->recording;
    const int64_t stamp_ns = r->frames[index].timestamp_ns;
    if (!(s->kinds & FATHOM_SOURCE_DEPTH)) return feed_samples(s, next, stamp_ns);
    source_slot *slot = source_queue_next_frame(&s->queue);
    const bool good = fathom_recording_read_depth(r, index, slot->depth) == FATHOM_OK;
    if (good && r->confidence) blank_unsure(s, index, slot->depth);
    if (!good) source_queue_count_malformed(&s->queue, 1);
    if (!feed_samples(s, next, stamp_ns) || !wait_for(s, stamp_ns, true)) return false;
    if (!good) return true;
    slot->about.timestamp_ns = stamp_ns;
    slot->frame.device_ns = stamp_ns;
    slot->frame.index = index;
    slot->frame.arrival_ns = monotonic_now_ns();
    source_queue_push_frame(&s->queue, slot);
    return true;
}

static int first_sample(const folder_source *s) {
    int first = 0;
    while (first < s->recording->imu_count &&
           imu_ns(s, first) < s->recording->frames[0].timestamp_ns - LEAD_IN_NS)
        first++;
    return first;
}

static void *feed(void *user) {
    folder_source *s = user;
    int next = first_sample(s);
    bool go_on = true;
    for (int i = 0; go_on && i < s->recording->frame_count; i++) go_on = feed_frame(s, i, &next);
    if (go_on) source_queue_end(&s->queue, FATHOM_ERROR_ENDED);
    return NULL;
}

/* ---- operations ---- */

static int folder_start(fathom_source *source) {
    folder_source *s = (folder_source *)source;
    const int first = first_sample(s);
    s->zero_ns = s->recording->frames[0].timestamp_ns;
    if (first < s->recording->imu_count && imu_ns(s, first) < s->zero_ns)
        s->zero_ns = imu_ns(s, first);
    s->start_ns = monotonic_now_ns();
    source_queue_start(&s->queue);
    if (pthread_create(&s->thread, NULL, feed, s)) {
        source_queue_stop(&s->queue);
        return source_fail(&s->base.options, FATHOM_ERROR_MEMORY, "folder: no thread could be made");
    }
    return FATHOM_OK;
}

static void folder_stop(fathom_source *source) {
    folder_source *s = (folder_source *)source;
    source_queue_stop(&s->queue);
    pthread_join(s->thread, NULL);
}

static int folder_wait(fathom_source *source, int timeout_ms) {
    return source_queue_wait(&((folder_source *)source)->queue, timeout_ms);
}

static void folder_cancel(fathom_source *source) {
    source_queue_cancel(&((folder_source *)source)->queue);
}

static int folder_read_depth(fathom_source *source, fathom_source_frame *frame) {
    return source_queue_read_depth(&((folder_source *)source)->queue, frame);
}

static int folder_read_imu(fathom_source *source, fathom_imu_sample *samples, int capacity) {
    return source_queue_read_imu(&((folder_source *)source)->queue, samples, capacity);
}

static int folder_status(fathom_source *source, fathom_source_status *status) {
    folder_source *s = (folder_source *)source;
    const fathom_recording *r = s->recording;
    source_queue_status(&s->queue, status);
    status->kinds = s->kinds;
    snprintf(status->name, sizeof status->name, "%s", r->folder);
    if (s->kinds & FATHOM_SOURCE_DEPTH) {
        status->camera = r->camera;
        status->depth_units_per_metre = r->depth_units_per_metre;
    }
    return FATHOM_OK;
}

/* A source of one kind reports that one only. */
static void folder_configure(fathom_source *source, fathom_config *config) {
    const folder_source *s = (const folder_source *)source;
    fathom_config all = *config;
    fathom_recording_configure(s->recording, &all);
    if (s->kinds == FATHOM_SOURCE_IMU) {
        const fathom_config depth = *config;
        all.depth_camera = depth.depth_camera;
        all.depth_units_per_metre = depth.depth_units_per_metre;
    }
    *config = all;
}

static void folder_close(fathom_source *source) {
    folder_source *s = (folder_source *)source;
    source_queue_free(&s->queue);
    fathom_recording_close(s->recording);
    free(s->confidence);
    free(s);
}

static const source_operations folder_operations = {
    .start = folder_start,
    .stop = folder_stop,
    .wait = folder_wait,
    .cancel = folder_cancel,
    .read_depth = folder_read_depth,
    .read_imu = folder_read_imu,
    .status = folder_status,
    .configure = folder_configure,
    .close = folder_close,
};

/* ---- opening ---- */

/* A frame that can't be read is left out: a warning. */
static void relay(void *user, fathom_log_level level, const char *text) {
    const folder_source *s = user;
    if (s->opened && level == FATHOM_LOG_ERROR) level = FATHOM_LOG_WARNING;
    source_say(s->base.options.log, s->base.options.log_user, level, "%s", text);
}

static int find_kinds(folder_source *s, const char *folder) {
    const unsigned there = FATHOM_SOURCE_DEPTH | (s->recording->imu_count > 0 ? FATHOM_SOURCE_IMU : 0);
    s->kinds = there & s->base.options.kinds;
    if (s->kinds) return FATHOM_OK;
    return source_fail(&s->base.options, FATHOM_ERROR_UNSUPPORTED, "%s: there are no samples in imu.txt",
                       folder);
}

static int folder_open(fathom_source **source, const char *address, const fathom_source_options *options) {
    if (!*address)
        return source_fail(options, FATHOM_ERROR_ARGUMENT,
                           "folder: the path of a recording folder must follow");
    folder_source *s = calloc(1, sizeof *s);
    if (!s) return FATHOM_ERROR_MEMORY;
    s->base = (fathom_source){.does = &folder_operations, .options = *options};
    const fathom_recording_options how = {.struct_size = sizeof how, .log = relay, .log_user = s};
    int result = fathom_recording_open(&s->recording, address, &how);
    if (!result) result = find_kinds(s, address);
    if (!result && s->recording->confidence) {
        s->confidence = malloc((size_t)s->recording->camera.width * (size_t)s->recording->camera.height);
        if (!s->confidence) result = FATHOM_ERROR_MEMORY;
    }
    if (!result)
        result = source_queue_make(&s->queue, s->kinds & FATHOM_SOURCE_IMU ? options->imu_capacity : 0,
                                   s->kinds & FATHOM_SOURCE_DEPTH ? options->frame_capacity : 0,
                                   s->recording->camera.width, s->recording->camera.height, false);
    if (result) {
        fathom_recording_close(s->recording);
        free(s->confidence);
        free(s);
        return result;
    }
    s->opened = true;
    *source = &s->base;
    return FATHOM_OK;
}

static int folder_enumerate(fathom_source_found found, void *user, fathom_log log, void *log_user) {
    (void)log, (void)log_user;
    const fathom_source_info info = {.struct_size = sizeof info, .driver = "folder",
                                     .uri = "folder:PATH",
                                     .name = "recording folders",
                                     .problem = "a folder's path opens it: folder:PATH, or PATH alone"};
    return found(user, &info) ? FATHOM_ERROR_STOPPED : 0;
}

const source_driver folder_driver = {"folder", folder_enumerate, folder_open};
