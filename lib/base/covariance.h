/* Covariances of poses: 6x6, row-major, of the twist of a right perturbation (rotation, then translation). */
#ifndef FATHOM_COVARIANCE_H
#define FATHOM_COVARIANCE_H

#include <stdbool.h>

#ifdef __cplusplus
extern "C" {
#endif

/* out = A c A^T; out may be c. With A an adjoint, it takes the covariance of a perturbation to other axes. */
void covariance_transport(const double a[36], const double c[36], double out[36]);
/* out = c^-1, symmetric; false when c isn't positive definite. */
bool covariance_invert(const double c[36], double out[36]);
/* The largest sigma of position along an axis, metres. */
double covariance_position_sigma(const double c[36]);
/* Mahalanobis distance sqrt(e^T c^-1 e) by Cholesky; INFINITY when c isn't positive definite. */
double covariance_mahalanobis(const double c[36], const double e[6]);

#ifdef __cplusplus
}
#endif

#endif
