/* Values of a picture, width x height floats, within windows about each pixel; windows end at the picture's edge. */
#ifndef FATHOM_WINDOW_H
#define FATHOM_WINDOW_H

/* Sums over all pixels above and left: (width + 1) x (height + 1). */
struct window_sums {
    int width, height;
    double *sums;
};

void window_sum(const struct window_sums *sums, const float *values);

/* The mean over size x size pixels about one; between whole sizes it changes smoothly. */
double window_mean(const struct window_sums *sums, int x, int y, double size);

/* out: the least, or greatest, of each pixel's window, which reaches so many pixels to all sides. scratch: as large as
 * out, which may be the values themselves. */
void window_least(const float *values, int width, int height, int reach, float *scratch, float *out);
void window_greatest(const float *values, int width, int height, int reach, float *scratch, float *out);

#endif
