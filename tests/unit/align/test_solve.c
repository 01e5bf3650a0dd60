/* The 6x6 system of Section 2 (lib/align/solve.cpp): sums made here in double precision from points and normals, against
 * motions that are known and figures worked out another way. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "simulate/counter_random.h"
#include "base/se3.h"
#include "align/solve.h"

#define PAIRS 400

/* A scan point, the normals of the model's plane and of the scan, the distance to it along the model's, the weight. */
typedef struct {
    double p[3], n[3], scan[3], b, w;
} pair;

static pair pairs[PAIRS];

static void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

static double dot3(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* Points in front of a camera, normals every way, weights between 0.2 and 1. */
static void random_pairs(uint64_t seed) {
    uint64_t key = random_key(seed, 1), k = 0;
    for (int i = 0; i < PAIRS; i++) {
        pair *q = &pairs[i];
        for (int j = 0; j < 3; j++) {
            q->p[j] = 2 * random_uniform(key, k++) - 1 + (j == 2 ? 2 : 0);
            q->n[j] = random_normal(key, k++);
        }
        double length = sqrt(dot3(q->n, q->n));
        for (int j = 0; j < 3; j++) q->scan[j] = q->n[j] /= length;
        q->w = 0.2 + 0.8 * random_uniform(key, k++);
        q->b = 0;
    }
}

/* The row of A for a twist about `centre`. */
static void row_with(const pair *q, const double n[3], const double centre[3], double a[6]) {
    double arm[3];
    for (int j = 0; j < 3; j++) arm[j] = q->p[j] - centre[j];
    cross(arm, n, a);
    memcpy(a + 3, n, sizeof q->n);
}

static void row_of(const pair *q, const double centre[3], double a[6]) {
    row_with(q, q->n, centre, a);
}

/* What the pair is off when the twist (about the origin) is exactly what moved the scan away, to first order. */
static void off_by(const double twist[6]) {
    static const double origin[3];
    for (int i = 0; i < PAIRS; i++) {
        double a[6];
        row_of(&pairs[i], origin, a);
        pairs[i].b = 0;
        for (int j = 0; j < 6; j++) pairs[i].b += a[j] * twist[j];
    }
}

static normal_equations sums_about(const double centre[3]) {
    normal_equations e;
    memset(&e, 0, sizeof e);
    memcpy(e.centre, centre, sizeof e.centre);
    for (int i = 0; i < PAIRS; i++) {
        const pair *q = &pairs[i];
        double a[6], scan[6];
        int k = 0;
        row_of(q, centre, a);
        row_with(q, q->scan, centre, scan);
        for (int r = 0; r < 6; r++) {
            for (int c = 0; c < 6; c++) e.ata[6 * r + c] += q->w * a[r] * a[c];
            for (int c = r; c < 6; c++, k++) {
                e.some[k] += q->w * a[r] * a[c];
                e.across[k] += 0.5 * q->w * (a[r] * scan[c] + a[c] * scan[r]);
            }
            e.atb[r] += q->w * a[r] * q->b;
        }
        e.btb += q->w * q->b * q->b;
        e.weight += q->w;
        for (int j = 0; j < 3; j++) {
            double arm = q->p[j] - centre[j];
            e.point[j] += q->w * arm;
            e.point_squared += q->w * arm * arm;
        }
        e.pairs++;
        e.overlap++;
    }
    return e;
}

static normal_equations sums(void) {
    static const double centre[3] = {0.1, -0.2, 1.5};
    return sums_about(centre);
}

/* The same with the sums of each band of the map: pairs with neighbouring numbers are in one. */
static normal_equations banded_sums(void) {
    normal_equations e = sums();
    for (int i = 0; i < PAIRS; i++) {
        const pair *q = &pairs[i];
        const int band = i * SOLVE_BANDS / PAIRS;
        double a[6];
        row_of(q, e.centre, a);
        int k = 0;
        for (int r = 0; r < 6; r++)
            for (int c = r; c < 6; c++, k++) e.bands[band][k] += q->w * a[r] * a[c];
        for (int r = 0; r < 6; r++) e.bands[band][21 + r] += q->w * a[r] * q->b;
    }
    return e;
}

/* Eigenvalues of a symmetric matrix, largest first, by Jacobi's rotations. */
static void eigenvalues(double m[36], double values[6]) {
    for (int sweep = 0; sweep < 60; sweep++)
        for (int p = 0; p < 6; p++)
            for (int q = p + 1; q < 6; q++) {
                double off = m[6 * p + q];
                if (off == 0) continue;
                double theta = 0.5 * atan2(2 * off, m[7 * q] - m[7 * p]), c = cos(theta), s = sin(theta);
                for (int k = 0; k < 6; k++) {
                    double a = m[6 * k + p], b = m[6 * k + q];
                    m[6 * k + p] = c * a - s * b;
                    m[6 * k + q] = s * a + c * b;
                }
                for (int k = 0; k < 6; k++) {
                    double a = m[6 * p + k], b = m[6 * q + k];
                    m[6 * p + k] = c * a - s * b;
                    m[6 * q + k] = s * a + c * b;
                }
            }
    for (int i = 0; i < 6; i++) values[i] = m[7 * i];
    for (int i = 0; i < 6; i++)
        for (int j = i + 1; j < 6; j++)
            if (values[j] > values[i]) {
                double t = values[i];
                values[i] = values[j];
                values[j] = t;
            }
}

static void strips_are_added_in_the_kernels_order(void **state) {
    (void)state;
    float strip[56];
    for (int i = 0; i < 56; i++) strip[i] = (float)(i + 1);
    normal_equations e;
    memset(&e, 0, sizeof e);
    normal_equations_add(&e, strip, 0);
    normal_equations_add(&e, strip, SOLVE_BANDS - 1);
    normal_equations_total(&e);
    int k = 0;
    for (int i = 0; i < 6; i++)
        for (int j = i; j < 6; j++, k++) {
            assert_true(e.ata[6 * i + j] == 2 * (k + 1));
            assert_true(e.ata[6 * j + i] == 2 * (k + 1));
        }
    assert_int_equal(k, 21);
    for (int i = 0; i < 6; i++) assert_true(e.atb[i] == 2 * (22 + i));
    for (int i = 0; i < SOLVE_BANDS; i++)
        for (int j = 0; j < 27; j++)
            assert_true(e.bands[i][j] == (i == 0 || i == SOLVE_BANDS - 1 ? j + 1 : 0));
    assert_true(e.btb == 56 && e.weight == 58 && e.point[0] == 60 && e.point[1] == 62 && e.point[2] == 64);
    assert_true(e.point_squared == 66 && e.pairs == 68 && e.overlap == 70);
    normal_equations_add_across(&e, strip, strip + 35);
    normal_equations_add_across(&e, strip, strip + 35);
    for (int i = 0; i < 21; i++) assert_true(e.some[i] == 2 * (1 + i) && e.across[i] == 2 * (36 + i));
}

static void a_known_motion_is_recovered(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 20; seed++) {
        double twist[6];
        random_pairs(seed);
        for (uint64_t j = 0; j < 6; j++) twist[j] = 0.4 * random_uniform(random_key(seed, 2), j) - 0.2;
        off_by(twist);
        normal_equations e = sums();
        solution s;
        assert_true(solve_alignment(&e, NULL, &s));
        for (int j = 0; j < 6; j++) assert_true(fabs(s.twist[j] - twist[j]) < 1e-11);
        assert_true(s.residual < 1e-10 * e.btb);
        assert_true(s.condition > 1 && s.condition < 5); /* normals every way */
    }
}

