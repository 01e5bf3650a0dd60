/*
 * The queue between a driver's thread, which fills it, and the thread that uses the source: a ring of depth frames and
 * a ring of inertial samples, both of fixed size, with counters. It also holds the source's state, and
 * fathom_source_wait waits on it.
 *
 *     source_queue_make(&queue, ...)                   once
 *     source_queue_start(&queue)                       then the driver's thread runs:
 *         slot = source_queue_next_frame(&queue);      fill slot->depth and slot->frame's stamps
 *         source_queue_push_frame(&queue, slot);
 *         source_queue_push_imu(&queue, &sample);
 *     source_queue_stop(&queue)                        then the driver joins its thread
 *     source_queue_free(&queue)
 *
 * No heap after source_queue_make. One thread fills, one reads; counting and queries may come from any thread.
 */
#ifndef FATHOM_SOURCE_QUEUE_H
#define FATHOM_SOURCE_QUEUE_H

#include <pthread.h>
#include <stdatomic.h>

#include "fathom_drivers.h"

/* Room for one frame. */
typedef struct {
    fathom_source_frame frame; /* its depth is set by the queue */
    /* the target of frame.depth: the filling thread sets its stamp, and its image where it has one */
    fathom_depth_frame about;
    fathom_image image;        /* of color: the filling thread sets its stamp */
    uint16_t *depth;           /* width * height */
    uint8_t *color;            /* 3 * width * height, or NULL */
} source_slot;

typedef struct {
    pthread_mutex_t lock;
    pthread_cond_t room; /* the reader made room, or the filling thread is to stop */
    int bell;            /* an eventfd: something can be read, or the wait is cancelled */
    atomic_bool cancelled;

    fathom_imu_sample *samples; /* ring */
    int sample_capacity, first_sample, sample_count;

    source_slot *slots; /* frame_capacity, one being filled, one held by the reader */
    int frame_capacity, slot_count;
    int *waiting; /* slot numbers, a ring */
    int first_frame, frame_count;
    int held;    /* the slot held by the reader; -1: none */
    int filling; /* the slot that source_queue_next_frame returned; -1: none */

    bool running;   /* between start and stop */
    int ended;      /* the result of wait after everything was read; FATHOM_OK: it goes on */
    bool unplugged; /* waiting for the device, when ended is FATHOM_OK */
    bool stalled;
    bool held_up;               /* the filling thread waits for the reader: its silence is no stall */
    bool counts_frames;         /* the rate is that of frames, else of samples */
    int64_t last_ns, window_ns; /* of the last arrival; start of the current window of the rate */
    int window_count;
    fathom_source_status counts; /* rate and counters; the rest is unused */
} source_queue;

/* frames 0: no depth; samples 0: no IMU. FATHOM_OK or FATHOM_ERROR_MEMORY, then there is nothing to free. */
int source_queue_make(source_queue *queue, int samples, int frames, int width, int height, bool color);
void source_queue_free(source_queue *queue);

/* Empties it and begins; a pending cancel stays. */
void source_queue_start(source_queue *queue);

/* Ends it: the filling thread returns from waiting for room or time. */
void source_queue_stop(source_queue *queue);

/* ---- the filling thread ---- */

/* Takes the sample; when the ring is full the oldest is dropped and counted. */
void source_queue_push_imu(source_queue *queue, const fathom_imu_sample *sample);

/* The slot to fill next: the same until it is pushed, whatever the reader does. Never NULL, never waits. */
source_slot *source_queue_next_frame(source_queue *queue);

/* Takes the slot that source_queue_next_frame returned; when the ring is full the oldest is dropped and counted. */
void source_queue_push_frame(source_queue *queue, source_slot *slot);

/* Waits until a frame (or else a sample) can be pushed without dropping one; false: stopped meanwhile. */
bool source_queue_wait_for_room(source_queue *queue, bool for_frame);

/* Waits until CLOCK_MONOTONIC has come to then_ns; false: stopped meanwhile. */
bool source_queue_sleep_until(source_queue *queue, int64_t then_ns);

/* Whether it is between start and stop. */
bool source_queue_is_running(source_queue *queue);

/* ---- what has happened ---- */

/* Marks the end of data: FATHOM_ERROR_ENDED, FATHOM_ERROR_UNPLUGGED, or the error that ended it. */
void source_queue_end(source_queue *queue, int why);

/* Mark that the device is gone and awaited, and that it is back. */
void source_queue_unplugged(source_queue *queue);
void source_queue_replugged(source_queue *queue);

void source_queue_count_lost(source_queue *queue, int64_t number);
void source_queue_count_malformed(source_queue *queue, int64_t number);

/* Sets the status's values of the device's clock (clock_map_offset_s, clock_map_drift_ppm). */
void source_queue_set_clock(source_queue *queue, double offset_s, double drift_ppm);

/* ---- the reader ---- */

/* As fathom_source_wait, _cancel, _read_depth, _read_imu. */
int source_queue_wait(source_queue *queue, int timeout_ms);
void source_queue_cancel(source_queue *queue);
int source_queue_read_depth(source_queue *queue, fathom_source_frame *frame);
int source_queue_read_imu(source_queue *queue, fathom_imu_sample *samples, int capacity);

/* Fills in state, rate and counts; the rest stays. */
void source_queue_status(source_queue *queue, fathom_source_status *status);

#endif
