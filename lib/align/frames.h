/* Alignment solves for a left twist in the model camera's axes; the rest of the library speaks of errors on the right
 * of a motion, in the scan camera's. What the one says in terms of the other: motion * exp(e) = exp(Ad(motion) e) *
 * motion. */
#ifndef FATHOM_FRAMES_H
#define FATHOM_FRAMES_H

#include <stdbool.h>

#include "base/se3.h"

/* What is known of a motion before the scan is looked at, wherever alignment starts: a mean, and mean * exp(error). */
typedef struct {
    pose mean;
    double covariance[36];
} align_prior;

/* Of a left twist: its covariance, its information, and an information times a way, as those of the error on the
 * right. */
void covariance_to_scan(const pose *motion, const double left[36], double out[36]);
void information_to_scan(const pose *motion, const double left[36], double out[36]);
void pull_to_scan(const pose *motion, const double left[6], double out[6]);

/* The prior's word on the next left twist of the motion, however far that is from the mean: where it should lead, and
 * the information. False when the covariance isn't positive definite. */
bool prior_of_twist(const align_prior *prior, const pose *motion, double mean[6], double information[36]);

#endif
