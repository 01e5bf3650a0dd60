/* The loop of the paper's Figure 2, one turn a call.
 *
 *     d = inertial_estimate(t_i-1, t_i)
 *     (icp, tracking) = align(scan, M * d)
 *     if tracking:  fuse(scan, icp);  M = icp
 *     else:         M = M * d
 */
#include <math.h>
#include <string.h>

#include "api/context.h"
#include "base/covariance.h"
#include "base/stamps.h"
#include "map/eviction.h"

#define SEARCH_SIGMA_M 0.01 /* a seed surer than this needs no search: alignment reaches further */

/* So many frames are looked for after the camera was lost, then every RARE-th, so that a board keeps up. */
#define EAGER 15
#define RARE 30

#define CALM_M 0.03 /* the camera's way from one fused frame to the next */
#define CALM_RAD 0.04

/* The covariance of pose * motion: the old error seen from the new camera, and the motion's own. */
static void propagate(const double old[36], const inertial_motion *d, double out[36]) {
    pose inverse = pose_inverse(&d->motion);
    double adjoint[36];
    pose_adjoint(&inverse, adjoint);
    covariance_transport(adjoint, old, out);
    for (int i = 0; i < 36; i++) out[i] += d->covariance[i];
}

/* The camera's way since the last frame: by the caller's hook, by inertia, or, knowing nothing, none. */
static inertial_motion inertial_seed(fathom *f, int64_t from_ns, int64_t to_ns) {
    inertial_motion d;
    fathom_motion given;
    const fathom_config *c = &f->config;
    bool hooked = c->inertial_hook &&
                  c->inertial_hook(c->inertial_user, from_ns, to_ns, &given) == FATHOM_OK &&
                  pose_from_matrix(given.motion, &d.motion);
    for (int i = 0; hooked && i < 36; i++) {
        d.covariance[i] = given.covariance[i];
        hooked = isfinite(d.covariance[i]) && (i % 7 != 0 || d.covariance[i] >= 0);
    }
    if (!hooked && inertial_estimate(&f->inertial, from_ns, to_ns, &d) == FATHOM_OK) return d;
    if (!hooked) {
        d.motion = pose_identity();
        double dt = 1e-9 * ((double)to_ns - (double)from_ns);
        memset(d.covariance, 0, sizeof d.covariance);
        for (int i = 0; i < 3; i++) {
            d.covariance[7 * i] = fmin(dt * dt, 1e6);
            d.covariance[7 * (i + 3)] = fmin(0.25 * dt * dt, 1e6);
        }
    }
    propagate(f->covariance, &d, d.pose_covariance);
    return d;
}

static double position_sigma(const double covariance[36]) {
    return sqrt(fmax(covariance[21], fmax(covariance[28], covariance[35])));
}

/* The model maps of an earlier frame will do for a seed so close to where they were seen from. */
static bool maps_hold(const fathom *f, const pose *seed, int coarsest) {
    pose way = pose_between(&f->reference, seed);
    return f->cast_coarsest <= coarsest && pose_distance(&way) < f->config.keep_model_m &&
           pose_angle(&way) < f->config.keep_model_rad;
}

/* The surface as it looks from the seed, near the scan; a good seed needs no more than what is very near. */
static void cast_maps(fathom *f, const pose *seed, int coarsest, double sigma_m, bool seeded) {
    raycast_near(&f->raycaster, &f->device, &f->maps, seed, align_reach(&f->aligner, coarsest, sigma_m),
                        !seeded, &f->aligner.model[FINEST]);
    raycast_halve(&f->raycaster, &f->device, f->maps.camera, f->aligner.model, coarsest);
    device_wait(&f->device);
    f->reference = *seed;
}

