/* InertialEstimate (Section 3): the samples from the pushing thread to the navigator, and the navigator over time. */
#ifndef FATHOM_INERTIAL_H
#define FATHOM_INERTIAL_H

#include <stdint.h>

#include "base/arena.h"
#include "base/se3.h"
#include "fathom.h"
#include "inertial/extrinsics.h"
#include "inertial/health/plausibility.h"
#include "inertial/samples.h"
#include "inertial/timeline.h"

typedef struct {
    const fathom_config *config;
    imu_samples samples;
    double lever[3]; /* the IMU's origin in camera axes */
    bool running;    /* the navigator has a first pose */
    navigation now;  /* at the last frame or measurement */
    timeline past;
    int64_t doubts; /* number of times that the gyroscope began to contradict the poses */
    int64_t late;   /* late measurements, applied at their own time ... */
    int64_t refused; /* ... and those too late for that */
    /* inertial/health/inertial_check.c */
    bool usable, force_usable; /* from the settings; cleared when the sensor is found to be wrong */
    plausibility check;
    fathom_imu_health told[2]; /* already logged, of gyroscope and accelerometer */
    pose base, accepted;       /* the start of the current interval; the last accepted pose */
    int64_t base_ns, accepted_ns; /* INT64_MIN: none */
    double velocity[3];        /* m/s, world, from the last two accepted poses */
    bool moving;               /* velocity is valid */
    /* inertial/rig.c */
    rig_refiner refiner;
    pose awaited;          /* an aligned frame for which samples are still missing */
    int64_t awaited_ns;    /* its stamp */
    bool awaiting;         /* there is one */
    pose refined_at;       /* the last frame that went to the refiner */
    int64_t refined_at_ns; /* its stamp; INT64_MIN: none yet */
} inertial;

typedef struct {
    pose motion;                /* inv(M_from) M_to */
    double covariance[36];      /* of the motion: motion * exp(error) */
    double pose_covariance[36]; /* of the pose at to, including the error of the pose at from */
} inertial_motion;

void inertial_init(inertial *n, arena *a, const fathom_config *config);
void inertial_reset(inertial *n);

/* From one other thread, at any time. */
int inertial_push(inertial *n, const fathom_imu_sample *sample);

/* Moves the pushed samples into the history. */
void inertial_drain(inertial *n);

/* To be called before a frame, after the samples that arrived before it: corrects the stamps after a leap of a
 * clock. */
void inertial_follow_clock(inertial *n, int64_t frame_ns);

/* The camera's motion between two stamps by inertia alone. FATHOM_OK, or FATHOM_ERROR_NO_DATA when there are neither
 * samples nor an accepted pose. */
int inertial_estimate(inertial *n, int64_t from_ns, int64_t to_ns, inertial_motion *out);

/* Propagates the state to the measurement's time and corrects it. A measurement older than the state is applied at its
 * own time: the state goes back to the moment before, and later measurements are applied again. FATHOM_OK;
 * FATHOM_ERROR_NO_DATA before the first pose; FATHOM_ERROR_TIME for one that is older than the timeline, which is left
 * out and counted. */
int inertial_measure(inertial *n, const measurement *m);

/* For a frame whose pose wasn't accepted: propagates the navigator to its stamp. */
void inertial_advance(inertial *n, int64_t timestamp_ns);

/* A frame's accepted pose corrects the navigator (the first one starts it); information and pull: see
 * measurement_of_pose. sound: alignment is beyond doubt, so that its difference from inertia shows how good the IMU
 * is. */
int inertial_correct(inertial *n, const pose *accepted, const double information[36], const double pull[6], bool sound,
                     int64_t timestamp_ns);

/* The IMU's pose of a camera pose. */
pose inertial_imu_pose(const inertial *n, const pose *camera);

/* Fills in the counters of inertial samples. */
void inertial_count(const inertial *n, fathom_counters *counters);

/* inertial/health/inertial_check.c: checks the IMU against the settings. aligned: a frame's pose by alignment; NULL:
 * none that is trusted in all directions. accepted: it is the frame's pose. Warns, and stops using a faulty sensor. */
void inertial_check(inertial *n, const pose *aligned, bool accepted, int64_t timestamp_ns);
void inertial_check_reset(inertial *n);

/* inertial/rig.c: resets rotation and clock offset to the settings; refines them with the motion from the last
 * well-aligned frame to this one (NULL: nothing to compare); reports them. */
void inertial_rig_reset(inertial *n);
void inertial_rig_add(inertial *n, const rig_interval *i, const pose *aligned, int64_t timestamp_ns);
void inertial_rig(const inertial *n, fathom_rig *rig);

/* While the IMU is unchecked: the pose that the velocity of the accepted poses predicts. False when it isn't needed
 * (seed: the inertial prediction) or no velocity is known. */
bool inertial_second_guess(inertial *n, const pose *seed, int64_t timestamp_ns, pose *guess,
                           double covariance[36]);

#endif
