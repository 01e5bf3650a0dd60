#include "clock_map.h"

#include <math.h>
#include <string.h>

#define WINDOW_S 0.5       /* one pair is kept per window, the fastest arrival */
#define OFFSET_WINDOWS 20  /* the line touches the fastest arrival of this number of windows */
#define DRIFT_SIGMA 1e-4   /* of a usual crystal; prior of the slope */
#define DELAY_SIGMA_S 5e-4 /* scatter of the fastest arrivals */
#define MOST_DRIFT 0.05
#define APPROACH 0.02 /* a wrong line is corrected by this part of elapsed time */
#define SETTLE_S 1.0  /* within the first second, by this part: */
#define APPROACH_EARLY 0.2
#define EARLY_LEAP_S 0.1 /* a stamp later than its arrival by this: the clock leapt ahead */
#define BACK_LEAP_S 0.05 /* a stamp earlier than the last by this: the clock went back */
#define LATE_S 0.2       /* nothing within this of the line ... */
#define LATE_WINDOWS 4   /* ... for this number of windows: the clock stood still or went back unnoticed */

void clock_map_reset(clock_map *map) {
    memset(map, 0, sizeof *map);
}

/* ---- the line under the fastest arrivals ---- */

static int window_at(const clock_map *map, int i) {
    return (map->first + i) % CLOCK_MAP_WINDOWS;
}

/* The median slope between windows half of them apart (Theil 1950, thinned out), so that a few windows without a fast
 * arrival don't matter, with the prior of crystals. */
static double fit_slope(const clock_map *map) {
    double slopes[CLOCK_MAP_WINDOWS / 2], apart_s = 0;
    const int half = (map->count + 1) / 2, pairs = map->count - half;
    for (int i = 0; i < pairs; i++) {
        const int from = window_at(map, i), to = window_at(map, i + half);
        const double seconds = map->fastest[to].at - map->fastest[from].at;
        const double slope = (map->fastest[to].offset - map->fastest[from].offset) / seconds;
        int at = i;
        for (; at > 0 && slopes[at - 1] > slope; at--) slopes[at] = slopes[at - 1];
        slopes[at] = slope;
        apart_s += seconds;
    }
    if (pairs == 0) return 0;
    const double median = (slopes[(pairs - 1) / 2] + slopes[pairs / 2]) / 2,
                 prior_s = DELAY_SIGMA_S / DRIFT_SIGMA;
    const double known = apart_s * apart_s / pairs; /* s^2: weight of all pairs together */
    return fmin(fmax(median * known / (known + prior_s * prior_s), -MOST_DRIFT), MOST_DRIFT);
}

/* The offset at the newest stamp, by the highest line of that slope below all recent arrivals. */
static double fit_offset(const clock_map *map, double slope) {
    const int recent = map->count < OFFSET_WINDOWS ? map->count : OFFSET_WINDOWS;
    double least = INFINITY;
    for (int i = map->count - recent; i < map->count; i++) {
        const int window = window_at(map, i);
        const double offset = map->fastest[window].offset + slope * (map->at - map->fastest[window].at);
        if (offset < least) least = offset;
    }
    return least;
}

static void begin(clock_map *map, int64_t device_ns, int64_t arrival_ns) {
    const int64_t last_stamp_ns = map->last_stamp_ns;
    const bool again = map->started;
    const int leaps = map->leaps;
    clock_map_reset(map);
    map->started = true;
    map->device_zero_ns = device_ns;
    map->host_zero_ns = arrival_ns;
    map->last_stamp_ns = again ? last_stamp_ns : INT64_MIN;
    map->leaps = leaps + again;
    map->count = 1; /* its window holds the pair (0, 0) */
    map->window_end = WINDOW_S;
    map->least_delay = 0;
}

/* True when the window that ends here shows that the line no longer fits the arrivals. */
static bool next_window(clock_map *map, double at, double offset) {
    map->late_windows = map->least_delay > LATE_S ? map->late_windows + 1 : 0;
    if (map->late_windows >= LATE_WINDOWS) return true;
    map->slope = fit_slope(map);
    if (map->count == CLOCK_MAP_WINDOWS)
        map->first = (map->first + 1) % CLOCK_MAP_WINDOWS;
    else
        map->count++;
    map->fastest[window_at(map, map->count - 1)].at = at;
    map->fastest[window_at(map, map->count - 1)].offset = offset;
    map->window_end = at + WINDOW_S;
    map->least_delay = INFINITY;
    return false;
}

/* False: the clock leapt. */
static bool learn(clock_map *map, double at, double arrival) {
    const double offset = arrival - at, expected = map->offset + map->slope * (at - map->at);
    const double delay = offset - expected;
    if (at < map->at - BACK_LEAP_S || delay < -EARLY_LEAP_S) return false;
    if (at <= map->at) return true; /* no new information */
    if (at >= map->window_end && next_window(map, at, offset)) return false;
    if (delay < map->least_delay) {
        const int newest = window_at(map, map->count - 1);
        map->least_delay = delay;
        map->fastest[newest].at = at;
        map->fastest[newest].offset = offset;
    }
    const double passed = at - map->at;
    const double most = (at < SETTLE_S ? APPROACH_EARLY : APPROACH) * passed;
    map->at = at;
    const double wrong = fit_offset(map, map->slope) - expected;
    map->offset = expected + fmin(fmax(wrong, -most), most);
    return true;
}

static double since(int64_t ns, int64_t zero_ns) {
    return 1e-9 * (double)(int64_t)((uint64_t)ns - (uint64_t)zero_ns);
}

void clock_map_restart(clock_map *map) {
    map->restart = map->started;
}

int64_t clock_map_stamp(clock_map *map, int64_t device_ns, int64_t arrival_ns) {
    if (!map->started || map->restart ||
        !learn(map, since(device_ns, map->device_zero_ns), since(arrival_ns, map->host_zero_ns)))
        begin(map, device_ns, arrival_ns);
    int64_t stamp_ns = clock_map_at(map, device_ns);
    if (stamp_ns > arrival_ns) stamp_ns = arrival_ns;
    if (stamp_ns <= map->last_stamp_ns) stamp_ns = map->last_stamp_ns + 1;
    map->last_stamp_ns = stamp_ns;
    return stamp_ns;
}

int64_t clock_map_at(const clock_map *map, int64_t device_ns) {
    const int64_t passed_ns = (int64_t)((uint64_t)device_ns - (uint64_t)map->device_zero_ns);
    const double offset = map->offset + map->slope * (1e-9 * (double)passed_ns - map->at);
    return (int64_t)((uint64_t)map->host_zero_ns + (uint64_t)passed_ns + (uint64_t)llrint(1e9 * offset));
}

double clock_map_offset_s(const clock_map *map) {
    if (!map->started) return 0;
    return 1e-9 * ((double)map->host_zero_ns - (double)map->device_zero_ns) + map->offset;
}

double clock_map_drift_ppm(const clock_map *map) {
    return -1e6 * map->slope;
}
