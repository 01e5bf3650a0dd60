/* Lever arm from the accelerometer. For frames i, m, j with h1, h2 seconds between them, and the tent L(t) that rises
 * from 0 at i to 1 at m and falls to 0 at j, integrating by parts gives for any moving point x
 *     (x_j - x_m) / h2 - (x_m - x_i) / h1 = integral L(t) x''(t) dt.
 * The IMU sits at x = p + R lever and measures f = C^T R^T (x'' - gravity) + bias, so lever, bias and gravity enter
 * linearly, and so does a small turn of C: gravity, seen from many sides, tells C's rotation better than a noisy
 * gyroscope can. R between frames is the gyroscope's, from the middle frame on. */
#include "calibrate/calibration_frames.hpp"
#include "calibrate/robust_fit.hpp"

#include <cmath>
#include <new>

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

namespace {

constexpr double half_window_s =
    0.3; /* alignment's noise weighs 1/h, the lever h; drift and bias set the end */
constexpr double reach_s = 6 * half_window_s;
/* Prior for any rig. */
constexpr double lever_prior = 0.3 /* m */, bias_prior = 0.5, gravity_prior = 0.05 /* m/s^2 */;

enum { LEVER = 0, BIAS = 3, GRAVITY = 6, ROTATION = 9, PARAMETERS = 12 };
using LeverFit = Fit<PARAMETERS>;
using LeverRow = FitRow<PARAMETERS>;

/* integral L R C dt and integral L R C f dt, in the axes of the gyroscope's first sample. */
struct Sums {
    Matrix3d turn = Matrix3d::Zero();
    Vector3d force = Vector3d::Zero();
};

/* Adds the way from t0 to t1 (IMU clock), where L goes from l0 to l1, by the trapezoid rule. */
void add(const GyroPath &gyro, double t0, double t1, double l0, double l1, Sums *sums) {
    double t = t0;
    Matrix3d turn = l0 * gyro.orientation_at(t0).toRotationMatrix();
    Vector3d force = turn * gyro.force_at(t0);
    for (int i = gyro.next(t0); t < t1; i++) {
        const double next = std::min(gyro.sample(i).t, t1);
        const double l = l0 + (l1 - l0) * (next - t0) / (t1 - t0);
        const Matrix3d next_turn = l * gyro.orientation_at(next).toRotationMatrix();
        const Vector3d next_force = next_turn * gyro.force_at(next);
        sums->turn += (next - t) / 2 * (turn + next_turn);
        sums->force += (next - t) / 2 * (force + next_force);
        turn = next_turn;
        force = next_force;
        t = next;
    }
}

} // namespace

static Matrix3d cross_matrix(const Vector3d &v) {
    Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
}

/* The row of three frames; false when samples are missing. Linear in the parameters: the value is that at zero. */
static bool make_row(const CalibrationFrames &frames, const GyroPath &gyro, const Quaterniond &mounting,
                     double offset, int i, LeverRow *row) {
    const int m = frames.after(i, half_window_s), j = m < 0 ? -1 : frames.after(m, half_window_s);
    Quaterniond turn;
    if (j < 0) return false;
    const CalibrationFrame &a = frames.frame[i], &b = frames.frame[m], &c = frames.frame[j];
    if (!gyro.between(a.t - offset, c.t - offset, &turn)) return false;
    Sums sums;
    add(gyro, a.t - offset, b.t - offset, 0, 1, &sums);
    add(gyro, b.t - offset, c.t - offset, 1, 0, &sums);
    const double h1 = b.t - a.t, h2 = c.t - b.t;
    const Matrix3d to_world =
        (b.rotation * mounting * gyro.orientation_at(b.t - offset).conjugate()).toRotationMatrix();
    const Matrix3d ra = a.rotation.toRotationMatrix(), rb = b.rotation.toRotationMatrix(),
                   rc = c.rotation.toRotationMatrix();
    row->t = a.t;
    row->value = (c.position - b.position) / h2 - (b.position - a.position) / h1 - to_world * sums.force;
    row->jacobian.block<3, 3>(0, LEVER) = (rc - rb) / h2 - (rb - ra) / h1;
    row->jacobian.block<3, 3>(0, BIAS) = to_world * sums.turn;
    row->jacobian.block<3, 3>(0, GRAVITY) = -(h1 + h2) / 2 * Matrix3d::Identity();
    row->jacobian.block<3, 3>(0, ROTATION) = rb * cross_matrix(rb.transpose() * (to_world * sums.force));
    return true;
}

