#include "inertial/health/evidence.h"

#include <math.h>
#include <string.h>

#define FORCES_MOST 30                 /* intervals after which a wrong accelerometer would have been found */

void plausibility_start(plausibility *p, const double mounting[9], double gravity) {
    memset(p, 0, sizeof *p);
    memcpy(p->mounting, mounting, sizeof p->mounting);
    p->gravity = gravity;
}

bool plausibility_bad(const plausibility_finding *f) {
    return f->health >= FATHOM_IMU_UNITS;
}

void found(plausibility_finding *f, fathom_imu_health health, double scale, int axes) {
    if (plausibility_bad(f)) return;
    f->health = health;
    f->scale = scale;
    f->axes = axes;
}

void plausibility_add(plausibility *p, const plausibility_interval *e) {
    judge_constant(p, e);
    add_turn(p, e);
    judge_gyro(p);
    if (!e->has_force) return;
    add_force(p, e);
    if (plausibility_bad(&p->accel)) return;
    bool sure = !p->suspect && (p->gyro.health == FATHOM_IMU_GOOD || p->gyro.health == FATHOM_IMU_SATURATED);
    for (int i = 3; i < 6; i++) sure = sure && p->axis[i].run < CONSTANT;
    if (sure && judge_axes(p)) judge_sign(p); /* otherwise a wrong clock may have spoilt all sums */
}

bool plausibility_doubtful(const plausibility *p, bool translation) {
    if (plausibility_bad(&p->gyro)) return false; /* no doubt at all */
    bool doubt = p->gyro.health == FATHOM_IMU_UNCHECKED || p->suspect;
    for (int i = 0; i < 3; i++) doubt = doubt || p->axis[i].run >= CONSTANT;
    bool used = translation && !plausibility_bad(&p->accel);
    return doubt || (used && p->accel.health == FATHOM_IMU_UNCHECKED && p->forced < FORCES_MOST);
}