/* The whole step of Section 2 on a motion that isn't small: pairs anew, solve, compose by the exponential. */
static void composed_updates_converge_to_a_large_motion(void **state) {
    (void)state;
    random_pairs(3);
    const double twist[6] = {0.3, -0.2, 0.25, 0.1, -0.15, 0.2};
    const pose truth = pose_exp(twist);
    pose motion = pose_identity();
    pair scan[PAIRS];
    memcpy(scan, pairs, sizeof scan);
    for (int round = 0; round < 8; round++) {
        for (int i = 0; i < PAIRS; i++) {
            double model[3], way[3];
            pose_apply(&truth, scan[i].p, model);
            pose_apply(&motion, scan[i].p, pairs[i].p);
            for (int j = 0; j < 3; j++) way[j] = model[j] - pairs[i].p[j];
            pairs[i].b = dot3(pairs[i].n, way);
        }
        normal_equations e = sums();
        solution s;
        assert_true(solve_alignment(&e, NULL, &s));
        pose update = pose_exp(s.twist);
        motion = pose_multiply(&update, &motion);
    }
    pose rest = pose_between(&truth, &motion);
    assert_true(pose_angle(&rest) < 1e-10 && pose_distance(&rest) < 1e-10);
}

static void residual_is_that_of_the_pairs(void **state) {
    (void)state;
    static const double origin[3];
    for (uint64_t seed = 0; seed < 10; seed++) {
        random_pairs(seed);
        for (int i = 0; i < PAIRS; i++) pairs[i].b = 0.01 * random_normal(random_key(seed, 3), (uint64_t)i);
        normal_equations e = sums();
        solution s;
        assert_true(solve_alignment(&e, NULL, &s));
        double direct = 0, moved = 0;
        for (int i = 0; i < PAIRS; i++) {
            double a[6], r = -pairs[i].b, other = -pairs[i].b;
            row_of(&pairs[i], origin, a);
            for (int j = 0; j < 6; j++) {
                r += a[j] * s.twist[j];
                other += a[j] * (s.twist[j] + (j == (int)seed % 6 ? 1e-4 : 0));
            }
            direct += pairs[i].w * r * r;
            moved += pairs[i].w * other * other;
        }
        assert_true(fabs(s.residual - direct) < 1e-12 * direct);
        assert_true(moved > direct); /* and it is the least */
    }
}