/* Aligns the scan with the surface, or with the last accepted frame. icp->motion becomes a pose, camera to world. */
static void align_scan(fathom *f, const pose *seed, const double predicted[36], alignment *icp,
                       fathom_result *r) {
    const fathom_config *c = &f->config;
    const int *budget = r->seeded ? c->seeded_iterations : c->iterations;
    double start = now_ms();
    int coarsest = 0;
    while (coarsest < FINEST && budget[coarsest] == 0) coarsest++;
    align_seed from = {.sigma_m = position_sigma(predicted), .prior = c->prior == FATHOM_PRIOR_INFORMATION};
    bool kept = r->seeded && maps_hold(f, seed, coarsest);
    if (c->against == FATHOM_AGAINST_MODEL && !kept) cast_maps(f, seed, coarsest, from.sigma_m, r->seeded);
    double cast = now_ms();
    from.motion = pose_between(&f->reference, seed);
    memcpy(from.covariance, predicted, sizeof from.covariance);
    align(&f->aligner, &f->device, &f->maps, &from, budget, icp);
    if (!kept) {
        f->cast_coarsest = c->against == FATHOM_AGAINST_MODEL ? coarsest : FATHOM_LEVELS;
        f->cast_pairs = icp->pairs;
    }
    if (icp->pairs < 0.9 * f->cast_pairs || icp->condition > 0.5 * c->max_condition)
        f->cast_coarsest = FATHOM_LEVELS;
    icp->motion = pose_multiply(&f->reference, &icp->motion);
    pose_normalise(&icp->motion);
    r->ms_raycast = (float)(cast - start);
    r->ms_align = (float)(now_ms() - cast);
}

/* Maps cast from a seed that was far off show another part of the surface: a second round from where the first has led. */
static void align_again(fathom *f, const double predicted[36], alignment *icp, fathom_result *r) {
    alignment again;
    float ms_raycast = r->ms_raycast, ms_align = r->ms_align;
    align_scan(f, &icp->motion, predicted, &again, r);
    r->ms_raycast += ms_raycast;
    r->ms_align += ms_align;
    again.iterations += icp->iterations;
    *icp = again;
}

void fuse(fathom *f, const pose *at, fathom_result *r) {
    double start = now_ms();
    pose way = pose_between(&f->fused, at);
    bool calm = f->started && pose_distance(&way) < CALM_M && pose_angle(&way) < CALM_RAD;
    f->fused = *at;
    int64_t dropped = f->store.dropped, restored = f->store.restored;
    int wanted = integrator_request(&f->integrator, &f->device, &f->volume, &f->maps, at, calm);
    if (wanted > 0) {
        bool drop = f->config.when_full == FATHOM_FULL_DROP;
        if (drop && f->volume.pool.count + wanted > f->volume.pool.capacity)
            eviction_make_room(&f->volume, &f->device, &f->integrator, &f->store, wanted);
        int first = integrator_allocate(&f->integrator, &f->device, &f->volume);
        if (drop) eviction_restore(&f->volume, &f->device, &f->store, first);
    }
    integrator_fuse(&f->integrator, &f->device, &f->volume, &f->maps, at, calm);
    if (f->config.fuse_behind)
        device_flush(&f->device);
    else
        device_wait(&f->device);
    r->fused = true;
    r->pool_full = f->integrator.full;
    r->blocks_dropped = (int)(f->store.dropped - dropped);
    r->blocks_restored = (int)(f->store.restored - restored);
    r->ms_fuse = (float)(now_ms() - start);
}

static void keep_as_reference(fathom *f, const pose *at) {
    if (f->config.against != FATHOM_AGAINST_PREVIOUS) return;
    for (int i = 0; i < FATHOM_LEVELS; i++) depth_maps_pack(&f->maps, &f->device, i, &f->aligner.model[i]);
    f->reference = *at;
}

static void report_alignment(const alignment *icp, fathom_result *r) {
    r->iterations = icp->iterations;
    r->pairs = icp->pairs;
    r->overlap_pixels = icp->overlap;
    r->rms_m = (float)icp->rms;
    r->weight = (float)icp->weight;
    r->condition = (float)icp->condition;
    for (int i = 0; i < 6; i++) r->singular_values[i] = (float)icp->singular[i];
}

