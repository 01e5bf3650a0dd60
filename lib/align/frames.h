/* Conversion of perturbations: alignment solves for a left twist in the model camera's axes; the rest of the library
 * uses right perturbations of a motion, in the scan camera's axes: motion * exp(e) = exp(Ad(motion) e) * motion. */
#ifndef FATHOM_FRAMES_H
#define FATHOM_FRAMES_H

#include <stdbool.h>

#include "base/se3.h"

/* The prior of a motion, independent of where alignment starts: a mean, and the covariance of e in mean * exp(e). */
typedef struct {
    pose mean;
    double covariance[36];
    double since_s; /* seconds since the last tracked frame, by which the map was made */
} align_prior;

/* Convert covariance, information, a twist, and information times twist of a left perturbation to those of the right
 * one. */
void covariance_to_scan(const pose *motion, const double left[36], double out[36]);
void information_to_scan(const pose *motion, const double left[36], double out[36]);
void twist_to_scan(const pose *motion, const double left[6], double out[6]);
void pull_to_scan(const pose *motion, const double left[6], double out[6]);

/* The prior of the next left twist of the motion, however far the motion is from the prior's mean: mean and
 * information. False when the covariance isn't positive definite. */
bool prior_of_twist(const align_prior *prior, const pose *motion, double mean[6], double information[36]);

#endif
