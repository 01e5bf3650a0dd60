/* The texts of inertial/health/plausibility.c's findings. */
#include <math.h>
#include <stdio.h>

#include "inertial/health/plausibility.h"
#include "base/se3.h"

#define DEGREE (3.14159265358979323846 / 180)

/* "x", "x and y", "x, y and z" from a bit each. */
static const char *axes_text(int axes) {
    static const char *const names[] = {"no", "x", "y", "x and y", "z", "x and z", "y and z", "x, y and z"};
    return names[axes & 7];
}

/* What each axis reads in place of its own value. */
static void map_text(const double map[9], char *text, size_t size) {
    int mirrored = 0, moved = 0, from[3] = {0, 1, 2};
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            if (fabs(map[3 * i + j]) > 0.9) {
                from[i] = j;
                mirrored |= map[3 * i + j] < 0 ? 1 << i : 0;
                moved |= i != j ? 1 << i : 0;
            }
    if (!moved)
        snprintf(text, size, "%s mirrored", axes_text(mirrored));
    else if (!mirrored && moved != 7)
        snprintf(text, size, "%s swapped", axes_text(moved));
    else
        snprintf(text, size, "x, y, z hold %s%c, %s%c, %s%c", mirrored & 1 ? "-" : "", "xyz"[from[0]],
                 mirrored & 2 ? "-" : "", "xyz"[from[1]], mirrored & 4 ? "-" : "", "xyz"[from[2]]);
}

/* The mounting that would make the reading right: mounting map^T, as a rotation vector in degrees. */
static void mounting_text(const plausibility *p, const plausibility_finding *f, char *text, size_t size) {
    double right[9] = {0}, w[3];
    const char *mirrored = f->mirrored ? ", with all axes mirrored" : "";
    double sign = *mirrored ? -1 : 1;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++) right[3 * i + j] += sign * p->mounting[3 * i + k] * f->map[3 * j + k];
    so3_log(right, w);
    snprintf(text, size,
             "turned by %.0f degrees from its mounting in the settings%s: try imu_to_camera_rotation %.0f "
             "%.0f %.0f "
             "(degrees), or run fathom calibrate",
             (*mirrored ? 180 * DEGREE - f->angle : f->angle) / DEGREE, mirrored, w[0] / DEGREE,
             w[1] / DEGREE, w[2] / DEGREE);
}

void plausibility_describe(const plausibility *p, bool gyro, char *text, size_t size) {
    const plausibility_finding *f = gyro ? &p->gyro : &p->accel;
    const char *sensor = gyro ? "the gyroscope" : "the accelerometer", *unit = gyro ? "rad/s" : "m/s^2";
    char words[200];
    double rate = p->samples > 1 ? (double)(p->samples - 1) / (1e-9 * (double)(p->last_ns - p->first_ns)) : 0;
    switch (f->health) {
    case FATHOM_IMU_UNCHECKED: snprintf(text, size, "%s has not been checked yet", sensor); break;
    case FATHOM_IMU_GOOD: snprintf(text, size, "%s agrees with the depth frames", sensor); break;
    case FATHOM_IMU_SATURATED:
        snprintf(text, size, "%s is cut off at %.4g %s in %s: raise its range", sensor, f->scale, unit,
                 axes_text(f->axes));
        break;
    case FATHOM_IMU_UNITS:
        if (!gyro)
            snprintf(text, size,
                     "the accelerometer reads %.4g where gravity is %.4g m/s^2: it seems to be in %s",
                     f->scale * p->gravity, p->gravity,
                     fabs(log(f->scale * 9.80665)) < 0.2 ? "g (or to have gravity taken off)"
                     : fabs(log(f->scale / 100)) < 0.2   ? "milli-g or cm/s^2"
                     : fabs(log(f->scale / 1000)) < 0.2  ? "mm/s^2"
                                                         : "another unit");
        else if (f->scale > 1)
            snprintf(text, size,
                     "the gyroscope reads %.1f times the turning that the depth frames show: it is in "
                     "degrees/s, not rad/s",
                     f->scale);
        else
            snprintf(text, size,
                     "the gyroscope reads %.4f times the turning that the depth frames show: rad/s seem to "
                     "have been "
                     "taken for degrees/s",
                     f->scale);
        break;
    case FATHOM_IMU_SCALE:
        snprintf(text, size, "%s reads %.3g times what the depth frames show: check its range setting",
                 sensor, f->scale);
        break;
    case FATHOM_IMU_AXES:
        map_text(f->map, words, sizeof words);
        snprintf(text, size, "%s has its axes wrong: %s", sensor, words);
        break;
    case FATHOM_IMU_MOUNTING:
        mounting_text(p, f, words, sizeof words);
        snprintf(text, size, "%s is %s", sensor, words);
        break;
    case FATHOM_IMU_SIGN:
        snprintf(text, size,
                 gyro ? "%s has the opposite sign in all axes"
                      : "%s has the opposite sign: specific force at rest is +9.8 along up",
                 sensor);
        break;
    case FATHOM_IMU_CLOCK:
        if (fabs(log(f->scale)) > 0.1)
            snprintf(text, size,
                     "the IMU's stamps run %.3g times as fast as the depth frames': check their unit and the "
                     "sample "
                     "rate (by its stamps %.4g Hz)",
                     f->scale, rate);
        else
            snprintf(text, size,
                     "the IMU's stamps are %.2f s too %s for the depth frames: change imu_clock_offset by "
                     "%+.2f s, or "
                     "run fathom calibrate",
                     fabs(f->delay), f->delay > 0 ? "late" : "early", -f->delay);
        break;
    case FATHOM_IMU_STUCK:
        snprintf(text, size, "%s is stuck in %s at %.4g %s while the camera turns", sensor,
                 axes_text(f->axes), f->scale, unit);
        break;
    case FATHOM_IMU_UNRELATED:
        snprintf(text, size, "%s doesn't follow the turning that the depth frames show", sensor);
        break;
    }
}
