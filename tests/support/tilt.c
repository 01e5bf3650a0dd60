#include "tilt.h"

#include <math.h>

double tilt_angle(const double a[3], const double b[3]) {
    const double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    const double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    return atan2(sqrt(cross[0] * cross[0] + cross[1] * cross[1] + cross[2] * cross[2]), dot);
}

void tilt_turn(double up[3], const double rate[3], double seconds) {
    const int steps = 8;
    for (int s = 0; s < steps; s++) {
        const double h = seconds / steps;
        const double u[3] = {up[0], up[1], up[2]};
        up[0] -= h * (rate[1] * u[2] - rate[2] * u[1]);
        up[1] -= h * (rate[2] * u[0] - rate[0] * u[2]);
        up[2] -= h * (rate[0] * u[1] - rate[1] * u[0]);
    }
}
