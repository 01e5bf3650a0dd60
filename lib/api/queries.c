/* Queries of a context: motion, pose, mounting, counters. */
#include <string.h>

#include "api/call.h"
#include "base/sized.h"
#include "base/stamps.h"

int fathom_inertial_estimate(fathom *f, int64_t from_ns, int64_t to_ns, fathom_motion *motion) {
    inertial_motion m;
    fathom_motion whole = FATHOM_STRUCT(fathom_motion);
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    const size_t size = call_struct(f, motion, "fathom_motion");
    if (size == 0) return FATHOM_ERROR_ARGUMENT;
    if (!stamp_valid(from_ns) || !stamp_valid(to_ns))
        return call_refuse(f, "a stamp more than 126 years from zero");
    inertial_drain(&f->inertial);
    e = inertial_estimate(&f->inertial, from_ns, to_ns, &m);
    if (e != FATHOM_OK) {
        return error_text_fail(&f->error, e, FATHOM_LOG_INFO,
                               "there are neither samples nor a tracked frame to estimate by");
    }
    whole.motion = pose_give(&m.motion);
    memcpy(whole.covariance, m.covariance, sizeof whole.covariance);
    sized_out(motion, size, &whole, sizeof whole);
    return FATHOM_OK;
}

int fathom_get_pose(fathom *f, fathom_pose *at, double covariance[36]) {
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    if (!at) return call_refuse(f, "pose is NULL");
    *at = pose_give(&f->pose);
    if (covariance) memcpy(covariance, f->covariance, sizeof f->covariance);
    return FATHOM_OK;
}

int fathom_get_span(fathom *f, fathom_span *given) {
    span_motion m;
    fathom_span whole = FATHOM_STRUCT(fathom_span);
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    const size_t size = call_struct(f, given, "fathom_span");
    if (size == 0) return FATHOM_ERROR_ARGUMENT;
    if (!span_get(&f->span, &m))
        return error_text_fail(&f->error, FATHOM_ERROR_NO_DATA, FATHOM_LOG_INFO, "there is no frame yet");
    whole.from_ns = m.from_ns;
    whole.to_ns = m.to_ns;
    whole.motion = pose_give(&m.motion);
    memcpy(whole.covariance, m.covariance, sizeof whole.covariance);
    sized_out(given, size, &whole, sizeof whole);
    return FATHOM_OK;
}

int fathom_get_rig(fathom *f, fathom_rig *rig) {
    fathom_rig whole = FATHOM_STRUCT(fathom_rig);
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    const size_t size = call_struct(f, rig, "fathom_rig");
    if (size == 0) return FATHOM_ERROR_ARGUMENT;
    inertial_rig(&f->inertial, &whole);
    sized_out(rig, size, &whole, sizeof whole);
    return FATHOM_OK;
}

int fathom_get_counters(fathom *f, fathom_counters *counters) {
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    const size_t size = call_struct(f, counters, "fathom_counters");
    if (size == 0) return FATHOM_ERROR_ARGUMENT;
    inertial_drain(&f->inertial);
    fathom_counters whole = FATHOM_STRUCT(fathom_counters);
    inertial_count(&f->inertial, &whole);
    whole.frames_ignored = f->frames_ignored;
    whole.blocks_dropped = f->store.put;
    whole.blocks_restored = f->store.restored;
    whole.blocks_refused = f->integrator.refused;
    whole.blocks_lost = f->store.lost;
    sized_out(counters, size, &whole, sizeof whole);
    return FATHOM_OK;
}
