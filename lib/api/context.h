/* A scanning context: everything that fathom_init lays out in the caller's block. */
#ifndef FATHOM_CONTEXT_H
#define FATHOM_CONTEXT_H

#include "align/align.h"
#include "inertial/inertial.h"
#include "tracking/verdict.h"
#include "tracking/relocalise.h"
#include "tracking/predicted_view.h"
#include "map/eviction.h"
#include "map/view.h"
#include "map/whole_mesh.h"

struct fathom {
    fathom_config config;
    device device;
    depth_maps maps;
    volume volume;
    integrator integrator;
    raycaster raycaster;
    aligner aligner;
    model_view view;
    inertial inertial;
    mesher mesher;
    volume patch; /* of the whole mesh */
    viewer viewer;
    caller_store store;
    int64_t arena_bytes;

    pose pose;             /* M of Figure 2: the last frame's camera to world */
    double covariance[36]; /* of that pose: pose * exp(error) */
    int64_t timestamp_ns;  /* of the last frame; INT64_MIN: none yet */
    bool started;          /* the first surface has been fused */
    pose reference;        /* where the model maps were seen from */
    pose fused;            /* of the last frame that went into the surface */
    int cast_coarsest; /* coarsest level of the model maps; FATHOM_LEVELS: there are none to be used again */
    int cast_pairs;    /* that alignment found when they were new */
    unsigned drawn;    /* hypotheses of the search so far */
    int missed;        /* frames in a row, lost, that alignment and search have failed for */
    bool paused;
    bool said_full; /* the log knows that the pool is full */
    int64_t frames_ignored;
    fathom_result result; /* of the last frame */
};

/* One turn of Figure 2 (lib/step.c); the frame has been checked. */
void step(fathom *f, const fathom_depth_frame *scan, fathom_result *r);

/* Its core: aligns the frame in the maps from a seed of that covariance, and judges. seeded: with seeded_iterations. */
void attempt(fathom *f, const fathom_depth_frame *scan, const pose *seed, const double predicted[36],
             bool seeded, alignment *icp, fathom_result *r);

/* Puts the frame in the maps into the surface, as seen from there. */
void fuse(fathom *f, const pose *at, fathom_result *r);

#endif
