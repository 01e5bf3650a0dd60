#include "base/se3.h"

#include <math.h>
#include <string.h>

pose pose_identity(void) {
    return (pose){{1, 0, 0, 0, 1, 0, 0, 0, 1}, {0, 0, 0}};
}

void so3_multiply(const double a[9], const double b[9], double out[9]) {
    double m[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            m[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
    memcpy(out, m, sizeof m);
}

void so3_transpose_multiply(const double a[9], const double b[9], double out[9]) {
    double m[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) m[3 * i + j] = a[i] * b[j] + a[3 + i] * b[3 + j] + a[6 + i] * b[6 + j];
    memcpy(out, m, sizeof m);
}

void so3_apply(const double r[9], const double v[3], double out[3]) {
    const double a[3] = {v[0], v[1], v[2]};
    for (int i = 0; i < 3; i++) out[i] = r[3 * i] * a[0] + r[3 * i + 1] * a[1] + r[3 * i + 2] * a[2];
}

void pose_apply(const pose *a, const double p[3], double out[3]) {
    double q[3];
    for (int i = 0; i < 3; i++)
        q[i] = a->r[3 * i] * p[0] + a->r[3 * i + 1] * p[1] + a->r[3 * i + 2] * p[2] + a->t[i];
    memcpy(out, q, sizeof q);
}

pose pose_multiply(const pose *a, const pose *b) {
    pose c;
    so3_multiply(a->r, b->r, c.r);
    pose_apply(a, b->t, c.t);
    return c;
}

pose pose_inverse(const pose *a) {
    pose c;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) c.r[3 * i + j] = a->r[3 * j + i];
    for (int i = 0; i < 3; i++)
        c.t[i] = -(c.r[3 * i] * a->t[0] + c.r[3 * i + 1] * a->t[1] + c.r[3 * i + 2] * a->t[2]);
    return c;
}

pose pose_between(const pose *from, const pose *to) {
    pose inverse = pose_inverse(from);
    return pose_multiply(&inverse, to);
}

/* sin(x)/x, (1-cos x)/x^2 and (x - sin x)/x^3, safe near zero. */
static void exp_factors(double x, double *a, double *b, double *c) {
    if (x < 1e-4) {
        double s = x * x;
        *a = 1 - s / 6;
        *b = 0.5 - s / 24;
        *c = 1.0 / 6 - s / 120;
    } else {
        *a = sin(x) / x;
        *b = (1 - cos(x)) / (x * x);
        *c = (x - sin(x)) / (x * x * x);
    }
}

/* I + a [w]x + b [w]x^2 */
static void rodrigues(const double w[3], double a, double b, double r[9]) {
    double x = w[0], y = w[1], z = w[2];
    double k[9] = {0, -z, y, z, 0, -x, -y, x, 0};
    double k2[9];
    so3_multiply(k, k, k2);
    for (int i = 0; i < 9; i++) r[i] = (i % 4 == 0) + a * k[i] + b * k2[i];
}

static double norm3(const double v[3]) {
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

void so3_exp(const double w[3], double r[9]) {
    double a, b, c;
    exp_factors(norm3(w), &a, &b, &c);
    rodrigues(w, a, b, r);
}

void so3_log(const double r[9], double w[3]) {
    /* Uses the unit quaternion, largest component first, so that half a turn is no special case. */
    double q[4];
    double trace = r[0] + r[4] + r[8];
    int i = 0;
    if (r[4] > r[0]) i = 1;
    if (r[8] > r[4 * i]) i = 2;
    if (trace > 0) {
        double s = sqrt(trace + 1);
        q[3] = 0.5 * s;
        q[0] = 0.5 * (r[7] - r[5]) / s;
        q[1] = 0.5 * (r[2] - r[6]) / s;
        q[2] = 0.5 * (r[3] - r[1]) / s;
    } else {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        double s = sqrt(fmax(r[4 * i] - r[4 * j] - r[4 * k] + 1, 1e-300));
        q[i] = 0.5 * s;
        q[3] = 0.5 * (r[3 * k + j] - r[3 * j + k]) / s;
        q[j] = 0.5 * (r[3 * j + i] + r[3 * i + j]) / s;
        q[k] = 0.5 * (r[3 * k + i] + r[3 * i + k]) / s;
    }
    double n = norm3(q), sign = q[3] < 0 ? -1 : 1;
    double factor = n < 1e-9 ? 2 / fmax(fabs(q[3]), 1e-9) : 2 * atan2(n, fabs(q[3])) / n;
    for (int m = 0; m < 3; m++) w[m] = sign * factor * q[m];
}

pose pose_exp(const double twist[6]) {
    pose p;
    double a, b, c, v[9];
    exp_factors(norm3(twist), &a, &b, &c);
    rodrigues(twist, a, b, p.r);
    rodrigues(twist, b, c, v);
    for (int i = 0; i < 3; i++)
        p.t[i] = v[3 * i] * twist[3] + v[3 * i + 1] * twist[4] + v[3 * i + 2] * twist[5];
    return p;
}

void pose_log(const pose *p, double twist[6]) {
    so3_log(p->r, twist);
    double x = norm3(twist), v[9];
    /* V^-1 = I - 1/2 [w]x + d [w]x^2 with d = 1/x^2 - (1 + cos x) / (2 x sin x), by half angles near zero and near
     * pi */
    double d = x < 1e-4 ? 1.0 / 12 + x * x / 720 : (1 - 0.5 * x * cos(0.5 * x) / sin(0.5 * x)) / (x * x);
    rodrigues(twist, -0.5, d, v);
    for (int i = 0; i < 3; i++)
        twist[3 + i] = v[3 * i] * p->t[0] + v[3 * i + 1] * p->t[1] + v[3 * i + 2] * p->t[2];
}

double pose_angle(const pose *a) {
    double w[3];
    so3_log(a->r, w);
    return norm3(w);
}

double pose_distance(const pose *a) {
    return norm3(a->t);
}

void pose_normalise(pose *a) {
    double *x = a->r, *y = a->r + 3, *z = a->r + 6;
    double n = norm3(x);
    for (int i = 0; i < 3; i++) x[i] /= n;
    double d = x[0] * y[0] + x[1] * y[1] + x[2] * y[2];
    for (int i = 0; i < 3; i++) y[i] -= d * x[i];
    n = norm3(y);
    for (int i = 0; i < 3; i++) y[i] /= n;
    z[0] = x[1] * y[2] - x[2] * y[1];
    z[1] = x[2] * y[0] - x[0] * y[2];
    z[2] = x[0] * y[1] - x[1] * y[0];
}

bool pose_is_finite(const pose *a) {
    for (int i = 0; i < 9; i++)
        if (!isfinite(a->r[i])) return false;
    return isfinite(a->t[0]) && isfinite(a->t[1]) && isfinite(a->t[2]);
}

void pose_adjoint(const pose *a, double adjoint[36]) {
    const double *t = a->t;
    double k[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0}, kr[9];
    so3_multiply(k, a->r, kr);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            adjoint[6 * i + j] = a->r[3 * i + j];
            adjoint[6 * i + j + 3] = 0;
            adjoint[6 * (i + 3) + j] = kr[3 * i + j];
            adjoint[6 * (i + 3) + j + 3] = a->r[3 * i + j];
        }
}

/* The series sum (-ad(twist))^k / (k + 1)!, whose terms vanish quickly up to half a turn and beyond. */
void pose_right_jacobian(const double twist[6], double j[36]) {
    const double *w = twist, *v = twist + 3;
    const double ad[36] = {0,     -w[2], w[1],  0,    0,     0,     w[2],  0, -w[0], 0,    0,    0,
                           -w[1], w[0],  0,     0,    0,     0,     0,     -v[2], v[1], 0,  -w[2], w[1],
                           v[2],  0,     -v[0], w[2], 0,     -w[0], -v[1], v[0], 0,    -w[1], w[0], 0};
    double term[36], next[36];
    for (int i = 0; i < 36; i++) j[i] = term[i] = i % 7 == 0;
    for (int k = 1; k <= 20; k++) {
        for (int i = 0; i < 36; i++) {
            next[i] = 0;
            for (int m = 0; m < 6; m++) next[i] -= term[i / 6 * 6 + m] * ad[6 * m + i % 6] / (k + 1);
        }
        for (int i = 0; i < 36; i++) j[i] += term[i] = next[i];
    }
}

void pose_to_matrix(const pose *a, double m[16]) {
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) m[4 * i + j] = a->r[3 * i + j];
        m[4 * i + 3] = a->t[i];
    }
    m[12] = m[13] = m[14] = 0;
    m[15] = 1;
}

