#include "tracking/relocalise.h"

#include <math.h>
#include <string.h>

#define DISTANCE_M 0.2 /* maximum of a pair, for comparing hypotheses */
#define HUBER_M 0.03   /* maximum residual with full weight */
#define APART_M 0.05   /* hypotheses closer than this are the same */
#define APART_RAD 0.05
#define KEPT 8 /* hypotheses that are refined */
#define REFINEMENTS 3
#define MOST_SIGMA 0.7 /* m and rad: even an unknown pose is searched near the seed */

/* Van der Corput's sequence: the digits of i mirrored at the point. */
static double mirrored(unsigned i, unsigned base) {
    double f = 1, r = 0;
    for (; i > 0; i /= base) {
        f /= base;
        r += f * (i % base);
    }
    return r;
}

/* Six normally distributed numbers that fill space evenly: Halton's points by Box and Muller's transform. */
static void normal_numbers(unsigned i, double z[6]) {
    static const unsigned bases[6] = {2, 3, 5, 7, 11, 13};
    for (int k = 0; k < 6; k += 2) {
        double radius = sqrt(-2 * log(1 - mirrored(i, bases[k])));
        double angle = 6.283185307179586 * mirrored(i, bases[k + 1]);
        z[k] = radius * cos(angle);
        z[k + 1] = radius * sin(angle);
    }
}

static double largest_sigma(const double c[36]) {
    double most = 0;
    for (int i = 0; i < 6; i++) most = fmax(most, c[7 * i]);
    return sqrt(most);
}

void search_spread(const double c[36], double l[36]) {
    double shrink = fmin(1, MOST_SIGMA / largest_sigma(c));
    memset(l, 0, 36 * sizeof *l);
    for (int j = 0; j < 6; j++) {
        double diagonal = c[7 * j];
        for (int k = 0; k < j; k++) diagonal -= l[6 * j + k] * l[6 * j + k];
        if (!(diagonal > 1e-12)) continue;
        l[7 * j] = sqrt(diagonal);
        for (int i = j + 1; i < 6; i++) {
            double s = c[6 * i + j];
            for (int k = 0; k < j; k++) s -= l[6 * i + k] * l[6 * j + k];
            l[6 * i + j] = s / l[7 * j];
        }
    }
    for (int i = 0; i < 36; i++) l[i] *= shrink;
}

void search_draw(const double spread[36], int i, unsigned drawn, double twist[6]) {
    double z[6];
    memset(twist, 0, 6 * sizeof *twist);
    if (i == 0) return; /* the seed itself */
    normal_numbers(drawn, z);
    for (int j = 0; j < 6; j++)
        for (int k = 0; k <= j; k++) twist[j] += spread[6 * j + k] * z[k];
}

/* The number of scan points on the surface, doubtful ones counted in part. */
static double score(aligner *a, device *d, depth_maps *maps, model_view *w, const pose *motion,
                    normal_equations *e) {
    const double centre[3] = {0, 0, 1.5};
    align_reduce(a, d, maps, w->level, motion, &w->map, &w->wide, DISTANCE_M, HUBER_M, centre, e);
    return e->weight;
}

static bool same(const pose *a, const pose *b) {
    pose way = pose_between(a, b);
    return pose_distance(&way) < APART_M && pose_angle(&way) < APART_RAD;
}

int search_keep(hypothesis *kept, int count, int room, const hypothesis *h) {
    for (int i = 0; i < count; i++)
        if (same(&kept[i].motion, &h->motion)) {
            if (kept[i].score >= h->score) return count;
            memmove(kept + i, kept + i + 1, (size_t)(count - 1 - i) * sizeof *kept);
            count--;
            break;
        }
    int at = count < room ? count++ : room - 1;
    for (; at > 0 && kept[at - 1].score < h->score; at--) kept[at] = kept[at - 1];
    kept[at] = *h;
    return count;
}

static void refine(aligner *a, device *d, depth_maps *maps, model_view *w, hypothesis *h) {
    normal_equations e;
    solution s;
    h->score = score(a, d, maps, w, &h->motion, &e);
    for (int i = 0; i < REFINEMENTS && solve_alignment(&e, NULL, &s); i++) {
        pose update = pose_exp(s.twist);
        hypothesis next = {.motion = pose_multiply(&update, &h->motion)};
        pose_normalise(&next.motion);
        next.score = score(a, d, maps, w, &next.motion, &e);
        if (!(next.score > h->score)) break;
        *h = next;
    }
}

int search_about(aligner *a, device *d, depth_maps *maps, model_view *w, raycaster *r, const pose *seed,
                 const double covariance[36], unsigned *drawn, pose best[SEARCH_BEST]) {
    hypothesis kept[KEPT], refined[SEARCH_BEST];
    double spread[36], twist[6], sigma = largest_sigma(covariance);
    int count = 0, found = 0, tries = sigma < 0.05 ? 24 : sigma < 0.2 ? 64 : 128;
    normal_equations e;
    search_spread(covariance, spread);
    model_view_cast_wide(w, d, r, seed);
    for (int i = 0; i < tries; i++) {
        search_draw(spread, i, (*drawn)++, twist);
        hypothesis h = {.motion = pose_exp(twist)};
        h.score = score(a, d, maps, w, &h.motion, &e);
        if (d->error != FATHOM_OK) return 0;
        if (h.score > 0 && (count < KEPT || h.score > kept[count - 1].score))
            count = search_keep(kept, count, KEPT, &h);
    }
    for (int i = 0; i < count; i++) {
        refine(a, d, maps, w, &kept[i]);
        if (found < SEARCH_BEST || kept[i].score > refined[found - 1].score)
            found = search_keep(refined, found, SEARCH_BEST, &kept[i]);
    }
    for (int i = 0; i < found; i++) best[i] = pose_multiply(seed, &refined[i].motion);
    return found;
}
