/* The verdict "tracking" of Section 2, last paragraph: is an alignment to be trusted? Every test of it is here. */
#ifndef FATHOM_VERDICT_H
#define FATHOM_VERDICT_H

#include "align/align.h"
#include "tracking/predicted_view.h"

/* One attempt to align the frame, and what is thought of it. */
typedef struct {
    alignment icp; /* its motion: camera to world */
    fathom_verdict verdict;
    bool seeded;                       /* from a seed good enough for max_seeded_iterations */
    bool searched;                     /* from a place that relocalisation proposed */
    bool by_velocity;                  /* the prior is where the last velocity leads, not inertia's */
    double rotation_rad, translation_m; /* from the prior's mean to the result */
    double innovation;                 /* the same in sigmas of the prior */
    double agreement, see_through;     /* parts of the predicted view; NAN: not looked at */
} attempt;

/* Valid depth: the part of the frame that is in the range which the maps take (by every fourth row). */
double valid_part(const depth_maps *maps, const fathom_depth_frame *scan);

/* A few stray pixels under a covered lens are no world to be found in. */
bool has_depth(double valid);

/* Correspondences n: fewer are too few, of a map of that size. */
int minimum_pairs(const fathom_config *config, int pixels);

/* Overlap, residual r, condition number kappa, innovation, in this order; the first that fails names the verdict. */
fathom_verdict judge_alignment(const fathom_config *config, const alignment *icp, double innovation);

/* What the surface should look like from the found pose. */
fathom_verdict judge_view(const fathom_config *config, const comparison *k);

/* Certainty of the found pose, inertia counted in: its covariance. */
fathom_verdict judge_certainty(const fathom_config *config, const double covariance[36]);

/* Innovation: how far the result lies from where it was expected. Floors are added to the prior's covariance, for
 * inertia may be better than they say, or just seem so. */
void measure_innovation(const fathom_config *config, const align_prior *prior, attempt *a);

/* From a good seed, with nearly all of the frame in pairs, and close to the seed: the predicted view can't say
 * otherwise. */
bool evident(const fathom_config *config, double valid, const attempt *a);

/* All of it. What is reported counts from the prior; the gate passes a result that lies as near to where a proposed
 * place was started from, for dead reckoning can be surer than it is right (docs/DESIGN.md, Search). Ray-casts the
 * predicted view where that has a word in it; waits for the device then. */
void judge(const fathom_config *config, model_view *view, device *d, depth_maps *maps, raycaster *r,
           const pose *start, const align_prior *prior, double valid, attempt *a);

/* Another try may find more: it isn't depth that is wanting, nor does geometry leave open what inertia doesn't know. */
bool worth_another_try(fathom_verdict verdict);

/* The result is where inertia (or the view) says, so that nobody need look further. */
bool undoubted(const fathom_config *config, const attempt *a);

/* `other` fits the surface clearly better, or is the only one to be trusted. */
bool fits_better(const fathom_config *config, const attempt *other, const attempt *a);

/* Geometry alone has settled the pose, whatever inertia thinks of it: evidence of how good inertia is. */
bool settled_by_geometry(const fathom_config *config, const attempt *a);

#endif
