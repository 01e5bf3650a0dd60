/* A scanning context: everything that fathom_init lays out in the caller's block. */
#ifndef FATHOM_CONTEXT_H
#define FATHOM_CONTEXT_H

#include <stdatomic.h>

#include "base/error_text.h"
#include "frame/depth_noise.h"
#include "inertial/inertial.h"
#include "map/fusing.h"
#include "map/view.h"
#include "map/whole_mesh.h"
#include "tracking/odometry.h"
#include "tracking/span.h"
#include "tracking/track.h"

/* The latest results, in a ring. */
typedef struct {
    fathom_result *results; /* FATHOM_RECENT; in the block, not in the context: a scratch context lies on the stack */
    int64_t count;          /* of results so far */
} recent;

struct fathom {
    fathom_config config; /* its log passes through the error text */
    error_text error;
    atomic_bool dead; /* OpenCL has failed; read by the thread that pushes samples */
    device device;
    depth_maps maps;
    depth_noise noise;
    volume volume;
    integrator integrator;
    caller_store store;
    raycaster raycaster;
    inertial inertial;
    tracker tracker;
    fusing fusing;
    mesher mesher;
    volume patch; /* of the whole mesh */
    viewer viewer;
    int64_t arena_bytes;

    pose pose;             /* M of Figure 2: the last frame's camera to world */
    double covariance[36]; /* of that pose: pose * exp(error) */
    odometry odometry;     /* the pose that never jumps */
    span span;             /* the motion over the last second */
    int64_t timestamp_ns;  /* of the last frame; INT64_MIN: none yet */
    bool started;          /* the first surface has been fused */
    bool paused;
    bool said_full; /* the log has the message that the pool is full */
    int64_t frames_ignored;
    fathom_result result; /* of the last frame */
    recent recent;
};

/* One pass of Figure 2's loop (lib/step.c), for a checked frame. */
void step(fathom *f, const fathom_depth_frame *scan, fathom_result *r);

#endif
