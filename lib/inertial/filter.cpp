#include "inertial/filter.h"

#include <Eigen/Dense>
#include <cmath>

#include "inertial/measurement.h"

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Error = Eigen::Matrix<double, NAVIGATOR_STATES, 1>;
using Covariance = Eigen::Matrix<double, NAVIGATOR_STATES, NAVIGATOR_STATES>;
using RowCovariance = Eigen::Matrix<double, NAVIGATOR_STATES, NAVIGATOR_STATES, Eigen::RowMajor>;
using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using RowMatrix6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
using Observation = Eigen::Matrix<double, 6, NAVIGATOR_STATES>;
using RowObservation = Eigen::Matrix<double, 6, NAVIGATOR_STATES, Eigen::RowMajor>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

#define USUAL_RATE 0.3 /* rad/s: sustained rotation of a hand-held camera, for the growth of a bias's error */

enum {
    ROTATION = NAVIGATOR_ROTATION,
    POSITION = NAVIGATOR_POSITION,
    VELOCITY = NAVIGATOR_VELOCITY,
    GYRO_BIAS = NAVIGATOR_GYRO_BIAS,
    ACCEL_BIAS = NAVIGATOR_ACCEL_BIAS,
    GRAVITY = NAVIGATOR_GRAVITY
};

static Matrix3d skew(const Vector3d &v) {
    Matrix3d m;
    m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
    return m;
}

static Matrix3d rotation_exp(const Vector3d &w) {
    Rotation r;
    so3_exp(w.data(), r.data());
    return r;
}

void navigator_start(navigator *n, const pose *imu_to_world, const double gravity[3], double velocity_sigma,
                     double gyro_bias_sigma, double accel_bias_sigma, double gravity_sigma) {
    int64_t timestamp_ns = n->timestamp_ns;
    *n = navigator{};
    n->timestamp_ns = timestamp_ns;
    for (int i = 0; i < 9; i++) n->r[i] = imu_to_world->r[i];
    for (int i = 0; i < 3; i++) {
        n->p[i] = imu_to_world->t[i];
        n->gravity[i] = gravity[i];
    }
    const double sigmas[6] = {1e-5, 1e-5, velocity_sigma, gyro_bias_sigma, accel_bias_sigma, gravity_sigma};
    for (int i = 0; i < NAVIGATOR_STATES; i++)
        n->covariance[i * (NAVIGATOR_STATES + 1)] = sigmas[i / 3] * sigmas[i / 3];
    Eigen::Map<RowCovariance> c(n->covariance); /* gravity = R (bias - measured force) */
    double bias = accel_bias_sigma * accel_bias_sigma;
    c.block<3, 3>(GRAVITY, ACCEL_BIAS) = bias * Eigen::Map<const Rotation>(n->r);
    c.block<3, 3>(ACCEL_BIAS, GRAVITY) = bias * Eigen::Map<const Rotation>(n->r).transpose();
    c.block<3, 3>(GRAVITY, GRAVITY) += bias * Matrix3d::Identity();
}