/* Singular values of A about the pairs' weighted centroid, lengths over their spread, by another algorithm. */
static void singular_values_are_centred_and_scaled(void **state) {
    (void)state;
    random_pairs(8);
    double mean[3] = {0}, weight = 0, spread = 0, m[36] = {0}, values[6];
    for (int i = 0; i < PAIRS; i++) {
        weight += pairs[i].w;
        for (int j = 0; j < 3; j++) mean[j] += pairs[i].w * pairs[i].p[j];
    }
    for (int j = 0; j < 3; j++) mean[j] /= weight;
    for (int i = 0; i < PAIRS; i++)
        for (int j = 0; j < 3; j++)
            spread += pairs[i].w / weight * (pairs[i].p[j] - mean[j]) * (pairs[i].p[j] - mean[j]);
    spread = sqrt(spread);
    for (int i = 0; i < PAIRS; i++) {
        double a[6];
        row_of(&pairs[i], mean, a);
        for (int j = 0; j < 3; j++) a[j] /= spread;
        for (int r = 0; r < 6; r++)
            for (int c = 0; c < 6; c++) m[6 * r + c] += pairs[i].w * a[r] * a[c];
    }
    eigenvalues(m, values);
    normal_equations e = sums();
    solution s;
    assert_true(solve_alignment(&e, NULL, &s));
    for (int i = 0; i < 6; i++) assert_true(fabs(s.singular[i] - sqrt(values[i])) < 1e-10 * s.singular[0]);
    assert_true(fabs(s.condition - sqrt(values[0] / values[5])) < 1e-9);
}

