/* Detects from the samples alone that the IMU may be at rest, and estimates the gyroscope's bias then. */
#ifndef FATHOM_STILLNESS_H
#define FATHOM_STILLNESS_H

#include <stdbool.h>
#include <stdint.h>

#include "base/se3.h"

#define STILL_SECONDS 0.4 /* this long without motion is a still start */

/* Sums over the current stillness, over those of its samples that have corrected the navigator, and over the window
 * being filled. */
typedef struct {
    int samples, used, window_samples;
    double gyro[3], accel[3], used_gyro[3];
    double window_gyro[3], window_accel[3];
    bool anchored; /* poses are watched too, since: */
    pose anchor;
    int64_t anchor_ns;
    double gyro_bias[3], gyro_bias_sigma; /* rad/s, camera axes: from stillness before the navigator starts */
} stillness;

/* Forgets everything; the bias is zero within gyro_bias_sigma. */
void stillness_reset(stillness *w, double gyro_bias_sigma);

/* Ages the bias: its sigma grows. */
void stillness_age(stillness *w, double seconds);

/* The next sample, in camera axes. period: seconds between samples; gyro_noise: rad/s/sqrt(Hz). */
void stillness_add(stillness *w, const double gyro[3], const double accel[3], double period,
                   double gyro_noise);

/* Ends the stillness after motion or a gap; the bias stays. */
void stillness_end(stillness *w);

#endif
