/* Checks the gyroscope against alignment's rotation. */
#include "inertial/health/evidence.h"
#include "inertial/health/axis_maps.h"

#include <math.h>
#include <string.h>

/* Limits for decisions. Correct real rigs have a misfit of 0.1 to 2 times the expected one. */
#define ENOUGH_INTERVALS 6
#define PLENTY_TURN (60 * DEGREE) /* for faults that are harder to distinguish */
#define AMPLE_TURN (90 * DEGREE) /* for the finding when nothing else explains the misfit */
#define AMPLE_INTERVALS 25
#define INTERVAL_NOISE 0.01       /* rad: misfit of a good rig over an interval, and ... */
#define SCALE_NOISE 0.05          /* ... in parts of the turn */
#define BIAS_SIGMA 0.1            /* rad/s: sigma of a bias; beyond three of it the reading isn't explained by a bias */
#define REFUTED 4                 /* times the expected misfit */
#define SUSPECT 2
#define EXPLAINED 0.15      /* fraction of the reading's energy that may stay unexplained */
#define HINT 0.15           /* times the expected misfit: minimum that needs an explanation */
#define TILT (10 * DEGREE)  /* smaller errors of the mounting are tolerated */
/* a delay must be found this many consecutive times: a growing one is a wrong rate of the clock */
#define CLOCKS 5
#define MEMORY_TURN (360 * DEGREE)     /* older evidence fades */

/* The sums less the part that a bias explains. */
typedef struct {
    double ww, gw[9], gg;
} moments;

static moments without_bias(const plausibility *p) {
    moments m = {0, {0}, p->gg};
    double tt = p->tt + INTERVAL_NOISE * INTERVAL_NOISE / (BIAS_SIGMA * BIAS_SIGMA);
    for (int i = 0; i < 3; i++) {
        m.ww += p->ww[4 * i] - p->wt[i] * p->wt[i] / tt;
        m.gg -= p->gt[i] * p->gt[i] / tt;
        for (int j = 0; j < 3; j++) m.gw[3 * i + j] = p->gw[3 * i + j] - p->gt[i] * p->wt[j] / tt;
    }
    return m;
}

/* Correlation of both turning speeds if the stamps of samples run `scale` times as fast and are `delay` late; *gain:
 * the gyroscope's speed over alignment's. 0 where too little overlaps. */
static double correlation(const plausibility *p, double scale, double delay, double *gain) {
    const plausibility_profile *a = &p->seen, *b = &p->read;
    double n = 0, x = 0, y = 0, xx = 0, yy = 0, xy = 0, origin = (double)p->origin_ns / BIN_NS;
    for (int64_t k = a->newest - PLAUSIBILITY_BINS + 1; k <= a->newest; k++) {
        int64_t l = (int64_t)floor(origin + scale * ((double)k + 0.5 - origin) + delay * 1e9 / BIN_NS);
        unsigned i = (unsigned)((uint64_t)k % PLAUSIBILITY_BINS),
                 j = (unsigned)((uint64_t)l % PLAUSIBILITY_BINS);
        if (l > b->newest || l <= b->newest - PLAUSIBILITY_BINS || !a->count[i] || !b->count[j]) continue;
        double u = a->speed[i], v = b->speed[j];
        n++;
        x += u;
        y += v;
        xx += u * u;
        yy += v * v;
        xy += u * v;
    }
    if (n < 30) return 0;
    xx -= x * x / n;
    yy -= y * y / n;
    xy -= x * y / n;
    if (!(xx > 0 && yy > 0)) return 0;
    *gain = xy / xx;
    return xy / sqrt(xx * yy);
}

/* Checks for a wrong clock: delayed, or at a wrong rate. True also while it isn't certain which. */
static bool find_clock(plausibility *p) {
    static const double scales[] = {1, 0.5, 2, 0.25, 4};
    double gain = 0, best = 0, now = correlation(p, 1, 0, &gain), scale = 1, delay = 0;
    for (int k = 0; k < 5; k++)
        for (double d = -1.5; d < 1.51; d += 0.05) {
            double r = correlation(p, scales[k], d, &gain);
            if (gain < 0.6 || gain > 1.6 || r < best) continue;
            best = r;
            scale = scales[k];
            delay = d;
        }
    if (best < 0.85 || best < now + 0.15) return false;
    bool again = scale == p->clock_scale && fabs(delay - p->clock_delay) < 0.06;
    p->clocks = again ? p->clocks + 1 : 1;
    p->clock_scale = scale;
    if (!again) p->clock_delay = delay;
    if (p->clocks < CLOCKS) return true;
    found(&p->gyro, FATHOM_IMU_CLOCK, scale, 7);
    p->gyro.delay = delay;
    return true;
}

