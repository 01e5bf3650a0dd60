/* An .oni recording as a source. A thread feeds the queue: at the pace of the stamps, or, with speed 0, at the reader's
 * own pace, where nothing is dropped. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "monotonic.h"
#include "camera/field_of_view.h"
#include "camera/openni2_oni.h"
#include "camera/openni2_playback.h"
#include "source_log.h"
#include "source_queue.h"

#define MOST_COMPLAINTS 3 /* maximum log lines about invalid frames */

typedef struct {
    fathom_source base;
    oni_file *file;
    oni_description about;
    char path[256];
    source_queue queue;
    pthread_t thread;
} oni_source;

/* ---- the feeding thread ---- */

static bool wait_for_turn(oni_source *s, int64_t since_first_ns, int64_t start_ns) {
    if (s->base.options.speed == 0) return source_queue_wait_for_room(&s->queue, true);
    return source_queue_sleep_until(&s->queue,
                                    start_ns + (int64_t)((double)since_first_ns / s->base.options.speed));
}

static void end(oni_source *s, int result, int read, const char *why) {
    if (result != FATHOM_ERROR_ENDED)
        source_fail(&s->base.options, result, "%s: after %d frames: %s", s->path, read, why);
    source_queue_end(&s->queue, result);
}

static void *feed(void *user) {
    oni_source *s = user;
    const int64_t start_ns = monotonic_now_ns();
    int64_t first_ns = -1;
    int read = 0, last = 0, complaints = 0;
    for (;;) {
        char why[160];
        source_slot *slot = source_queue_next_frame(&s->queue);
        int64_t stamp_ns = 0;
        int number = 0;
        const int result = oni_next(s->file, slot->depth, &stamp_ns, &number, why, sizeof why);
        if (result == FATHOM_ERROR_SIZE) {
            source_queue_count_malformed(&s->queue, 1);
            if (complaints++ < MOST_COMPLAINTS)
                source_warn(&s->base.options, "%s: %s: it is left out", s->path, why);
            last = number;
            continue;
        }
        if (result) {
            end(s, result, read, why);
            return NULL;
        }
        if (first_ns < 0) first_ns = stamp_ns;
        if (last > 0 && number > last + 1) source_queue_count_lost(&s->queue, number - last - 1);
        last = number;
        read++;
        slot->about.timestamp_ns = slot->frame.device_ns = stamp_ns;
        slot->frame.index = number;
        if (!wait_for_turn(s, stamp_ns - first_ns, start_ns)) return NULL;
        slot->frame.arrival_ns = monotonic_now_ns();
        source_queue_push_frame(&s->queue, slot);
    }
}

/* ---- operations ---- */

static int oni_source_start(fathom_source *source) {
    oni_source *s = (oni_source *)source;
    oni_rewind(s->file);
    source_queue_start(&s->queue);
    if (pthread_create(&s->thread, NULL, feed, s)) {
        source_queue_stop(&s->queue);
        return source_fail(&source->options, FATHOM_ERROR_MEMORY, "%s: no thread could be made", s->path);
    }
    return FATHOM_OK;
}

static void oni_source_stop(fathom_source *source) {
    oni_source *s = (oni_source *)source;
    source_queue_stop(&s->queue);
    pthread_join(s->thread, NULL);
}

static int oni_source_wait(fathom_source *source, int timeout_ms) {
    return source_queue_wait(&((oni_source *)source)->queue, timeout_ms);
}

static void oni_source_cancel(fathom_source *source) {
    source_queue_cancel(&((oni_source *)source)->queue);
}

static int oni_source_read_depth(fathom_source *source, fathom_source_frame *frame) {
    return source_queue_read_depth(&((oni_source *)source)->queue, frame);
}

static int oni_source_status(fathom_source *source, fathom_source_status *status) {
    oni_source *s = (oni_source *)source;
    source_queue_status(&s->queue, status);
    status->kinds = FATHOM_SOURCE_DEPTH;
    snprintf(status->name, sizeof status->name, "%.95s", s->path);
    status->camera = camera_of_view(s->about.width, s->about.height, s->about.fov[0], s->about.fov[1]);
    status->depth_units_per_metre = s->about.units_per_metre;
    return FATHOM_OK;
}

static void oni_source_close(fathom_source *source) {
    oni_source *s = (oni_source *)source;
    source_queue_free(&s->queue);
    oni_close(s->file);
    free(s);
}

static const source_operations oni_operations = {
    .start = oni_source_start,
    .stop = oni_source_stop,
    .wait = oni_source_wait,
    .cancel = oni_source_cancel,
    .read_depth = oni_source_read_depth,
    .status = oni_source_status,
    .close = oni_source_close,
};

int openni2_play(fathom_source **source, const char *path, const fathom_source_options *options) {
    char why[200];
    FILE *stream = fopen(path, "rb");
    if (!stream) return source_fail(options, FATHOM_ERROR_NO_DATA, "%s: %m", path);
    oni_source *s = calloc(1, sizeof *s);
    if (!s) {
        fclose(stream);
        return FATHOM_ERROR_MEMORY;
    }
    s->base = (fathom_source){.does = &oni_operations, .options = *options};
    snprintf(s->path, sizeof s->path, "%s", path);
    int result = oni_open(&s->file, stream, &s->about, why, sizeof why);
    if (result) {
        source_fail(options, result, "%s: %s", path, why);
        free(s);
        return result;
    }
    if (options->color) source_warn(options, "%s: colour isn't read from recordings", path);
    result = source_queue_make(&s->queue, 0, options->frame_capacity, s->about.width, s->about.height, false);
    if (result) {
        oni_close(s->file);
        free(s);
        return result;
    }
    *source = &s->base;
    return FATHOM_OK;
}
