/* Is the IMU what the settings say? Its turning and specific force against those that alignment shows, in running sums:
 * no heap, a few hundred operations an interval. Pure arithmetic; inertial/health/inertial_check.c feeds it and acts on
 * what it finds.
 *
 * All vectors are in the IMU's axes as the mounting in the settings has them, so that what is found is named in the
 * axes that the caller's driver fills. The methods: regression of the gyroscope's angle on alignment's, with a bias of
 * its own; the 48 signed permutations of axes and the best orthogonal map (Horn 1987) as explanations of a misfit; the
 * correlation of both turning speeds over delays and time scales; specific force turned into the world, which must keep
 * its mean (gravity) and give the changes of velocity that alignment shows. */
#ifndef FATHOM_PLAUSIBILITY_H
#define FATHOM_PLAUSIBILITY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fathom.h"

#define PLAUSIBILITY_BINS 256 /* of 50 ms: the turning speeds that are kept to compare clocks */

/* What both sides say of the way between two well-aligned frames. */
typedef struct {
    int64_t from_ns, to_ns;
    double turn[3];              /* alignment's rotation vector */
    double gyro[3];              /* the gyroscope's rate, integrated */
    bool has_force;              /* the rest is there */
    double force[3];             /* mean specific force, m/s^2 */
    double imu_to_world[9];      /* amid the interval, by alignment */
    double moved[3];             /* of the IMU, world, metres, by alignment */
    double speed_up[3], gone[3]; /* specific force turned into the world: once and twice integrated */
} plausibility_interval;

/* What was found of one sensor, with the numbers that the warning tells. */
typedef struct {
    fathom_imu_health health;
    double scale;  /* reading over what it should be; stamps' time over true time; the limit of saturation */
    double delay;  /* seconds that stamps come late */
    double angle;  /* radians between the true mounting and the one in the settings */
    double map[9]; /* row-major: reading = scale * map * true value; signed permutation or orthogonal */
    bool mirrored; /* map is no rotation */
    int axes;      /* the axes concerned, a bit each */
} plausibility_finding;

/* One axis of one sensor. */
typedef struct {
    float value;      /* the last one */
    int64_t since_ns; /* since when it has been that */
    int run;          /* so many samples */
    double turned;    /* radians that the camera turned meanwhile in a way that the axis should show */
    float most;       /* the largest magnitude so far */
    float step;       /* the smallest change so far */
    int stays;        /* how often it stayed there for some samples, and left */
} plausibility_axis;

/* Mean speed of turning in bins of 50 ms, the latest PLAUSIBILITY_BINS. */
typedef struct {
    int64_t newest; /* number of the bin */
    float speed[PLAUSIBILITY_BINS];
    int count[PLAUSIBILITY_BINS];
} plausibility_profile;

typedef struct {
    double mounting[9], gravity; /* v_camera = mounting * v_imu; m/s^2 */
    plausibility_finding gyro, accel;
    plausibility_axis axis[6]; /* gyroscope x y z, accelerometer x y z */
    int64_t first_ns, last_ns; /* stamps of samples */
    int64_t samples, forces;
    double force_seconds, force_length; /* |f|: time and integral */

    /* gyroscope: sums over intervals of rate integral g, alignment's turn w, length t */
    int intervals;
    double turned, noise; /* sum of |w| above noise; of the expected misfit */
    double tt, wt[3], gt[3], ww[9], gw[9], gg;
    bool suspect; /* more misfit than is usual, or some that a mistake would explain */
    plausibility_profile seen, read;
    int64_t origin_ns; /* of the first interval */
    int clocks;        /* so often in a row the same clock explained the misfit */
    double clock_scale, clock_delay;

    /* accelerometer: force turned into the world, once for each map from axes to axes */
    int forced;
    double tensor[27], force_squared;
    /* changes of velocity: alignment's d, specific force's f, t of gravity */
    bool chained;
    plausibility_interval before;
    int changes;
    double d_d, f_f, f_d, f_t[3], d_t[3], change_tt;

    /* stamps against the depth clock */
    int64_t pace_sample_ns, pace_frame_ns, samples_then;
    int odd_paces;
} plausibility;

void plausibility_start(plausibility *p, const double mounting[9], double gravity);

/* A sample, stamp on the depth clock. accel NaN: there is none. */
void plausibility_sample(plausibility *p, int64_t timestamp_ns, const float gyro[3], const float accel[3]);

/* A frame with its stamp, whether aligned or not. */
void plausibility_frame(plausibility *p, int64_t timestamp_ns);

/* The way between two frames that were aligned well: the evidence. */
void plausibility_add(plausibility *p, const plausibility_interval *i);

/* Not yet known to be right, or no longer sure. translation: the accelerometer matters too. */
bool plausibility_doubtful(const plausibility *p, bool translation);

/* The sensor can't be used. */
bool plausibility_bad(const plausibility_finding *f);

/* Says what was found and what to do, without a full stop at the end. */
void plausibility_describe(const plausibility *p, bool gyro, char *text, size_t size);

#endif
