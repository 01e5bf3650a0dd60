#include "tracking/verdict.h"

int least_pairs(const fathom_config *c, int pixels) {
    int least = c->min_pairs > 0 ? c->min_pairs : pixels / 100;
    return least < 6 ? 6 : least;
}

fathom_verdict judge(const fathom_config *c, const alignment *a, double innovation) {
    if (a->pairs < least_pairs(c, a->pixels)) return FATHOM_VERDICT_FEW_PAIRS;
    if (a->pairs < c->min_overlap * a->overlap) return FATHOM_VERDICT_OVERLAP;
    if (!(a->rms <= c->max_rms_m)) return FATHOM_VERDICT_RESIDUAL;
    if (c->prior == FATHOM_PRIOR_SEED && !(a->condition <= c->max_condition)) return FATHOM_VERDICT_CONDITION;
    if (!(innovation <= c->max_innovation_sigmas)) return FATHOM_VERDICT_INNOVATION;
    return FATHOM_VERDICT_TRACKING;
}

fathom_verdict judge_view(const fathom_config *c, const comparison *k) {
    bool agree = k->agree >= c->min_agreement * k->visible, through = k->through > c->max_see_through * k->visible;
    return agree && !through ? FATHOM_VERDICT_TRACKING : FATHOM_VERDICT_CONTRADICTION;
}

fathom_verdict judge_certainty(const fathom_config *c, const double covariance[36]) {
    for (int i = 0; i < 6; i++) {
        double most = i < 3 ? c->max_sigma_rad : c->max_sigma_m;
        if (!(covariance[7 * i] <= most * most)) return FATHOM_VERDICT_UNCERTAIN;
    }
    return FATHOM_VERDICT_TRACKING;
}
