#include "align/solve.h"

#include <Eigen/Dense>
#include <cmath>

/* Scan and map share a part of their normals' noise, since the map was made of scans and a sensor's flicker lasts: this part
 * of the sum of w (1 - cosine), along each direction, and how long it takes to fall to a third. */
#define SHARED_NOISE 0.15
#define FLICKER_S 0.3

/* A direction of less reliability shows nothing of the error that pixels share. */
#define LEAST_RELIABLE 0.1

/* The error that the pixels of a frame share lasts over some frames, and the map takes it over: it is this many times what
 * the residuals of one frame show. */
#define SHARED_IN_TIME 2.0

using Matrix6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Eigen::Matrix3d;
using Eigen::Vector3d;

void normal_equations_add(normal_equations *e, const float *sums, int band) {
    for (int k = 0; k < 27; k++) e->bands[band][k] += sums[k];
    e->btb += sums[27];
    e->weight += sums[28];
    for (int i = 0; i < 3; i++) e->point[i] += sums[29 + i];
    e->point_squared += sums[32];
    e->pairs += sums[33];
    e->overlap += sums[34];
}

void normal_equations_add_across(normal_equations *e, const float *ata, const float *ats) {
    for (int k = 0; k < 21; k++) {
        e->some[k] += ata[k];
        e->across[k] += ats[k];
    }
}

/* Adds a symmetric matrix, given by its upper triangle. */
static void add_triangle(const double triangle[21], double m[36]) {
    int k = 0;
    for (int i = 0; i < 6; i++)
        for (int j = i; j < 6; j++, k++) {
            m[6 * i + j] += triangle[k];
            if (i != j) m[6 * j + i] += triangle[k];
        }
}

/* Adds a band's A^T A and A^T b. */
static void add_band(const double band[27], double ata[36], double atb[6]) {
    add_triangle(band, ata);
    for (int i = 0; i < 6; i++) atb[i] += band[21 + i];
}

void normal_equations_total(normal_equations *e) {
    for (int i = 0; i < SOLVE_BANDS; i++) add_band(e->bands[i], e->ata, e->atb);
}

static Matrix3d skew(const Vector3d &v) {
    Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
}

/* The twist that rotates about c + shift moves p by w x (p - c - shift) + v', so about c it is the same w and
 * v = v' - w x shift = v' + [shift]x w. */
static Matrix6 about(const Vector3d &shift) {
    Matrix6 j = Matrix6::Identity();
    j.block<3, 3>(3, 0) = skew(shift);
    return j;
}

/* The variance of the solution by the cluster-robust ("sandwich") estimate, Liang and Zeger 1986: what the bands' residuals
 * would contribute to it, H^-1 (sum of g g^T) H^-1 with g = A^T (b - A x) of each band, whatever correlates them within.
 * Its mean over the directions that the pairs determine. scaled: x about the centroid to x about the reference. */
static double shared_variance(const normal_equations *e, const Matrix6 &scaled, const Vector6 &y,
                              const Matrix6 &v, const Vector6 &squared, const Vector6 &reliable) {
    const Vector6 x = scaled * y;
    Eigen::Matrix<double, 6, SOLVE_BANDS> g;
    for (int i = 0; i < SOLVE_BANDS; i++) {
        Matrix6 ata = Matrix6::Zero();
        Vector6 atb = Vector6::Zero();
        add_band(e->bands[i], ata.data(), atb.data());
        g.col(i) = scaled.transpose() * (atb - ata * x);
    }
    g.colwise() -= g.rowwise().mean().eval();
    double sum = 0;
    int observed = 0;
    for (int i = 0; i < 6; i++) {
        if (reliable[i] <= LEAST_RELIABLE) continue;
        sum += (v.col(i).transpose() * g).squaredNorm() / (squared[i] * squared[i]);
        observed++;
    }
    return observed > 0 ? sum / observed * SOLVE_BANDS / (SOLVE_BANDS - 1) : 0;
}

/* The part of A^T A along each direction of v that surface contributes and not the noise of normals. The model's normals
 * are noisy, so A^T A shows information in directions that the surface leaves free, as many square metres of a bare wall
 * do along the wall. The scan's normals have a noise of their own: in A^T S only what both show adds up (an instrumental
 * variable: Fuller 1987, Section 1.4). */
static Vector6 reliability(const normal_equations *e, double since_s, const Matrix6 &to_reference,
                           const Matrix6 &v) {
    Matrix6 some = Matrix6::Zero(), across = Matrix6::Zero();
    add_triangle(e->some, some.data());
    add_triangle(e->across, across.data());
    const double unlike = some.diagonal().tail<3>().sum() - across.diagonal().tail<3>().sum();
    const double shared = SHARED_NOISE * std::exp(-since_s / FLICKER_S) * std::max(unlike, 0.0);
    const Matrix6 directions = to_reference * v;
    Vector6 out;
    for (int i = 0; i < 6; i++) {
        const double all = directions.col(i).dot(some * directions.col(i));
        const double both = directions.col(i).dot(across * directions.col(i)) - shared;
        out[i] = all > 0 ? std::min(std::max(both / all, 0.0), 1.0) : 0;
    }
    return out;
}

