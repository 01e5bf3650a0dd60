#include "tracking/span.h"

#include <string.h>

#include "base/covariance.h"
#include "base/stamps.h"

#define SPAN_S 1.0
#define SPAN_FRAMES 144 /* a second and more of frames that are ... */
#define APART_S 0.0075  /* ... further apart than this; of those that aren't, the first is kept */

/* As the camera moves on, surface that was fused at a pose with an error is what the next poses are aligned with: the map
 * drifts by so many times the error that pixels share, over a metre of way or a radian of turning. Fitted to the normalised
 * error of simulated sensors and of recordings (docs/DESIGN.md, Covariance); turning per metre of it. */
#define DRIFT_OF_SHARED 18.0
#define DRIFT_TURN 0.5 /* rad/m */

void span_init(span *s, arena *a) {
    memset(s, 0, sizeof *s);
    s->frames = arena_take(a, SPAN_FRAMES * sizeof *s->frames);
}

void span_reset(span *s) {
    s->count = 0;
    s->now = (span_frame){0};
}

static const span_frame *frame_at(const span *s, int64_t i) {
    return &s->frames[i % SPAN_FRAMES];
}

void span_add(span *s, const pose *at, const double covariance[36], bool tracked, double shared_m,
              int64_t timestamp_ns) {
    if (s->count > 0) {
        const pose way = pose_between(&s->now.at, at);
        const double each = DRIFT_OF_SHARED * shared_m;
        s->now.drift += each * each * (pose_distance(&way) + pose_angle(&way));
    }
    s->now.timestamp_ns = timestamp_ns;
    s->now.at = *at;
    s->now.tracked += tracked;
    memcpy(s->now.covariance, covariance, sizeof s->now.covariance);
    if (s->count > 0 && seconds_between(frame_at(s, s->count - 1)->timestamp_ns, timestamp_ns) < APART_S)
        return;
    s->frames[s->count++ % SPAN_FRAMES] = s->now;
}

static const span_frame *start_of(const span *s) {
    const int64_t oldest = s->count > SPAN_FRAMES ? s->count - SPAN_FRAMES : 0;
    int64_t i = s->count - 1;
    while (i > oldest && seconds_between(frame_at(s, i)->timestamp_ns, s->now.timestamp_ns) < SPAN_S - 1e-6)
        i--;
    return frame_at(s, i);
}

/* The error of inv(A exp(a)) B exp(b) is b - Ad(inv(motion)) a. Where a frame between was tracked, or the present one,
 * the two errors are those of two alignments, independent of each other, and the map has drifted between. Where dead
 * reckoning led from the one to the other, the later error contains the earlier one. */
static void relate(const span_frame *from, const span_frame *to, const pose *motion, double out[36]) {
    const pose back = pose_inverse(motion);
    const double drift = to->drift - from->drift;
    double adjoint[36], carried[36];
    bool contained = from->tracked == to->tracked;
    pose_adjoint(&back, adjoint);
    covariance_transport(adjoint, from->covariance, carried);
    for (int i = 0; i < 6; i++) contained = contained && to->covariance[7 * i] > carried[7 * i];
    for (int i = 0; i < 36; i++) out[i] = to->covariance[i] + (contained ? -carried[i] : carried[i]);
    for (int i = 0; i < 6; i++) out[7 * i] += drift * (i < 3 ? DRIFT_TURN * DRIFT_TURN : 1);
}

bool span_get(const span *s, span_motion *out) {
    if (s->count == 0) return false;
    const span_frame *from = start_of(s);
    out->from_ns = from->timestamp_ns;
    out->to_ns = s->now.timestamp_ns;
    out->motion = pose_between(&from->at, &s->now.at);
    if (out->from_ns == out->to_ns)
        memset(out->covariance, 0, sizeof out->covariance);
    else
        relate(from, &s->now, &out->motion, out->covariance);
    return true;
}
