#include "base/covariance.h"

#include <math.h>

void covariance_transport(const double a[36], const double c[36], double out[36]) {
    double ac[36];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double s = 0;
            for (int k = 0; k < 6; k++) s += a[6 * i + k] * c[6 * k + j];
            ac[6 * i + j] = s;
        }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double s = 0;
            for (int k = 0; k < 6; k++) s += ac[6 * i + k] * a[6 * j + k];
            out[6 * i + j] = s;
        }
}

/* c = l l^T, l lower triangular (Cholesky); false when c isn't positive definite. */
static bool cholesky(const double c[36], double l[36]) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j <= i; j++) {
            double s = c[6 * i + j];
            for (int k = 0; k < j; k++) s -= l[6 * i + k] * l[6 * j + k];
            if (i == j && !(s > 0)) return false;
            l[6 * i + j] = i == j ? sqrt(s) : s / l[7 * j];
        }
    return true;
}

bool covariance_invert(const double c[36], double out[36]) {
    double l[36], inverse[36] = {0};
    if (!cholesky(c, l)) return false;
    for (int j = 0; j < 6; j++) /* l^-1, column by column */
        for (int i = j; i < 6; i++) {
            double s = i == j;
            for (int k = j; k < i; k++) s -= l[6 * i + k] * inverse[6 * k + j];
            inverse[6 * i + j] = s / l[7 * i];
        }
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double s = 0;
            for (int k = i > j ? i : j; k < 6; k++) s += inverse[6 * k + i] * inverse[6 * k + j];
            out[6 * i + j] = s;
        }
    return true;
}

double covariance_position_sigma(const double c[36]) {
    return sqrt(fmax(c[21], fmax(c[28], c[35])));
}

double covariance_mahalanobis(const double c[36], const double e[6]) {
    double l[36], y[6], sum = 0;
    if (!cholesky(c, l)) return INFINITY;
    for (int i = 0; i < 6; i++) {
        y[i] = e[i];
        for (int k = 0; k < i; k++) y[i] -= l[6 * i + k] * y[k];
        y[i] /= l[7 * i];
        sum += y[i] * y[i];
    }
    return sqrt(sum);
}
