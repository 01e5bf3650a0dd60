/* Rigid motions (lib/base/se3.c): exp and log against a power series and each other, adjoint, covariances, matrices. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "base/covariance.h"
#include "base/se3.h"

#define PI 3.14159265358979323846

static double uniform(uint64_t i, double low, double high) {
    return low + (high - low) * random_uniform(random_key(11, 0), i);
}

/* A twist whose rotation has the given angle; the first three have the axes themselves. */
static void twist_of(uint64_t which, double angle, double reach, double twist[6]) {
    double axis[3], n = 0;
    for (int k = 0; k < 3; k++) {
        axis[k] = which < 3 ? (double)(which == (uint64_t)k) : uniform(6 * which + (uint64_t)k, -1, 1);
        n += axis[k] * axis[k];
    }
    for (int k = 0; k < 3; k++) {
        twist[k] = angle * axis[k] / sqrt(n);
        twist[3 + k] = uniform(6 * which + 3 + (uint64_t)k, -reach, reach);
    }
}

static pose random_pose(uint64_t which) {
    double twist[6];
    twist_of(100 + which, uniform(7000 + which, 0, PI), 3, twist);
    return pose_exp(twist);
}

static void multiply4(const double a[16], const double b[16], double out[16]) {
    double m[16];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) {
            m[4 * i + j] = 0;
            for (int k = 0; k < 4; k++) m[4 * i + j] += a[4 * i + k] * b[4 * k + j];
        }
    memcpy(out, m, sizeof m);
}

