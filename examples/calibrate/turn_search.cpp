/* The closed form of TurnSolver, and the exclusion of wrong parts of the path. */
#include "calibrate/turn_solver.hpp"
#include "simulate/counter_random.h"

#include <cmath>

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

static constexpr double grid_s = 0.005;
static constexpr double least_correlation = 0.7;
/* A mirror is accepted when it leaves less than this of the disagreement. */
static constexpr double mirror_gain = 0.3;
/* Below this (rad/s) noise alone may spoil the correlation; and tracking follows so small a turning too late and too
 * little, which no sigma shows: with hand tremor alone (0.02) mountings came out up to 9 degrees wrong with sigmas of
 * 1.5. So slower rotation must correlate better. */
static constexpr double weak_turning = 0.07;
static constexpr double least_correlation_weak = 0.995;
static constexpr double scale_low = 0.8, scale_high = 1.25;
static constexpr int consensus_draws = 40;      /* at each offset */
static constexpr double least_agreement = 0.25; /* of the rotation's energy; by chance it is some hundredths */

TurnLikeness TurnSolver::compare() const {
    TurnLikeness like;
    Vector3d camera_mean = Vector3d::Zero(), gyro_mean = Vector3d::Zero();
    for (int k = 0; k < count; k++) {
        const TurnWindow &w = windows[k];
        if (!w.usable) continue;
        camera_mean += rotation_log(w.camera) / w.seconds;
        gyro_mean += rotation_log(w.gyro) / w.seconds;
        like.windows++;
    }
    if (!like.windows) return like;
    camera_mean /= like.windows;
    gyro_mean /= like.windows;
    for (int k = 0; k < count; k++) {
        const TurnWindow &w = windows[k];
        if (!w.usable) continue;
        const Vector3d a = rotation_log(w.camera) / w.seconds - camera_mean;
        const Vector3d b = rotation_log(w.gyro) / w.seconds - gyro_mean;
        like.covariance += a * b.transpose() / like.windows;
        like.camera_square += a.cwiseAbs2() / like.windows;
        like.gyro_square += b.squaredNorm() / like.windows;
    }
    like.covariance /= std::sqrt(std::max(like.camera_square.sum() * like.gyro_square, 1e-30));
    return like;
}

/* Horn 1987, "Closed-form solution of absolute orientation using unit quaternions", Section 4: the rotation that
 * correlates the rates best, and how well; *mirrored is what the best reflection would reach. */
static double best_rotation(const Matrix3d &covariance, Quaterniond *rotation, double *mirrored) {
    const Matrix3d s = covariance.transpose();
    Eigen::Matrix4d n;
    n << s.trace(), s(1, 2) - s(2, 1), s(2, 0) - s(0, 2), s(0, 1) - s(1, 0), /**/
        0, 2 * s(0, 0) - s.trace(), s(0, 1) + s(1, 0), s(2, 0) + s(0, 2),    /**/
        0, 0, 2 * s(1, 1) - s.trace(), s(1, 2) + s(2, 1),                    /**/
        0, 0, 0, 2 * s(2, 2) - s.trace();
    const Eigen::Matrix4d symmetric = n.selfadjointView<Eigen::Upper>();
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> eigen(symmetric);
    const Eigen::Vector4d q = eigen.eigenvectors().col(3);
    *rotation = Quaterniond(q[0], q[1], q[2], q[3]).normalized();
    *mirrored = -eigen.eigenvalues()[0]; /* a reflection is a rotation of the rates' negatives */
    return eigen.eigenvalues()[3];
}

calibration_outcome TurnSolver::search(const calibration_input &input, TurnGuess *guess,
                                       calibration *result) {
    const int half = (int)std::ceil(input.offset_range / grid_s);
    int most = 0, best = 0;
    double correlation = -1, mirrored = -1;
    for (int k = -half; k <= half; k++) most = std::max(most, place(input.offset_start + k * grid_s));
    result->windows = most;
    if (most < CALIBRATION_LEAST_WINDOWS) return CALIBRATION_FEW_FRAMES;
    TurnLikeness like;
    for (int k = -half; k <= half; k++) {
        const double offset = input.offset_start + k * grid_s;
        if (place(offset) < std::max(most / 2, CALIBRATION_LEAST_WINDOWS)) continue;
        const TurnLikeness here = compare();
        Quaterniond rotation;
        double reflection;
        const double value = best_rotation(here.covariance, &rotation, &reflection);
        mirrored = std::max(mirrored, reflection);
        if (value <= correlation) continue;
        correlation = value;
        best = k;
        like = here;
        guess->rotation = rotation;
        guess->offset = offset;
    }
    for (int i = 0; i < 3; i++) result->turning[i] = std::sqrt(like.camera_square[i]);
    result->correlation = correlation;
    result->gyro_scale = std::sqrt(like.camera_square.sum() / std::max(like.gyro_square, 1e-30));
    const double turning = std::sqrt(like.camera_square.sum());
    if (mirrored > std::max(least_correlation, correlation + 0.005) &&
        1 - mirrored < mirror_gain * (1 - correlation))
        return CALIBRATION_MIRRORED;
    if (correlation < least_correlation)
        return turning < weak_turning ? CALIBRATION_LITTLE_TURNING : CALIBRATION_DISAGREES;
    if (turning < weak_turning && correlation < least_correlation_weak) return CALIBRATION_LITTLE_TURNING;
    if (result->gyro_scale < scale_low || result->gyro_scale > scale_high) return CALIBRATION_SCALE;
    return half > 0 && std::abs(best) == half ? CALIBRATION_RANGE : CALIBRATION_DONE;
}

