#include "tracking/track.h"

#include <math.h>
#include <string.h>

#include "base/covariance.h"
#include "base/stamps.h"
#include "tracking/relocalise.h"
#include "tracking/seed.h"

#define SEARCH_SIGMA_M 0.01 /* a seed with a smaller sigma needs no search: alignment reaches further */

/* Number of frames that are searched for after the camera was lost, then every RARE-th, so that a board keeps up. */
#define EAGER 15
#define RARE 30

/* Where inertia alone is as sure as this and alignment agrees with it, a surface that contradicts both for LASTING_S is
 * wrong (it has moved, or the sensor saw what isn't there: glass, smear), and gives way to the present frames. */
#define CONFIRMED_M 0.05
#define CONFIRMED_RAD 0.02
#define CONFIRMED_SIGMAS 3
#define LASTING_S 0.1
#define PAUSE_S 0.5            /* within which it is the same contradiction */
#define CONTRADICTED_TRUST 0.1 /* of alignment's information: it used that surface, too */

/* The last tracked frame isn't looked for further back: a bound on the samples to go over again. */
#define SINCE_S 1.0

/* more rounds from a proposed pose: where the weight of far pairs is small, alignment converges slowly */
#define MAX_ROUNDS 4
#define STAYS_M 0.002 /* a round that moves the pose by less has converged */
#define STAYS_RAD 0.002

void tracker_init(tracker *t, device *d, arena *a, const fathom_config *config, depth_maps *maps,
                  raycaster *r, inertial *n) {
    memset(t, 0, sizeof *t);
    t->config = config;
    t->device = d;
    t->maps = maps;
    t->raycaster = r;
    t->inertial = n;
    aligner_init(&t->aligner, d, a, config, maps);
    model_maps_init(&t->models, d, a, config, maps);
    model_view_init(&t->view, d, a, config, maps);
    tracker_reset(t);
}

void tracker_close(tracker *t) {
    model_view_close(&t->view);
    model_maps_close(&t->models);
    aligner_close(&t->aligner);
}

void tracker_reset(tracker *t) {
    aligner_reset(&t->aligner);
    model_maps_forget(&t->models);
    t->strayed = false;
    t->contradicted_ns = t->contradiction_ns = INT64_MIN;
    t->missed = 0;
    t->drawn = 0;
}

/* Whether too little surface for enough pairs is in view, so that the fine maps needn't be cast. After a tracked frame
 * there is enough. */
static bool nothing_in_view(tracker *t, const pose *start) {
    const kernel_camera *c = &t->maps->camera[FINEST];
    double pixels = (double)c->width * c->height;
    return t->strayed && t->config->against == FATHOM_AGAINST_MODEL &&
           pixels * model_view_part(&t->view, t->device, t->raycaster, start) <
               minimum_pairs(t->config, c->width * c->height);
}

/* The attempt of a frame that isn't aligned. */
static void leave(const tracker *t, const pose *at, attempt *a) {
    a->icp = (alignment){.motion = *at, .condition = INFINITY};
    a->rotation_rad = a->translation_m = a->innovation = 0;
    a->agreement = a->see_through = NAN;
    a->verdict = has_depth(t->valid) ? FATHOM_VERDICT_FEW_PAIRS : FATHOM_VERDICT_NO_DEPTH;
}

/* Casts the surface at a pose, near the scan. thorough: also where it is further from the scan than the truncation; a
 * good seed doesn't need that. */
static void cast_maps(tracker *t, const pose *from, int coarsest, double sigma_m, bool thorough) {
    model_maps *m = &t->models;
    raycast_near(t->raycaster, t->device, t->maps, from, align_reach(&t->aligner, coarsest, sigma_m),
                 thorough, &m->level[FINEST]);
    raycast_halve(t->raycaster, t->device, t->maps->camera, m->level, coarsest);
    device_wait(t->device);
    model_maps_renew(m, from, coarsest);
}

