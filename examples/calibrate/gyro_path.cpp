#include "calibrate/gyro_path.hpp"

#include <algorithm>
#include <cmath>
#include <new>

using Eigen::Quaterniond;
using Eigen::Vector3d;

Quaterniond rotation_exp(const Vector3d &vector) {
    const double angle = vector.norm(), s = angle > 1e-9 ? std::sin(angle / 2) / angle : 0.5;
    return Quaterniond(std::cos(angle / 2), s * vector.x(), s * vector.y(), s * vector.z());
}

Vector3d rotation_log(const Quaterniond &rotation) {
    const double sine = rotation.vec().norm(), sign = rotation.w() < 0 ? -1 : 1;
    const double scale = sine > 1e-9 ? 2 * std::atan2(sine, std::fabs(rotation.w())) / sine : 2;
    return sign * scale * rotation.vec();
}

/* A rate that changes linearly from a to b within h seconds: the integral and the first coning term (Bortz 1971, "A new
 * mathematical formulation for strapdown inertial navigation"). */
static Quaterniond turn_of(const Vector3d &a, const Vector3d &b, double h) {
    return rotation_exp(h / 2 * (a + b) + h * h / 12 * a.cross(b));
}

bool GyroPath::read(const fathom_imu_sample *imu, int imu_count, int64_t origin_ns) {
    samples.reset(new (std::nothrow) Sample[(size_t)imu_count + 1]);
    orientations.reset(new (std::nothrow) Quaterniond[(size_t)imu_count + 1]);
    gaps.reset(new (std::nothrow) int[(size_t)imu_count + 1]);
    std::unique_ptr<double[]> steps(new (std::nothrow) double[(size_t)imu_count + 1]);
    if (!samples || !orientations || !gaps || !steps) return false;
    count = 0;
    forces = true;
    for (int i = 0; i < imu_count; i++) {
        Sample s;
        s.t = 1e-9 * (double)(imu[i].timestamp_ns - origin_ns);
        for (int k = 0; k < 3; k++) {
            s.rate[k] = imu[i].gyro[k];
            s.force[k] = imu[i].accel[k];
        }
        if (!s.rate.allFinite() || (count && s.t <= samples[count - 1].t)) continue;
        forces = forces && s.force.allFinite();
        if (count) steps[count - 1] = s.t - samples[count - 1].t;
        samples[count++] = s;
    }
    forces = forces && count > 0;
    /* As the library counts them: a pause of more than five periods is a gap. */
    double longest = 0;
    if (count > 1) {
        std::nth_element(steps.get(), steps.get() + (count - 1) / 2, steps.get() + count - 1);
        longest = 5 * steps[(count - 1) / 2];
    }
    for (int i = 0; i < count; i++)
        gaps[i] = i ? gaps[i - 1] + (samples[i].t - samples[i - 1].t > longest) : 0;
    return true;
}

void GyroPath::integrate(const Vector3d &bias, double scale) {
    bias_ = bias;
    scale_ = scale;
    if (count) orientations[0] = Quaterniond::Identity();
    for (int i = 1; i < count; i++)
        orientations[i] =
            (orientations[i - 1] * turn_of(rate_of(i - 1), rate_of(i), samples[i].t - samples[i - 1].t))
                .normalized();
}

/* The last sample at or before t; -1: none. */
int GyroPath::index_of(double t) const {
    const Sample *begin = samples.get();
    return (int)(std::upper_bound(begin, begin + count, t,
                                  [](double at, const Sample &s) { return at < s.t; }) -
                 begin) -
           1;
}

Quaterniond GyroPath::orientation_at(int i, double t) const {
    const double step = t - samples[i].t;
    if (step <= 0 || i + 1 >= count) return orientations[i];
    const Vector3d a = rate_of(i), b = rate_of(i + 1);
    return orientations[i] * turn_of(a, a + step / (samples[i + 1].t - samples[i].t) * (b - a), step);
}

Vector3d GyroPath::force_at(double t) const {
    const int i = index_of(t);
    if (i + 1 >= count) return samples[i].force;
    const double share = (t - samples[i].t) / (samples[i + 1].t - samples[i].t);
    return samples[i].force + share * (samples[i + 1].force - samples[i].force);
}

bool GyroPath::between(double t0, double t1, Quaterniond *turn) const {
    const int i = index_of(t0), j = index_of(t1);
    if (i < 0 || j < i || t1 > samples[count - 1].t) return false;
    const int last = t1 > samples[j].t ? j + 1 : j; /* the sample used for t1 */
    if (gaps[last] != gaps[i]) return false;
    *turn = orientation_at(i, t0).conjugate() * orientation_at(j, t1);
    return true;
}