/* The part of the frame that is valid depth, by every fourth row. */
static double valid_part(const fathom_config *c, const fathom_depth_frame *scan) {
    int valid = 0, rows = 0;
    float units = c->depth_units_per_metre;
    int low = (int)fminf(fmaxf(ceilf(c->depth_min_m * units), 1), 65535),
        high = (int)fminf(c->depth_max_m * units, 65534);
    for (int y = 0; y < scan->height; y += 4, rows++)
        for (int x = 0; x < scan->width; x++) {
            int d = scan->depth[y * scan->width + x];
            valid += d >= low && d <= high;
        }
    return (double)valid / (rows * scan->width);
}

/* Of the frame: a few stray pixels under a covered lens are no world to find back to. */
#define LEAST_VALID 0.01

static bool has_depth(const fathom_config *c, const fathom_depth_frame *scan) {
    return valid_part(c, scan) >= LEAST_VALID;
}

/* Too little surface for enough pairs lies before the camera: there is no need to cast the fine maps. After a tracked frame
 * there is enough. */
static bool nothing_in_view(fathom *f, const pose *seed) {
    if (f->result.state < FATHOM_RECKONED || f->config.against != FATHOM_AGAINST_MODEL) return false;
    const kernel_camera *c = &f->maps.camera[FINEST];
    double pixels = (double)c->width * c->height;
    return pixels * model_view_part(&f->view, &f->device, &f->raycaster, seed) <
           least_pairs(&f->config, c->width * c->height);
}

/* A frame that isn't aligned. */
static void leave(const fathom *f, const fathom_depth_frame *scan, const pose *seed, alignment *icp,
                  fathom_result *r) {
    *icp = (alignment){.motion = *seed, .condition = INFINITY};
    report_alignment(icp, r);
    r->prior_rotation_rad = r->prior_translation_m = r->innovation_sigmas = 0;
    r->agreement = r->see_through = NAN;
    r->verdict = has_depth(&f->config, scan) ? FATHOM_VERDICT_FEW_PAIRS : FATHOM_VERDICT_NO_DEPTH;
}

/* Aligns from a seed, and judges. */
void attempt(fathom *f, const fathom_depth_frame *scan, const pose *seed, const double predicted[36],
             bool seeded, alignment *icp, fathom_result *r) {
    const fathom_config *c = &f->config;
    double twist[6];
    r->seeded = seeded;
    double valid = valid_part(c, scan);
    if (valid < LEAST_VALID || (!seeded && nothing_in_view(f, seed))) {
        leave(f, scan, seed, icp, r);
        return;
    }
    align_scan(f, seed, predicted, icp, r);
    bool recast = c->against == FATHOM_AGAINST_MODEL && !seeded && icp->pairs > 0;
    if (recast && !maps_hold(f, &icp->motion, FINEST)) align_again(f, predicted, icp, r);
    report_alignment(icp, r);
    pose correction = pose_between(seed, &icp->motion);
    pose_log(&correction, twist);
    r->prior_rotation_rad = (float)pose_angle(&correction);
    r->prior_translation_m = (float)pose_distance(&correction);
    double gate[36]; /* inertia may be better than its floors, or just seem so */
    memcpy(gate, predicted, sizeof gate);
    for (int i = 0; i < 6; i++)
        gate[7 * i] += i < 3 ? c->seed_floor_rad * c->seed_floor_rad : c->seed_floor_m * c->seed_floor_m;
    r->innovation_sigmas = (float)covariance_mahalanobis(gate, twist);
    r->agreement = r->see_through = NAN;
    r->verdict = judge(c, icp, r->innovation_sigmas);
    bool evident = seeded && icp->pairs >= c->evident_pairs * valid * icp->pixels &&
                   r->innovation_sigmas <= c->evident_sigmas;
    if (r->verdict == FATHOM_VERDICT_TRACKING && c->against == FATHOM_AGAINST_MODEL && !evident) {
        comparison k;
        double start = now_ms();
        model_view_compare(&f->view, &f->device, &f->maps, &f->raycaster, &icp->motion,
                           c->agreement_m + c->voxel_m, &k);
        r->agreement = k.visible > 0 ? k.agree / k.visible : 0;
        r->see_through = k.visible > 0 ? k.through / k.visible : 0;
        r->verdict = judge_view(c, &k);
        r->ms_raycast += (float)(now_ms() - start);
    }
    if (r->verdict == FATHOM_VERDICT_TRACKING && c->prior == FATHOM_PRIOR_INFORMATION)
        r->verdict = judge_certainty(c, icp->covariance);
}

