/* The motion over the last second: from the pose in the map of the last frame that is at least a second older to the
 * present one, with what the two of them leave uncertain. */
#ifndef FATHOM_SPAN_H
#define FATHOM_SPAN_H

#include <stdbool.h>
#include <stdint.h>

#include "base/arena.h"
#include "base/se3.h"

typedef struct {
    int64_t timestamp_ns;
    pose at;               /* camera to world, in the map */
    double covariance[36]; /* at * exp(error) */
    int64_t tracked;       /* number of tracked frames up to it */
} span_frame;

typedef struct {
    span_frame *frames; /* a ring of SPAN_FRAMES, in the caller's block */
    int64_t count;      /* of frames that were put there */
    span_frame now;     /* the present frame */
} span;

typedef struct {
    int64_t from_ns, to_ns;
    pose motion;           /* inv(M_from) M_to */
    double covariance[36]; /* motion * exp(error) */
} span_motion;

void span_init(span *s, arena *a);
void span_reset(span *s);

/* Takes a frame's pose in the map; tracked: by alignment. */
void span_add(span *s, const pose *at, const double covariance[36], bool tracked, int64_t timestamp_ns);

/* False before the first frame. Before the first second is over: the motion since the first frame. */
bool span_get(const span *s, span_motion *out);

#endif