void judge_gyro(plausibility *p) {
    plausibility_finding *f = &p->gyro;
    if (p->intervals < ENOUGH_INTERVALS || p->turned < ENOUGH_TURN || plausibility_bad(f)) return;
    bool plenty = p->intervals >= PLENTY_INTERVALS && p->turned > PLENTY_TURN;
    moments m = without_bias(p);
    double same = m.gw[0] + m.gw[4] + m.gw[8], misfit = m.gg - 2 * same + m.ww;
    double scatter = m.ww * m.gg, map[9], turned_map[9], mirrored[9];
    int rivals = 0;
    double t = best_permutation(m.gw, scatter, map, &rivals), scale = t / m.ww;
    for (int i = 0; i < 9; i++) mirrored[i] = -m.gw[i];
    double r = best_rotation(m.gw, turned_map), s = best_rotation(mirrored, mirrored);
    if (s > 1.05 * r) {
        r = s;
        for (int i = 0; i < 9; i++) turned_map[i] = -mirrored[i];
    }
    double tilt = angle_of(turned_map);

    double explained = fmin(m.gg - 2 * t + m.ww, tilt > TILT ? m.gg - 2 * r + m.ww : misfit);
    double suspicion = misfit / p->noise;
    bool hint = suspicion > HINT && explained < BETTER * misfit;
    p->suspect = suspicion > SUSPECT || (suspicion > HINT && explained < 2 * BETTER * misfit);
    if (suspicion < REFUTED && !hint) {
        if (!p->suspect && f->health == FATHOM_IMU_UNCHECKED) f->health = FATHOM_IMU_GOOD;
        return;
    }
    if (f->health == FATHOM_IMU_SATURATED) return; /* that explains it, and it is right between its limits */

    if (m.gg < 0.1 * m.ww && same > 0 && fabs(log(57.3 * same / m.ww)) < 0.4) { /* its noise hides the axes */
        if (plenty) found(f, FATHOM_IMU_UNITS, same / m.ww, 7);
        return;
    }
    double left = 1 - t * t / scatter, left_turned = 1 - r * r / scatter; /* of the reading's energy */
    bool identity = map[0] + map[4] + map[8] > 2.5, degrees = fabs(log(scale / 57.3)) < 0.25;
    bool factor = degrees || (scale > 0.6 && scale < 1.6);
    if (tilt > TILT && left_turned < EXPLAINED && left_turned < 0.5 * left && left - left_turned > 0.01) {
        if (!plenty) return;
        found(f, FATHOM_IMU_MOUNTING, r / m.ww, 7);
        memcpy(f->map, turned_map, sizeof turned_map);
    } else if (left < EXPLAINED && factor && !(identity && !degrees)) {
        if (rivals > 0 && !plenty) return;
        bool proper = determinant(map) > 0, negated = map[0] + map[4] + map[8] < -2.5;
        found(f,
              identity  ? FATHOM_IMU_UNITS
              : negated ? FATHOM_IMU_SIGN
              : proper  ? FATHOM_IMU_MOUNTING
                        : FATHOM_IMU_AXES,
              scale, 7);
        memcpy(f->map, map, sizeof map);
    } else if (plenty && !find_clock(p) && p->intervals >= AMPLE_INTERVALS && p->turned > AMPLE_TURN) {
        found(f, left < EXPLAINED && identity ? FATHOM_IMU_SCALE : FATHOM_IMU_UNRELATED, scale, 7);
        memcpy(f->map, map, sizeof map);
    }
    f->angle = angle_of(f->map);
    f->mirrored = determinant(f->map) < 0;
}

void add_turn(plausibility *p, const plausibility_interval *e) {
    double t = 1e-9 * (double)(e->to_ns - e->from_ns), turn = 0;
    for (int i = 0; i < 3; i++) {
        turn += e->turn[i] * e->turn[i];
        p->gg += e->gyro[i] * e->gyro[i];
        p->wt[i] += e->turn[i] * t;
        p->gt[i] += e->gyro[i] * t;
        for (int j = 0; j < 3; j++) {
            p->ww[3 * i + j] += e->turn[i] * e->turn[j];
            p->gw[3 * i + j] += e->gyro[i] * e->turn[j];
        }
    }
    p->tt += t * t;
    p->noise += 3 * (INTERVAL_NOISE * INTERVAL_NOISE + SCALE_NOISE * SCALE_NOISE * turn);
    p->turned += fmax(0, sqrt(turn) - TURN_NOISE);
    p->intervals++;
    if (p->origin_ns == 0) p->origin_ns = e->from_ns;
    for (int64_t s = e->from_ns; s < e->to_ns; s += BIN_NS) profile_add(&p->seen, s, sqrt(turn) / t);
    if (p->turned < MEMORY_TURN) return;
    p->turned /= 2;
    p->noise /= 2;
    p->intervals /= 2;
    p->tt /= 2;
    p->gg /= 2;
    for (int i = 0; i < 3; i++) {
        p->wt[i] /= 2;
        p->gt[i] /= 2;
    }
    for (int i = 0; i < 9; i++) {
        p->ww[i] /= 2;
        p->gw[i] /= 2;
    }
}
