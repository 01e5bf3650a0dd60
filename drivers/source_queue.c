#include "source_queue.h"

#include <errno.h>
#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "monotonic.h"

#define RATE_WINDOW_NS 1000000000 /* the rate is measured over this */
#define STALL_PERIODS 10          /* silence for this number of periods is a stall, */
#define STALL_LEAST_NS 500000000  /* and for this at least */

/* ---- life ---- */

static bool make_slots(source_queue *q, int frames, int width, int height, bool color) {
    const size_t pixels = (size_t)width * (size_t)height;
    q->frame_capacity = frames;
    q->slot_count = frames + 2;
    q->slots = calloc((size_t)q->slot_count, sizeof *q->slots);
    q->waiting = calloc((size_t)frames, sizeof *q->waiting);
    if (!q->slots || !q->waiting) return false;
    for (int i = 0; i < q->slot_count; i++) {
        source_slot *slot = &q->slots[i];
        slot->depth = calloc(pixels, sizeof *slot->depth);
        if (color) slot->color = calloc(3, pixels);
        if (!slot->depth || (color && !slot->color)) return false;
        slot->about = FATHOM_STRUCT(fathom_depth_frame);
        slot->about.depth = slot->depth;
        slot->about.width = width;
        slot->about.height = height;
        slot->frame = FATHOM_STRUCT(fathom_source_frame);
        slot->frame.depth = &slot->about;
        slot->image = FATHOM_STRUCT(fathom_image);
        slot->image.format = FATHOM_IMAGE_RGB8;
        slot->image.width = width;
        slot->image.height = height;
        slot->image.data = slot->color;
    }
    return true;
}

static void make_locks(source_queue *q) {
    pthread_condattr_t attributes;
    pthread_mutex_init(&q->lock, NULL);
    pthread_condattr_init(&attributes);
    pthread_condattr_setclock(&attributes, CLOCK_MONOTONIC);
    pthread_cond_init(&q->room, &attributes);
    pthread_condattr_destroy(&attributes);
}

int source_queue_make(source_queue *q, int samples, int frames, int width, int height, bool color) {
    memset(q, 0, sizeof *q);
    atomic_init(&q->cancelled, false);
    make_locks(q);
    q->held = q->filling = -1;
    q->counts_frames = frames > 0;
    q->sample_capacity = samples;
    bool made = (q->bell = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) >= 0;
    if (made && samples > 0) made = (q->samples = calloc((size_t)samples, sizeof *q->samples)) != NULL;
    if (made && frames > 0) made = make_slots(q, frames, width, height, color);
    if (made) return FATHOM_OK;
    source_queue_free(q);
    return FATHOM_ERROR_MEMORY;
}

void source_queue_free(source_queue *q) {
    for (int i = 0; q->slots && i < q->slot_count; i++) {
        free(q->slots[i].depth);
        free(q->slots[i].color);
    }
    free(q->slots);
    free(q->waiting);
    free(q->samples);
    if (q->bell >= 0) close(q->bell);
    pthread_cond_destroy(&q->room);
    pthread_mutex_destroy(&q->lock);
}

/* Wakes a wait. Safe in a signal handler. */
static void ring(source_queue *q) {
    const int before = errno;
    const uint64_t one = 1;
    if (write(q->bell, &one, sizeof one) < 0) { /* full: it rings already */
    }
    errno = before;
}

void source_queue_start(source_queue *q) {
    pthread_mutex_lock(&q->lock);
    q->first_sample = q->sample_count = q->first_frame = q->frame_count = 0;
    q->held = q->filling = -1;
    q->running = true;
    q->ended = FATHOM_OK;
    q->unplugged = q->stalled = q->held_up = false;
    q->last_ns = q->window_ns = monotonic_now_ns();
    q->window_count = 0;
    q->counts.rate_hz = 0;
    pthread_mutex_unlock(&q->lock);
}

void source_queue_stop(source_queue *q) {
    pthread_mutex_lock(&q->lock);
    q->running = false;
    pthread_cond_broadcast(&q->room);
    pthread_mutex_unlock(&q->lock);
    ring(q);
}

/* ---- rate and silence; all with the lock held ---- */

static int64_t longest_silence_ns(const source_queue *q) {
    const double periods = q->counts.rate_hz > 0 ? 1e9 * STALL_PERIODS / q->counts.rate_hz : 0;
    return periods > STALL_LEAST_NS ? (int64_t)periods : STALL_LEAST_NS;
}

static void notice_silence(source_queue *q, int64_t now_ns) {
    if (!q->running || q->ended || q->unplugged || q->stalled || q->held_up) return;
    if (now_ns - q->last_ns <= longest_silence_ns(q)) return;
    q->stalled = true;
    q->counts.stalls++;
    q->counts.rate_hz = 0;
}

