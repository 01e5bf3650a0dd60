/* The verdict "tracking" of Section 2, last paragraph: whether an alignment is trusted. All its tests are here. */
#ifndef FATHOM_VERDICT_H
#define FATHOM_VERDICT_H

#include "align/align.h"
#include "tracking/predicted_view.h"

/* One attempt to align the frame, and its verdict. */
typedef struct {
    alignment icp; /* its motion: camera to world */
    fathom_verdict verdict;
    bool seeded;                       /* from a seed good enough for max_seeded_iterations */
    bool searched;                     /* from a pose that relocalisation proposed */
    bool contradicted;                 /* the surface contradicts it, or did lately: it teaches nothing about the IMU */
    bool by_velocity;                  /* the prior is the pose that the last velocity predicts, not inertia's */
    double rotation_rad, translation_m; /* from the prior's mean to the result */
    double innovation;                 /* the same as a Mahalanobis distance, in sigmas of the prior */
    double agreement, see_through;     /* fractions of the predicted view; NAN: not compared */
} attempt;

/* The fraction of the frame that is within the maps' range of depths (from every fourth row). */
double valid_part(const depth_maps *maps, const fathom_depth_frame *scan);

/* Whether there are enough valid pixels to align or to start a map; false for a few stray ones under a covered lens. */
bool has_depth(double valid);

/* The minimum number of pairs n for a map of that size. */
int minimum_pairs(const fathom_config *config, int pixels);

/* Overlap, residual r, condition number kappa, innovation, in this order; the first that fails names the verdict. */
fathom_verdict judge_alignment(const fathom_config *config, const alignment *icp, double innovation);

/* Agreement with the predicted view at the found pose. */
fathom_verdict judge_view(const fathom_config *config, const comparison *k);

/* Certainty of the found pose: its covariance, inertia included. */
fathom_verdict judge_certainty(const fathom_config *config, const double covariance[36]);

/* The same relative to an earlier pose whose surface is in view. motion: covariance of the motion since, by inertia. */
fathom_verdict judge_certainty_since(const fathom_config *config, const double motion[36], const alignment *icp);

/* Innovation: the distance of the result from the prior's mean. Floors are added to the prior's covariance, which may
 * be smaller than the true errors. */
void measure_innovation(const fathom_config *config, const align_prior *prior, attempt *a);

/* Whether the result is beyond doubt without a comparison: from a good seed, close to it, and with nearly all of the
 * frame in pairs. */
bool evident(const fathom_config *config, double valid, const attempt *a);

/* All tests. Reported distances are from the prior; the gate also passes a result that lies as near to a start that the
 * search proposed, since dead reckoning can be overconfident (docs/DESIGN.md, Search). Ray-casts the predicted view
 * where it is needed, and then waits for the device. */
void judge(const fathom_config *config, model_view *view, device *d, depth_maps *maps, raycaster *r,
           const pose *start, const align_prior *prior, double valid, attempt *a);

/* Whether another attempt may succeed: neither is depth missing, nor does geometry leave directions free that inertia
 * doesn't hold. */
bool worth_another_try(fathom_verdict verdict);

/* Whether the result agrees with inertia or the predicted view, so that no further attempt is needed. */
bool undoubted(const fathom_config *config, const attempt *a);

/* Whether `other` fits the surface clearly better, or is the only one that is trusted. */
bool fits_better(const fathom_config *config, const attempt *other, const attempt *a);

/* Whether geometry alone determines the pose, so that it is evidence of how good inertia is. */
bool settled_by_geometry(const fathom_config *config, const attempt *a);

#endif