bool calibrate_lever(const CalibrationFrames &frames, const GyroPath &gyro, double gravity,
                     calibration *result) {
    std::unique_ptr<LeverRow[]> base(new (std::nothrow) LeverRow[(size_t)frames.count + 1]);
    std::unique_ptr<LeverRow[]> rows(new (std::nothrow) LeverRow[(size_t)frames.count + 1]);
    std::unique_ptr<double[]> scratch(new (std::nothrow) double[(size_t)frames.count + 1]);
    if (!base || !rows || !scratch) return false;
    Matrix3d rotation, turn_information;
    for (int k = 0; k < 9; k++) {
        rotation(k / 3, k % 3) = result->rotation[k];
        turn_information(k / 3, k % 3) = result->rotation_covariance[k];
    }
    turn_information = turn_information.inverse().eval();
    const Quaterniond mounting(rotation);
    int count = 0;
    double seconds = 0; /* of tracking */
    for (int i = 0; i < frames.count; i++) {
        if (!make_row(frames, gyro, mounting, result->offset, i, &base[count])) continue;
        count++;
        seconds += frames.frame[i + 1].t - frames.frame[i].t;
    }
    if (count < CALIBRATION_LEAST_WINDOWS) return true;

    /* The first guess of gravity: the mean of the accelerometer, assuming no acceleration. */
    LeverFit::Vector x = LeverFit::Vector::Zero();
    for (int k = 0; k < count; k++)
        x.segment<3>(GRAVITY) += base[k].jacobian.block<3, 3>(0, GRAVITY).inverse() * -base[k].value / count;
    LeverFit fit;
    for (int n = 0; n < 10; n++) {
        const Vector3d g = x.segment<3>(GRAVITY), down = g.normalized();
        LeverFit::Vector expected = LeverFit::Vector::Zero();
        for (int k = 0; k < 3; k++) {
            fit.prior(LEVER + k, LEVER + k) = 1 / (lever_prior * lever_prior);
            fit.prior(BIAS + k, BIAS + k) = 1 / (bias_prior * bias_prior);
            expected[LEVER + k] = -x[LEVER + k];
            expected[BIAS + k] = -x[BIAS + k];
        }
        fit.prior.block<3, 3>(GRAVITY, GRAVITY) = down * down.transpose() / (gravity_prior * gravity_prior);
        expected.segment<3>(GRAVITY) = gravity * down - g;
        fit.prior.block<3, 3>(ROTATION, ROTATION) = turn_information;
        expected.segment<3>(ROTATION) = -x.segment<3>(ROTATION);
        fit.prior_pull = fit.prior * expected;
        for (int k = 0; k < count; k++) {
            rows[k] = base[k];
            rows[k].value += base[k].jacobian * x;
        }
        const LeverFit::Vector step = fit.step(rows.get(), count, scratch.get());
        if (!step.allFinite()) return true;
        x += step;
        if (step.norm() < 1e-9) break;
    }
    const LeverFit::Matrix covariance =
        fit.covariance(rows.get(), count, reach_s, 3 * seconds / half_window_s);
    double worst = 0;
    for (int k = 0; k < 3; k++) {
        result->lever[k] = x[LEVER + k];
        result->lever_sigma[k] = std::sqrt(covariance(LEVER + k, LEVER + k));
        result->accel_bias[k] = x[BIAS + k];
        result->accel_bias_sigma[k] = std::sqrt(covariance(BIAS + k, BIAS + k));
        result->gravity[k] = x[GRAVITY + k];
        worst = std::max(worst, result->lever_sigma[k]);
    }
    result->accelerometer = true;
    result->lever_observable = worst <= CALIBRATION_LEVER_SIGMA_M;
    /* Without a lever the positions are poor, and gravity hardly constrains the rotation. */
    if (!result->lever_observable) return true;
    const Matrix3d better = (rotation_exp(x.segment<3>(ROTATION)) * mounting).toRotationMatrix();
    for (int k = 0; k < 9; k++) {
        result->rotation[k] = better(k / 3, k % 3);
        result->rotation_covariance[k] = covariance(ROTATION + k / 3, ROTATION + k % 3);
    }
    return true;
}
