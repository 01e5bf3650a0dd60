/* Relocalisation: poses drawn around the seed with its covariance are compared with the surface on the view's maps; the
 * best are refined a little and passed on to alignment and the verdict. */
#ifndef FATHOM_SEARCH_H
#define FATHOM_SEARCH_H

#include "align/align.h"
#include "tracking/predicted_view.h"

#define SEARCH_BEST 3

/* The lower triangle l with l l^T = covariance, shrunk to a maximum sigma of 0.7: even an unknown pose is searched near
 * the seed. Directions without variance are zero. */
void search_spread(const double covariance[36], double l[36]);

/* Hypothesis i, as a twist from the seed: the seed itself first, then normally distributed numbers times spread. drawn
 * selects the numbers. */
void search_draw(const double spread[36], int i, unsigned drawn, double twist[6]);

typedef struct {
    pose motion; /* to the seed's camera */
    double score;
} hypothesis;

/* Keeps a sorted list of the best hypotheses; of two that are the same (within 5 cm and 0.05 rad) the better one stays.
 * Returns the new count. `room` is the maximum; in a full list h must be better than the last. */
int search_keep(hypothesis *kept, int count, int room, const hypothesis *h);

/* Writes up to SEARCH_BEST poses, best first, and returns their number. covariance: of the seed, seed * exp(error).
 * *drawn counts the hypotheses of all calls, so that the next call draws others. Waits for the device. */
int search_about(aligner *a, device *d, depth_maps *maps, model_view *w, raycaster *r, const pose *seed,
                 const double covariance[36], unsigned *drawn, pose best[SEARCH_BEST]);

#endif
