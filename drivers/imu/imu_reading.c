#include "imu/imu_reading.h"

#include <math.h>

uint64_t whole_counter_next(whole_counter *counter, uint64_t raw, int bits, double tick_ns,
                            int64_t arrival_ns) {
    const uint64_t wrap = UINT64_C(1) << bits;
    if (!counter->known) {
        *counter = (whole_counter){.known = true, .count = raw & (wrap - 1)};
    } else {
        const uint64_t step = (raw - counter->count) & (wrap - 1);
        double wraps = step > wrap - wrap / 8 ? -1 : 0;
        if (arrival_ns && counter->seen_ns) {
            const double since_seen = (double)(int64_t)(counter->count - counter->seen_count);
            const double expected = (double)(arrival_ns - counter->seen_ns) / tick_ns - since_seen;
            wraps = round((expected - (double)step) / (double)wrap);
        }
        counter->count += step;
        if (wraps < 0 && counter->count >= wrap)
            counter->count -= wrap;
        else if (wraps > 0 && wraps * (double)wrap < 4e18)
            counter->count += (uint64_t)wraps * wrap;
    }
    if (arrival_ns) {
        counter->seen_count = counter->count;
        counter->seen_ns = arrival_ns;
    }
    return counter->count;
}