/* Sola 2017, eq. 260 (nominal) and 268 to 271 (error), with the orientation at the middle of the step. */
void navigator_step(navigator *n, double dt, const double gyro[3], const double accel[3],
                    const navigator_noise *noise) {
    Eigen::Map<Rotation> r(n->r);
    Eigen::Map<Vector3d> p(n->p), v(n->v);
    Eigen::Map<const Vector3d> gyro_bias(n->gyro_bias), accel_bias(n->accel_bias), gravity(n->gravity);
    Vector3d turn = (Eigen::Map<const Vector3d>(gyro) - gyro_bias) * dt;
    Matrix3d middle = r * rotation_exp(0.5 * turn);
    Vector3d force = Vector3d::Zero(), acceleration = Vector3d::Zero();
    if (accel) {
        force = Eigen::Map<const Vector3d>(accel) - accel_bias;
        acceleration = middle * force + gravity;
    }
    p += v * dt + 0.5 * dt * dt * acceleration;
    v += acceleration * dt;
    Matrix3d before = r, step = rotation_exp(turn);
    pose turned = {{0}, {0}};
    Eigen::Map<Rotation>(turned.r) = before * step;
    pose_normalise(&turned);
    r = Eigen::Map<Rotation>(turned.r);
    if (!(dt > 0)) return;

    Covariance f = Covariance::Identity();
    f.block<3, 3>(ROTATION, ROTATION) = step.transpose();
    f.block<3, 3>(ROTATION, GYRO_BIAS) = -dt * Matrix3d::Identity();
    f.block<3, 3>(POSITION, VELOCITY) = dt * Matrix3d::Identity();
    if (accel) {
        Matrix3d lean = -middle * skew(force);
        f.block<3, 3>(VELOCITY, ROTATION) = dt * lean;
        f.block<3, 3>(VELOCITY, ACCEL_BIAS) = -dt * middle;
        f.block<3, 3>(VELOCITY, GRAVITY) = dt * Matrix3d::Identity();
        f.block<3, 3>(POSITION, ROTATION) = 0.5 * dt * dt * lean;
        f.block<3, 3>(POSITION, ACCEL_BIAS) = -0.5 * dt * dt * middle;
        f.block<3, 3>(POSITION, GRAVITY) = 0.5 * dt * dt * Matrix3d::Identity();
    }
    Eigen::Map<RowCovariance> stored(n->covariance);
    Covariance c = f * stored * f.transpose();
    const double a2 = noise->accel * noise->accel;
    for (int i = 0; i < 3; i++) {
        c(ROTATION + i, ROTATION + i) += noise->gyro * noise->gyro * dt + noise->turn * noise->turn;
        c(VELOCITY + i, VELOCITY + i) += a2 * dt;
        c(VELOCITY + i, POSITION + i) += a2 * dt * dt / 2;
        c(POSITION + i, VELOCITY + i) += a2 * dt * dt / 2;
        c(POSITION + i, POSITION + i) +=
            a2 * dt * dt * dt / 3 + noise->position_walk * noise->position_walk * dt;
        c(GYRO_BIAS + i, GYRO_BIAS + i) += noise->gyro_walk * noise->gyro_walk * dt;
        c(ACCEL_BIAS + i, ACCEL_BIAS + i) += noise->accel_walk * noise->accel_walk * dt;
    }
    /* Slow drift of the map's rotation turns orientation, velocity and gravity alike: gravity in the IMU's axes
     * stays. */
    Eigen::Matrix<double, NAVIGATOR_STATES, 3> turned_map =
        Eigen::Matrix<double, NAVIGATOR_STATES, 3>::Zero();
    turned_map.block<3, 3>(ROTATION, 0) = r.transpose();
    turned_map.block<3, 3>(VELOCITY, 0) = -skew(v);
    turned_map.block<3, 3>(GRAVITY, 0) = -skew(gravity);
    c += noise->rotation_walk * noise->rotation_walk * dt * turned_map * turned_map.transpose();
    stored = 0.5 * (c + c.transpose());
}

/* Jacobian of the camera's pose (right perturbation): the camera is at p - R lever, so it turns by the same angle and
 * moves by R^T dp + lever x rotation, in its own axes. */
static Observation camera_of_error(const navigator *n, const double lever[3]) {
    Observation h = Observation::Zero();
    h.block<3, 3>(0, ROTATION) = Matrix3d::Identity();
    h.block<3, 3>(3, ROTATION) = skew(Eigen::Map<const Vector3d>(lever));
    h.block<3, 3>(3, POSITION) = Eigen::Map<const Rotation>(n->r).transpose();
    return h;
}

pose navigator_camera(const navigator *n, const double lever[3]) {
    pose c;
    for (int i = 0; i < 9; i++) c.r[i] = n->r[i];
    Eigen::Map<Vector3d>(c.t) = Eigen::Map<const Vector3d>(n->p) -
                                Eigen::Map<const Rotation>(n->r) * Eigen::Map<const Vector3d>(lever);
    return c;
}

void navigator_camera_covariance(const navigator *n, const double lever[3], double covariance[36]) {
    Observation h = camera_of_error(n, lever);
    Eigen::Map<RowMatrix6>(covariance).noalias() =
        h * Eigen::Map<const RowCovariance>(n->covariance) * h.transpose();
}

void navigator_camera_jacobian(const navigator *n, const double lever[3],
                               double jacobian[6 * NAVIGATOR_STATES]) {
    Eigen::Map<RowObservation> j(jacobian);
    j = camera_of_error(n, lever);
}

void navigator_forget_pose_error(navigator *n) {
    Eigen::Map<RowCovariance> c(n->covariance);
    c.topRows<6>().setZero();
    c.leftCols<6>().setZero();
}

