#include "tracking/verdict.h"

#include <math.h>
#include <string.h>

#include "base/covariance.h"

#define LEAST_VALID 0.01     /* of the frame */
#define UNDOUBTED_SIGMAS 0.5 /* innovation */
#define CLEARLY 0.95         /* of the misfit */
#define SETTLED_CONDITION 0.5 /* of max_condition */

double valid_part(const depth_maps *maps, const fathom_depth_frame *scan) {
    const kernel_depth_source *s = &maps->source;
    int valid = 0, rows = 0;
    float unit = s->metres_per_unit;
    int low = (int)fminf(fmaxf(ceilf(s->min_m / unit), 1), 65535), high = (int)fminf(s->max_m / unit, 65534);
    for (int y = 0; y < scan->height; y += 4, rows++)
        for (int x = 0; x < scan->width; x++) {
            int d = scan->depth[y * (scan->row_stride_bytes / 2) + x];
            valid += d >= low && d <= high && depth_maps_sure(maps, scan, x, y);
        }
    return (double)valid / (rows * scan->width);
}

bool has_depth(double valid) {
    return valid >= LEAST_VALID;
}

int minimum_pairs(const fathom_config *c, int pixels) {
    int least = c->min_pairs > 0 ? c->min_pairs : pixels / 100;
    return least < 6 ? 6 : least;
}

fathom_verdict judge_alignment(const fathom_config *c, const alignment *icp, double innovation) {
    if (icp->pairs < minimum_pairs(c, icp->pixels)) return FATHOM_VERDICT_FEW_PAIRS;
    if (icp->pairs < c->min_overlap * icp->overlap) return FATHOM_VERDICT_OVERLAP;
    if (!(icp->rms <= c->max_rms_m)) return FATHOM_VERDICT_RESIDUAL;
    if (c->prior == FATHOM_PRIOR_SEED && !(icp->condition <= c->max_condition))
        return FATHOM_VERDICT_CONDITION;
    if (!(innovation <= c->max_innovation_sigmas)) return FATHOM_VERDICT_INNOVATION;
    return FATHOM_VERDICT_TRACKING;
}

fathom_verdict judge_view(const fathom_config *c, const comparison *k) {
    bool agree = k->agree >= c->min_agreement * k->visible,
         through = k->through > c->max_see_through * k->visible;
    return agree && !through ? FATHOM_VERDICT_TRACKING : FATHOM_VERDICT_CONTRADICTION;
}

fathom_verdict judge_certainty(const fathom_config *c, const double covariance[36]) {
    for (int i = 0; i < 6; i++) {
        double most = i < 3 ? c->max_sigma_rad : c->max_sigma_m;
        if (!(covariance[7 * i] <= most * most)) return FATHOM_VERDICT_UNCERTAIN;
    }
    return FATHOM_VERDICT_TRACKING;
}

fathom_verdict judge_certainty_since(const fathom_config *c, const double motion[36], const alignment *icp) {
    double information[36], covariance[36];
    if (!covariance_invert(motion, information)) return FATHOM_VERDICT_UNCERTAIN;
    for (int i = 0; i < 36; i++) information[i] += icp->information[i];
    if (!covariance_invert(information, covariance)) return FATHOM_VERDICT_UNCERTAIN;
    return judge_certainty(c, covariance);
}

void measure_innovation(const fathom_config *c, const align_prior *prior, attempt *a) {
    double twist[6], gate[36];
    pose correction = pose_between(&prior->mean, &a->icp.motion);
    pose_log(&correction, twist);
    memcpy(gate, prior->covariance, sizeof gate);
    for (int i = 0; i < 6; i++)
        gate[7 * i] += i < 3 ? c->seed_noise_rad * c->seed_noise_rad : c->seed_noise_m * c->seed_noise_m;
    a->rotation_rad = pose_angle(&correction);
    a->translation_m = pose_distance(&correction);
    a->innovation = covariance_mahalanobis(gate, twist);
}

bool evident(const fathom_config *c, double valid, const attempt *a) {
    return a->seeded && a->icp.pairs >= c->min_evident_fraction * valid * a->icp.pixels &&
           a->innovation <= c->max_evident_sigmas;
}

void judge(const fathom_config *c, model_view *view, device *d, depth_maps *maps, raycaster *r,
           const pose *start, const align_prior *prior, double valid, attempt *a) {
    align_prior about = *prior;
    attempt from_start = *a;
    about.mean = *start;
    measure_innovation(c, &about, &from_start);
    measure_innovation(c, prior, a);
    a->agreement = a->see_through = NAN;
    a->verdict = judge_alignment(c, &a->icp, fmin(a->innovation, from_start.innovation));
    if (a->verdict == FATHOM_VERDICT_TRACKING && c->against == FATHOM_AGAINST_MODEL &&
        !evident(c, valid, a)) {
        comparison k;
        model_view_compare(view, d, maps, r, &a->icp.motion, c->agreement_tolerance_m + c->voxel_m, &k);
        a->agreement = k.visible > 0 ? k.agree / k.visible : 0;
        a->see_through = k.visible > 0 ? k.through / k.visible : 0;
        a->verdict = judge_view(c, &k);
    }
    if (a->verdict == FATHOM_VERDICT_TRACKING && c->prior == FATHOM_PRIOR_INFORMATION)
        a->verdict = judge_certainty(c, a->icp.covariance);
}

bool worth_another_try(fathom_verdict verdict) {
    return verdict != FATHOM_VERDICT_TRACKING && verdict != FATHOM_VERDICT_NO_DEPTH &&
           verdict != FATHOM_VERDICT_UNCERTAIN;
}

bool undoubted(const fathom_config *c, const attempt *a) {
    bool unseen = c->against == FATHOM_AGAINST_MODEL && isnan(a->agreement); /* evident */
    return a->verdict == FATHOM_VERDICT_TRACKING && (unseen || a->innovation < UNDOUBTED_SIGMAS);
}

/* Sum of squared distances; those of the `pixels` without a pair count as far. */
static double misfit(const fathom_config *c, const alignment *icp, int pixels) {
    return icp->pairs * icp->rms * icp->rms + (pixels - icp->pairs) * c->max_rms_m * c->max_rms_m;
}

bool fits_better(const fathom_config *c, const attempt *other, const attempt *a) {
    int pixels = other->icp.overlap > a->icp.overlap ? other->icp.overlap : a->icp.overlap;
    if (other->verdict != FATHOM_VERDICT_TRACKING) return false;
    return a->verdict != FATHOM_VERDICT_TRACKING ||
           misfit(c, &other->icp, pixels) < CLEARLY * misfit(c, &a->icp, pixels);
}

bool settled_by_geometry(const fathom_config *c, const attempt *a) {
    return (a->verdict == FATHOM_VERDICT_TRACKING || a->verdict == FATHOM_VERDICT_INNOVATION) &&
           a->icp.condition < SETTLED_CONDITION * c->max_condition;
}
