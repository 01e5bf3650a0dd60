/* Samples and frames in, results out. */
#include "api/call.h"
#include "api/frame_check.h"
#include "base/log.h"
#include "base/sized.h"

int fathom_push_imu(fathom *f, const fathom_imu_sample *sample) {
    if (!f || !sample) return FATHOM_ERROR_ARGUMENT;
    if (atomic_load(&f->dead)) return FATHOM_ERROR_DEVICE;
    return inertial_push(&f->inertial, sample);
}

static void remember(recent *r, const fathom_result *result) {
    r->results[r->count++ % FATHOM_RECENT] = *result;
}

int fathom_step(fathom *f, const fathom_depth_frame *given, fathom_result *result) {
    fathom_depth_frame frame;
    fathom_result whole;
    size_t size = sized_of(result);
    int e = call_begin(f);
    if (e == FATHOM_OK && (size = call_struct(f, result, "fathom_result")) == 0) e = FATHOM_ERROR_ARGUMENT;
    if (e == FATHOM_OK) e = frame_take(f, given, &frame);
    if (e == FATHOM_ERROR_SIZE || e == FATHOM_ERROR_TIME) f->frames_ignored++;
    if (e != FATHOM_OK) {
        if (f && size > 0) sized_out(result, size, &f->result, sizeof f->result);
        return e;
    }
    const fathom_result last = f->result;
    const pose at = f->pose;
    step(f, &frame, &whole);
    if (f->device.error != FATHOM_OK) { /* results since then are invalid: the last good pose stays */
        f->pose = at;
        f->result = last;
    }
    e = call_end(f);
    if (e == FATHOM_OK)
        remember(&f->recent, &whole);
    else
        whole = f->result;
    sized_out(result, size, &whole, sizeof whole);
    if (whole.pool_full && !f->said_full) {
        f->said_full = true;
        log_write(&f->config, FATHOM_LOG_WARNING,
                   "the block pool is full (%d blocks): the surface no longer grows, tracking goes on",
                   f->volume.pool.capacity);
    }
    return e;
}

int32_t fathom_get_recent(fathom *f, fathom_result *results, int32_t capacity) {
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    if (capacity < 0) return call_refuse(f, "a capacity of %d results", capacity);
    const size_t size = capacity > 0 ? call_struct(f, results, "fathom_result") : 0;
    if (capacity > 0 && size == 0) return FATHOM_ERROR_ARGUMENT;
    const int64_t kept = f->recent.count < FATHOM_RECENT ? f->recent.count : FATHOM_RECENT;
    const int32_t count = kept < capacity ? (int32_t)kept : capacity;
    for (int32_t i = 0; i < count; i++) {
        const fathom_result *r = &f->recent.results[(f->recent.count - count + i) % FATHOM_RECENT];
        sized_out((unsigned char *)results + size * (size_t)i, size, r, sizeof *r);
    }
    return count;
}
