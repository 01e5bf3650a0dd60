/* The line [rigidICP, tracking] = ICP(scan, M * d) of Figure 2: attempts to align the frame, each from another start,
 * until one is trusted. The prior is the inertial estimate, wherever an attempt starts. */
#ifndef FATHOM_TRACK_H
#define FATHOM_TRACK_H

#include "align/model_maps.h"
#include "inertial/inertial.h"
#include "tracking/verdict.h"

/* The cost of a frame: the sum over its attempts, failed ones included. */
typedef struct {
    int iterations;
    double ms_raycast, ms_align;
} tracking_cost;

typedef struct {
    const fathom_config *config;
    device *device;
    depth_maps *maps; /* the frame's */
    raycaster *raycaster;
    inertial *inertial;
    aligner aligner;
    model_maps models;
    model_view view;
    int64_t tracked_ns; /* of the last tracked frame */
    bool strayed;   /* the last frame wasn't tracked */
    /* when the surface began to contradict poses that inertia confirms, and when it did last; INT64_MIN: never */
    int64_t contradicted_ns, contradiction_ns;
    int missed;     /* consecutive lost frames for which every attempt failed */
    unsigned drawn; /* hypotheses of relocalisation so far */
    /* of the current frame */
    int64_t timestamp_ns;
    double valid; /* the fraction of valid depth */
    tracking_cost cost;
} tracker;

void tracker_init(tracker *t, device *d, arena *a, const fathom_config *config, depth_maps *maps,
                  raycaster *r, inertial *n);
void tracker_close(tracker *t);
void tracker_reset(tracker *t);

/* Figure 2's line. The frame's maps are made; seed: M * d. True if *icp is trusted. Waits for the device. */
bool track(tracker *t, const fathom_depth_frame *scan, const align_prior *seed, attempt *icp);

/* One attempt: aligns from a start, and judges the result. seeded: with max_seeded_iterations. The frame is that of the
 * last track(). */
void track_attempt(tracker *t, const pose *start, const align_prior *prior, bool seeded, attempt *a);

/* Takes the frame's outcome, which decides how thoroughly the next one is searched for. */
void track_settle(tracker *t, fathom_state state, fathom_verdict verdict);

/* Takes a frame's accepted pose: with FATHOM_AGAINST_PREVIOUS the next frame is aligned with this one. */
void track_keep(tracker *t, const pose *at, int64_t timestamp_ns);

#endif