/* Sola 2017, Section 6.2 */
void navigator_perturb(navigator *n, const double error[NAVIGATOR_STATES]) {
    Eigen::Map<const Error> e(error);
    pose turned = {{0}, {0}};
    Eigen::Map<Rotation>(turned.r) = Eigen::Map<const Rotation>(n->r) * rotation_exp(e.segment<3>(ROTATION));
    pose_normalise(&turned);
    for (int i = 0; i < 9; i++) n->r[i] = turned.r[i];
    for (int i = 0; i < 3; i++) {
        n->p[i] += e[POSITION + i];
        n->v[i] += e[VELOCITY + i];
        n->gyro_bias[i] += e[GYRO_BIAS + i];
        n->accel_bias[i] += e[ACCEL_BIAS + i];
        n->gravity[i] += e[GRAVITY + i];
    }
}

/* Gain and innovation of a measurement: Sola 2017, Section 6.1, with the information Y of the measurement, which may be
 * singular, instead of its covariance: the gain is K = P H^T W with W = (I + Y H P H^T)^-1 Y. */
struct Comparison {
    Eigen::Matrix<double, NAVIGATOR_STATES, 6> ph;
    Matrix6 predicted; /* H P H^T */
    Matrix6 floors;
    Matrix6 w;
    Vector6 innovation;
    Vector6 weighed; /* W times the innovation */
};

static Comparison compare(const navigator *n, const measurement *m, double mismatch) {
    Comparison c;
    linearisation at = {};
    m->linearise(m, n, &at);
    Observation h = Eigen::Map<const RowObservation>(at.jacobian);
    Matrix6 y = Eigen::Map<const RowMatrix6>(m->information), identity = Matrix6::Identity();
    c.floors.setZero();
    for (int i = 0; i < 6; i++) c.floors(i, i) = mismatch * m->floors[i] * (mismatch * m->floors[i]);
    auto floored = (identity + y * c.floors).partialPivLu(); /* (Y^-1 + floors)^-1 = (I + Y floors)^-1 Y */
    y = floored.solve(y).eval();
    y = 0.5 * (y + y.transpose()).eval();
    c.ph = Eigen::Map<const RowCovariance>(n->covariance) * h.transpose();
    c.predicted = h * c.ph;
    auto gain = (identity + y * c.predicted).partialPivLu();
    c.w = gain.solve(y);
    c.innovation = Eigen::Map<const Vector6>(at.residual);
    Vector6 right = y * c.innovation;
    right += floored.solve(Eigen::Map<const Vector6>(m->pull));
    c.weighed = gain.solve(right);
    return c;
}

double navigator_misfit(const navigator *n, const measurement *m, double mismatch) {
    Comparison c = compare(n, m, mismatch);
    Matrix6 own = c.predicted + c.floors;
    double directions = (c.w * own).trace(), square = c.weighed.dot(own * c.weighed);
    return directions > 1 && std::isfinite(square) ? square / directions : -1;
}

bool navigator_correct(navigator *n, const measurement *m, double mismatch) {
    Comparison c = compare(n, m, mismatch);
    if (std::isfinite(m->max_squares) && !(c.innovation.dot(c.weighed) < m->max_squares)) return false;
    Eigen::Matrix<double, NAVIGATOR_STATES, 6> gain = c.ph * c.w;
    Error e = c.ph * c.weighed;
    if (!e.allFinite()) return false;
    Eigen::Map<RowCovariance> stored(n->covariance);
    Covariance p = stored;
    p = (p - gain * c.ph.transpose()).eval();
    stored = 0.5 * (p + p.transpose());
    navigator_perturb(n, e.data());
    return true;
}

void navigator_turn_imu(navigator *n, const double turn[3]) {
    Eigen::Map<Vector3d> gyro_bias(n->gyro_bias), accel_bias(n->accel_bias);
    Eigen::Map<const Vector3d> t(turn), gravity(n->gravity);
    Matrix3d q = rotation_exp(t);
    gyro_bias = (q * gyro_bias).eval();
    accel_bias = (q * accel_bias).eval();
    Covariance f = Covariance::Identity();
    f.block<3, 3>(GYRO_BIAS, GYRO_BIAS) = q;
    f.block<3, 3>(ACCEL_BIAS, ACCEL_BIAS) = q;
    Eigen::Map<RowCovariance> stored(n->covariance);
    Covariance c = f * stored * f.transpose();
    for (int i = 0; i < 3; i++) {
        c(GYRO_BIAS + i, GYRO_BIAS + i) += t.squaredNorm() * USUAL_RATE * USUAL_RATE;
        c(ACCEL_BIAS + i, ACCEL_BIAS + i) += t.squaredNorm() * gravity.squaredNorm();
        c(GRAVITY + i, GRAVITY + i) += t.squaredNorm() * gravity.squaredNorm();
    }
    stored = 0.5 * (c + c.transpose());
}
