/* Mounting rotation and clock offset from turning alone. A camera turning at rate a and a gyroscope reading b satisfy
 * a(t + offset) = scale C (b(t) - bias). First the offset and C that make mean rates over short windows most alike, in
 * closed form for each offset of a grid (turn_search.cpp); from there by Gauss and Newton, with the gyroscope integrated
 * exactly (turn_refine.cpp); at last what is known of boards (calibration_square.cpp). */
#ifndef FATHOM_CLI_TURN_SOLVER_HPP
#define FATHOM_CLI_TURN_SOLVER_HPP

#include <memory>

#include "calibrate/calibration_frames.hpp"
#include "calibrate/robust_fit.hpp"

/* The parameters of the refinement. */
enum { TURN_ROTATION = 0, TURN_OFFSET = 3, TURN_BIAS = 4, TURN_SCALE = 7, TURN_PARAMETERS = 8 };
using TurnFit = Fit<TURN_PARAMETERS>;
using TurnRow = FitRow<TURN_PARAMETERS>;

/* From frame i to frame j: the camera's turn, and the gyroscope's as last placed. */
struct TurnWindow {
    int i, j;
    double seconds;
    Eigen::Quaterniond camera, gyro;
    bool trusted; /* not left out as wrongly tracked */
    bool usable;  /* trusted, and there are samples for it */
};

/* How alike the windows' mean rates are; their means over all windows are taken off, and the bias with them. */
struct TurnLikeness {
    int windows = 0;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero(); /* of camera and gyroscope, over the roots of both mean squares */
    Eigen::Vector3d camera_square = Eigen::Vector3d::Zero(); /* mean squares, rad^2/s^2 */
    double gyro_square = 0;
};

struct TurnGuess {
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
    double offset = 0;
    Eigen::Vector3d bias = Eigen::Vector3d::Zero();
    double scale = 1;
};

class TurnSolver {
  public:
    CalibrationFrames frames;
    GyroPath gyro;

    bool prepare(const calibration_input &input);
    calibration_outcome solve(const calibration_input &input, double window_length, calibration *result);

  private:
    std::unique_ptr<TurnWindow[]> windows;
    std::unique_ptr<TurnRow[]> rows;
    std::unique_ptr<double[]> scratch;
    double window_s = 0;
    int count = 0;

    void cut(double window_length);
    calibration_outcome search(const calibration_input &input, TurnGuess *guess, calibration *result);
    bool consensus(const calibration_input &input, calibration *result);
    calibration_outcome refine(TurnGuess *guess, calibration *result);
    int place(double offset);
    TurnLikeness compare() const;
    double agreement(const Eigen::Quaterniond &rotation, double *energy) const;
    Eigen::Quaterniond from_pair(const TurnWindow &p, const TurnWindow &q) const;
    Eigen::Vector3d residual(const TurnWindow &window, const TurnGuess &guess) const;
    int linearise(const TurnGuess &guess);
};

/* Takes a mounting for square where the data allow it: false, and nothing changes, when they say that it isn't. */
bool calibration_lean_to_square(calibration *result);

/* Takes the rotation's sigmas from its covariance. */
calibration_outcome calibration_judge_rotation(calibration *result);

/* Keeps beside the result what came out of the data alone. */
void calibration_compare_with_data(const calibration &data, bool leant, calibration *result);

#endif
