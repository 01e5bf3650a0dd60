#include "align/frames.h"

#include <string.h>

#include "base/covariance.h"

void covariance_to_scan(const pose *motion, const double left[36], double out[36]) {
    pose inverse = pose_inverse(motion);
    double adjoint[36];
    pose_adjoint(&inverse, adjoint);
    covariance_transport(adjoint, left, out);
}

void information_to_scan(const pose *motion, const double left[36], double out[36]) {
    double adjoint[36], transposed[36];
    pose_adjoint(motion, adjoint);
    for (int i = 0; i < 36; i++) transposed[i] = adjoint[i % 6 * 6 + i / 6];
    covariance_transport(transposed, left, out);
}

void twist_to_scan(const pose *motion, const double left[6], double out[6]) {
    const pose inverse = pose_inverse(motion);
    double adjoint[36];
    pose_adjoint(&inverse, adjoint);
    memset(out, 0, 6 * sizeof *out);
    for (int i = 0; i < 36; i++) out[i / 6] += adjoint[i] * left[i % 6];
}

void pull_to_scan(const pose *motion, const double left[6], double out[6]) {
    double adjoint[36];
    pose_adjoint(motion, adjoint);
    memset(out, 0, 6 * sizeof *out);
    for (int i = 0; i < 36; i++) out[i % 6] += adjoint[i] * left[i / 6];
}

/* With the motion off from the mean by o = log(inv(mean) motion), an error e of the prior is
 * log(inv(mean) exp(x) motion) = o + inv(Jr(o)) Ad(inv(motion)) x, so x = Ad(motion) Jr(o) (e - o); and Jr(o) o = o. */
bool prior_of_twist(const align_prior *prior, const pose *motion, double mean[6], double information[36]) {
    double off[6], adjoint[36], right[36], covariance[36];
    pose way = pose_between(&prior->mean, motion);
    pose_log(&way, off);
    pose_adjoint(motion, adjoint);
    pose_right_jacobian(off, right);
    for (int i = 0; i < 6; i++) {
        mean[i] = 0;
        for (int j = 0; j < 6; j++) mean[i] -= adjoint[6 * i + j] * off[j];
    }
    covariance_transport(right, prior->covariance, covariance);
    covariance_transport(adjoint, covariance, covariance);
    return covariance_invert(covariance, information);
}
