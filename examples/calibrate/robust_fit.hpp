/* Least squares over many 3-vectors of residuals: Cauchy's weights, weak priors that keep what the data leave open in
 * place, and an uncertainty that holds for overlapping stretches too, whose errors go together. */
#ifndef FATHOM_CLI_ROBUST_FIT_HPP
#define FATHOM_CLI_ROBUST_FIT_HPP

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>

/* A residual, linearised: value + jacobian * step. */
template <int N> struct FitRow {
    Eigen::Vector3d value;
    Eigen::Matrix<double, 3, N> jacobian;
    double t;      /* seconds, increasing */
    double weight; /* Cauchy's */
};

template <int N> struct Fit {
    using Vector = Eigen::Matrix<double, N, 1>;
    using Matrix = Eigen::Matrix<double, N, N>;

    Matrix prior = Matrix::Zero();      /* information */
    Vector prior_pull = Vector::Zero(); /* information times (expected - present) */
    double sigma = 0;                   /* of a residual's component, robust */
    Matrix inverse = Matrix::Zero();    /* of the normal matrix */

    /* The step to the least sum; sets sigma and the weights. scratch has room for count numbers. */
    Vector step(FitRow<N> *rows, int count, double *scratch) {
        for (int i = 0; i < count; i++) scratch[i] = rows[i].value.norm();
        std::nth_element(scratch, scratch + count / 2, scratch + count);
        /* The median length of a normal 3-vector is 1.5382 sigma. */
        sigma = std::max(scratch[count / 2] / 1.5382, 1e-7);
        Matrix normal = prior;
        Vector pull = prior_pull;
        for (int i = 0; i < count; i++) {
            FitRow<N> &row = rows[i];
            const double length = row.value.norm();
            row.weight = 1 / (1 + length * length / (cauchy * cauchy * sigma * sigma));
            normal.noalias() += row.weight / (sigma * sigma) * row.jacobian.transpose() * row.jacobian;
            pull.noalias() -= row.weight / (sigma * sigma) * row.jacobian.transpose() * row.value;
        }
        inverse = normal.ldlt().solve(Matrix::Identity());
        return inverse * pull;
    }

    /* After the last step: Newey and West 1987, "A simple, positive semi-definite, heteroskedasticity and
     * autocorrelation consistent covariance matrix", equation 5, over `reach` seconds. Corrected for the
     * freedom that the parameters take from `free` independent residuals. */
    Matrix covariance(const FitRow<N> *rows, int count, double reach, double free) const {
        Matrix scatter = Matrix::Zero();
        for (int i = 0; i < count; i++) {
            const Vector here = pull_of(rows[i]);
            scatter.noalias() += here * here.transpose();
            for (int k = i + 1; k < count && rows[k].t - rows[i].t < reach; k++) {
                const Vector there = (1 - (rows[k].t - rows[i].t) / reach) * pull_of(rows[k]);
                scatter.noalias() += here * there.transpose() + there * here.transpose();
            }
        }
        scatter *= free / std::max(free - N, 1.0);
        return inverse * (scatter + prior) * inverse;
    }

  private:
    static constexpr double cauchy = 2.0; /* in sigmas, of the vector's length */

    Vector pull_of(const FitRow<N> &row) const {
        return row.weight / (sigma * sigma) * row.jacobian.transpose() * row.value;
    }
};

#endif
