/* Refines the IMU's mounting rotation and clock offset from the camera's rotation: a Kalman filter of ten states
 * (orientation 3, mounting 3, offset 1, gyro bias 3) that propagates the camera's orientation with the gyroscope and
 * compares it with alignment's. Pure arithmetic; inertial/health/inertial_check.c gathers its input, inertial/rig.c
 * applies its results.
 *
 * The states are those of Li and Mourikis 2014, "Online temporal calibration for camera-IMU systems", without
 * translation: rotation alone needs neither the lever nor gravity. */
#ifndef FATHOM_EXTRINSICS_H
#define FATHOM_EXTRINSICS_H

#include <stdbool.h>

#define RIG_STATES 10

/* The rotation between two well-aligned frames by alignment and by the gyroscope, in camera axes according to the
 * mounting in use. */
typedef struct {
    double from[9], to[9]; /* alignment's: camera to world */
    double turned[9];      /* the gyroscope's, less the refiner's bias: later camera to earlier */
    double by_bias[9];     /* seconds: a further bias b turns it by exp(-by_bias b) */
    double rate_from[3], rate_to[3]; /* rad/s, at both ends, smoothed */
} rig_interval;

typedef struct {
    bool started;       /* carried is valid */
    double carried[9];  /* orientation, camera to world; its error is on the right */
    double mounting[3]; /* v_camera = exp(mounting) v, where v has the mounting in use; radians */
    double offset;      /* seconds to be added to the stamps, in addition to the offset in use */
    double bias[3];     /* of the gyroscope, rad/s */
    double covariance[RIG_STATES * RIG_STATES]; /* orientation, mounting, offset, bias */
    double start[RIG_STATES];                   /* sigmas */
    double noise;   /* variance of alignment and rotation, in units of the usual one */
    double misfit;  /* mean normalised innovation squared of recent intervals; 1 is expected */
    double rate[3]; /* at the end of the last interval */
    int intervals;
} rig_refiner;

void rig_refiner_start(rig_refiner *r, double rotation_sigma, double offset_sigma, double bias_sigma);

/* seconds: of the interval, which begins where the last one ended. */
void rig_refiner_add(rig_refiner *r, const rig_interval *i, double seconds);

/* Marks a gap between the last interval and the next. */
void rig_refiner_break(rig_refiner *r);

/* Sigma of the estimate: of the mounting about camera axis 0..2, rad, or, 3, of the offset, s. */
double rig_refiner_sigma(const rig_refiner *r, int part);

/* Writes the correction to apply, once it exceeds its own uncertainty; it then counts as applied. */
bool rig_refiner_take(rig_refiner *r, double mounting[3], double *offset);

#endif
