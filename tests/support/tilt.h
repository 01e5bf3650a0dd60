/* For tests: whether a gyroscope and an accelerometer agree about rotations. */
#ifndef TILT_H
#define TILT_H

/* The angle between two directions, radians. */
double tilt_angle(const double a[3], const double b[3]);

/* Turns "up" in the device's axes as rates turn the device: du/dt = -rate x u. */
void tilt_turn(double up[3], const double rate[3], double seconds);

#endif
