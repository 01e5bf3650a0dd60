/* Finding back: poses about the seed, as its covariance spreads them, are held against the surface on the view's maps; the
 * best are refined a little and left to alignment and the verdict. */
#ifndef FATHOM_SEARCH_H
#define FATHOM_SEARCH_H

#include "align/align.h"
#include "tracking/predicted_view.h"

#define SEARCH_BEST 3

/* Writes at most SEARCH_BEST poses, best first, and returns how many. covariance: of the seed, seed * exp(error).
 * *drawn counts the hypotheses of all calls, so that the next call tries others. Waits for the device. */
int search_about(aligner *a, device *d, depth_maps *maps, model_view *w, raycaster *r, const pose *seed,
                 const double covariance[36], unsigned *drawn, pose best[SEARCH_BEST]);

#endif