bool pose_from_matrix(const double m[16], pose *a) {
    for (int i = 0; i < 16; i++)
        if (!isfinite(m[i])) return false;
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) a->r[3 * i + j] = m[4 * i + j];
        a->t[i] = m[4 * i + 3];
    }
    double product[9];
    so3_transpose_multiply(a->r, a->r, product);
    for (int i = 0; i < 9; i++)
        if (fabs(product[i] - (i % 4 == 0)) > 1e-3) return false;
    double z = a->r[6] * (a->r[1] * a->r[5] - a->r[2] * a->r[4]) +
               a->r[7] * (a->r[2] * a->r[3] - a->r[0] * a->r[5]) +
               a->r[8] * (a->r[0] * a->r[4] - a->r[1] * a->r[3]);
    bool last_row = fabs(m[12]) + fabs(m[13]) + fabs(m[14]) + fabs(m[15] - 1) < 1e-3;
    if (z < 0 || !last_row) return false;
    pose_normalise(a);
    return true;
}

fathom_pose pose_give(const pose *a) {
    const double *r = a->r, trace = r[0] + r[4] + r[8];
    fathom_pose p = {{a->t[0], a->t[1], a->t[2]}, {0, 0, 0, 0}};
    double *q = p.orientation, length = 0;
    if (trace > 0) {
        q[0] = r[7] - r[5];
        q[1] = r[2] - r[6];
        q[2] = r[3] - r[1];
        q[3] = 1 + trace;
    } else { /* from the largest on the diagonal, to avoid division by small numbers */
        int i = r[0] > r[4] ? (r[0] > r[8] ? 0 : 2) : (r[4] > r[8] ? 1 : 2), j = (i + 1) % 3, k = (i + 2) % 3;
        q[i] = 1 + r[4 * i] - r[4 * j] - r[4 * k];
        q[j] = r[3 * i + j] + r[3 * j + i];
        q[k] = r[3 * i + k] + r[3 * k + i];
        q[3] = r[3 * k + j] - r[3 * j + k];
    }
    for (int i = 0; i < 4; i++) length += q[i] * q[i];
    length = copysign(sqrt(length), q[3]); /* w >= 0 */
    for (int i = 0; i < 4; i++) q[i] /= length;
    return p;
}

bool pose_take(const fathom_pose *p, pose *a) {
    const double *q = p->orientation;
    double x = q[0], y = q[1], z = q[2], w = q[3], length = sqrt(x * x + y * y + z * z + w * w);
    for (int i = 0; i < 3; i++)
        if (!isfinite(a->t[i] = p->position[i])) return false;
    if (!(fabs(length - 1) <= 1e-3)) return false; /* false for NaN */
    x /= length, y /= length, z /= length, w /= length;
    const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w),
                         2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                         2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)};
    memcpy(a->r, r, sizeof r);
    return true;
}
