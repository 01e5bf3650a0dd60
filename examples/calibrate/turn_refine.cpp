/* The refinement of TurnSolver. */
#include "calibrate/turn_solver.hpp"

#include <cmath>

using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;

static constexpr double reach_windows = 4; /* beyond it, the errors of windows are taken as independent */
/* Prior for any MEMS gyroscope. */
static constexpr double bias_prior = 0.01 /* rad/s */, scale_prior = 0.05;
static constexpr int most_steps = 30;

/* The residual rotation between gyroscope and camera, in the later camera's axes. */
Vector3d TurnSolver::residual(const TurnWindow &window, const TurnGuess &guess) const {
    const Quaterniond turn = guess.rotation * window.gyro * guess.rotation.conjugate();
    return rotation_log(turn.conjugate() * window.camera);
}

static TurnGuess moved(const TurnGuess &guess, const TurnFit::Vector &step) {
    return {(rotation_exp(step.segment<3>(TURN_ROTATION)) * guess.rotation).normalized(),
            guess.offset + step[TURN_OFFSET], guess.bias + step.segment<3>(TURN_BIAS),
            guess.scale + step[TURN_SCALE]};
}

/* Rows for all usable windows: the residual, and its derivatives by central differences. Returns their number; leaves
 * the gyroscope's path integrated with the guess. */
int TurnSolver::linearise(const TurnGuess &guess) {
    static const double steps[TURN_PARAMETERS] = {1e-4, 1e-4, 1e-4, 1e-2, 1e-4, 1e-4, 1e-4, 1e-4};
    const auto fill = [&](const TurnGuess &at, const auto &take) {
        int row = 0;
        gyro.integrate(at.bias, at.scale);
        for (int k = 0; k < count; k++) {
            if (!windows[k].usable) continue;
            TurnWindow w = windows[k];
            /* A window at the very end of the samples may lose them by the step: it is then left out. */
            if (!gyro.between(frames.frame[w.i].t - at.offset, frames.frame[w.j].t - at.offset, &w.gyro))
                w.gyro = windows[k].gyro;
            take(rows[row++], residual(w, at), frames.frame[w.i].t);
        }
        return row;
    };
    for (int p = 0; p < TURN_PARAMETERS; p++) {
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

calibration_outcome TurnSolver::refine(TurnGuess *guess, calibration *result) {
    TurnFit fit;
    for (int i = 0; i < 3; i++) fit.prior(TURN_BIAS + i, TURN_BIAS + i) = 1 / (bias_prior * bias_prior);
    fit.prior(TURN_SCALE, TURN_SCALE) = 1 / (scale_prior * scale_prior);
    int used = 0;
    for (int n = 0; n < most_steps; n++) {
        gyro.integrate(guess->bias, guess->scale);
        place(guess->offset);
        used = linearise(*guess);
        if (used < CALIBRATION_LEAST_WINDOWS) return CALIBRATION_FEW_FRAMES;
        TurnFit::Vector expected = TurnFit::Vector::Zero();
        expected.segment<3>(TURN_BIAS) = -guess->bias;
        expected[TURN_SCALE] = 1 - guess->scale;
        fit.prior_pull = fit.prior * expected;
        TurnFit::Vector step = fit.step(rows.get(), used, scratch.get());
        if (!step.allFinite()) return CALIBRATION_LITTLE_TURNING;
        /* Beyond these the linear model is invalid. */
        const double most =
            std::max(step.segment<3>(TURN_ROTATION).norm() / 0.2, std::fabs(step[TURN_OFFSET]) / 0.02);
        if (most > 1) step /= most;
        *guess = moved(*guess, step);
        if (step.segment<3>(TURN_ROTATION).norm() < 1e-6 && std::fabs(step[TURN_OFFSET]) < 1e-7) break;
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
        result->gyro_bias_sigma[i] = sigma(TURN_BIAS + i);
    }
    result->offset = guess->offset;
    result->offset_sigma = sigma(TURN_OFFSET);
    result->offset_observable = result->offset_sigma <= CALIBRATION_OFFSET_SIGMA_S;
    result->gyro_scale = guess->scale;
    result->gyro_scale_sigma = sigma(TURN_SCALE);
    result->rotation_residual = fit.sigma;
    result->windows = used;
    const Matrix3d open = covariance.block<3, 3>(TURN_ROTATION, TURN_ROTATION);
    for (int i = 0; i < 9; i++) result->rotation_covariance[i] = open(i / 3, i % 3);
    return calibration_judge_rotation(result);
}