/* The exponential of a twist by its definition: scaled down, the power series of the 4x4 matrix, squared up again. */
static void series_exp(const double twist[6], double sum[16]) {
    const int squarings = 6;
    const double *w = twist, *v = twist + 3, s = ldexp(1, -squarings);
    const double a[16] = {0,         -w[2] * s, w[1] * s, v[0] * s, w[2] * s, 0, -w[0] * s, v[1] * s,
                          -w[1] * s, w[0] * s,  0,        v[2] * s, 0,        0, 0,         0};
    double term[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    memcpy(sum, term, sizeof term);
    for (int k = 1; k < 16; k++) {
        multiply4(term, a, term);
        for (int i = 0; i < 16; i++) sum[i] += term[i] /= k;
    }
    for (int k = 0; k < squarings; k++) multiply4(sum, sum, sum);
}

static void assert_pose_equal(const pose *a, const pose *b, double tolerance) {
    for (int i = 0; i < 9; i++) assert_true(fabs(a->r[i] - b->r[i]) <= tolerance);
    for (int i = 0; i < 3; i++) assert_true(fabs(a->t[i] - b->t[i]) <= tolerance);
}

static const double angles[] = {0,        1e-15, 1e-12,     1e-9,      1e-7,      1e-5,     9.99e-5,
                                1.001e-4, 1e-3,  0.05,      0.5,       1.0,       1.57,     2.0,
                                2.5,      3.0,   PI - 1e-2, PI - 1e-4, PI - 1e-6, PI - 1e-9};
#define ANGLES (sizeof angles / sizeof *angles)

static void exp_is_the_power_series(void **state) {
    (void)state;
    for (size_t i = 0; i < ANGLES; i++)
        for (uint64_t which = 0; which < 20; which++) {
            double twist[6], m[16];
            twist_of(which, angles[i], 5, twist);
            pose p = pose_exp(twist);
            series_exp(twist, m);
            for (int r = 0; r < 3; r++) {
                for (int c = 0; c < 3; c++) assert_true(fabs(p.r[3 * r + c] - m[4 * r + c]) < 1e-11);
                assert_true(fabs(p.t[r] - m[4 * r + 3]) < 1e-10);
            }
        }
}

static void log_undoes_exp(void **state) {
    (void)state;
    for (size_t i = 0; i < ANGLES; i++)
        for (uint64_t which = 0; which < 50; which++) {
            double twist[6], back[6], w[3], r[9];
            twist_of(which, angles[i], 5, twist);
            pose p = pose_exp(twist);
            pose_log(&p, back);
            for (int k = 0; k < 6; k++) assert_true(fabs(back[k] - twist[k]) < 1e-9);
            assert_true(fabs(pose_angle(&p) - angles[i]) < 1e-9);
            so3_exp(twist, r);
            so3_log(r, w);
            for (int k = 0; k < 3; k++) assert_true(fabs(w[k] - twist[k]) < 1e-9);
        }
}

/* At half a turn an axis and its opposite are the same rotation: exp(log(R)) is R all the same. Beyond it the log goes
 * the short way round. */
static void exp_undoes_log_at_and_beyond_half_a_turn(void **state) {
    (void)state;
    const double beyond[] = {PI - 1e-12, PI, PI + 1e-12, PI + 1e-6, 4.0, 6.0, 2 * PI - 1e-9, 9.0};
    for (size_t i = 0; i < sizeof beyond / sizeof *beyond; i++)
        for (uint64_t which = 0; which < 50; which++) {
            double twist[6], back[6];
            twist_of(which, beyond[i], 5, twist);
            pose p = pose_exp(twist);
            pose_log(&p, back);
            pose again = pose_exp(back);
            assert_pose_equal(&p, &again, 1e-9);
            assert_true(pose_angle(&p) <= PI + 1e-9);
        }
}

static void products_inverses_and_points_agree(void **state) {
    (void)state;
    for (uint64_t i = 0; i < 50; i++) {
        pose a = random_pose(3 * i), b = random_pose(3 * i + 1), c = random_pose(3 * i + 2);
        pose ab = pose_multiply(&a, &b), bc = pose_multiply(&b, &c);
        pose left = pose_multiply(&ab, &c), right = pose_multiply(&a, &bc);
        assert_pose_equal(&left, &right, 1e-12);
        pose inverse = pose_inverse(&a), one = pose_multiply(&a, &inverse), identity = pose_identity();
        assert_pose_equal(&one, &identity, 1e-12);
        pose between = pose_between(&a, &b), there = pose_multiply(&a, &between);
        assert_pose_equal(&there, &b, 1e-12);
        double p[3] = {uniform(900 + i, -2, 2), 0.3, -1.1}, q[3], r[3];
        pose_apply(&b, p, q);
        pose_apply(&a, q, q); /* in place */
        pose_apply(&ab, p, r);
        for (int k = 0; k < 3; k++) assert_true(fabs(q[k] - r[k]) < 1e-12);
        assert_true(fabs(pose_distance(&a) - sqrt(a.t[0] * a.t[0] + a.t[1] * a.t[1] + a.t[2] * a.t[2])) <
                    1e-15);
        double product[9], transposed[9];
        so3_transpose_multiply(a.r, a.r, product);
        so3_multiply(inverse.r, a.r, transposed);
        for (int k = 0; k < 9; k++) {
            assert_true(fabs(product[k] - (k % 4 == 0)) < 1e-12);
            assert_true(fabs(product[k] - transposed[k]) < 1e-12);
        }
    }
}

static void normalise_makes_a_rotation_again(void **state) {
    (void)state;
    for (uint64_t i = 0; i < 20; i++) {
        pose a = random_pose(i), b = a;
        for (int k = 0; k < 9; k++) b.r[k] += uniform(2000 + 9 * i + (uint64_t)k, -1e-4, 1e-4);
        pose_normalise(&b);
        double product[9];
        so3_transpose_multiply(b.r, b.r, product);
        for (int k = 0; k < 9; k++) assert_true(fabs(product[k] - (k % 4 == 0)) < 1e-14);
        assert_pose_equal(&a, &b, 5e-4);
        double w[3];
        so3_log(b.r, w); /* right-handed: the log is that of a rotation near a's */
        assert_true(fabs(pose_angle(&a) - sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2])) < 1e-3);
    }
}