/* ---- when part of the way is wrong --------------------------------------------------------------------- */

/* Maximum difference between the rates of camera and gyroscope: the bias, and a share for scale and noise. */
static double tolerance(const Vector3d &rate) {
    return 0.08 + 0.1 * rate.norm();
}

/* The sum of the gyroscope's squared rates that a rotation explains; *energy is the sum of all. */
double TurnSolver::agreement(const Quaterniond &rotation, double *energy) const {
    double sum = 0;
    *energy = 0;
    for (int k = 0; k < count; k++) {
        const TurnWindow &w = windows[k];
        if (!w.usable) continue;
        const Vector3d b = rotation_log(w.gyro) / w.seconds;
        const double off = (rotation_log(w.camera) / w.seconds - rotation * b).norm() / tolerance(b);
        *energy += b.squaredNorm();
        if (off < 1) sum += (1 - off * off) * b.squaredNorm();
    }
    return sum;
}

/* The rotation that takes two gyroscope rates to the camera's (Black 1964, "A passive system for determining the
 * attitude of a satellite": TRIAD). */
Quaterniond TurnSolver::from_pair(const TurnWindow &p, const TurnWindow &q) const {
    const auto triad = [](const Vector3d &u, const Vector3d &v) {
        Matrix3d m;
        m.col(0) = u.normalized();
        m.col(1) = u.cross(v).normalized();
        m.col(2) = m.col(0).cross(m.col(1));
        return m;
    };
    const Matrix3d rotation = triad(rotation_log(p.camera), rotation_log(q.camera)) *
                              triad(rotation_log(p.gyro), rotation_log(q.gyro)).transpose();
    return Quaterniond(rotation).normalized();
}

/* Where tracking was wrong for much of the path, means and correlations are useless. Then the offset and the rotation
 * that most windows agree on (Fischler and Bolles 1981, "Random sample consensus", from two windows each time)
 * determine the windows to leave out. False when there are none. */
bool TurnSolver::consensus(const calibration_input &input, calibration *result) {
    const int half = (int)std::ceil(input.offset_range / grid_s);
    const uint64_t key = random_key(1, 0xca11b);
    TurnGuess best;
    double most = 0;
    uint64_t draw = 0;
    for (int k = -half; k <= half; k++) {
        const double offset = input.offset_start + k * grid_s;
        if (place(offset) < CALIBRATION_LEAST_WINDOWS) continue;
        for (int n = 0; n < consensus_draws; n++) {
            const TurnWindow &p = windows[(int)(count * random_uniform(key, draw++))];
            const TurnWindow &q = windows[(int)(count * random_uniform(key, draw++))];
            if (!p.usable || !q.usable) continue;
            const Vector3d bp = rotation_log(p.gyro) / p.seconds, bq = rotation_log(q.gyro) / q.seconds;
            const Vector3d ap = rotation_log(p.camera) / p.seconds, aq = rotation_log(q.camera) / q.seconds;
            if (bp.cross(bq).norm() < 0.3 * bp.norm() * bq.norm() || ap.cross(aq).norm() < 1e-6 ||
                std::fabs(ap.norm() - bp.norm()) > tolerance(bp) ||
                std::fabs(aq.norm() - bq.norm()) > tolerance(bq))
                continue;
            const Quaterniond rotation = from_pair(p, q);
            double energy;
            const double sum = agreement(rotation, &energy);
            if (sum < least_agreement * energy || sum <= most) continue;
            most = sum;
            best.rotation = rotation;
            best.offset = offset;
        }
    }
    if (most <= 0) return false;
    const int all = place(best.offset);
    int kept = 0;
    for (int k = 0; k < count; k++) {
        TurnWindow &w = windows[k];
        const Vector3d b = rotation_log(w.gyro) / w.seconds;
        w.trusted =
            w.usable && (rotation_log(w.camera) / w.seconds - best.rotation * b).norm() < tolerance(b);
        kept += w.trusted;
    }
    result->left_out = all - kept;
    return kept >= CALIBRATION_LEAST_WINDOWS && kept < all;
}