static void start_window(source_queue *q, int64_t now_ns) {
    q->window_ns = now_ns;
    q->window_count = 0;
}

/* Counts an arrived frame or sample. measured: of the kind whose rate is measured. */
static void notice_arrival(source_queue *q, bool measured) {
    const int64_t now_ns = monotonic_now_ns();
    notice_silence(q, now_ns);
    if (q->stalled) start_window(q, now_ns);
    q->stalled = false;
    q->last_ns = now_ns;
    if (!measured) return;
    q->window_count++;
    if (now_ns - q->window_ns < RATE_WINDOW_NS) return;
    q->counts.rate_hz = 1e9 * q->window_count / (double)(now_ns - q->window_ns);
    start_window(q, now_ns);
}

/* ---- the filling thread ---- */

void source_queue_push_imu(source_queue *q, const fathom_imu_sample *sample) {
    pthread_mutex_lock(&q->lock);
    if (q->sample_count == q->sample_capacity) {
        q->first_sample = (q->first_sample + 1) % q->sample_capacity;
        q->sample_count--;
        q->counts.samples_dropped++;
    }
    q->samples[(q->first_sample + q->sample_count++) % q->sample_capacity] = *sample;
    q->counts.samples++;
    notice_arrival(q, !q->counts_frames);
    pthread_mutex_unlock(&q->lock);
    ring(q);
}

static bool is_free(const source_queue *q, int slot) {
    if (slot == q->held) return false;
    for (int i = 0; i < q->frame_count; i++)
        if (q->waiting[(q->first_frame + i) % q->frame_capacity] == slot) return false;
    return true;
}

source_slot *source_queue_next_frame(source_queue *q) {
    pthread_mutex_lock(&q->lock);
    int slot = q->filling >= 0 ? q->filling : 0;
    while (!is_free(q, slot)) slot++; /* one is: there are two more than can wait */
    q->filling = slot;
    pthread_mutex_unlock(&q->lock);
    return &q->slots[slot];
}

void source_queue_push_frame(source_queue *q, source_slot *slot) {
    pthread_mutex_lock(&q->lock);
    if (q->frame_count == q->frame_capacity) {
        q->first_frame = (q->first_frame + 1) % q->frame_capacity;
        q->frame_count--;
        q->counts.frames_dropped++;
    }
    q->waiting[(q->first_frame + q->frame_count++) % q->frame_capacity] = (int)(slot - q->slots);
    q->filling = -1;
    q->counts.frames++;
    notice_arrival(q, true);
    pthread_mutex_unlock(&q->lock);
    ring(q);
}

bool source_queue_wait_for_room(source_queue *q, bool for_frame) {
    pthread_mutex_lock(&q->lock);
    while (q->running &&
           (for_frame ? q->frame_count == q->frame_capacity : q->sample_count == q->sample_capacity)) {
        q->held_up = true;
        pthread_cond_wait(&q->room, &q->lock);
        q->last_ns = monotonic_now_ns();
    }
    q->held_up = false;
    const bool running = q->running;
    pthread_mutex_unlock(&q->lock);
    return running;
}

bool source_queue_sleep_until(source_queue *q, int64_t then_ns) {
    const struct timespec then = monotonic_timespec(then_ns > 0 ? then_ns : 0);
    pthread_mutex_lock(&q->lock);
    while (q->running && pthread_cond_timedwait(&q->room, &q->lock, &then) != ETIMEDOUT) {
    }
    const bool running = q->running;
    pthread_mutex_unlock(&q->lock);
    return running;
}

bool source_queue_is_running(source_queue *q) {
    pthread_mutex_lock(&q->lock);
    const bool running = q->running;
    pthread_mutex_unlock(&q->lock);
    return running;
}

/* ---- what has happened ---- */

void source_queue_end(source_queue *q, int why) {
    pthread_mutex_lock(&q->lock);
    if (why == FATHOM_ERROR_UNPLUGGED && !q->unplugged) q->counts.unplugged++;
    q->ended = why;
    pthread_mutex_unlock(&q->lock);
    ring(q);
}

void source_queue_unplugged(source_queue *q) {
    pthread_mutex_lock(&q->lock);
    if (!q->unplugged) q->counts.unplugged++;
    q->unplugged = true;
    q->stalled = false;
    q->counts.rate_hz = 0;
    pthread_mutex_unlock(&q->lock);
}

void source_queue_replugged(source_queue *q) {
    pthread_mutex_lock(&q->lock);
    if (q->unplugged) q->counts.reconnects++;
    q->unplugged = false;
    q->last_ns = monotonic_now_ns();
    start_window(q, q->last_ns);
    pthread_mutex_unlock(&q->lock);
}

void source_queue_count_lost(source_queue *q, int64_t number) {
    pthread_mutex_lock(&q->lock);
    q->counts.lost += number;
    pthread_mutex_unlock(&q->lock);
}