/* Which directions the pairs' information determines. */
static void observe(const Matrix6 &own, const Matrix6 &to_origin, double max_sigma_m, solution *s) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(own); /* smallest first */
    for (int i = 0; i < 6; i++) s->observed += eigen.eigenvalues()[i] * max_sigma_m * max_sigma_m > 1;
    Eigen::Map<Vector6>(s->weakest) = to_origin * eigen.eigenvectors().col(0);
    s->weakest_sigma_m = 1 / std::sqrt(std::max(eigen.eigenvalues()[0], 1.0));
}

/* The information of a measurement whose error has `variance` more in each direction: (Y^-1 + variance)^-1. */
static Matrix6 widened(const Matrix6 &y, double variance, Vector6 *right) {
    const Eigen::PartialPivLU<Eigen::Matrix<double, 6, 6>> more(Matrix6::Identity() + variance * y);
    const Matrix6 out = more.solve(y);
    *right = more.solve(*right).eval();
    return 0.5 * (out + out.transpose());
}

bool solve_alignment(const normal_equations *e, const solve_prior *prior, solution *s) {
    *s = solution{};
    s->condition = INFINITY;
    Eigen::Map<const Matrix6> ata(e->ata);
    Eigen::Map<const Vector6> atb(e->atb);
    if (!(e->weight > 0) || !ata.allFinite() || !atb.allFinite() || !std::isfinite(e->btb)) return false;
    if (!std::isfinite(e->weight) || !std::isfinite(e->point_squared)) return false;

    /* Centre on the pairs and scale lengths by their spread, so that kappa depends neither on the origin nor on metres
     * against radians: columns of A for rotation are divided by the spread, those for translation stay. */
    Vector3d mean = Eigen::Map<const Vector3d>(e->point) / e->weight;
    double spread = std::sqrt(std::max(e->point_squared / e->weight - mean.squaredNorm(), 1e-12));
    Vector6 scale;
    scale << 1 / spread, 1 / spread, 1 / spread, 1, 1, 1;
    Matrix6 to_reference =
        about(mean) * scale.asDiagonal(); /* x about centre = to_reference * scaled x about mean */
    Matrix6 to_origin = about(Eigen::Map<const Vector3d>(e->centre)) * to_reference;
    Matrix6 h = to_reference.transpose() * ata * to_reference;
    Vector6 g = to_reference.transpose() * atb;
    h = 0.5 * (h + h.transpose()).eval();

    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>> eigen(h); /* smallest first */
    const Matrix6 v = eigen.eigenvectors().rowwise().reverse();
    const Vector6 squared =
        eigen.eigenvalues().reverse().cwiseMax(0.0); /* the squares of A's singular values */
    const Vector6 projected = v.transpose() * g;
    double largest = squared[0];
    Vector6 y = Vector6::Zero();
    Matrix6 covariance = Matrix6::Zero();
    for (int i = 0; i < 6; i++) {
        s->singular[i] = std::sqrt(squared[i]);
        if (squared[i] > 1e-12 * largest) y += v.col(i) * (projected[i] / squared[i]);
        covariance += v.col(i) * v.col(i).transpose() / std::max(squared[i], 1e-9 * largest);
    }
    s->condition = s->singular[5] > 0 ? s->singular[0] / s->singular[5] : INFINITY;
    s->residual = std::max(e->btb - 2 * y.dot(g) + y.dot(h * y), 0.0);

    if (prior && e->pairs > 6) {
        /* a pair's variance from the residual; minimum sigma 10 um, for scans without noise */
        double variance = std::max(s->residual / (e->pairs - 6), 1e-10) * prior->correlated;
        const Vector6 reliable = reliability(e, prior->since_s, to_reference, v);
        s->shared_m = std::sqrt(shared_variance(e, to_reference, y, v, squared, reliable));
        Matrix6 joint = to_origin.transpose() * Eigen::Map<const Matrix6>(prior->information) * to_origin;
        Vector6 right = joint * to_origin.inverse() * Eigen::Map<const Vector6>(prior->mean);
        Vector6 own_right = Vector6::Zero();
        Matrix6 own = Matrix6::Zero();
        for (int i = 0; i < 6; i++) {
            if (squared[i] <= 1e-12 * largest) continue;
            /* the variance along it is squared[i] variance / (reliable[i] squared[i])^2 */
            const double part = prior->converging ? 1 : reliable[i] * reliable[i];
            const double information = part * squared[i] / variance;
            own += information * v.col(i) * v.col(i).transpose();
            own_right += v.col(i) * (information * projected[i] / squared[i]);
        }
        const double lasting = SHARED_IN_TIME * std::max(prior->shared_m, s->shared_m);
        own = widened(own, lasting * lasting, &own_right);
        observe(own, to_origin, prior->max_sigma_m, s);
        joint += own;
        right += own_right;
        Matrix6 from_origin = to_origin.inverse();
        Eigen::Map<Matrix6>(s->information) = from_origin.transpose() * own * from_origin;
        Eigen::LDLT<Eigen::Matrix<double, 6, 6>> factor(joint);
        y = factor.solve(right);
        Eigen::Map<Vector6>(s->pull) = from_origin.transpose() * (own_right - own * y);
        covariance = factor.solve(Matrix6::Identity());
        s->residual = std::max(e->btb - 2 * y.dot(g) + y.dot(h * y), 0.0);
    }

    Eigen::Map<Vector6> twist(s->twist);
    twist = to_origin * y;
    Eigen::Map<Matrix6> out(s->covariance);
    out = to_origin * covariance * to_origin.transpose();
    return twist.allFinite() && out.allFinite();
}
