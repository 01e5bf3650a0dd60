/* The 6x6 system of Section 2: A x = b in the least squares sense from its sums, with the figures to judge it by. */
#ifndef FATHOM_SOLVE_H
#define FATHOM_SOLVE_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

#define SOLVE_BANDS 12 /* of a map: neighbouring pixels are in the same */

/* Sums over the kept pairs; see opencl/align.cl. Rotations and points are relative to `centre`. */
typedef struct {
    double ata[36];       /* A^T A, row-major: rotation, then translation */
    double atb[6];        /* A^T b */
    double btb;           /* b^T b */
    double weight;        /* sum of w */
    double point[3];      /* sum of w p */
    double point_squared; /* sum of w |p|^2 */
    double pairs;         /* n */
    double overlap;       /* pixels where scan and model both have a surface */
    /* of some of the pairs: A^T A, and the symmetric part of A^T S, S being A with the scan's normals in place of the
     * model's; upper triangles, row by row */
    double some[21], across[21];
    double centre[3];
    /* the upper triangle of A^T A, row by row, and A^T b of each band of the map, from top to bottom */
    double bands[SOLVE_BANDS][27];
} normal_equations;

typedef struct {
    double twist[6];    /* x about the model camera's origin: p moves to p + rotation x p + translation */
    double residual;    /* r = ||A x - b||^2 of the linear model after the update */
    double singular[6]; /* of A centred on the pairs and scaled by their spread, largest first */
    double condition;   /* kappa(A) = largest / smallest; INFINITY when the smallest is 0 */
    /* (A^T A)^-1 of twist for unit variance of a pair of weight 1; directions that the pairs leave free get a large,
     * finite variance */
    double covariance[36];
    /* of twist, from the pairs alone, in true units, without the share due to noise; zero without a prior */
    double information[36];
    /* that information times the correction of twist that the pairs alone would add to the solution */
    double pull[6];
    /* sigma of the error that pixels share, as these pairs show it: of the translation, and of the rotation about the
     * pairs' centroid times their spread. 0: unknown */
    double shared_m;
    /* with a prior: the number of directions that the pairs alone determine to max_sigma_m, the one that they determine
     * least, of length 1 where rotations are about the centroid and times the spread, and its sigma, 1 m at most */
    int observed;
    double weakest[6], weakest_sigma_m;
} solution;

/* Adds one strip's sums, as the kernel wrote them, in double precision; band: 0..SOLVE_BANDS-1. A^T A and A^T b are known
 * once all strips have been added, by normal_equations_total. */
void normal_equations_add(normal_equations *e, const float *sums, int band);

/* Adds a strip that holds A^T S: the upper triangles of A^T A and of that. */
void normal_equations_add_across(normal_equations *e, const float *ata, const float *ats);
void normal_equations_total(normal_equations *e);

/* The inertial prior of the twist: mean and information (inverse covariance). */
typedef struct {
    double mean[6];
    double information[36]; /* row-major */
    double correlated;      /* number of pairs that count as one independent measurement beside the prior */
    /* the pose isn't settled, and normals differ as those of wrong pairs do: all of the pairs' information counts */
    bool converging;
    double since_s; /* seconds since the map was last made from a scan: their noise is less alike with time */
    double max_sigma_m; /* of an observed direction */
    double shared_m;    /* minimum of the error that pixels share: solution.shared_m of earlier frames */
} solve_prior;

/* Solves by the singular values of A. Without a prior (NULL), directions whose singular value is below 1e-6 of the
 * largest are left alone (minimum norm). With one, its information is added to the pairs', from which the share due to
 * noise is taken first, so that inertia holds the directions that geometry leaves free; covariance is then the
 * joint one, in true units. However many pairs there are, they are no surer than the error that they share: its variance
 * is added to theirs in each direction. False when there is nothing to solve: no pairs, or sums that aren't finite. */
bool solve_alignment(const normal_equations *e, const solve_prior *prior, solution *s);

#ifdef __cplusplus
}
#endif

#endif