static void kappa_depends_on_neither_origin_nor_unit(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 10; seed++) {
        random_pairs(seed);
        for (int i = 0; i < PAIRS; i++) { /* mostly one wall, so that kappa isn't about 1 */
            if (i % 8 == 0) continue;
            pairs[i].n[0] = 0.05 * pairs[i].n[0];
            pairs[i].n[1] = 0.05 * pairs[i].n[1];
            pairs[i].n[2] = -sqrt(1 - pairs[i].n[0] * pairs[i].n[0] - pairs[i].n[1] * pairs[i].n[1]);
        }
        normal_equations e = sums();
        solution plain, moved, shifted, scaled;
        assert_true(solve_alignment(&e, NULL, &plain));
        assert_true(plain.condition > 2);

        const double centre[3] = {-3, 2, 7}; /* rotations taken about somewhere else */
        e = sums_about(centre);
        assert_true(solve_alignment(&e, NULL, &moved));

        const double far[3] = {30, -20, 10}; /* the whole scene somewhere else */
        for (int i = 0; i < PAIRS; i++)
            for (int j = 0; j < 3; j++) pairs[i].p[j] += far[j];
        e = sums();
        assert_true(solve_alignment(&e, NULL, &shifted));
        for (int i = 0; i < PAIRS; i++) /* millimetres */
            for (int j = 0; j < 3; j++) pairs[i].p[j] = 1000 * (pairs[i].p[j] - far[j]);
        e = sums();
        assert_true(solve_alignment(&e, NULL, &scaled));
        assert_true(fabs(moved.condition / plain.condition - 1) < 1e-9);
        assert_true(fabs(shifted.condition / plain.condition - 1) < 1e-7);
        assert_true(fabs(scaled.condition / plain.condition - 1) < 1e-9);
    }
}

/* A flat wall gives its distance and two angles; the other three directions are left alone. */
static void a_plane_leaves_its_free_directions_alone(void **state) {
    (void)state;
    random_pairs(5);
    for (int i = 0; i < PAIRS; i++) {
        const double normal[3] = {0, 0, -1};
        memcpy(pairs[i].n, normal, sizeof normal);
        pairs[i].p[2] = 2;
    }
    /* a tilt and a way along the normal, with a turn about it and ways along the wall that no pair can see */
    const double twist[6] = {0.02, -0.03, 0.5, 0.7, -0.4, 0.015};
    off_by(twist);
    normal_equations e = sums();
    solution s;
    assert_true(solve_alignment(&e, NULL, &s));
    assert_true(s.condition > 1e6);
    assert_true(fabs(s.twist[0] - twist[0]) < 1e-9 && fabs(s.twist[1] - twist[1]) < 1e-9);
    assert_true(fabs(s.twist[5] - twist[5]) < 1e-9);
    assert_true(fabs(s.twist[2]) < 1e-9); /* no turn about the normal */
    double mean[3], way[3];
    for (int j = 0; j < 3; j++) mean[j] = e.centre[j] + e.point[j] / e.weight;
    cross(s.twist, mean, way); /* and the pairs' middle moves along the normal only */
    assert_true(fabs(way[0] + s.twist[3]) < 1e-9 && fabs(way[1] + s.twist[4]) < 1e-9);
    /* what it doesn't know it says: along the wall the variance is vast but finite, across it isn't */
    const double *c = s.covariance;
    for (int i = 0; i < 36; i++) assert_true(isfinite(c[i]));
    assert_true(c[7 * 2] > 1e4 * c[7 * 0] && c[7 * 3] > 1e4 * c[7 * 5]);
}

/* All pairs in one point: everything about rotation is free. */
static void pairs_in_one_point_are_survived(void **state) {
    (void)state;
    random_pairs(6);
    for (int i = 0; i < PAIRS; i++)
        for (int j = 0; j < 3; j++) pairs[i].p[j] = j == 2;
    const double twist[6] = {0, 0, 0, 0.01, -0.02, 0.03};
    off_by(twist);
    normal_equations e = sums();
    solution s;
    assert_true(solve_alignment(&e, NULL, &s));
    for (int i = 0; i < 6; i++) assert_true(isfinite(s.twist[i]));
    double way[3];
    cross(s.twist, pairs[0].p, way); /* whatever turn: the point itself goes where it should */
    for (int j = 0; j < 3; j++) assert_true(fabs(way[j] + s.twist[3 + j] - twist[3 + j]) < 1e-6);
}