/* Not for want of depth, nor of what geometry can tell: another try may find more. */
static bool failed(const fathom_result *r) {
    return r->verdict != FATHOM_VERDICT_TRACKING && r->verdict != FATHOM_VERDICT_NO_DEPTH &&
           r->verdict != FATHOM_VERDICT_UNCERTAIN;
}

/* Alignment from the seed has failed, and the seed may be too far off: others about it are tried. */
static void search(fathom *f, const fathom_depth_frame *scan, const pose *seed, const double predicted[36],
                   alignment *icp, fathom_result *r) {
    pose best[SEARCH_BEST];
    if (!failed(r) || f->config.against != FATHOM_AGAINST_MODEL || position_sigma(predicted) < SEARCH_SIGMA_M)
        return;
    double start = now_ms();
    int found = search_about(&f->aligner, &f->device, &f->maps, &f->view, &f->raycaster, seed, predicted,
                             &f->drawn, best);
    r->searched = true;
    r->ms_align += (float)(now_ms() - start);
    for (int i = 0; i < found; i++) {
        alignment other;
        fathom_result o = *r;
        attempt(f, scan, &best[i], predicted, false, &other, &o);
        o.ms_align = r->ms_align += o.ms_align;
        o.ms_raycast = r->ms_raycast += o.ms_raycast;
        o.iterations = r->iterations += o.iterations;
        if (o.verdict != FATHOM_VERDICT_TRACKING) continue;
        *icp = other;
        *r = o;
        return;
    }
}

/* Squared distances summed; of `pixels` that could have pairs, those without are far. */
static double misfit(const fathom_config *c, const alignment *a, int pixels) {
    return a->pairs * a->rms * a->rms + (pixels - a->pairs) * c->max_rms_m * c->max_rms_m;
}

/* While the IMU isn't known to be right, the frame is aligned from the last velocity too, and what fits the surface clearly
 * better is taken. */
static void second_attempt(fathom *f, const fathom_depth_frame *scan, const pose *seed, alignment *icp,
                           fathom_result *r) {
    pose guess;
    double covariance[36];
    alignment other;
    fathom_result o = *r;
    bool evident = f->config.against == FATHOM_AGAINST_MODEL && isnan(r->agreement);
    bool agreed = r->verdict == FATHOM_VERDICT_TRACKING && (evident || r->innovation_sigmas < 0.5);
    if (agreed || r->verdict == FATHOM_VERDICT_NO_DEPTH ||
        !inertial_second_guess(&f->inertial, seed, r->timestamp_ns, &guess, covariance))
        return;
    attempt(f, scan, &guess, covariance, false, &other, &o);
    o.ms_align = r->ms_align += o.ms_align;
    o.ms_raycast = r->ms_raycast += o.ms_raycast;
    o.iterations = r->iterations += o.iterations;
    int pixels = other.overlap > icp->overlap ? other.overlap : icp->overlap;
    bool better = r->verdict != FATHOM_VERDICT_TRACKING ||
                  misfit(&f->config, &other, pixels) < 0.95 * misfit(&f->config, icp, pixels);
    if (o.verdict != FATHOM_VERDICT_TRACKING || !better) return;
    *icp = other;
    *r = o;
}

/* Lost for long: this frame isn't looked for. */
static bool rests(const fathom *f) {
    return f->missed >= EAGER && f->missed % RARE != 0;
}

static void first_step(fathom *f, const fathom_depth_frame *scan, fathom_result *r) {
    if (f->paused) { /* there is nothing to align with, and nothing may be fused */
        r->state = FATHOM_RECKONED;
        r->verdict = FATHOM_VERDICT_FEW_PAIRS;
        return;
    }
    if (has_depth(&f->config, scan)) fuse(f, &f->pose, r);
    r->fused = f->started = f->volume.pool.count > 0;
    r->state = f->started ? FATHOM_FIRST : FATHOM_RECKONED;
    r->verdict = f->started ? FATHOM_VERDICT_TRACKING : FATHOM_VERDICT_NO_DEPTH;
    if (!f->started) return;
    keep_as_reference(f, &f->pose);
    inertial_correct(&f->inertial, &f->pose, NULL, NULL, r->timestamp_ns);
    inertial_check(&f->inertial, &f->pose, true, r->timestamp_ns);
    memset(f->covariance, 0, sizeof f->covariance);
    for (int i = 0; i < 6; i++) f->covariance[7 * i] = 1e-10; /* the first frame is the world */
}