/* Aligns the scan with the surface, or with the last accepted frame. Start, prior and result: camera to world. */
static void align_scan(tracker *t, const pose *start, const align_prior *prior, bool seeded, alignment *icp) {
    const fathom_config *c = t->config;
    const int *budget = seeded ? c->max_seeded_iterations : c->max_iterations;
    model_maps *m = &t->models;
    double began = now_ms();
    int coarsest = 0;
    while (coarsest < FINEST && budget[coarsest] == 0) coarsest++;
    if (c->against == FATHOM_AGAINST_MODEL && !(seeded && model_maps_hold(m, start, coarsest)))
        cast_maps(t, start, coarsest, covariance_position_sigma(prior->covariance), !seeded);
    double cast = now_ms();
    align_prior known = *prior;
    pose from = pose_between(&m->seen_from, start);
    known.mean = pose_between(&m->seen_from, &prior->mean);
    known.since_s = seconds_between(t->tracked_ns, t->timestamp_ns);
    align(&t->aligner, t->device, t->maps, m->level, &from, &known, budget, icp);
    model_maps_used(m, icp->pairs, icp->condition);
    icp->motion = pose_multiply(&m->seen_from, &icp->motion);
    pose_normalise(&icp->motion);
    t->cost.iterations += icp->iterations;
    t->cost.ms_raycast += cast - began;
    t->cost.ms_align += now_ms() - cast;
}

static bool stays(const pose *before, const pose *after) {
    pose way = pose_between(before, after);
    return pose_distance(&way) < STAYS_M && pose_angle(&way) < STAYS_RAD;
}

/* The surface in view was fused at the last tracked frame and before, with the error of its pose. What adds up beyond that,
 * as along a bare wall, says nothing of how well the frame lies on that surface. */
static fathom_verdict certainty_since(tracker *t, const attempt *a) {
    static const double exact[36];
    if (seconds_between(t->tracked_ns, t->timestamp_ns) > SINCE_S) return a->verdict;
    const inertial_motion since = inertial_seed(t->inertial, exact, t->tracked_ns, t->timestamp_ns);
    return judge_certainty_since(t->config, since.covariance, &a->icp);
}

void track_attempt(tracker *t, const pose *start, const align_prior *prior, bool seeded, attempt *a) {
    const fathom_config *c = t->config;
    a->seeded = seeded;
    if (!has_depth(t->valid) || (!seeded && nothing_in_view(t, start))) {
        leave(t, start, a);
        return;
    }
    align_scan(t, start, prior, seeded, &a->icp);
    /* maps cast from a distant start show another part of the surface, so another round starts from the result; from a
     * pose of the search, which is rough, rounds go on until the pose converges */
    bool recast = c->against == FATHOM_AGAINST_MODEL && !seeded && a->icp.pairs > 0;
    bool proposed = start != &prior->mean;
    pose led = *start;
    for (int i = 0; recast && i < (proposed ? MAX_ROUNDS : 1); i++) {
        if (proposed ? stays(&led, &a->icp.motion) : model_maps_hold(&t->models, &a->icp.motion, FINEST))
            break;
        led = a->icp.motion;
        align_scan(t, &led, prior, false, &a->icp);
    }
    double began = now_ms();
    judge(c, &t->view, t->device, t->maps, t->raycaster, start, prior, t->valid, a);
    if (a->verdict == FATHOM_VERDICT_UNCERTAIN) a->verdict = certainty_since(t, a);
    t->cost.ms_raycast += now_ms() - began;
}

/* While the IMU is unchecked, the frame is also aligned from the pose that the last velocity predicts, with that as its
 * prior; the result that fits the surface clearly better is taken. */
static void second_attempt(tracker *t, const pose *seed, int64_t timestamp_ns, attempt *icp) {
    align_prior guess;
    attempt other = *icp;
    if (undoubted(t->config, icp) || icp->verdict == FATHOM_VERDICT_NO_DEPTH ||
        !inertial_second_guess(t->inertial, seed, timestamp_ns, &guess.mean, guess.covariance))
        return;
    other.by_velocity = true;
    track_attempt(t, &guess.mean, &guess, false, &other);
    if (fits_better(t->config, &other, icp)) *icp = other;
}

