/* Noise that is smooth over the picture and in time. */
#ifndef FATHOM_SMOOTH_NOISE_H
#define FATHOM_SMOOTH_NOISE_H

#include <stdbool.h>
#include <stdint.h>

/* Adds scale times a field of mean 0 and variance 1, about normal, to width x height values. Pixels much farther apart
 * than pitch, and times much farther apart than 1, are independent; age, from 0 on, counts such times. A whole age
 * shares nothing with the next. False when out of memory. */
bool smooth_noise_add(float *values, int width, int height, double pitch, double age, double scale,
                      uint64_t key);

/* The same for a single value. */
double smooth_noise_at(double age, uint64_t key);

#endif
