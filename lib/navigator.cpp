#include "navigator.h"

#include <Eigen/Dense>

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Error = Eigen::Matrix<double, NAVIGATOR_STATES, 1>;
using Covariance = Eigen::Matrix<double, NAVIGATOR_STATES, NAVIGATOR_STATES>;
using RowCovariance = Eigen::Matrix<double, NAVIGATOR_STATES, NAVIGATOR_STATES, Eigen::RowMajor>;
using Rotation = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using RowMatrix6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;
using Observation = Eigen::Matrix<double, 6, NAVIGATOR_STATES>;

enum { ROTATION = 0, POSITION = 3, VELOCITY = 6, GYRO_BIAS = 9, ACCEL_BIAS = 12, GRAVITY = 15 };

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
}

/* Sola 2017, eq. 260 (nominal) and 268 to 271 (error), with the orientation taken amid the stretch. */
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
        c(POSITION + i, POSITION + i) += a2 * dt * dt * dt / 3;
        c(GYRO_BIAS + i, GYRO_BIAS + i) += noise->gyro_walk * noise->gyro_walk * dt;
        c(ACCEL_BIAS + i, ACCEL_BIAS + i) += noise->accel_walk * noise->accel_walk * dt;
    }
    stored = 0.5 * (c + c.transpose());
}

/* How the error moves the camera's pose (right perturbation): the camera is at p - R lever, so it turns by the same angle
 * and moves by R^T dp + lever x rotation, in its own axes. */
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

void navigator_forget_pose_error(navigator *n) {
    Eigen::Map<RowCovariance> c(n->covariance);
    c.topRows<6>().setZero();
    c.leftCols<6>().setZero();
}

/* Sola 2017, Sections 6.1 and 6.2; with the information Y of the measurement, which may be singular, instead of its
 * covariance: K = P H^T (I + Y H P H^T)^-1 Y. */
void navigator_correct(navigator *n, const double lever[3], const pose *camera_to_world,
                       const double information[36], double floor_rad, double floor_m) {
    Eigen::Map<RowCovariance> stored(n->covariance);
    Covariance c = stored;
    Observation h = camera_of_error(n, lever);
    Matrix6 y = Eigen::Map<const RowMatrix6>(information), floors = Matrix6::Zero(),
            identity = Matrix6::Identity();
    for (int i = 0; i < 6; i++) floors(i, i) = i < 3 ? floor_rad * floor_rad : floor_m * floor_m;
    y = y * (identity + floors * y).partialPivLu().inverse(); /* (Y^-1 + floors)^-1 */
    y = 0.5 * (y + y.transpose()).eval();
    Eigen::Matrix<double, NAVIGATOR_STATES, 6> ph = c * h.transpose();
    Eigen::Matrix<double, NAVIGATOR_STATES, 6> gain = ph * (identity + y * (h * ph)).partialPivLu().solve(y);

    pose camera = navigator_camera(n, lever), way = pose_between(&camera, camera_to_world);
    Eigen::Matrix<double, 6, 1> innovation;
    pose_log(&way, innovation.data());
    Error e = gain * innovation;
    if (!e.allFinite()) return;
    c = (c - gain * ph.transpose()).eval();
    stored = 0.5 * (c + c.transpose());

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