static void adjoint_moves_a_twist_to_the_other_side(void **state) {
    (void)state;
    for (uint64_t i = 0; i < 30; i++) {
        pose a = random_pose(i), inverse = pose_inverse(&a);
        double adjoint[36], twist[6], moved[6] = {0};
        pose_adjoint(&a, adjoint);
        twist_of(400 + i, 1.2, 0.7, twist); /* holds for twists of any size */
        for (int r = 0; r < 6; r++)
            for (int c = 0; c < 6; c++) moved[r] += adjoint[6 * r + c] * twist[c];
        pose right = pose_exp(twist), left = pose_exp(moved);
        pose one = pose_multiply(&a, &right), two = pose_multiply(&left, &a);
        assert_pose_equal(&one, &two, 1e-9);
        for (int c = 0; c < 6; c++) { /* its columns by finite differences */
            const double h = 1e-5;
            double plus[6] = {0}, minus[6] = {0}, up[6], down[6];
            plus[c] = h;
            minus[c] = -h;
            pose p = pose_exp(plus), m = pose_exp(minus);
            p = pose_multiply(&a, &p);
            p = pose_multiply(&p, &inverse);
            m = pose_multiply(&a, &m);
            m = pose_multiply(&m, &inverse);
            pose_log(&p, up);
            pose_log(&m, down);
            for (int r = 0; r < 6; r++)
                assert_true(fabs((up[r] - down[r]) / (2 * h) - adjoint[6 * r + c]) < 1e-8);
        }
    }
}

static void mahalanobis_has_the_values_worked_out_by_hand(void **state) {
    (void)state;
    double c[36] = {0}, e[6] = {1, 2, 3, 4, 5, 6};
    for (int i = 0; i < 6; i++) c[7 * i] = (i + 1) * (i + 1); /* sigmas 1..6: each component is one sigma */
    assert_true(fabs(covariance_mahalanobis(c, e) - sqrt(6)) < 1e-14);
    double none[6] = {0};
    assert_true(covariance_mahalanobis(c, none) == 0);

    /* [2 1; 1 2] has the inverse [2 -1; -1 2] / 3: e = (1, 1) gives 2/3, e = (1, -1) gives 2 */
    memset(c, 0, sizeof c);
    for (int i = 0; i < 6; i++) c[7 * i] = i < 2 ? 2 : 1;
    c[1] = c[6] = 1;
    double together[6] = {1, 1, 0, 0, 0, 0}, apart[6] = {1, -1, 0, 0, 0, 0};
    assert_true(fabs(covariance_mahalanobis(c, together) - sqrt(2.0 / 3)) < 1e-14);
    assert_true(fabs(covariance_mahalanobis(c, apart) - sqrt(2)) < 1e-14);

    c[7 * 5] = 0; /* a direction of no variance */
    assert_true(isinf(covariance_mahalanobis(c, together)));
    c[7 * 5] = NAN;
    assert_true(isinf(covariance_mahalanobis(c, together)));
    c[7 * 5] = 1;
    c[1] = c[6] = 3; /* indefinite */
    assert_true(isinf(covariance_mahalanobis(c, together)));
}

static void transport_is_the_product_and_keeps_the_distance(void **state) {
    (void)state;
    for (uint64_t i = 0; i < 10; i++) {
        double root[36], c[36], a[36], moved[36], e[6], f[6] = {0};
        pose p = random_pose(i);
        pose_adjoint(&p, a);
        for (int k = 0; k < 36; k++) root[k] = uniform(5000 + 36 * i + (uint64_t)k, -1, 1);
        for (int r = 0; r < 6; r++)
            for (int s = 0; s < 6; s++) {
                c[6 * r + s] = r == s ? 0.1 : 0;
                for (int k = 0; k < 6; k++) c[6 * r + s] += root[6 * r + k] * root[6 * s + k];
            }
        covariance_transport(a, c, moved);
        for (int r = 0; r < 6; r++)
            for (int s = 0; s < 6; s++) {
                double sum = 0;
                for (int k = 0; k < 6; k++)
                    for (int m = 0; m < 6; m++) sum += a[6 * r + k] * c[6 * k + m] * a[6 * s + m];
                assert_true(fabs(moved[6 * r + s] - sum) < 1e-11);
            }
        for (int k = 0; k < 6; k++) e[k] = uniform(6000 + 6 * i + (uint64_t)k, -1, 1);
        for (int r = 0; r < 6; r++)
            for (int k = 0; k < 6; k++) f[r] += a[6 * r + k] * e[k];
        double before = covariance_mahalanobis(c, e);
        assert_true(fabs(covariance_mahalanobis(moved, f) - before) < 1e-8 * (1 + before));
        covariance_transport(a, c, c); /* in place */
        assert_memory_equal(c, moved, sizeof c);
    }
}