/* Pairs whose distances have the variance 1 / weight give twists with the covariance that is said, about a camera that
 * stands elsewhere. */
static void covariance_is_what_a_monte_carlo_finds(void **state) {
    (void)state;
    enum { TRIALS = 6000 };
    double mean[6] = {0}, found[36] = {0};
    solution s;
    random_pairs(9);
    uint64_t key = random_key(9, 4), k = 0;
    for (int t = 0; t < TRIALS; t++) {
        for (int i = 0; i < PAIRS; i++) pairs[i].b = random_normal(key, k++) / sqrt(pairs[i].w);
        normal_equations e = sums();
        assert_true(solve_alignment(&e, NULL, &s));
        for (int r = 0; r < 6; r++) {
            mean[r] += s.twist[r] / TRIALS;
            for (int c = 0; c < 6; c++) found[6 * r + c] += s.twist[r] * s.twist[c] / TRIALS;
        }
    }
    for (int r = 0; r < 6; r++) {
        double sigma = sqrt(s.covariance[7 * r]);
        assert_true(fabs(mean[r]) < 4 * sigma / sqrt(TRIALS));
        for (int c = 0; c < 6; c++) { /* an entry's own error is about sqrt(2 / TRIALS) = 1.8 % */
            double scale = sigma * sqrt(s.covariance[7 * c]);
            assert_true(fabs(found[6 * r + c] - s.covariance[6 * r + c]) < 0.08 * scale);
            assert_true(fabs(s.covariance[6 * r + c] - s.covariance[6 * c + r]) < 1e-12 * scale);
        }
    }
}

/* ---- with a prior ------------------------------------------------------------------------------------------------- */

static solve_prior prior_of(const double mean[6], double sigma_rotation, double sigma_translation) {
    solve_prior p = {.correlated = 1};
    memcpy(p.mean, mean, sizeof p.mean);
    for (int i = 0; i < 6; i++) {
        double sigma = i < 3 ? sigma_rotation : sigma_translation;
        p.information[7 * i] = 1 / (sigma * sigma);
    }
    return p;
}

/* The joint estimate is where the pairs' pull and the prior's cancel, and its covariance is the inverse of the sum of
 * their informations; all about the camera's origin, in plain sums. */
static void pairs_and_prior_are_joined_by_their_information(void **state) {
    (void)state;
    static const double origin[3];
    for (uint64_t seed = 0; seed < 10; seed++) {
        const double mean[6] = {0.01, -0.02, 0.005, 0.02, 0.01, -0.03};
        random_pairs(seed);
        for (int i = 0; i < PAIRS; i++) pairs[i].b = 0.5 * random_normal(random_key(seed, 5), (uint64_t)i);
        normal_equations e = sums(), about_origin = sums_about(origin);
        solve_prior prior = prior_of(mean, 0.03, 0.02); /* about as strong as the pairs */
        prior.correlated = 4;
        solution alone, both;
        assert_true(solve_alignment(&e, NULL, &alone));
        assert_true(solve_alignment(&e, &prior, &both));
        double variance = 4 * alone.residual / (PAIRS - 6), pull = 0;
        for (int r = 0; r < 6; r++) {
            double data = -about_origin.atb[r] / variance, own = 0;
            for (int c = 0; c < 6; c++) {
                data += about_origin.ata[6 * r + c] / variance * both.twist[c];
                own += prior.information[6 * r + c] * (both.twist[c] - mean[c]);
            }
            pull = fmax(pull, fabs(data));
            assert_true(fabs(data + own) < 1e-7 * (1 + fabs(data)));
            for (int c = 0; c < 6; c++) { /* information times covariance is one */
                double sum = 0;
                for (int k = 0; k < 6; k++)
                    sum += (about_origin.ata[6 * r + k] / variance + prior.information[6 * r + k]) *
                           both.covariance[6 * k + c];
                assert_true(fabs(sum - (r == c)) < 1e-7);
            }
        }
        assert_true(pull > 1); /* neither had it all its own way */
        assert_true(both.residual >= alone.residual);
        assert_true(both.condition == alone.condition); /* kappa is that of the pairs alone */
    }
}

