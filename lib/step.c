/* The loop of the paper's Figure 2, one pass per call.
 *
 *     d = InertialEstimate(t_i-1, t_i)
 *     [rigidICP, tracking] = ICP(scan, M * d)
 *     if tracking:  Fusion(scan, rigidICP);  M = rigidICP
 *     else:         M = M * d */
#include <string.h>

#include "context.h"
#include "base/covariance.h"
#include "base/stamps.h"
#include "tracking/report.h"
#include "tracking/seed.h"

/* M = at */
static void move(fathom *f, const pose *at, const double covariance[36]) {
    f->pose = *at;
    memcpy(f->covariance, covariance, sizeof f->covariance);
}

/* M = Identity(): the first surface, seen from the first pose, defines the world. */
static void first_turn(fathom *f, const fathom_depth_frame *scan, fathom_result *r) {
    r->state = FATHOM_RECKONED;
    r->verdict = FATHOM_VERDICT_NO_DEPTH;
    if (f->paused) { /* no surface to align with, and fusing is paused */
        r->verdict = FATHOM_VERDICT_FEW_PAIRS;
        return;
    }
    if (has_depth(valid_part(&f->maps, scan))) fuse(&f->fusing, &f->pose, r);
    r->fused = f->started = f->volume.pool.count > 0;
    if (!f->started) return;
    memset(f->covariance, 0, sizeof f->covariance);
    for (int i = 0; i < 6; i++) f->covariance[7 * i] = 1e-10;
    track_keep(&f->tracker, &f->pose, r->timestamp_ns);
    inertial_correct(&f->inertial, &f->pose, NULL, NULL, true, r->timestamp_ns);
    inertial_check(&f->inertial, &f->pose, true, r->timestamp_ns);
    r->state = FATHOM_FIRST;
    r->verdict = FATHOM_VERDICT_TRACKING;
}

/* Updates the navigator with the frame's pose, or propagates it without, and advances the pose that never jumps. */
static void learn(fathom *f, const inertial_motion *d, const attempt *best, bool tracking,
                  int64_t timestamp_ns) {
    const alignment *icp = &best->icp;
    if (tracking || best->verdict == FATHOM_VERDICT_UNCERTAIN)
        inertial_correct(&f->inertial, &f->pose, icp->information, icp->pull, !best->contradicted, timestamp_ns);
    else
        inertial_advance(&f->inertial, timestamp_ns);
    bool settled = settled_by_geometry(&f->config, best) && !best->contradicted;
    inertial_check(&f->inertial, settled ? &icp->motion : NULL, tracking, timestamp_ns);
    odometry_advance(&f->odometry, &d->motion, d->covariance, &f->pose, f->covariance, tracking,
                     seconds_between(f->timestamp_ns, timestamp_ns));
}

static void turn(fathom *f, const fathom_depth_frame *scan, fathom_result *r) {
    attempt best;
    const alignment *icp = &best.icp;
    inertial_motion d = inertial_seed(&f->inertial, f->covariance, f->timestamp_ns, scan->timestamp_ns);
    align_prior seed = seed_at(&f->pose, &d); /* M * d */
    bool tracking = track(&f->tracker, scan, &seed, &best);
    if (tracking) {
        if (!f->paused) fuse(&f->fusing, &icp->motion, r);
        move(f, &icp->motion, icp->covariance);
        track_keep(&f->tracker, &f->pose, scan->timestamp_ns);
    } else if (best.verdict == FATHOM_VERDICT_UNCERTAIN) { /* some directions are known: a wall's distance, tilt */
        move(f, &icp->motion, icp->covariance);
    } else {
        move(f, &seed.mean, seed.covariance);
    }
    bool lost = covariance_position_sigma(f->covariance) > f->config.max_reckoned_sigma_m;
    r->state = tracking ? FATHOM_TRACKED : lost ? FATHOM_LOST : FATHOM_RECKONED;
    learn(f, &d, &best, tracking, scan->timestamp_ns);
    track_settle(&f->tracker, r->state, best.verdict);
    report_alignment(&best, &f->tracker.cost, r);
}

static void report(fathom *f, fathom_result *r) {
    span_add(&f->span, &f->pose, f->covariance, r->state <= FATHOM_TRACKED, f->tracker.aligner.shared_m,
             r->timestamp_ns);
    r->pose = pose_give(&f->pose);
    memcpy(r->pose_covariance, f->covariance, sizeof r->pose_covariance);
    r->odometry = pose_give(&f->odometry.at);
    memcpy(r->odometry_covariance, f->odometry.covariance, sizeof r->odometry_covariance);
    r->blocks = f->volume.pool.count;
    r->shared_error_m = (float)f->tracker.aligner.shared_m;
    r->gyro_health = f->inertial.check.gyro.health;
    r->accel_health = f->inertial.check.accel.health;
}

void step(fathom *f, const fathom_depth_frame *scan, fathom_result *r) {
    double start = now_ms();
    *r = FATHOM_STRUCT(fathom_result);
    r->timestamp_ns = scan->timestamp_ns;
    inertial_drain(&f->inertial);
    inertial_follow_clock(&f->inertial, scan->timestamp_ns);
    depth_noise_look(&f->noise, &f->maps, scan);
    depth_maps_take(&f->maps, &f->device, scan, 0);
    device_wait(&f->device);
    r->ms_maps = (float)(now_ms() - start);
    if (f->started)
        turn(f, scan, r);
    else
        first_turn(f, scan, r);
    f->timestamp_ns = scan->timestamp_ns;
    report(f, r);
    r->ms_total = (float)(now_ms() - start);
    f->result = *r;
}