static void multiply6(const double a[36], const double b[36], double out[36]) {
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            out[6 * i + j] = 0;
            for (int k = 0; k < 6; k++) out[6 * i + j] += a[6 * i + k] * b[6 * k + j];
        }
}

/* Symmetric and positive: root root^T. */
static void random_covariance(uint64_t which, double c[36]) {
    double root[36], unit[36] = {0};
    for (int i = 0; i < 36; i++) root[i] = (i % 7 == 0) + uniform(9000 + 36 * which + (uint64_t)i, -0.3, 0.3);
    for (int i = 0; i < 6; i++) unit[7 * i] = 1;
    covariance_transport(root, unit, c);
}

static void the_inverses_adjoint_is_the_adjoints_inverse(void **state) {
    (void)state;
    for (uint64_t k = 0; k < 50; k++) {
        double there[36], back[36], both[36];
        pose a = random_pose(k), inverse = pose_inverse(&a);
        pose_adjoint(&a, there);
        pose_adjoint(&inverse, back);
        multiply6(there, back, both);
        for (int i = 0; i < 36; i++) assert_true(fabs(both[i] - (i % 7 == 0)) < 1e-12);
    }
}

static void the_products_adjoint_is_the_adjoints_product(void **state) {
    (void)state;
    for (uint64_t k = 0; k < 50; k++) {
        double first[36], second[36], both[36], product[36];
        pose a = random_pose(k), b = random_pose(k + 50), ab = pose_multiply(&a, &b);
        pose_adjoint(&a, first);
        pose_adjoint(&b, second);
        pose_adjoint(&ab, both);
        multiply6(first, second, product);
        for (int i = 0; i < 36; i++) assert_true(fabs(both[i] - product[i]) < 1e-11);
    }
}

static void a_covariance_carried_there_and_back_is_itself(void **state) {
    (void)state;
    for (uint64_t k = 0; k < 50; k++) {
        double c[36], carried[36], adjoint[36], most = 0;
        pose a = random_pose(k), inverse = pose_inverse(&a);
        random_covariance(k, c);
        pose_adjoint(&a, adjoint);
        covariance_transport(adjoint, c, carried);
        for (int i = 0; i < 36; i++) most = fmax(most, fabs(carried[i] - c[i]));
        assert_true(most > 0.01);
        pose_adjoint(&inverse, adjoint);
        covariance_transport(adjoint, carried, carried);
        for (int i = 0; i < 36; i++) assert_true(fabs(carried[i] - c[i]) < 1e-10);
    }
}

/* Of errors drawn on the right of a pose: those on its left have the covariance that the adjoint carries it to. */
static void a_carried_covariance_is_that_of_the_same_errors_on_the_other_side(void **state) {
    (void)state;
    const int draws = 20000;
    double adjoint[36], c[36] = {0}, carried[36], found[36] = {0};
    pose a = random_pose(3), inverse = pose_inverse(&a);
    for (int i = 0; i < 6; i++) c[7 * i] = (i + 1) * 1e-8;
    pose_adjoint(&a, adjoint);
    covariance_transport(adjoint, c, carried);
    for (int k = 0; k < draws; k++) {
        double e[6], left[6];
        for (int i = 0; i < 6; i++)
            e[i] = sqrt(c[7 * i]) * random_normal(random_key(13, 1), (uint64_t)(6 * k + i));
        pose error = pose_exp(e), moved = pose_multiply(&a, &error), other = pose_multiply(&moved, &inverse);
        pose_log(&other, left);
        for (int i = 0; i < 36; i++) found[i] += left[i / 6] * left[i % 6] / draws;
    }
    for (int i = 0; i < 36; i++)
        assert_true(fabs(found[i] - carried[i]) < 0.05 * sqrt(carried[i / 6 * 7] * carried[i % 6 * 7]));
}

