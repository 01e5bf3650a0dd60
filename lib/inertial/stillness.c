#include "inertial/stillness.h"

#include <math.h>
#include <string.h>

#define WINDOW 0.05       /* s */
#define GYRO 0.06         /* rad/s: maximum of a bias; a hand turns faster */
#define GYRO_CHANGE 0.03  /* rad/s away from the mean of the stillness so far */
#define ACCEL_CHANGE 0.25 /* m/s^2, the same */
#define BIAS_AGE 2e-4     /* rad/s/sqrt(s): random walk of a known bias */

void stillness_reset(stillness *w, double gyro_bias_sigma) {
    memset(w, 0, sizeof *w);
    w->gyro_bias_sigma = gyro_bias_sigma;
}

void stillness_end(stillness *w) {
    stillness fresh = {.gyro_bias_sigma = w->gyro_bias_sigma};
    memcpy(fresh.gyro_bias, w->gyro_bias, sizeof fresh.gyro_bias);
    *w = fresh;
}

void stillness_age(stillness *w, double seconds) {
    w->gyro_bias_sigma = sqrt(w->gyro_bias_sigma * w->gyro_bias_sigma + BIAS_AGE * BIAS_AGE * seconds);
}

/* Averaged over windows, to suppress white noise, the gyroscope at rest reads its bias only. Its mean is taken over as
 * long as the stillness lasts. */
void stillness_add(stillness *w, const double gyro[3], const double accel[3], double period,
                   double gyro_noise) {
    double before = w->samples;
    if (w->window_samples == 0 || w->window_samples * period > 10 * WINDOW) { /* or a gap */
        memset(w->window_gyro, 0, sizeof w->window_gyro);
        memset(w->window_accel, 0, sizeof w->window_accel);
        w->window_samples = 0;
    }
    w->window_samples++;
    for (int i = 0; i < 3; i++) {
        w->window_gyro[i] += gyro[i];
        w->window_accel[i] += accel[i];
    }
    if (w->window_samples * period < WINDOW) return;
    bool still = true;
    for (int i = 0; i < 3; i++) {
        double rate = w->window_gyro[i] / w->window_samples, force = w->window_accel[i] / w->window_samples;
        still = still && fabs(rate) < GYRO;
        if (before > 0 && fabs(rate - w->gyro[i] / before) > GYRO_CHANGE) still = false;
        if (before > 0 && fabs(force - w->accel[i] / before) > ACCEL_CHANGE) still = false;
    }
    if (!still) {
        stillness_end(w);
        return;
    }
    for (int i = 0; i < 3; i++) {
        w->gyro[i] += w->window_gyro[i];
        w->accel[i] += w->window_accel[i];
    }
    w->samples += w->window_samples;
    w->window_samples = 0;
    double seconds = period * w->samples;
    if (seconds < STILL_SECONDS) return;
    double sigma = gyro_noise / sqrt(seconds) + 1e-4;
    if (sigma > w->gyro_bias_sigma) return; /* the known bias is better */
    for (int i = 0; i < 3; i++) w->gyro_bias[i] = w->gyro[i] / w->samples;
    w->gyro_bias_sigma = sigma;
}