/* After alignment from the seed has failed, as when the seed is too far off: tries other poses around it. */
static void search(tracker *t, const align_prior *seed, attempt *icp) {
    pose best[SEARCH_BEST];
    if (!worth_another_try(icp->verdict) || t->config->against != FATHOM_AGAINST_MODEL ||
        covariance_position_sigma(seed->covariance) < SEARCH_SIGMA_M)
        return;
    double began = now_ms();
    int found = search_about(&t->aligner, t->device, t->maps, &t->view, t->raycaster, &seed->mean,
                             seed->covariance, &t->drawn, best);
    icp->searched = true;
    t->cost.ms_align += now_ms() - began;
    for (int i = 0; i < found; i++) {
        attempt other = *icp;
        track_attempt(t, &best[i], seed, false, &other);
        if (other.verdict != FATHOM_VERDICT_TRACKING) continue;
        *icp = other;
        return;
    }
}

static double rotation_sigma(const double covariance[36]) {
    return sqrt(fmax(covariance[0], fmax(covariance[7], covariance[14])));
}

/* Ends a contradiction that lasts. */
static void settle_contradiction(tracker *t, const align_prior *seed, int64_t timestamp_ns, attempt *icp) {
    const bool sure = covariance_position_sigma(seed->covariance) < CONFIRMED_M &&
                      rotation_sigma(seed->covariance) < CONFIRMED_RAD && icp->innovation < CONFIRMED_SIGMAS;
    const bool lately =
        t->contradiction_ns != INT64_MIN && seconds_between(t->contradiction_ns, timestamp_ns) < PAUSE_S;
    icp->contradicted = lately;
    if ((icp->verdict != FATHOM_VERDICT_CONTRADICTION && icp->verdict != FATHOM_VERDICT_RESIDUAL) || !sure)
        return;
    if (!lately) t->contradicted_ns = timestamp_ns;
    t->contradiction_ns = timestamp_ns;
    icp->contradicted = true;
    if (seconds_between(t->contradicted_ns, timestamp_ns) < LASTING_S) return;
    icp->verdict = FATHOM_VERDICT_TRACKING;
    align_trust_less(&icp->icp, seed, CONTRADICTED_TRUST);
}

/* Lost for long: this frame isn't searched for. */
static bool rests(const tracker *t) {
    return t->missed >= EAGER && t->missed % RARE != 0;
}

bool track(tracker *t, const fathom_depth_frame *scan, const align_prior *seed, attempt *icp) {
    memset(icp, 0, sizeof *icp);
    t->cost = (tracking_cost){0};
    t->timestamp_ns = scan->timestamp_ns;
    t->valid = valid_part(t->maps, scan);
    if (rests(t)) {
        leave(t, &seed->mean, icp);
        return false;
    }
    bool seeded = covariance_position_sigma(seed->covariance) < t->config->max_seed_sigma_m;
    track_attempt(t, &seed->mean, seed, seeded, icp);
    if (seeded && worth_another_try(icp->verdict)) track_attempt(t, &seed->mean, seed, false, icp);
    second_attempt(t, &seed->mean, scan->timestamp_ns, icp);
    search(t, seed, icp);
    settle_contradiction(t, seed, scan->timestamp_ns, icp);
    if (icp->verdict == FATHOM_VERDICT_TRACKING && !icp->contradicted) aligner_learn(&t->aligner, &icp->icp);
    return icp->verdict == FATHOM_VERDICT_TRACKING;
}

void track_settle(tracker *t, fathom_state state, fathom_verdict verdict) {
    t->strayed = state >= FATHOM_RECKONED;
    t->missed = state == FATHOM_LOST && worth_another_try(verdict) ? t->missed + 1 : 0;
}

void track_keep(tracker *t, const pose *at, int64_t timestamp_ns) {
    t->tracked_ns = timestamp_ns;
    if (t->config->against == FATHOM_AGAINST_PREVIOUS)
        model_maps_take_frame(&t->models, t->device, t->maps, at);
}
