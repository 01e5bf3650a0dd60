/* Between the files that gather and judge the evidence of inertial/health/plausibility.h. */
#ifndef FATHOM_EVIDENCE_H
#define FATHOM_EVIDENCE_H

#include "inertial/health/plausibility.h"

#define PI 3.14159265358979323846
#define DEGREE (PI / 180)
#define BIN_NS 50000000
#define ENOUGH_TURN (20 * DEGREE) /* turned in all */
#define PLENTY_INTERVALS 15
#define TURN_NOISE (0.3 * DEGREE) /* turning that alignment sees where there is none */
#define BETTER 0.25         /* fraction of the misfit left by a clearly better explanation */
#define CONSTANT 10                    /* samples in a row that are the same: more than chance */

/* Sets a finding, unless one is there that rules the sensor out. */
void found(plausibility_finding *f, fathom_imu_health health, double scale, int axes);

/* sample_checks.c */
void profile_add(plausibility_profile *q, int64_t timestamp_ns, double speed);
void judge_constant(plausibility *p, const plausibility_interval *e);

/* gyro_check.c */
void add_turn(plausibility *p, const plausibility_interval *e);
void judge_gyro(plausibility *p);

/* accel_check.c */
void add_force(plausibility *p, const plausibility_interval *e);
bool judge_axes(plausibility *p); /* true when no other axes explain the force better */
void judge_sign(plausibility *p);

#endif
