/* Point-to-plane alignment of a frame's maps with a model map (Section 2; Chen and Medioni 1992; Low 2004). */
#ifndef FATHOM_ALIGN_H
#define FATHOM_ALIGN_H

#include "align/frames.h"
#include "frame/depth_maps.h"
#include "align/solve.h"

typedef struct {
    device_buffer sums; /* SUMS floats per row of the finest level */
    cl_kernel reduce;
    const fathom_config *config;
    double shared_m; /* the mean of solution.shared_m over trusted frames; 0: none yet */
    int learnt;      /* number of those frames */
} aligner;

/* The result of an alignment. Motions map the scan's camera to the model's camera. */
typedef struct {
    pose motion;
    int iterations;
    int pairs, overlap; /* at the last iteration */
    int pixels;         /* of the map of the last level */
    double weight, rms;
    double singular[6], condition;
    double covariance[36]; /* of motion, in the scan camera's axes: motion * exp(error) */
    /* inverse covariance from the pairs alone: zero in directions that they leave free */
    double information[36];
    double pull[6];  /* that information times the twist from motion to the optimum of the pairs alone */
    double shared_m; /* solution.shared_m */
    /* solution.observed, and the direction that is determined least, in the scan camera's axes */
    int observed;
    double weakest[6], weakest_sigma_m;
} alignment;

void aligner_init(aligner *a, device *d, arena *block, const fathom_config *config, const depth_maps *maps);
void aligner_close(aligner *a);
void aligner_reset(aligner *a);

/* Takes what a trusted alignment shows of the error that pixels share. */
void aligner_learn(aligner *a, const alignment *trusted);

/* Section 2: one reduction over all pixels of a level at a motion, against a model map of any camera. Waits for the
 * device. distance: maximum of a pair; huber_m: residual beyond which its weight falls; centre: see
 * normal_equations. */
void align_reduce(aligner *a, device *d, depth_maps *maps, int level, const pose *motion,
                  const device_buffer *model, const kernel_camera *model_camera, double distance,
                  double huber_m, const double centre[3], normal_equations *e);

/* Maximum distance of a model point from a scan point that it pairs with, from the coarsest level on. */
float align_reach(const aligner *a, int coarsest, double position_sigma_m);

/* Aligns from `start` on, with a maximum of budget[level] iterations at each level and the model maps of that level.
 * The prior's position sigma widens the pair distance; its information enters the solve with FATHOM_PRIOR_INFORMATION.
 * Waits for the device at each iteration. */
void align(aligner *a, device *d, depth_maps *maps, const device_buffer model[FATHOM_LEVELS],
           const pose *start, const align_prior *prior, const int budget[FATHOM_LEVELS], alignment *result);

/* Weighs the pairs' information, `trust` of which is left, anew against the prior that they were joined with: motion,
 * covariance, information and pull become those of that. Trust 0: the prior itself. */
void align_trust_less(alignment *a, const align_prior *known, double trust);

#endif
