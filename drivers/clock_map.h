/*
 * Maps a device's clock to the host's monotonic one, from pairs of a device stamp and its time of arrival. Their
 * difference is the clocks' offset plus a delay that is never negative, so the offset follows the fastest arrivals (a
 * minimum-delay filter, as in the Network Time Protocol's clock filter), and the drift is their slope over half a
 * minute.
 *
 * The constant part of the delay is unobservable; a driver that knows it subtracts it from the stamps.
 */
#ifndef FATHOM_CLOCK_MAP_H
#define FATHOM_CLOCK_MAP_H

#include <stdbool.h>
#include <stdint.h>

#define CLOCK_MAP_WINDOWS 64

typedef struct {
    bool started, restart;
    int64_t device_zero_ns, host_zero_ns; /* the first pair, to which all else is relative */
    double at, offset;                    /* seconds: the newest device stamp, and the offset added to it */
    double slope;                         /* of the offset, seconds per second */
    struct {
        double at, offset; /* of the fastest arrival within the window */
    } fastest[CLOCK_MAP_WINDOWS];
    int first, count;      /* ring of windows */
    double window_end;     /* of the current one, on the device's clock */
    double least_delay;    /* within the current window */
    int late_windows;      /* consecutive ones without any arrival near the line */
    int64_t last_stamp_ns; /* the newest that clock_map_stamp gave */
    int leaps;             /* number of leaps of the device's clock, each of which began a new line */
} clock_map;

/* Forgets everything. A zeroed map is ready for use. */
void clock_map_reset(clock_map *map);

/* To be called when the device was reopened, and its clock may have been set: the next pair begins a new line. */
void clock_map_restart(clock_map *map);

/* Takes a stamp and its time of arrival; returns the stamp on the host's clock. Returned stamps always increase, and
 * don't lie after the arrival unless they must in order to increase. The mapping approaches a corrected line by 2 % of
 * elapsed time; after a leap of the device's clock (a reset, a wrap) it begins a new line. */
int64_t clock_map_stamp(clock_map *map, int64_t device_ns, int64_t arrival_ns);

/* Maps another stamp of the same clock, near the last one, without updating the map. */
int64_t clock_map_at(const clock_map *map, int64_t device_ns);

/* Host minus device at the newest stamp, seconds; 0 before the first. */
double clock_map_offset_s(const clock_map *map);

/* Drift: by how much the device's clock runs fast, parts per million of the host's. */
double clock_map_drift_ppm(const clock_map *map);

#endif