static void a_covariance_times_its_inverse_is_one(void **state) {
    (void)state;
    double c[36], inverse[36], both[36];
    for (uint64_t k = 0; k < 50; k++) {
        random_covariance(k, c);
        assert_true(covariance_invert(c, inverse));
        multiply6(c, inverse, both);
        for (int i = 0; i < 36; i++) {
            assert_true(fabs(both[i] - (i % 7 == 0)) < 1e-10);
            assert_true(inverse[i] == inverse[6 * (i % 6) + i / 6]);
        }
    }
    for (int i = 0; i < 6; i++) c[6 * 5 + i] = c[6 * i + 5] = 0; /* a direction that isn't uncertain */
    assert_false(covariance_invert(c, inverse));
}

static void matrices_go_to_poses_and_back(void **state) {
    (void)state;
    for (uint64_t i = 0; i < 50; i++) {
        pose a = random_pose(i), b;
        double m[16];
        pose_to_matrix(&a, m);
        assert_true(m[12] == 0 && m[13] == 0 && m[14] == 0 && m[15] == 1);
        assert_true(pose_from_matrix(m, &b));
        assert_pose_equal(&a, &b, 1e-14);
        assert_true(pose_is_finite(&b));
        m[1] += 2e-4; /* as from a file with four digits: taken, and made a rotation */
        assert_true(pose_from_matrix(m, &b));
        double product[9];
        so3_transpose_multiply(b.r, b.r, product);
        for (int k = 0; k < 9; k++) assert_true(fabs(product[k] - (k % 4 == 0)) < 1e-12);
    }
}

static void bad_matrices_are_refused(void **state) {
    (void)state;
    double good[16], m[16];
    pose a = random_pose(3), p;
    pose_to_matrix(&a, good);
    for (int i = 0; i < 16; i++) { /* not finite, anywhere */
        const double bad[] = {NAN, INFINITY, -INFINITY};
        for (int k = 0; k < 3; k++) {
            memcpy(m, good, sizeof m);
            m[i] = bad[k];
            assert_false(pose_from_matrix(m, &p));
        }
    }
    for (int k = 0; k < 4; k++) { /* the last row */
        memcpy(m, good, sizeof m);
        m[12 + k] += 0.01;
        assert_false(pose_from_matrix(m, &p));
    }
    memcpy(m, good, sizeof m); /* scaled */
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) m[4 * i + j] *= 1.01;
    assert_false(pose_from_matrix(m, &p));
    memcpy(m, good, sizeof m); /* sheared */
    for (int j = 0; j < 3; j++) m[j] += 0.1 * m[4 + j];
    assert_false(pose_from_matrix(m, &p));
    memcpy(m, good, sizeof m); /* mirrored */
    for (int j = 0; j < 3; j++) m[j] = -m[j];
    assert_false(pose_from_matrix(m, &p));
    memset(m, 0, sizeof m);
    assert_false(pose_from_matrix(m, &p));

    a.t[1] = NAN;
    assert_false(pose_is_finite(&a));
    a.t[1] = 0;
    a.r[4] = INFINITY;
    assert_false(pose_is_finite(&a));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(exp_is_the_power_series),
        cmocka_unit_test(log_undoes_exp),
        cmocka_unit_test(exp_undoes_log_at_and_beyond_half_a_turn),
        cmocka_unit_test(products_inverses_and_points_agree),
        cmocka_unit_test(normalise_makes_a_rotation_again),
        cmocka_unit_test(adjoint_moves_a_twist_to_the_other_side),
        cmocka_unit_test(mahalanobis_has_the_values_worked_out_by_hand),
        cmocka_unit_test(transport_is_the_product_and_keeps_the_distance),
        cmocka_unit_test(the_inverses_adjoint_is_the_adjoints_inverse),
        cmocka_unit_test(the_products_adjoint_is_the_adjoints_product),
        cmocka_unit_test(a_covariance_carried_there_and_back_is_itself),
        cmocka_unit_test(a_carried_covariance_is_that_of_the_same_errors_on_the_other_side),
        cmocka_unit_test(a_covariance_times_its_inverse_is_one),
        cmocka_unit_test(matrices_go_to_poses_and_back),
        cmocka_unit_test(bad_matrices_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
