#include "tracking/report.h"

void report_alignment(const attempt *a, const tracking_cost *cost, fathom_result *r) {
    const alignment *icp = &a->icp;
    r->verdict = a->verdict;
    r->iterations = cost->iterations;
    r->ms_raycast = (float)cost->ms_raycast;
    r->ms_align = (float)cost->ms_align;
    r->pairs = icp->pairs;
    r->overlap_pixels = icp->overlap;
    r->rms_m = (float)icp->rms;
    r->weight = (float)icp->weight;
    r->condition = (float)icp->condition;
    for (int i = 0; i < 6; i++) r->singular_values[i] = (float)icp->singular[i];
    r->prior_rotation_rad = (float)a->rotation_rad;
    r->prior_translation_m = (float)a->translation_m;
    r->innovation_sigmas = (float)a->innovation;
    r->agreement = (float)a->agreement;
    r->see_through = (float)a->see_through;
    if (a->verdict == FATHOM_VERDICT_TRACKING || a->verdict == FATHOM_VERDICT_UNCERTAIN) {
        r->observed_directions = icp->observed;
        r->weakest_sigma_m = (float)icp->weakest_sigma_m;
        for (int i = 0; i < 6; i++) r->weakest_direction[i] = (float)icp->weakest[i];
    }
    r->contradicted = a->contradicted;
    r->searched = a->searched;
    r->seeded = a->seeded;
    r->by_velocity = a->by_velocity;
}
