#include "fathom/replay/evaluate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The eigenvector of the largest eigenvalue of a symmetric 4x4 matrix, by cyclic Jacobi rotations. Destroys
 * the matrix. */
static void largest_eigenvector(double a[4][4], double vector[4]) {
    double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int sweep = 0; sweep < 50; sweep++) {
        double off = 0, on = 0;
        for (int p = 0; p < 4; p++) {
            on += a[p][p] * a[p][p];
            for (int q = p + 1; q < 4; q++) off += a[p][q] * a[p][q];
        }
        if (off <= 1e-30 * on) break;
        for (int p = 0; p < 4; p++)
            for (int q = p + 1; q < 4; q++) {
                if (a[p][q] == 0) continue;
                const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
                const double t = (theta < 0 ? -1 : 1) / (fabs(theta) + sqrt(theta * theta + 1));
                const double c = 1 / sqrt(t * t + 1), s = t * c;
                for (int k = 0; k < 4; k++) {
                    const double kp = a[k][p], kq = a[k][q];
                    a[k][p] = c * kp - s * kq;
                    a[k][q] = s * kp + c * kq;
                }
                for (int k = 0; k < 4; k++) {
                    const double pk = a[p][k], qk = a[q][k], kp = v[k][p], kq = v[k][q];
                    a[p][k] = c * pk - s * qk;
                    a[q][k] = s * pk + c * qk;
                    v[k][p] = c * kp - s * kq;
                    v[k][q] = s * kp + c * kq;
                }
            }
    }
    int best = 0;
    for (int k = 1; k < 4; k++)
        if (a[k][k] > a[best][best]) best = k;
    for (int k = 0; k < 4; k++) vector[k] = v[k][best];
}

/* Horn's Section 4: the rotation is the eigenvector of N, made of the sums of products S. */
static void best_rotation(const double s[3][3], double r[3][3]) {
    double n[4][4] = {{s[0][0] + s[1][1] + s[2][2], s[1][2] - s[2][1], s[2][0] - s[0][2], s[0][1] - s[1][0]},
                      {s[1][2] - s[2][1], s[0][0] - s[1][1] - s[2][2], s[0][1] + s[1][0], s[2][0] + s[0][2]},
                      {s[2][0] - s[0][2], s[0][1] + s[1][0], s[1][1] - s[0][0] - s[2][2], s[1][2] + s[2][1]},
                      {s[0][1] - s[1][0], s[2][0] + s[0][2], s[1][2] + s[2][1], s[2][2] - s[0][0] - s[1][1]}};
    double q[4];
    largest_eigenvector(n, q);
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double rotation[3][3] = {{w * w + x * x - y * y - z * z, 2 * (x * y - w * z), 2 * (x * z + w * y)},
                                   {2 * (x * y + w * z), w * w - x * x + y * y - z * z, 2 * (y * z - w * x)},
                                   {2 * (x * z - w * y), 2 * (y * z + w * x), w * w - x * x - y * y + z * z}};
    memcpy(r, rotation, sizeof rotation);
}

double evaluate_rmse(const double (*estimate)[3], const double (*truth)[3], int count) {
    double from[3] = {0}, to[3] = {0}, s[3][3] = {{0}}, r[3][3], sum = 0;
    if (count < 3) return NAN;
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            from[k] += estimate[i][k] / count;
            to[k] += truth[i][k] / count;
        }
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++)
            for (int l = 0; l < 3; l++) s[k][l] += (estimate[i][k] - from[k]) * (truth[i][l] - to[l]);
    best_rotation(s, r);
    for (int i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            double left = truth[i][k] - to[k];
            for (int l = 0; l < 3; l++) left -= r[k][l] * (estimate[i][l] - from[l]);
            sum += left * left;
        }
    return sqrt(sum / count);
}

double evaluate_ate(const fathom_recording *recording, const struct path *path) {
    const size_t room = (size_t)path->count + 1;
    double(*estimate)[3] = malloc(room * sizeof *estimate);
    double(*truth)[3] = malloc(room * sizeof *truth);
    int count = 0;
    for (int i = 0; estimate && truth && i < path->count; i++) {
        fathom_pose pose;
        if (fathom_recording_pose_at(recording, path->points[i].timestamp_ns, &pose)) continue;
        memcpy(truth[count], pose.position, sizeof pose.position);
        memcpy(estimate[count], path->points[i].pose.position, sizeof pose.position);
        count++;
    }
    const double rmse =
        count ? evaluate_rmse((const double(*)[3])estimate, (const double(*)[3])truth, count) : NAN;
    free(estimate);
    free(truth);
    return rmse;
}