void source_queue_count_malformed(source_queue *q, int64_t number) {
    pthread_mutex_lock(&q->lock);
    q->counts.malformed += number;
    pthread_mutex_unlock(&q->lock);
}

void source_queue_set_clock(source_queue *q, double offset_s, double drift_ppm) {
    pthread_mutex_lock(&q->lock);
    q->counts.clock_offset_s = offset_s;
    q->counts.clock_drift_ppm = drift_ppm;
    pthread_mutex_unlock(&q->lock);
}

/* ---- the reader ---- */

/* FATHOM_ERROR_TIMEOUT: nothing to report yet. */
static int look(source_queue *q) {
    pthread_mutex_lock(&q->lock);
    int result = FATHOM_ERROR_TIMEOUT;
    if (q->frame_count || q->sample_count)
        result = FATHOM_OK;
    else if (q->ended)
        result = q->ended;
    else if (!q->running)
        result = FATHOM_ERROR_ARGUMENT;
    notice_silence(q, monotonic_now_ns());
    pthread_mutex_unlock(&q->lock);
    return result;
}

int source_queue_wait(source_queue *q, int timeout_ms) {
    const int64_t deadline_ns = monotonic_deadline_ns(timeout_ms);
    struct pollfd bell = {.fd = q->bell, .events = POLLIN};
    for (;;) {
        if (atomic_exchange(&q->cancelled, false)) return FATHOM_ERROR_CANCELLED;
        const int result = look(q);
        if (result != FATHOM_ERROR_TIMEOUT) return result;
        const int64_t left_ns = timeout_ms < 0 ? 1 : deadline_ns - monotonic_now_ns();
        if (left_ns <= 0) return FATHOM_ERROR_TIMEOUT;
        const struct timespec left = monotonic_timespec(left_ns);
        uint64_t rings;
        if (ppoll(&bell, 1, timeout_ms < 0 ? NULL : &left, NULL) > 0 &&
            read(q->bell, &rings, sizeof rings) < 0) { /* rung off by another wait */
        }
    }
}

void source_queue_cancel(source_queue *q) {
    atomic_store(&q->cancelled, true);
    ring(q);
}

int source_queue_read_depth(source_queue *q, fathom_source_frame *frame) {
    pthread_mutex_lock(&q->lock);
    const bool there = q->frame_count > 0;
    q->held = -1; /* the previous frame is no longer valid */
    if (there) {
        q->held = q->waiting[q->first_frame];
        q->first_frame = (q->first_frame + 1) % q->frame_capacity;
        q->frame_count--;
        *frame = q->slots[q->held].frame;
        pthread_cond_signal(&q->room);
    }
    pthread_mutex_unlock(&q->lock);
    return there ? FATHOM_OK : FATHOM_ERROR_TIMEOUT;
}

int source_queue_read_imu(source_queue *q, fathom_imu_sample *samples, int capacity) {
    pthread_mutex_lock(&q->lock);
    const int count = q->sample_count < capacity ? q->sample_count : capacity;
    for (int i = 0; i < count; i++) samples[i] = q->samples[(q->first_sample + i) % q->sample_capacity];
    if (count > 0) {
        q->first_sample = (q->first_sample + count) % q->sample_capacity;
        q->sample_count -= count;
        pthread_cond_signal(&q->room);
    }
    pthread_mutex_unlock(&q->lock);
    return count;
}

static fathom_source_state state_of(const source_queue *q) {
    if (q->ended == FATHOM_ERROR_ENDED && !q->frame_count && !q->sample_count) return FATHOM_SOURCE_AT_END;
    if (!q->running) return FATHOM_SOURCE_STOPPED;
    if (q->unplugged || q->ended == FATHOM_ERROR_UNPLUGGED) return FATHOM_SOURCE_UNPLUGGED;
    return q->stalled ? FATHOM_SOURCE_STALLED : FATHOM_SOURCE_RUNNING;
}

void source_queue_status(source_queue *q, fathom_source_status *status) {
    pthread_mutex_lock(&q->lock);
    notice_silence(q, monotonic_now_ns());
    const fathom_source_status *c = &q->counts;
    status->state = state_of(q);
    status->rate_hz = c->rate_hz;
    status->frames = c->frames;
    status->samples = c->samples;
    status->frames_dropped = c->frames_dropped;
    status->samples_dropped = c->samples_dropped;
    status->lost = c->lost;
    status->malformed = c->malformed;
    status->unplugged = c->unplugged;
    status->reconnects = c->reconnects;
    status->stalls = c->stalls;
    status->clock_offset_s = c->clock_offset_s;
    status->clock_drift_ppm = c->clock_drift_ppm;
    pthread_mutex_unlock(&q->lock);
}
