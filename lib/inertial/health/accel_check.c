/* Checks the accelerometer against alignment's rotation and translation. */
#include "inertial/health/evidence.h"
#include "inertial/health/axis_maps.h"

#include <math.h>
#include <string.h>

#define FORCE_SCATTER 0.008 /* fraction of its energy that specific force has beside gravity without a fault */
#define MEMORY_FORCES 200              /* intervals, the same for specific force */

/* Energy of specific force in world axes beside its mean, as a fraction of all, with its axes mapped by `map`. */
static double scatter_with(const plausibility *p, const double map[9]) {
    double mean[3] = {0, 0, 0};
    for (int i = 0; i < 3; i++) /* R map^T f */
        for (int j = 0; j < 3; j++)
            for (int l = 0; l < 3; l++) mean[i] += p->tensor[9 * i + 3 * j + l] * map[3 * l + j];
    double length = mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2];
    return 1 - length / p->forced / p->force_squared;
}

/* Gravity is constant in world axes while the camera turns. True when no other axes explain the force better. */
bool judge_axes(plausibility *p) {
    double map[9], best_map[9] = {0}, now, best = 1, least = 1;
    int simplest = 99;
    if (p->forced < PLENTY_INTERVALS || p->turned < ENOUGH_TURN) return false;
    signed_permutation(0, map);
    now = scatter_with(p, map);
    for (int k = 1; k < 48; k++) {
        signed_permutation(k, map);
        best = fmin(best, scatter_with(p, map));
    }
    if (now < FORCE_SCATTER || best > BETTER * now) return best > 2 * BETTER * now;
    for (int k = 1; k < 48; k++) {
        int complexity = signed_permutation(k, map);
        double scatter = scatter_with(p, map);
        if (scatter > TIE * best + 0.05 * now || complexity > simplest ||
            (complexity == simplest && scatter > least))
            continue;
        simplest = complexity;
        least = scatter;
        memcpy(best_map, map, sizeof map);
    }
    found(&p->accel, determinant(best_map) > 0 ? FATHOM_IMU_MOUNTING : FATHOM_IMU_AXES, 1, 7);
    memcpy(p->accel.map, best_map, sizeof best_map);
    p->accel.angle = angle_of(best_map);
    p->accel.mirrored = determinant(best_map) < 0;
    return false;
}

/* Changes of velocity: (p2 - p1)/T2 - (p1 - p0)/T1 = V1 - P1/T1 + P2/T2 + gravity (T1 + T2)/2, with V, P the single and
 * double integrals of specific force. The slope of the left side on the right is +1 for specific force and -1 for its
 * opposite. */
static void add_change(plausibility *p, const plausibility_interval *a, const plausibility_interval *b) {
    double t1 = 1e-9 * (double)(a->to_ns - a->from_ns), t2 = 1e-9 * (double)(b->to_ns - b->from_ns);
    double t = 0.5 * (t1 + t2);
    for (int i = 0; i < 3; i++) {
        double d = b->moved[i] / t2 - a->moved[i] / t1;
        double f = a->speed_up[i] - a->gone[i] / t1 + b->gone[i] / t2;
        p->d_d += d * d;
        p->f_f += f * f;
        p->f_d += f * d;
        p->f_t[i] += f * t;
        p->d_t[i] += d * t;
    }
    p->change_tt += t * t;
    p->changes++;
}

void judge_sign(plausibility *p) {
    double ff = p->f_f, fd = p->f_d, dd = p->d_d;
    for (int i = 0; i < 3; i++) {
        ff -= p->f_t[i] * p->f_t[i] / p->change_tt;
        fd -= p->f_t[i] * p->d_t[i] / p->change_tt;
        dd -= p->d_t[i] * p->d_t[i] / p->change_tt;
    }
    if (p->changes < PLENTY_INTERVALS || !(ff > 0) || plausibility_bad(&p->accel)) return;
    double slope = fd / ff, left = fmax(dd - slope * fd, 1e-4 * p->changes);
    double sigma = sqrt(left / (3 * p->changes - 4) / ff);
    if (sigma > 0.25 * fabs(slope) || fabs(slope) < 0.2) return;
    if (slope < 0)
        found(&p->accel, FATHOM_IMU_SIGN, slope, 7);
    else if (p->accel.health == FATHOM_IMU_UNCHECKED)
        p->accel.health = FATHOM_IMU_GOOD;
}

void add_force(plausibility *p, const plausibility_interval *e) {
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int l = 0; l < 3; l++)
                p->tensor[9 * i + 3 * j + l] += e->imu_to_world[3 * i + j] * e->force[l];
    for (int i = 0; i < 3; i++) p->force_squared += e->force[i] * e->force[i];
    p->forced++;
    if (p->chained && p->before.to_ns == e->from_ns) add_change(p, &p->before, e);
    p->before = *e;
    p->chained = true;
    if (p->forced < MEMORY_FORCES) return;
    for (int i = 0; i < 27; i++) p->tensor[i] /= 2;
    p->force_squared /= 2;
    p->forced /= 2;
    p->d_d /= 2;
    p->f_f /= 2;
    p->f_d /= 2;
    p->change_tt /= 2;
    p->changes /= 2;
    for (int i = 0; i < 3; i++) {
        p->f_t[i] /= 2;
        p->d_t[i] /= 2;
    }
}
