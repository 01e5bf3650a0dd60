/* Boards are mounted square: the mounting's rotation with that as a prior, and its uncertainty. */
#include "calibrate/turn_solver.hpp"

#include <cmath>

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

static constexpr double square_prior = CALIBRATION_SQUARE_DEG * (M_PI / 180);

/* The nearest rotation whose axes are the camera's, in some order and sign. */
static Matrix3d nearest_square(const Matrix3d &rotation) {
    Matrix3d best = Matrix3d::Identity();
    for (int order = 0; order < 27; order++) {
        Matrix3d square = Matrix3d::Zero();
        const int row[3] = {order % 3, order / 3 % 3, order / 9};
        for (int c = 0; c < 3; c++) square(row[c], c) = rotation(row[c], c) < 0 ? -1 : 1;
        if (std::fabs(square.determinant() - 1) > 0.5) continue;
        if ((square.transpose() * rotation).trace() > (best.transpose() * rotation).trace()) best = square;
    }
    return best;
}

static Matrix3d matrix(const double m[9]) {
    return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(m);
}

bool calibration_lean_to_square(calibration *result) {
    const Matrix3d rotation = matrix(result->rotation), covariance = matrix(result->rotation_covariance);
    const Vector3d off = rotation_log(Quaterniond(Matrix3d(nearest_square(rotation) * rotation.transpose())));
    const Matrix3d both = (covariance + square_prior * square_prior * Matrix3d::Identity()).inverse();
    if (off.dot(both * off) > 9) return false; /* three sigma */
    const Matrix3d gain = covariance * both;
    const Matrix3d better = rotation_exp(gain * off).toRotationMatrix() * rotation;
    const Matrix3d left = covariance - gain * covariance;
    for (int i = 0; i < 9; i++) {
        result->rotation[i] = better(i / 3, i % 3);
        result->rotation_covariance[i] = left(i / 3, i % 3);
    }
    return true;
}

calibration_outcome calibration_judge_rotation(calibration *result) {
    const Matrix3d covariance = matrix(result->rotation_covariance);
    const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(covariance);
    for (int i = 0; i < 3; i++) {
        result->rotation_sigma[i] = std::sqrt(covariance(i, i));
        result->weak_axis[i] = eigen.eigenvectors()(i, 2);
    }
    result->weak_sigma = std::sqrt(eigen.eigenvalues()[2]);
    return result->weak_sigma <= CALIBRATION_ROTATION_SIGMA_DEG * (M_PI / 180) ? CALIBRATION_DONE
                                                                               : CALIBRATION_LITTLE_TURNING;
}

void calibration_compare_with_data(const calibration &data, bool leant, calibration *result) {
    std::copy(data.rotation, data.rotation + 9, result->data_rotation);
    std::copy(data.rotation_sigma, data.rotation_sigma + 3, result->data_rotation_sigma);
    std::copy(data.weak_axis, data.weak_axis + 3, result->data_weak_axis);
    result->data_weak_sigma = data.weak_sigma;
    const Vector3d moved =
        rotation_log(Quaterniond(Matrix3d(matrix(result->rotation) * matrix(data.rotation).transpose())));
    const double square = moved.dot(matrix(data.rotation_covariance).inverse() * moved);
    result->square_moved = leant ? std::sqrt(std::max(square, 0.0)) : 0;
}
