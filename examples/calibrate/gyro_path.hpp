/* The gyroscope's turning, integrated once over all samples, so that the turn between any two times is two look-ups. */
#ifndef FATHOM_CLI_GYRO_PATH_HPP
#define FATHOM_CLI_GYRO_PATH_HPP

#include <memory>

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include "fathom.h"

Eigen::Quaterniond rotation_exp(const Eigen::Vector3d &vector);
Eigen::Vector3d rotation_log(const Eigen::Quaterniond &rotation);

class GyroPath {
  public:
    struct Sample {
        double t; /* IMU clock, seconds from origin_ns */
        Eigen::Vector3d rate, force;
    };

    /* Keeps the finite samples. False when there is no memory. */
    bool read(const fathom_imu_sample *imu, int imu_count, int64_t origin_ns);

    /* Integrates scale * (rate - bias). */
    void integrate(const Eigen::Vector3d &bias, double scale);

    /* The turn from t0 to t1 (later axes to earlier ones). False outside of the samples and across a gap. */
    bool between(double t0, double t1, Eigen::Quaterniond *turn) const;

    /* Specific force and orientation (IMU axes to those at the first sample); t as for between(). */
    Eigen::Vector3d force_at(double t) const;
    Eigen::Quaterniond orientation_at(double t) const {
        return orientation_at(index_of(t), t);
    }

    /* The first sample after t. */
    int next(double t) const {
        return index_of(t) + 1;
    }
    const Sample &sample(int i) const {
        return samples[i];
    }
    const Eigen::Quaterniond &orientation(int i) const {
        return orientations[i];
    }
    bool has_force() const {
        return forces;
    }

  private:
    int index_of(double t) const;
    Eigen::Quaterniond orientation_at(int i, double t) const;
    Eigen::Vector3d rate_of(int i) const {
        return scale_ * (samples[i].rate - bias_);
    }

    std::unique_ptr<Sample[]> samples;
    std::unique_ptr<Eigen::Quaterniond[]> orientations;
    std::unique_ptr<int[]> gaps; /* before each sample */
    int count = 0;
    bool forces = false;
    Eigen::Vector3d bias_ = Eigen::Vector3d::Zero();
    double scale_ = 1;
};

#endif
