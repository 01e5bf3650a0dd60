/* Rigid motions SE(3) in double precision. References: Sola, Deray, Atchuthan, "A micro Lie theory for state estimation
 * in robotics" (2018), Section IV and Appendix B, D.
 *
 * A pose maps p to rotation * p + translation. A twist is rotation (radians) then translation (metres); perturbations
 * are on the right: pose * exp(twist), so a twist and a covariance live in the axes of the frame that the pose maps
 * from. */
#ifndef FATHOM_SE3_H
#define FATHOM_SE3_H

#include <stdbool.h>

#include "fathom.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    double r[9]; /* rotation, row-major */
    double t[3]; /* translation */
} pose;

pose pose_identity(void);
pose pose_multiply(const pose *a, const pose *b); /* a * b */
pose pose_inverse(const pose *a);
pose pose_between(const pose *from, const pose *to); /* inv(from) * to */
void pose_apply(const pose *a, const double p[3], double out[3]);
pose pose_exp(const double twist[6]); /* rotation by exp; translation = V(rotation) * twist[3..5] */
void pose_log(const pose *a, double twist[6]);
double pose_angle(const pose *a);    /* 0..pi */
double pose_distance(const pose *a); /* length of the translation */
void pose_normalise(pose *a);        /* makes the rotation orthonormal again (Gram-Schmidt) */
bool pose_is_finite(const pose *a);
/* exp(adjoint * twist) * a = a * exp(twist), row-major 6x6 */
void pose_adjoint(const pose *a, double adjoint[36]);
/* exp(twist + d) = exp(twist) * exp(j d) for small d, row-major 6x6 */
void pose_right_jacobian(const double twist[6], double j[36]);

void pose_to_matrix(const pose *a, double matrix[16]); /* row-major 4x4 */
/* False unless finite, rigid (to 1e-3) and right-handed. */
bool pose_from_matrix(const double matrix[16], pose *a);

/* To the public form and back. False unless finite and of unit length, to 1e-3. */
fathom_pose pose_give(const pose *a);
bool pose_take(const fathom_pose *given, pose *a);

void so3_exp(const double w[3], double r[9]); /* Rodrigues */
void so3_log(const double r[9], double w[3]);
void so3_apply(const double r[9], const double v[3], double out[3]); /* r v; out may be v */
void so3_multiply(const double a[9], const double b[9], double out[9]);           /* out may be a or b */
void so3_transpose_multiply(const double a[9], const double b[9], double out[9]); /* a^T b */

#ifdef __cplusplus
}
#endif

#endif
