/* Refines the IMU's mounting rotation and clock offset from the way that the camera turned: a Kalman filter of ten
 * states (orientation 3, mounting 3, offset 1, gyro bias 3) that carries the camera's orientation on by the gyroscope
 * and compares it with alignment's. Pure arithmetic; inertial/health/inertial_check.c gathers what it compares,
 * inertial/rig.c acts on what it finds.
 *
 * The states are those of Li and Mourikis 2014, "Online temporal calibration for camera-IMU systems", without
 * translation: rotation alone needs neither the lever nor gravity. */
#ifndef FATHOM_EXTRINSICS_H
#define FATHOM_EXTRINSICS_H

#include <stdbool.h>

#define RIG_STATES 10

/* What both sides say of the turn between two well-aligned frames, in camera axes as the mounting in use has them. */
typedef struct {
    double from[9], to[9]; /* alignment's: camera to world */
    double turned[9];      /* the gyroscope's, the refiner's bias taken off: later camera to earlier */
    double by_bias[9];     /* seconds: a bias b more turns it by exp(-by_bias b) */
    double rate_from[3], rate_to[3]; /* rad/s, at both ends, smoothed */
} rig_interval;

typedef struct {
    bool started;       /* there is an orientation to go on from */
    double carried[9];  /* it: camera to world; its error is on the right */
    double mounting[3]; /* v_camera = exp(mounting) v, where v has the mounting in use; radians */
    double offset;      /* seconds to be added to the stamps, beside the offset in use */
    double bias[3];     /* of the gyroscope, rad/s */
    double covariance[RIG_STATES * RIG_STATES]; /* orientation, mounting, offset, bias */
    double start[RIG_STATES];                   /* sigmas */
    double noise;   /* variance of alignment and turn, in units of what is usual */
    double misfit;  /* squared, as intervals had it lately; 1 is expected */
    double rate[3]; /* at the end of the last interval */
    int intervals;
} rig_refiner;

void rig_refiner_start(rig_refiner *r, double rotation_sigma, double offset_sigma, double bias_sigma);

/* seconds: of the interval, which begins where the last one ended. */
void rig_refiner_add(rig_refiner *r, const rig_interval *i, double seconds);

/* There is a gap between the last interval and the next. */
void rig_refiner_break(rig_refiner *r);

/* Sigma of what is found: of the mounting about a camera axis 0..2, rad, or, 3, of the offset, s. */
double rig_refiner_sigma(const rig_refiner *r, int part);

/* Hands out what is to be applied, once it stands out of its own uncertainty; it then counts as applied. */
bool rig_refiner_take(rig_refiner *r, double mounting[3], double *offset);

#endif
