/* Mounting rotation and clock offset from turning alone. A camera turning at rate a and a gyroscope reading b satisfy
 * a(t + offset) = scale C (b(t) - bias). First the offset and C that make mean rates over short windows most alike, in
 * closed form for each offset of a grid; from there by Gauss and Newton, with the gyroscope integrated exactly. */
#include "calibrate/calibration.h"
#include "calibrate/calibration_frames.hpp"
#include "simulate/counter_random.h"
#include "calibrate/robust_fit.hpp"

#include <cmath>
#include <new>

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

namespace {

/* Windows long against alignment's noise, and short against the motion, the drift and the bias: which that is depends on
 * the recording, so all are tried, and the one with the least uncertainty is taken. */
constexpr double window_lengths[] = {0.1, 0.2, 0.4};
constexpr double reach_windows = 4; /* beyond it, the errors of windows are taken as independent */
constexpr double grid_s = 0.005;
constexpr double least_correlation = 0.7;
constexpr double mirror_gain =
    0.3; /* a mirror is believed in when it leaves less than this of the disagreement */
/* Below this (rad/s) noise alone may spoil the correlation; and tracking follows so small a turning too late and too
 * little, which no sigma shows: with hand tremor alone (0.02) mountings came out up to 9 degrees wrong with sigmas of 1.5.
 * So what turns less must correlate better. */
constexpr double weak_turning = 0.07;
constexpr double least_correlation_weak = 0.995;
constexpr double scale_low = 0.8, scale_high = 1.25;
/* What is known of any MEMS gyroscope before the data speak. */
constexpr double bias_prior = 0.01 /* rad/s */, scale_prior = 0.05;
constexpr double square_prior = CALIBRATION_SQUARE_DEG * (M_PI / 180);
constexpr int most_steps = 30;
constexpr int consensus_draws = 40;      /* at each offset */
constexpr double least_agreement = 0.25; /* of the turning's energy; by chance it is some hundredths */

enum { ROTATION = 0, OFFSET = 3, BIAS = 4, SCALE = 7, PARAMETERS = 8 };
using TurnFit = Fit<PARAMETERS>;
using TurnRow = FitRow<PARAMETERS>;

/* From frame i to frame j: the camera's turn, and the gyroscope's as last placed. */
struct Window {
    int i, j;
    double seconds;
    Quaterniond camera, gyro;
    bool trusted; /* not left out as wrongly tracked */
    bool usable;  /* trusted, and there are samples for it */
};

/* How alike the windows' mean rates are; their means over all windows are taken off, and the bias with them. */
struct Likeness {
    int windows = 0;
    Matrix3d covariance = Matrix3d::Zero(); /* of camera and gyroscope, over the roots of both mean squares */
    Vector3d camera_square = Vector3d::Zero(); /* mean squares, rad^2/s^2 */
    double gyro_square = 0;
};

struct Guess {
    Quaterniond rotation = Quaterniond::Identity();
    double offset = 0;
    Vector3d bias = Vector3d::Zero();
    double scale = 1;
};

class Solver {
  public:
    CalibrationFrames frames;
    GyroPath gyro;

    bool prepare(const calibration_input &input);
    calibration_outcome solve(const calibration_input &input, double window_length, calibration *result);

  private:
    std::unique_ptr<Window[]> windows;
    std::unique_ptr<TurnRow[]> rows;
    std::unique_ptr<double[]> scratch;
    double window_s = 0;
    int count = 0;

    void cut(double window_length);
    calibration_outcome search(const calibration_input &input, Guess *guess, calibration *result);
    bool consensus(const calibration_input &input, calibration *result);
    calibration_outcome refine(Guess *guess, calibration *result);
    int place(double offset);
    Likeness compare() const;
    double agreement(const Quaterniond &rotation, double *energy) const;
    Quaterniond from_pair(const Window &p, const Window &q) const;
    Vector3d residual(const Window &window, const Guess &guess) const;
    int linearise(const Guess &guess);
};

} // namespace

bool Solver::prepare(const calibration_input &input) {
    if (!frames.read(input.path) || !gyro.read(input.imu, input.imu_count, frames.origin_ns)) return false;
    windows.reset(new (std::nothrow) Window[(size_t)frames.count + 1]);
    rows.reset(new (std::nothrow) TurnRow[(size_t)frames.count + 1]);
    scratch.reset(new (std::nothrow) double[(size_t)frames.count + 1]);
    return windows && rows && scratch;
}