static void a_prior_holds_what_a_plane_leaves_free(void **state) {
    (void)state;
    random_pairs(5);
    for (int i = 0; i < PAIRS; i++) {
        const double normal[3] = {0, 0, -1};
        memcpy(pairs[i].n, normal, sizeof normal);
        memcpy(pairs[i].scan, normal, sizeof normal);
        pairs[i].p[2] = 2;
    }
    const double twist[6] = {0.002, -0.003, 0, 0, 0, 0.015}, mean[6] = {0, 0, 0.004, 0.006, -0.005, 0};
    off_by(twist);
    normal_equations e = sums();
    solve_prior prior = prior_of(mean, 0.01, 0.01);
    solution s;
    assert_true(solve_alignment(&e, &prior, &s));
    assert_true(fabs(s.twist[0] - twist[0]) < 1e-5 && fabs(s.twist[1] - twist[1]) < 1e-5);
    assert_true(fabs(s.twist[5] - twist[5]) < 1e-5); /* what the wall says */
    assert_true(fabs(s.twist[2] - mean[2]) < 1e-4);  /* what only inertia can say */
    assert_true(fabs(s.twist[3] - mean[3]) < 1e-4 && fabs(s.twist[4] - mean[4]) < 1e-4);
    for (int i = 2; i < 5; i++) assert_true(fabs(sqrt(s.covariance[7 * i]) - 0.01) < 1e-3);
    assert_true(sqrt(s.covariance[0]) < 1e-4 && sqrt(s.covariance[35]) < 1e-3);
    assert_true(s.condition > 1e6);
}

/* A wall whose normals are rough by 0.08 in either map: that looks like information along the wall, and about its normal. What
 * both maps show adds up to none; a step in the wall, which both see, is some. */
static void rough_normals_are_no_information(void **state) {
    (void)state;
    const double none[6] = {0};
    solution s[2];
    for (int step = 0; step < 2; step++) {
        random_pairs(8);
        for (int i = 0; i < PAIRS; i++) {
            pair *q = &pairs[i];
            const uint64_t key = random_key(8, 3 + (i & 1)), at = (uint64_t)(4 * i);
            q->p[2] = 2;
            for (int j = 0; j < 2; j++) {
                q->n[j] = 0.08 * random_normal(key, at + (uint64_t)j);
                q->scan[j] = 0.08 * random_normal(key, at + 2 + (uint64_t)j);
            }
            q->n[2] = q->scan[2] = -1;
            if (step && i % 20 == 0) { /* its faces hold x and the rotation about z */
                q->n[0] = q->scan[0] = 1;
                q->n[2] = q->scan[2] = 0;
            }
            q->b = 0.001 * random_normal(random_key(8, 5), (uint64_t)i);
        }
        normal_equations e = sums();
        solve_prior prior = prior_of(none, 0.1, 0.1);
        prior.max_sigma_m = 0.02;
        assert_true(solve_alignment(&e, &prior, &s[step]));
        prior.converging = true; /* until the pose has settled all of it counts: see align() */
        solution all;
        assert_true(solve_alignment(&e, &prior, &all));
        for (int i = 3; i < 5; i++) assert_true(all.information[7 * i] > 1e4);
        assert_true(s[step].information[35] > 0.9 * all.information[35]);
        assert_true(s[step].information[28] < 0.1 * all.information[28]); /* along y */
        assert_true(s[step].observed == 3 + 2 * step);
    }
    assert_true(s[0].information[21] < 0.1 * s[1].information[21]); /* along x */
}

