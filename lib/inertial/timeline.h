/* The recent past of the navigator: its state after each measurement, so that a late one is applied in order. */
#ifndef FATHOM_TIMELINE_H
#define FATHOM_TIMELINE_H

#include "base/arena.h"
#include "inertial/measurement.h"

/* with a frame's pose and, at rest, two measurements of that: a quarter of a second at 30 Hz */
#define TIMELINE_MOMENTS 24
#define TIMELINE_NS 1000000000 /* none is looked for further back than this: a bound on the samples to go over again */

/* The state that measurements change. */
typedef struct {
    navigator state;      /* at the last measurement */
    double mismatch;      /* disagreement of poses and inertia: sigmas in units of the settings' */
    bool doubted;         /* the gyroscope contradicts the poses and is ignored until it agrees again */
    int against;          /* consecutive accepted poses that it contradicted */
    double gyro_error;    /* rad^2: error of the rotation between poses as the samples predict it */
    double turn_error;    /* the same as the previous poses predict it, without samples */
    /* mean squares of what constant velocity didn't foresee, without an IMU: of the angular acceleration, rad^2/s^4, and
     * the linear one's density, m^2/s^3 */
    double unsteady[2];
    double turning[3];    /* rad/s in camera axes, from the last two poses; used without a gyroscope */
    int64_t corrected_ns; /* stamp of the last accepted pose; INT64_MIN: none yet */
    pose corrected;       /* that pose */
} navigation;

typedef struct {
    measurement by;
    navigation after;
} timeline_moment;

typedef struct {
    timeline_moment *moments; /* a circle in the order of stamps */
    int first, count;
} timeline;

void timeline_init(timeline *t, arena *a);

/* The i-th moment, 0 the oldest. */
static inline timeline_moment *timeline_at(const timeline *t, int i) {
    return &t->moments[(t->first + i) % TIMELINE_MOMENTS];
}

/* Forgets the past; the present is the first moment. */
void timeline_restart(timeline *t, const navigation *now);

/* Index of the last moment at or before a stamp, or -1: none is so old, or it is too far back. */
int timeline_find(const timeline *t, int64_t timestamp_ns);

/* Makes room for a moment before the i-th (i = count: at the end), which the caller fills in; the oldest is dropped
 * when full. Returns its index. i >= 1. */
int timeline_insert(timeline *t, int i);

#endif
