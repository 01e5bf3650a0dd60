/* Time: stamps in nanoseconds on the depth camera's clock, and the host's clock for durations. */
#ifndef FATHOM_STAMPS_H
#define FATHOM_STAMPS_H

#include <stdbool.h>
#include <stdint.h>
#include <time.h>

#define STAMP_MAX 4000000000000000000 /* ns, 126 years: the difference of two stamps fits an int64 */

static inline bool stamp_valid(int64_t stamp_ns) {
    return stamp_ns >= -STAMP_MAX && stamp_ns <= STAMP_MAX;
}

static inline double seconds_between(int64_t from_ns, int64_t to_ns) {
    return 1e-9 * ((double)to_ns - (double)from_ns);
}

/* Milliseconds of the host's monotonic clock. */
static inline double now_ms(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

#endif