/* What the pairs alone would add to the joint solution, times their information: the navigator takes that in, so that what it
 * said itself as the prior doesn't come back to it as news. */
static void the_pull_is_what_the_pairs_alone_would_add(void **state) {
    (void)state;
    for (uint64_t seed = 0; seed < 10; seed++) {
        const double mean[6] = {0.01, -0.02, 0.005, 0.02, 0.01, -0.03};
        random_pairs(seed);
        for (int i = 0; i < PAIRS; i++) pairs[i].b = 0.5 * random_normal(random_key(seed, 5), (uint64_t)i);
        normal_equations e = sums();
        solve_prior prior = prior_of(mean, 0.03, 0.02);
        solution alone, both;
        assert_true(solve_alignment(&e, NULL, &alone));
        assert_true(solve_alignment(&e, &prior, &both));
        double direct = 0; /* and the residual is that of the pairs at the joint solution */
        for (int i = 0; i < PAIRS; i++) {
            static const double origin[3];
            double a[6], left = -pairs[i].b;
            row_of(&pairs[i], origin, a);
            for (int j = 0; j < 6; j++) left += a[j] * both.twist[j];
            direct += pairs[i].w * left * left;
        }
        assert_true(fabs(both.residual - direct) < 1e-9 * direct && direct > 1.0001 * alone.residual);
        for (int r = 0; r < 6; r++) {
            double want = 0, size = 0;
            for (int c = 0; c < 6; c++) {
                double part = both.information[6 * r + c] * (alone.twist[c] - both.twist[c]);
                want += part;
                size += fabs(part);
            }
            assert_true(size > 0.1);
            assert_true(fabs(both.pull[r] - want) < 1e-6 * size);
        }
    }
}

static void nothing_to_solve_is_said(void **state) {
    (void)state;
    solution s;
    normal_equations none, e;
    memset(&none, 0, sizeof none);
    assert_false(solve_alignment(&none, NULL, &s));
    assert_true(isinf(s.condition));
    for (int j = 0; j < 6; j++) assert_true(s.twist[j] == 0);

    random_pairs(1);
    const double twist[6] = {0.01, 0, 0, 0, 0.02, 0};
    off_by(twist);
    const double bad[] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 3; k++) {
        double *places[] = {&e.ata[0], &e.ata[20], &e.ata[35],  &e.atb[0],
                            &e.atb[5], &e.btb,     &e.point[1], &e.point_squared};
        for (size_t i = 0; i < sizeof places / sizeof *places; i++) {
            e = sums();
            *places[i] = bad[k];
            bool solved = solve_alignment(&e, NULL, &s);
            if (solved) print_message("place %zu, value %g was solved\n", i, bad[k]);
            assert_false(solved);
        }
    }
    e = sums();
    e.weight = NAN;
    assert_false(solve_alignment(&e, NULL, &s));
    e.weight = INFINITY;
    assert_false(solve_alignment(&e, NULL, &s));
    e.weight = -1;
    assert_false(solve_alignment(&e, NULL, &s));
}

/* ---- the error that pixels share */

/* Errors of each pair's own, and errors that a band's pairs have in common. */
static void disturb(uint64_t seed, double own_m, double of_band_m) {
    const uint64_t key = random_key(seed, 7);
    for (int i = 0; i < PAIRS; i++)
        pairs[i].b = own_m * random_normal(key, (uint64_t)i) +
                     of_band_m * random_normal(key, (uint64_t)(PAIRS + i * SOLVE_BANDS / PAIRS));
}

/* The mean square of a twist that should be zero: of the translation of the pairs' centroid, and of the rotation times
 * their spread. */
