/*
 * A device's clock against the host's monotonic one, from the pairs of a device stamp and the time at which it
 * arrived. What lies between the two is the clocks' offset and a delay that is never negative, so the offset
 * follows the fastest arrivals (a minimum-delay filter, as in the Network Time Protocol's clock filter), and
 * the drift is their slope over half a minute.
 *
 * The part of the delay that is always there can't be seen; a driver that knows it takes it off the stamps.
 */
#ifndef FATHOM_CLOCK_MAP_H
#define FATHOM_CLOCK_MAP_H

#include <stdbool.h>
#include <stdint.h>

#define CLOCK_MAP_WINDOWS 64

typedef struct {
    bool started, restart;
    int64_t device_zero_ns, host_zero_ns; /* the first pair; everything else counts from there */
    double at, offset;                    /* seconds: the newest device stamp, and what is added to it */
    double slope;                         /* of the offset, seconds a second */
    struct {
        double at, offset; /* of the fastest arrival within the window */
    } fastest[CLOCK_MAP_WINDOWS];
    int first, count;      /* ring of windows */
    double window_end;     /* of the present one, on the device's clock */
    double least_delay;    /* within the present window */
    int late_windows;      /* in a row without any arrival near the line */
    int64_t last_stamp_ns; /* the newest that clock_map_stamp gave */
    int leaps;             /* times that the device's clock leapt and the line was begun anew */
} clock_map;

/* Forgets everything. A map of zeros is started. */
void clock_map_reset(clock_map *map);

/* The device was opened anew, and its clock may have been set: the next pair begins a new line. */
void clock_map_restart(clock_map *map);

/* The pair of a stamp and its arrival; the stamp on the host's clock. Stamps given here increase, however the
 * device's behave, and don't lie after the arrival unless they must in order to increase. When the line is
 * found to be wrong it is approached by 2 % of the time that passes; after a leap of the device's clock (its
 * reset, a wrap) it is begun anew. */
int64_t clock_map_stamp(clock_map *map, int64_t device_ns, int64_t arrival_ns);

/* Another stamp of the same clock, near the last one; nothing is learnt from it. */
int64_t clock_map_at(const clock_map *map, int64_t device_ns);

/* Host minus device at the newest stamp, seconds; 0 before the first. */
double clock_map_offset_s(const clock_map *map);

/* How much the device's clock runs fast, parts a million of the host's. */
double clock_map_drift_ppm(const clock_map *map);

#endif
