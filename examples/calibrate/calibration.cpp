#include "calibrate/turn_solver.hpp"

#include <cmath>
#include <new>

using Eigen::Quaterniond;
using Eigen::Vector3d;

/* Windows long against alignment's noise, and short against the motion, the drift and the bias: which that is depends
 * on the recording, so all are tried, and the one with the least uncertainty is taken. */
static constexpr double window_lengths[] = {0.1, 0.2, 0.4};

bool TurnSolver::prepare(const calibration_input &input) {
    if (!frames.read(input.path) || !gyro.read(input.imu, input.imu_count, frames.origin_ns)) return false;
    windows.reset(new (std::nothrow) TurnWindow[(size_t)frames.count + 1]);
    rows.reset(new (std::nothrow) TurnRow[(size_t)frames.count + 1]);
    scratch.reset(new (std::nothrow) double[(size_t)frames.count + 1]);
    return windows && rows && scratch;
}

void TurnSolver::cut(double window_length) {
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

/* Looks up the gyroscope's rotations at an offset; returns the number of windows with one. */
int TurnSolver::place(double offset) {
    int usable = 0;
    for (int k = 0; k < count; k++) {
        TurnWindow &w = windows[k];
        w.usable =
            w.trusted && gyro.between(frames.frame[w.i].t - offset, frames.frame[w.j].t - offset, &w.gyro);
        usable += w.usable;
    }
    return usable;
}

calibration_outcome TurnSolver::solve(const calibration_input &input, double window_length,
                                      calibration *result) {
    TurnGuess guess;
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
        /* Degrees for radians give rotations beyond half a turn, which can't be compared. */
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
    const bool leant = calibration_lean_to_square(result);
    const double gravity = input.gravity > 0 ? input.gravity : 9.80665;
    if (gyro.has_force() &&
        (!calibrate_lever(frames, gyro, gravity, &data) || !calibrate_lever(frames, gyro, gravity, result)))
        return CALIBRATION_MEMORY;
    calibration_judge_rotation(&data);
    calibration_compare_with_data(data, leant, result);
    return calibration_judge_rotation(result);
}

calibration_outcome calibration_solve(const calibration_input *input, calibration *result) {
    TurnSolver solver;
    calibration_outcome outcome = CALIBRATION_MEMORY;
    *result = calibration();
    if (!solver.prepare(*input)) return outcome;
    /* Results without a sigma rank behind those with one. */
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