static double square_about_the_pairs(const normal_equations *e, const double twist[6]) {
    double c[3], lever[3], length = 0, sum = 0;
    for (int i = 0; i < 3; i++) {
        c[i] = e->point[i] / e->weight;
        length += c[i] * c[i];
    }
    const double spread_squared = e->point_squared / e->weight - length;
    for (int i = 0; i < 3; i++) c[i] += e->centre[i];
    cross(twist, c, lever);
    for (int i = 0; i < 3; i++) {
        const double moved = twist[i + 3] + lever[i];
        sum += moved * moved + spread_squared * twist[i] * twist[i];
    }
    return sum / 6;
}

/* What the bands' residuals say of the solution's error against that error itself, over many frames. */
static void shared_error_is_as_large_as_the_solutions(double own_m, double of_band_m) {
    double said = 0, was = 0;
    random_pairs(5);
    for (int k = 0; k < 400; k++) {
        disturb((uint64_t)k, own_m, of_band_m);
        const normal_equations e = banded_sums();
        const solve_prior loose = {.information = {0}, .correlated = 1};
        solution s;
        assert_true(solve_alignment(&e, &loose, &s));
        said += s.shared_m * s.shared_m;
        was += square_about_the_pairs(&e, s.twist);
    }
    if (!(said > 0.5 * was && said < 1.5 * was)) fail_msg("said %g, was %g m^2", said / 400, was / 400);
}

static void the_shared_error_of_pixels_of_their_own_is_the_solutions(void **state) {
    (void)state;
    shared_error_is_as_large_as_the_solutions(0.001, 0);
}

static void the_shared_error_of_bands_is_the_solutions(void **state) {
    (void)state;
    shared_error_is_as_large_as_the_solutions(0.0002, 0.001);
}

static void pairs_are_no_surer_than_the_error_that_they_share(void **state) {
    (void)state;
    const double shared_m = 0.003, most = 1 / (shared_m * shared_m);
    random_pairs(6);
    disturb(1, 1e-4, 0);
    const normal_equations e = banded_sums();
    solve_prior prior = {.information = {0}, .correlated = 1};
    solution alone, widened;
    for (int i = 0; i < 6; i++) prior.information[7 * i] = 1;
    assert_true(solve_alignment(&e, &prior, &alone));
    prior.shared_m = shared_m;
    assert_true(solve_alignment(&e, &prior, &widened));
    assert_true(alone.shared_m == widened.shared_m && alone.shared_m < 1e-4);
    for (int i = 3; i < 6; i++) {
        assert_true(alone.information[7 * i] > 10 * most);
        assert_true(widened.information[7 * i] < most && widened.information[7 * i] > most / 10);
        assert_true(widened.covariance[7 * i] > 1 / most);
    }
    for (int i = 0; i < 6; i++) assert_true(fabs(alone.twist[i] - widened.twist[i]) < 1e-4);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(strips_are_added_in_the_kernels_order),
        cmocka_unit_test(the_shared_error_of_pixels_of_their_own_is_the_solutions),
        cmocka_unit_test(the_shared_error_of_bands_is_the_solutions),
        cmocka_unit_test(pairs_are_no_surer_than_the_error_that_they_share),
        cmocka_unit_test(a_known_motion_is_recovered),
        cmocka_unit_test(composed_updates_converge_to_a_large_motion),
        cmocka_unit_test(residual_is_that_of_the_pairs),
        cmocka_unit_test(singular_values_are_centred_and_scaled),
        cmocka_unit_test(kappa_depends_on_neither_origin_nor_unit),
        cmocka_unit_test(a_plane_leaves_its_free_directions_alone),
        cmocka_unit_test(pairs_in_one_point_are_survived),
        cmocka_unit_test(covariance_is_what_a_monte_carlo_finds),
        cmocka_unit_test(pairs_and_prior_are_joined_by_their_information),
        cmocka_unit_test(a_prior_holds_what_a_plane_leaves_free),
        cmocka_unit_test(rough_normals_are_no_information),
        cmocka_unit_test(the_pull_is_what_the_pairs_alone_would_add),
        cmocka_unit_test(nothing_to_solve_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
