/* The host's monotonic clock, in nanoseconds. */
#ifndef FATHOM_MONOTONIC_H
#define FATHOM_MONOTONIC_H

#include <stdint.h>
#include <time.h>

static inline int64_t monotonic_now_ns(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* timeout_ms from now; negative: never. */
static inline int64_t monotonic_deadline_ns(int timeout_ms) {
    return timeout_ms < 0 ? INT64_MAX : monotonic_now_ns() + (int64_t)timeout_ms * 1000000;
}

static inline struct timespec monotonic_timespec(int64_t ns) {
    struct timespec time;
    time.tv_sec = (time_t)(ns / 1000000000);
    time.tv_nsec = (long)(ns % 1000000000);
    return time;
}

#endif
