/* The line [rigidICP, tracking] = ICP(scan, M * d) of Figure 2: attempts to align the frame, each from a start of its
 * own, until one is to be trusted. The prior is what inertia says, wherever an attempt starts. */
#ifndef FATHOM_TRACK_H
#define FATHOM_TRACK_H

#include "align/model_maps.h"
#include "inertial/inertial.h"
#include "tracking/verdict.h"

/* What a frame has cost: the sum over its attempts, those that failed too. */
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
    bool strayed;   /* the last frame wasn't tracked */
    int missed;     /* frames in a row, lost, that every attempt has failed for */
    unsigned drawn; /* hypotheses of relocalisation so far */
    /* of the frame at hand */
    double valid; /* the part of it that is valid depth */
    tracking_cost cost;
} tracker;

void tracker_init(tracker *t, device *d, arena *a, const fathom_config *config, depth_maps *maps,
                  raycaster *r, inertial *n);
void tracker_close(tracker *t);
void tracker_reset(tracker *t);

/* Figure 2's line. The frame's maps are made; seed: M * d. True where *icp is to be trusted. Waits for the device. */
bool track(tracker *t, const fathom_depth_frame *scan, const align_prior *seed, attempt *icp);

/* One attempt: aligns from a start, and judges. seeded: with max_seeded_iterations. The frame is that of the last
 * track(). */
void track_attempt(tracker *t, const pose *start, const align_prior *prior, bool seeded, attempt *a);

/* What became of the frame decides how hard the next one is looked for. */
void track_settle(tracker *t, fathom_state state, fathom_verdict verdict);

/* A pose was accepted: with FATHOM_AGAINST_PREVIOUS the frame is what the next one is aligned with. */
void track_keep(tracker *t, const pose *at);

#endif
