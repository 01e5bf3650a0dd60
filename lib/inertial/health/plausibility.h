/* Checks the IMU against the settings: compares its rotation and specific force with those by alignment, in running
 * sums: no heap, a few hundred operations per interval. Pure arithmetic; inertial/health/inertial_check.c feeds it and
 * acts on its findings.
 *
 * All vectors are in the IMU's axes according to the mounting in the settings, so that findings refer to the axes that
 * the caller's driver fills. The methods: regression of the gyroscope's angle on alignment's, with a bias of its own;
 * the 48 signed permutations of axes and the best orthogonal map (Horn 1987) as explanations of a misfit; the
 * correlation of both turning speeds over delays and time scales; specific force in world axes, whose mean must stay
 * constant (gravity) and which must explain the changes of velocity by alignment. */
#ifndef FATHOM_PLAUSIBILITY_H
#define FATHOM_PLAUSIBILITY_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "fathom.h"

#define PLAUSIBILITY_BINS 256 /* of 50 ms: the turning speeds that are kept to compare clocks */

/* The motion between two well-aligned frames by alignment and by the IMU. */
typedef struct {
    int64_t from_ns, to_ns;
    double turn[3];              /* alignment's rotation vector */
    double gyro[3];              /* the gyroscope's rate, integrated */
    bool has_force;              /* the fields below are set */
    double force[3];             /* mean specific force, m/s^2 */
    double imu_to_world[9];      /* at the middle of the interval, by alignment */
    double moved[3];             /* of the IMU, world, metres, by alignment */
    double speed_up[3], gone[3]; /* specific force in world axes, integrated once and twice */
} plausibility_interval;

/* The finding for one sensor, with the figures for the warning. */
typedef struct {
    fathom_imu_health health;
    double scale;  /* reading over true value; stamps' time over true time; the limit of saturation */
    double delay;  /* seconds by which stamps are late */
    double angle;  /* radians between the true mounting and the one in the settings */
    double map[9]; /* row-major: reading = scale * map * true value; signed permutation or orthogonal */
    bool mirrored; /* map is no rotation */
    int axes;      /* the axes concerned, one bit per axis */
} plausibility_finding;

/* One axis of one sensor. */
typedef struct {
    float value;      /* the last one */
    int64_t since_ns; /* since when it has been constant */
    int run;          /* number of samples since */
    double turned;    /* radians of camera rotation since then that the axis should show */
    float most;       /* the largest magnitude so far */
    float step;       /* the smallest change so far */
    int stays;        /* how often it stayed at that limit for some samples and left it */
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
    bool suspect; /* an unusual misfit, or one that a fault would explain */
    plausibility_profile seen, read;
    int64_t origin_ns; /* of the first interval */
    int clocks;        /* consecutive times that the same clock error explained the misfit */
    double clock_scale, clock_delay;

    /* accelerometer: specific force in world axes, once for each map between axes */
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

/* Takes a sample, stamp on the depth clock. accel NaN: none. */
void plausibility_sample(plausibility *p, int64_t timestamp_ns, const float gyro[3], const float accel[3]);

/* Takes a frame's stamp, whether aligned or not. */
void plausibility_frame(plausibility *p, int64_t timestamp_ns);

/* Takes the motion between two well-aligned frames. */
void plausibility_add(plausibility *p, const plausibility_interval *i);

/* Whether the IMU is unchecked or in doubt again. translation: the accelerometer counts too. */
bool plausibility_doubtful(const plausibility *p, bool translation);

/* Whether the sensor is unusable. */
bool plausibility_bad(const plausibility_finding *f);

/* Writes the finding and its remedy, without a full stop at the end. */
void plausibility_describe(const plausibility *p, bool gyro, char *text, size_t size);

#endif
