/* Finding back: poses about the seed, as its covariance spreads them, are held against the surface on the view's maps;
 * the best are refined a little and left to alignment and the verdict. */
#ifndef FATHOM_SEARCH_H
#define FATHOM_SEARCH_H

#include "align/align.h"
#include "tracking/predicted_view.h"

#define SEARCH_BEST 3

/* The lower triangle l with l l^T = covariance, shrunk so that the largest sigma is 0.7 at most: a seed that knows
 * nothing is still looked for about where it is. Directions that the covariance gives no room are zero. */
void search_spread(const double covariance[36], double l[36]);

/* Hypothesis i about the seed, as a twist: the seed itself first, then normal numbers as they are spread. drawn: which
 * ones. */
void search_draw(const double spread[36], int i, unsigned drawn, double twist[6]);

typedef struct {
    pose motion; /* to the seed's camera */
    double score;
} hypothesis;

/* Keeps a list of the best, best first; of two that are the same (5 cm and 0.05 rad) the better one stays. Returns how
 * many there are now. The list is full with `room`; then h must be better than the last. */
int search_keep(hypothesis *kept, int count, int room, const hypothesis *h);

/* Writes at most SEARCH_BEST poses, best first, and returns how many. covariance: of the seed, seed * exp(error).
 * *drawn counts the hypotheses of all calls, so that the next call tries others. Waits for the device. */
int search_about(aligner *a, device *d, depth_maps *maps, model_view *w, raycaster *r, const pose *seed,
                 const double covariance[36], unsigned *drawn, pose best[SEARCH_BEST]);

#endif
