/* Point-to-plane alignment of a frame's maps with a model map (Section 2; Chen and Medioni 1992; Low 2004). */
#ifndef FATHOM_ALIGN_H
#define FATHOM_ALIGN_H

#include "frame/depth_maps.h"
#include "align/solve.h"

typedef struct {
    device_buffer model[FATHOM_LEVELS]; /* normal and depth, in the model camera's axes */
    device_buffer sums;                 /* SUMS floats a row of the finest level */
    cl_kernel reduce;
    const fathom_config *config;
} aligner;

/* What an alignment found. Motions map the scan's camera to the model's camera. */
typedef struct {
    pose motion;
    int iterations;
    int level;          /* finest level that had pairs */
    int pairs, overlap; /* at the last iteration */
    int pixels;         /* of the map of that level */
    double weight, rms;
    double singular[6], condition;
    double covariance[36]; /* of motion, in the scan camera's axes: motion * exp(error) */
    double information
        [36];       /* the same from the pairs alone, inverted: directions that they leave free have none */
    double pull[6]; /* that information times the way from motion to where the pairs alone want it */
} alignment;

void aligner_init(aligner *a, device *d, arena *block, const fathom_config *config, const depth_maps *maps);
void aligner_close(aligner *a);

/* Section 2: one reduction over all pixels of a level at a motion, against a model map of any camera. Waits for the device.
 * distance: of a pair at most; huber_m: residual from which its weight falls; centre: see normal_equations. */
void align_reduce(aligner *a, device *d, depth_maps *maps, int level, const pose *motion,
                  const device_buffer *model, const kernel_camera *model_camera, double distance,
                  double huber_m, const double centre[3], normal_equations *e);

/* How far from the scan a model point may lie and still pair with it, from the coarsest level on. */
float align_reach(const aligner *a, int coarsest, double seed_sigma_m);

/* Where to start from, and how sure that is. */
typedef struct {
    pose motion;           /* scan's camera to model's camera */
    double covariance[36]; /* motion * exp(error) */
    double sigma_m;        /* of the position: widens the pair distance to three of it, 60 cm at most */
    bool prior; /* the covariance enters the solve (else the seed is only where the search starts) */
} align_seed;

/* Aligns from the seed on, with at most budget[level] iterations at each level. Waits for the device at each iteration. */
void align(aligner *a, device *d, depth_maps *maps, const align_seed *seed, const int budget[FATHOM_LEVELS],
           alignment *result);

#endif