void Solver::cut(double window_length) {
    gyro.integrate(Vector3d::Zero(), 1);
    window_s = window_length;
    count = 0;
    for (int i = 0; i < frames.count; i++) {
        const int j = frames.after(i, window_s);
        if (j < 0) continue;
        const CalibrationFrame &a = frames.frame[i], &b = frames.frame[j];
        windows[count++] = {
            i, j, b.t - a.t, a.rotation.conjugate() * b.rotation, Quaterniond::Identity(), true, false};
    }
}

/* Looks up the gyroscope's turns at an offset; the number of windows that have one. */
int Solver::place(double offset) {
    int usable = 0;
    for (int k = 0; k < count; k++) {
        Window &w = windows[k];
        w.usable =
            w.trusted && gyro.between(frames.frame[w.i].t - offset, frames.frame[w.j].t - offset, &w.gyro);
        usable += w.usable;
    }
    return usable;
}

/* ---- the closed form ----------------------------------------------------------------------------------- */

Likeness Solver::compare() const {
    Likeness like;
    Vector3d camera_mean = Vector3d::Zero(), gyro_mean = Vector3d::Zero();
    for (int k = 0; k < count; k++) {
        const Window &w = windows[k];
        if (!w.usable) continue;
        camera_mean += rotation_log(w.camera) / w.seconds;
        gyro_mean += rotation_log(w.gyro) / w.seconds;
        like.windows++;
    }
    if (!like.windows) return like;
    camera_mean /= like.windows;
    gyro_mean /= like.windows;
    for (int k = 0; k < count; k++) {
        const Window &w = windows[k];
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

calibration_outcome Solver::search(const calibration_input &input, Guess *guess, calibration *result) {
    const int half = (int)std::ceil(input.offset_range / grid_s);
    int most = 0, best = 0;
    double correlation = -1, mirrored = -1;
    for (int k = -half; k <= half; k++) most = std::max(most, place(input.offset_start + k * grid_s));
    result->windows = most;
    if (most < CALIBRATION_LEAST_WINDOWS) return CALIBRATION_FEW_FRAMES;
    Likeness like;
    for (int k = -half; k <= half; k++) {
        const double offset = input.offset_start + k * grid_s;
        if (place(offset) < std::max(most / 2, CALIBRATION_LEAST_WINDOWS)) continue;
        const Likeness here = compare();
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

/* How far the rates of camera and gyroscope may lie apart: the bias, and a share for scale and noise. */
static double tolerance(const Vector3d &rate) {
    return 0.08 + 0.1 * rate.norm();
}

/* The sum of the gyroscope's squared rates that a rotation explains; *energy is the sum of all. */
double Solver::agreement(const Quaterniond &rotation, double *energy) const {
    double sum = 0;
    *energy = 0;
    for (int k = 0; k < count; k++) {
        const Window &w = windows[k];
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
Quaterniond Solver::from_pair(const Window &p, const Window &q) const {
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

/* Where tracking went astray for a good part of the way, means and correlations mean nothing. Then the offset and the
 * rotation that most windows agree on (Fischler and Bolles 1981, "Random sample consensus", from two windows each time)
 * tell which windows to leave out. False when there are no such. */
bool Solver::consensus(const calibration_input &input, calibration *result) {
    const int half = (int)std::ceil(input.offset_range / grid_s);
    const uint64_t key = random_key(1, 0xca11b);
    Guess best;
    double most = 0;
    uint64_t draw = 0;
    for (int k = -half; k <= half; k++) {
        const double offset = input.offset_start + k * grid_s;
        if (place(offset) < CALIBRATION_LEAST_WINDOWS) continue;
        for (int n = 0; n < consensus_draws; n++) {
            const Window &p = windows[(int)(count * random_uniform(key, draw++))];
            const Window &q = windows[(int)(count * random_uniform(key, draw++))];
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
        Window &w = windows[k];
        const Vector3d b = rotation_log(w.gyro) / w.seconds;
        w.trusted =
            w.usable && (rotation_log(w.camera) / w.seconds - best.rotation * b).norm() < tolerance(b);
        kept += w.trusted;
    }
    result->left_out = all - kept;
    return kept >= CALIBRATION_LEAST_WINDOWS && kept < all;
}

/* ---- the refinement ------------------------------------------------------------------------------------ */

/* The turn that is left between what the gyroscope says and what the camera did, in the later camera's axes. */
Vector3d Solver::residual(const Window &window, const Guess &guess) const {
    const Quaterniond turn = guess.rotation * window.gyro * guess.rotation.conjugate();
    return rotation_log(turn.conjugate() * window.camera);
}

static Guess moved(const Guess &guess, const TurnFit::Vector &step) {
    return {(rotation_exp(step.segment<3>(ROTATION)) * guess.rotation).normalized(),
            guess.offset + step[OFFSET], guess.bias + step.segment<3>(BIAS), guess.scale + step[SCALE]};
}

/* Rows for all usable windows: the residual, and its derivatives by central differences. Returns their number;
 * the gyroscope's path is left integrated as the guess has it. */
int Solver::linearise(const Guess &guess) {
    static const double steps[PARAMETERS] = {1e-4, 1e-4, 1e-4, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4};
    const auto fill = [&](const Guess &at, const auto &take) {
        int row = 0;
        gyro.integrate(at.bias, at.scale);
        for (int k = 0; k < count; k++) {
            if (!windows[k].usable) continue;
            Window w = windows[k];
            /* A window at the very end of the samples may lose them by the step: it then says nothing. */
            if (!gyro.between(frames.frame[w.i].t - at.offset, frames.frame[w.j].t - at.offset, &w.gyro))
                w.gyro = windows[k].gyro;
            take(rows[row++], residual(w, at), frames.frame[w.i].t);
        }
        return row;
    };
    for (int p = 0; p < PARAMETERS; p++) {
        TurnFit::Vector step = TurnFit::Vector::Zero();
        step[p] = steps[p];
        fill(moved(guess, step),
             [&](TurnRow &row, const Vector3d &value, double) { row.jacobian.col(p) = value; });
        fill(moved(guess, -step), [&](TurnRow &row, const Vector3d &value, double) {
            row.jacobian.col(p) = (row.jacobian.col(p) - value) / (2 * steps[p]);
        });
    }
    return fill(guess, [](TurnRow &row, const Vector3d &value, double t) {
        row.value = value;
        row.t = t;
    });
}

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

/* False, and nothing changes, when the data say that the mounting isn't square. */
static bool lean_to_square(calibration *result) {
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

/* Takes the rotation's sigmas from its covariance. */
static calibration_outcome judge_rotation(calibration *result) {
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

/* Keeps beside the result what came out of the data without the prior. */
static void compare_with_data(const calibration &data, bool leant, calibration *result) {
    std::copy(data.rotation, data.rotation + 9, result->data_rotation);
    std::copy(data.rotation_sigma, data.rotation_sigma + 3, result->data_rotation_sigma);
    std::copy(data.weak_axis, data.weak_axis + 3, result->data_weak_axis);
    result->data_weak_sigma = data.weak_sigma;
    const Vector3d moved =
        rotation_log(Quaterniond(Matrix3d(matrix(result->rotation) * matrix(data.rotation).transpose())));
    const double square = moved.dot(matrix(data.rotation_covariance).inverse() * moved);
    result->square_moved = leant ? std::sqrt(std::max(square, 0.0)) : 0;
}

calibration_outcome Solver::refine(Guess *guess, calibration *result) {
    TurnFit fit;
    for (int i = 0; i < 3; i++) fit.prior(BIAS + i, BIAS + i) = 1 / (bias_prior * bias_prior);
    fit.prior(SCALE, SCALE) = 1 / (scale_prior * scale_prior);
    int used = 0;
    for (int n = 0; n < most_steps; n++) {
        gyro.integrate(guess->bias, guess->scale);
        place(guess->offset);
        used = linearise(*guess);
        if (used < CALIBRATION_LEAST_WINDOWS) return CALIBRATION_FEW_FRAMES;
        TurnFit::Vector expected = TurnFit::Vector::Zero();
        expected.segment<3>(BIAS) = -guess->bias;
        expected[SCALE] = 1 - guess->scale;
        fit.prior_pull = fit.prior * expected;
        TurnFit::Vector step = fit.step(rows.get(), used, scratch.get());
        if (!step.allFinite()) return CALIBRATION_LITTLE_TURNING;
        /* Beyond these the linear model is no guide. */
        const double most = std::max(step.segment<3>(ROTATION).norm() / 0.2, std::fabs(step[OFFSET]) / 0.02);
        if (most > 1) step /= most;
        *guess = moved(*guess, step);
        if (step.segment<3>(ROTATION).norm() < 1e-6 && std::fabs(step[OFFSET]) < 1e-7) break;
    }
    gyro.integrate(guess->bias, guess->scale);
    place(guess->offset);

    double seconds = 0; /* of tracking; windows that share no frame are independent */
    for (int k = 0; k < count; k++)
        if (windows[k].usable) seconds += windows[k].seconds / (windows[k].j - windows[k].i);
    const TurnFit::Matrix covariance =
        fit.covariance(rows.get(), used, reach_windows * window_s, 3 * seconds / window_s);
    const auto sigma = [&](int p) { return std::sqrt(covariance(p, p)); };
    const Matrix3d rotation = guess->rotation.toRotationMatrix();
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) result->rotation[3 * i + k] = rotation(i, k);
        result->gyro_bias[i] = guess->bias[i];
        result->gyro_bias_sigma[i] = sigma(BIAS + i);
    }
    result->offset = guess->offset;
    result->offset_sigma = sigma(OFFSET);
    result->offset_observable = result->offset_sigma <= CALIBRATION_OFFSET_SIGMA_S;
    result->gyro_scale = guess->scale;
    result->gyro_scale_sigma = sigma(SCALE);
    result->rotation_residual = fit.sigma;
    result->windows = used;
    const Matrix3d open = covariance.block<3, 3>(ROTATION, ROTATION);
    for (int i = 0; i < 9; i++) result->rotation_covariance[i] = open(i / 3, i % 3);
    return judge_rotation(result);
}

calibration_outcome Solver::solve(const calibration_input &input, double window_length, calibration *result) {
    Guess guess;
    *result = calibration();
    cut(window_length);
    calibration_outcome outcome = search(input, &guess, result);
    if (outcome != CALIBRATION_DONE && outcome != CALIBRATION_FEW_FRAMES && outcome != CALIBRATION_MIRRORED) {
        const calibration whole = *result;
        if (consensus(input, result) && search(input, &guess, result) == CALIBRATION_DONE)
            outcome = CALIBRATION_DONE;
        else
            *result = whole;
    }
    if (outcome == CALIBRATION_DISAGREES) {
        /* Degrees for radians make turns beyond half a circle, which compare with nothing. */
        calibration degrees = calibration();
        gyro.integrate(Vector3d::Zero(), M_PI / 180);
        if (search(input, &guess, &degrees) == CALIBRATION_DONE) {
            outcome = CALIBRATION_SCALE;
            *result = degrees;
            result->gyro_scale *= M_PI / 180;
        }
    }
    if (outcome == CALIBRATION_DONE) outcome = refine(&guess, result);
    if (outcome != CALIBRATION_DONE) return outcome;
    calibration data = *result;
    const bool leant = lean_to_square(result);
    const double gravity = input.gravity > 0 ? input.gravity : 9.80665;
    if (gyro.has_force() &&
        (!calibrate_lever(frames, gyro, gravity, &data) || !calibrate_lever(frames, gyro, gravity, result)))
        return CALIBRATION_MEMORY;
    judge_rotation(&data);
    compare_with_data(data, leant, result);
    return judge_rotation(result);
}

calibration_outcome calibration_solve(const calibration_input *input, calibration *result) {
    Solver solver;
    calibration_outcome outcome = CALIBRATION_MEMORY;
    *result = calibration();
    if (!solver.prepare(*input)) return outcome;
    /* What has no sigma yet ranks behind what has one. */
    const auto doubt = [](const calibration &c) {
        return c.weak_sigma > 0 ? c.weak_sigma * c.offset_sigma : 1e9;
    };
    for (const double length : window_lengths) {
        calibration tried;
        const calibration_outcome came = solver.solve(*input, length, &tried);
        if (outcome != CALIBRATION_MEMORY && doubt(tried) >= doubt(*result)) continue;
        outcome = came;
        *result = tried;
    }
    return outcome;
}