static void next_step(fathom *f, const fathom_depth_frame *scan, fathom_result *r) {
    const fathom_config *c = &f->config;
    inertial_motion d = inertial_seed(f, f->timestamp_ns, r->timestamp_ns);
    pose seed = pose_multiply(&f->pose, &d.motion);
    const double *predicted = d.pose_covariance;
    alignment icp;
    if (rests(f)) {
        leave(f, scan, &seed, &icp, r);
    } else {
        bool seeded = position_sigma(predicted) < c->seeded_sigma_m;
        attempt(f, scan, &seed, predicted, seeded, &icp, r);
        if (seeded && failed(r)) attempt(f, scan, &seed, predicted, false, &icp, r);
        second_attempt(f, scan, &seed, &icp, r);
        search(f, scan, &seed, predicted, &icp, r);
    }

    if (r->verdict == FATHOM_VERDICT_TRACKING) {
        f->pose = icp.motion;
        memcpy(f->covariance, icp.covariance, sizeof f->covariance);
        if (!f->paused) fuse(f, &f->pose, r);
        keep_as_reference(f, &f->pose);
        inertial_correct(&f->inertial, &f->pose, icp.information, icp.pull, r->timestamp_ns);
        r->state = FATHOM_TRACKED;
    } else if (r->verdict ==
               FATHOM_VERDICT_UNCERTAIN) { /* some directions are known: a wall's distance and tilt */
        f->pose = icp.motion;
        memcpy(f->covariance, icp.covariance, sizeof f->covariance);
        inertial_correct(&f->inertial, &f->pose, icp.information, icp.pull, r->timestamp_ns);
        r->state = position_sigma(icp.covariance) > c->lost_sigma_m ? FATHOM_LOST : FATHOM_RECKONED;
    } else {
        f->pose = seed;
        memcpy(f->covariance, predicted, sizeof f->covariance);
        inertial_advance(&f->inertial, r->timestamp_ns);
        r->state = position_sigma(predicted) > c->lost_sigma_m ? FATHOM_LOST : FATHOM_RECKONED;
    }
    f->missed = r->state == FATHOM_LOST && failed(r) ? f->missed + 1 : 0;
    /* a pose that geometry alone has settled is evidence, whatever inertia thinks of it */
    bool tracked = r->state == FATHOM_TRACKED, settled = tracked || r->verdict == FATHOM_VERDICT_INNOVATION;
    settled = settled && icp.condition < 0.5 * c->max_condition;
    inertial_check(&f->inertial, settled ? &icp.motion : NULL, tracked, r->timestamp_ns);
}

void step(fathom *f, const fathom_depth_frame *scan, fathom_result *r) {
    double start = now_ms();
    memset(r, 0, sizeof *r);
    r->timestamp_ns = scan->timestamp_ns;
    inertial_drain(&f->inertial);
    inertial_follow_clock(&f->inertial, scan->timestamp_ns);
    depth_maps_make(&f->maps, &f->device, scan->depth, 0);
    device_wait(&f->device);
    r->ms_maps = (float)(now_ms() - start);

    if (f->started)
        next_step(f, scan, r);
    else
        first_step(f, scan, r);

    f->timestamp_ns = scan->timestamp_ns;
    pose_to_matrix(&f->pose, r->pose);
    for (int i = 0; i < 36; i++) r->covariance[i] = (float)f->covariance[i];
    r->blocks = f->volume.pool.count;
    r->gyro_health = f->inertial.check.gyro.health;
    r->accel_health = f->inertial.check.accel.health;
    r->ms_total = (float)(now_ms() - start);
    f->result = *r;
}
