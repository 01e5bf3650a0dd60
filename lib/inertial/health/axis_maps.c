#include "inertial/health/axis_maps.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#define TIE_LEAST 0.002     /* fraction of the energy within which maps count as equal: the simplest is reported */

static double explained_by(const double map[9], const double gw[9]) {
    double sum = 0;
    for (int i = 0; i < 9; i++) sum += map[i] * gw[i];
    return sum;
}

double determinant(const double m[9]) {
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}

/* The k-th of the 48 signed permutations, and how unlikely a mistake it is. */
int signed_permutation(int k, double map[9]) {
    static const int order[6][3] = {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1}};
    const int *o = order[k / 8];
    int signs = k % 8, negative = (signs & 1) + (signs >> 1 & 1) + (signs >> 2);
    memset(map, 0, 9 * sizeof *map);
    for (int i = 0; i < 3; i++) map[3 * i + o[i]] = signs >> i & 1 ? -1 : 1;
    if (k / 8 == 0) return negative == 3 ? 1 : negative;
    return determinant(map) > 0 ? 3 : k < 32 && negative == 0 ? 1 : 4;
}

/* The most likely signed permutation: the simplest of those whose misfit hardly exceeds the minimum. Returns its sum;
 * *rivals: number of others that are as simple. */
double best_permutation(const double gw[9], double scatter, double best_map[9], int *rivals) {
    double map[9], most = 0, sum = 0;
    int simplest = 99;
    for (int k = 0; k < 48; k++) {
        signed_permutation(k, map);
        most = fmax(most, explained_by(map, gw));
    }
    double bound = TIE * (1 - most * most / scatter) + TIE_LEAST;
    signed_permutation(0, best_map);
    for (int k = 0; k < 48; k++) {
        int complexity = signed_permutation(k, map);
        double t = explained_by(map, gw);
        if (t <= 0 || 1 - t * t / scatter > bound) continue;
        *rivals = complexity < simplest ? 0 : *rivals + 1;
        if (complexity < simplest || (complexity == simplest && t > sum)) {
            simplest = complexity;
            sum = t;
            memcpy(best_map, map, sizeof map);
        }
    }
    return sum;
}

/* The rotation R with the largest sum of R .* m (Horn 1987, "Closed-form solution of absolute orientation using unit
 * quaternions", Section 4), by Jacobi's method on the 4x4 matrix. Returns that sum. */
double best_rotation(const double m[9], double map[9]) {
    double a[4][4] = {{m[0] + m[4] + m[8], m[7] - m[5], m[2] - m[6], m[3] - m[1]},
                      {0, m[0] - m[4] - m[8], m[1] + m[3], m[2] + m[6]},
                      {0, 0, m[4] - m[0] - m[8], m[5] + m[7]},
                      {0, 0, 0, m[8] - m[0] - m[4]}};
    double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++) a[i][j] = a[j][i];
    for (int sweep = 0; sweep < 12; sweep++)
        for (int i = 0; i < 4; i++)
            for (int j = i + 1; j < 4; j++) {
                if (fabs(a[i][j]) < 1e-300) continue;
                double angle = 0.5 * atan2(2 * a[i][j], a[j][j] - a[i][i]), c = cos(angle), s = sin(angle);
                for (int k = 0; k < 4; k++) {
                    double x = a[k][i], y = a[k][j], vx = v[k][i], vy = v[k][j];
                    a[k][i] = c * x - s * y;
                    a[k][j] = s * x + c * y;
                    v[k][i] = c * vx - s * vy;
                    v[k][j] = s * vx + c * vy;
                }
                for (int k = 0; k < 4; k++) {
                    double x = a[i][k], y = a[j][k];
                    a[i][k] = c * x - s * y;
                    a[j][k] = s * x + c * y;
                }
            }
    int top = 0;
    for (int i = 1; i < 4; i++)
        if (a[i][i] > a[top][top]) top = i;
    double w = v[0][top], x = v[1][top], y = v[2][top], z = v[3][top];
    const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    memcpy(map, r, sizeof r);
    return a[top][top];
}

double angle_of(const double map[9]) {
    return acos(fmin(1, fmax(-1, 0.5 * (map[0] + map[4] + map[8] - 1))));
}
