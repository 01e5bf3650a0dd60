#include "inertial/health/plausibility.h"

#include <math.h>
#include <string.h>

#define PI 3.14159265358979323846
#define DEGREE (PI / 180)
#define BIN_NS 50000000

/* How sure is sure enough. Real rigs that are right have a misfit of 0.1 to 2 times the expected one. */
#define ENOUGH_TURN (20 * DEGREE) /* turned in all */
#define ENOUGH_INTERVALS 6
#define PLENTY_TURN (60 * DEGREE) /* for what is told apart less easily */
#define PLENTY_INTERVALS 15
#define AMPLE_TURN (90 * DEGREE) /* for what is said when nothing else explains it */
#define AMPLE_INTERVALS 25
#define TURN_NOISE (0.3 * DEGREE) /* turning that alignment sees where there is none */
#define INTERVAL_NOISE 0.01       /* rad: misfit of a good rig over an interval, and ... */
#define SCALE_NOISE 0.05          /* ... in parts of the turn */
#define BIAS_SIGMA 0.1            /* rad/s: a bias beyond three of these is no bias */
#define REFUTED 4                 /* times the expected misfit */
#define SUSPECT 2
#define EXPLAINED 0.15      /* of the reading's energy may stay unexplained */
#define BETTER 0.25         /* of the misfit is left by what explains it clearly better */
#define HINT 0.15           /* times the expected misfit: worth being explained */
#define TILT (10 * DEGREE)  /* a mounting that is off by less is no mistake */
#define TIE 1.3             /* explanations that leave this times more, and */
#define TIE_LEAST 0.002     /* of the energy, are the same: the simplest is told */
#define PACE_SECONDS 1.5    /* a stretch to compare the clocks' paces over */
#define PACES 3             /* so many odd ones in a row */
#define CLOCKS 5            /* a delay must be found so many times in a row: one that grows is a pace */
#define FORCE_SCATTER 0.008 /* of its energy specific force has beside gravity when nothing is wrong */
#define MEMORY_TURN (360 * DEGREE)     /* older evidence fades */
#define FORCES_MOST 30                 /* intervals: by then a wrong accelerometer would have shown */
#define MEMORY_FORCES 200              /* intervals, the same for specific force */
#define CONSTANT 10                    /* samples in a row that are the same: more than chance */
#define STUCK_TURN (8 * DEGREE)        /* a constant gyroscope axis while the camera turns about it */
#define STUCK_FORCE_TURN (30 * DEGREE) /* a constant accelerometer axis while the camera turns at all */
#define STAY 4                         /* samples in a row at the largest value: a stay at the limit */
#define STAYS 3                        /* so many stays make a limit */
#define COARSE 0.01f     /* readings in steps of more of their maximum stay there of themselves */
#define LIMIT_GYRO 0.3   /* rad/s, and */
#define LIMIT_ACCEL 14.0 /* m/s^2: no sensor's range ends below */

void plausibility_start(plausibility *p, const double mounting[9], double gravity) {
    memset(p, 0, sizeof *p);
    memcpy(p->mounting, mounting, sizeof p->mounting);
    p->gravity = gravity;
}

bool plausibility_bad(const plausibility_finding *f) {
    return f->health >= FATHOM_IMU_UNITS;
}

static void found(plausibility_finding *f, fathom_imu_health health, double scale, int axes) {
    if (plausibility_bad(f)) return;
    f->health = health;
    f->scale = scale;
    f->axes = axes;
}

/* ---- single samples: stuck, saturated, units of specific force ----------------------------------------------------- */

static void profile_add(plausibility_profile *q, int64_t timestamp_ns, double speed) {
    int64_t bin = timestamp_ns / BIN_NS;
    if (q->newest == 0 || bin > q->newest + PLAUSIBILITY_BINS || bin + PLAUSIBILITY_BINS <= q->newest) {
        memset(q->count, 0, sizeof q->count);
        q->newest = bin;
    }
    while (q->newest < bin) q->count[(uint64_t)++q->newest % PLAUSIBILITY_BINS] = 0;
    unsigned i = (unsigned)((uint64_t)bin % PLAUSIBILITY_BINS);
    q->speed[i] = (float)((q->speed[i] * q->count[i] + speed) / (q->count[i] + 1));
    q->count[i]++;
}

static bool at_limit(const plausibility_axis *a, double least) {
    return fabsf(a->value) == a->most && a->most > least;
}

static void stay_at_limit(plausibility *p, int which, int times) {
    plausibility_finding *f = which < 3 ? &p->gyro : &p->accel;
    plausibility_axis *a = &p->axis[which];
    a->stays += times;
    if (a->stays < STAYS || f->health > FATHOM_IMU_SATURATED) return;
    if (f->health < FATHOM_IMU_SATURATED) found(f, FATHOM_IMU_SATURATED, a->most, 0);
    f->axes |= 1 << which % 3;
}

static void watch_axis(plausibility *p, int which, int64_t timestamp_ns, float value) {
    plausibility_axis *a = &p->axis[which];
    float magnitude = fabsf(value);
    if (a->run > 0 && value == a->value) {
        a->run += a->run < 1000000;
        return;
    }
    if (a->run > 0 && (a->step == 0 || fabsf(value - a->value) < a->step)) a->step = fabsf(value - a->value);
    if (a->run >= STAY && magnitude < a->most && at_limit(a, which < 3 ? LIMIT_GYRO : LIMIT_ACCEL) &&
        a->step < COARSE * a->most)
        stay_at_limit(p, which, 1);
    if (magnitude > a->most) {
        a->most = magnitude;
        a->stays = 0;
    }
    a->value = value;
    a->since_ns = timestamp_ns;
    a->run = 1;
    a->turned = 0;
}

/* The length of specific force is gravity's, on the average of a second. */
static void judge_units(plausibility *p) {
    double ratio = p->force_length / p->force_seconds / p->gravity;
    static const double usual[] = {1 / 9.80665, 100, 1000}; /* g; milli-g or cm/s^2; mm/s^2 */
    bool sure = p->force_seconds > 1;
    for (size_t i = 0; i < sizeof usual / sizeof *usual; i++)
        sure = sure || fabs(log(ratio / usual[i])) < 0.2;
    if (p->force_seconds < 0.25 || !sure || (ratio > 0.5 && ratio < 2)) return;
    found(&p->accel, FATHOM_IMU_UNITS, ratio, 7);
}

void plausibility_sample(plausibility *p, int64_t timestamp_ns, const float gyro[3], const float accel[3]) {
    double dt = 1e-9 * (double)(timestamp_ns - p->last_ns);
    bool force = isfinite(accel[0] + accel[1] + accel[2]);
    for (int i = 0; i < 3; i++) {
        watch_axis(p, i, timestamp_ns, gyro[i]);
        if (force) watch_axis(p, 3 + i, timestamp_ns, accel[i]);
    }
    profile_add(&p->read, timestamp_ns,
                sqrt((double)gyro[0] * gyro[0] + (double)gyro[1] * gyro[1] + (double)gyro[2] * gyro[2]));
    if (force && p->samples > 0 && dt > 0 && dt < 0.1 && p->gravity > 1 &&
        p->accel.health < FATHOM_IMU_UNITS) {
        p->force_seconds += dt;
        p->force_length += dt * sqrt((double)accel[0] * accel[0] + (double)accel[1] * accel[1] +
                                     (double)accel[2] * accel[2]);
        judge_units(p);
        if (p->force_seconds > 4) {
            p->force_seconds /= 2;
            p->force_length /= 2;
        }
    }
    if (p->samples++ == 0) p->first_ns = timestamp_ns;
    p->last_ns = timestamp_ns;
}

/* Both clocks go on at the same pace, however samples are delayed. One stretch that is odd is a jump, or a delivery in
 * bursts; several in a row are a pace. */
void plausibility_frame(plausibility *p, int64_t timestamp_ns) {
    if (p->samples == 0) return;
    bool none = p->samples == p->samples_then; /* nothing has come: nothing to compare */
    double frames = 1e-9 * (double)(timestamp_ns - p->pace_frame_ns);
    double samples = 1e-9 * (double)(p->last_ns - p->pace_sample_ns);
    bool begun = p->samples_then > 0 && !none;
    p->samples_then = p->samples;
    if (begun && frames < PACE_SECONDS) return;
    p->odd_paces = begun && fabs(log(fmax(samples, 1e-6) / frames)) > 0.35 ? p->odd_paces + 1 : 0;
    if (p->odd_paces >= PACES) found(&p->gyro, FATHOM_IMU_CLOCK, samples / frames, 7);
    p->pace_frame_ns = timestamp_ns;
    p->pace_sample_ns = p->last_ns;
}

/* ---- the gyroscope against alignment's turning --------------------------------------------------------------------- */

/* An axis that says the same all the time while the camera turns: stuck, or at its limit. A reading that is constant because
 * the turning is so isn't either. */
static void judge_constant(plausibility *p, const plausibility_interval *e) {
    double seconds = 1e-9 * (double)(e->to_ns - e->from_ns), f = 0;
    for (int i = 0; i < 3; i++) f += e->force[i] * e->force[i];
    f = sqrt(f);
    for (int i = 0; i < 6; i++) {
        plausibility_axis *a = &p->axis[i];
        int j = (i + 1) % 3, k = (i + 2) % 3;
        if (a->run < CONSTANT || a->since_ns > e->from_ns) continue;
        if (i < 3) {
            double turn = e->turn[i] * (a->value < 0 ? -1 : 1), read = fabsf(a->value) * seconds;
            if (fabs(turn - read) < 0.3 * fabs(turn)) continue;
            if (turn > 1.15 * read + 2 * TURN_NOISE && at_limit(a, LIMIT_GYRO)) {
                stay_at_limit(p, i, STAYS);
                continue;
            }
            a->turned += fmax(0, fabs(turn) - TURN_NOISE);
            if (a->turned > STUCK_TURN) found(&p->gyro, FATHOM_IMU_STUCK, a->value, 1 << i);
        } else if (e->has_force && f > 0) { /* gravity goes by in the IMU's axes: -turn x force */
            a->turned += fabs(e->turn[j] * e->force[k] - e->turn[k] * e->force[j]) / f;
            if (a->turned > STUCK_FORCE_TURN) found(&p->accel, FATHOM_IMU_STUCK, a->value, 1 << i % 3);
        }
    }
}

/* The sums without what a bias explains. */
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

static double explained_by(const double map[9], const double gw[9]) {
    double sum = 0;
    for (int i = 0; i < 9; i++) sum += map[i] * gw[i];
    return sum;
}

static double determinant(const double m[9]) {
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}

/* The k-th of the 48 signed permutations, and how unlikely a mistake it is. */
static int signed_permutation(int k, double map[9]) {
    static const int order[6][3] = {{0, 1, 2}, {1, 0, 2}, {0, 2, 1}, {2, 1, 0}, {1, 2, 0}, {2, 0, 1}};
    const int *o = order[k / 8];
    int signs = k % 8, negative = (signs & 1) + (signs >> 1 & 1) + (signs >> 2);
    memset(map, 0, 9 * sizeof *map);
    for (int i = 0; i < 3; i++) map[3 * i + o[i]] = signs >> i & 1 ? -1 : 1;
    if (k / 8 == 0) return negative == 3 ? 1 : negative;
    return determinant(map) > 0 ? 3 : k < 32 && negative == 0 ? 1 : 4;
}

/* The likeliest signed permutation: the simplest of those that leave hardly more unexplained than the best does. Returns its
 * sum; *rivals: so many others are as simple. */
static double best_permutation(const double gw[9], double scatter, double best_map[9], int *rivals) {
    double map[9], most = 0, sum = 0;
    int simplest = 99;
    for (int k = 0; k < 48; k++) {
        signed_permutation(k, map);
        most = fmax(most, explained_by(map, gw));
    }
    double bound = TIE * (1 - most * most / scatter) + TIE_LEAST;
    signed_permutation(0, best_map);
    for (int k = 0; k < 48; k++) {
        int complexity = signed_permutation(k, map);
        double t = explained_by(map, gw);
        if (t <= 0 || 1 - t * t / scatter > bound) continue;
        *rivals = complexity < simplest ? 0 : *rivals + 1;
        if (complexity < simplest || (complexity == simplest && t > sum)) {
            simplest = complexity;
            sum = t;
            memcpy(best_map, map, sizeof map);
        }
    }
    return sum;
}

/* The rotation R with the largest sum of R .* m (Horn 1987, "Closed-form solution of absolute orientation using unit
 * quaternions", Section 4), by Jacobi's method on the 4x4 matrix. Returns that sum. */
static double best_rotation(const double m[9], double map[9]) {
    double a[4][4] = {{m[0] + m[4] + m[8], m[7] - m[5], m[2] - m[6], m[3] - m[1]},
                      {0, m[0] - m[4] - m[8], m[1] + m[3], m[2] + m[6]},
                      {0, 0, m[4] - m[0] - m[8], m[5] + m[7]},
                      {0, 0, 0, m[8] - m[0] - m[4]}};
    double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < i; j++) a[i][j] = a[j][i];
    for (int sweep = 0; sweep < 12; sweep++)
        for (int i = 0; i < 4; i++)
            for (int j = i + 1; j < 4; j++) {
                if (fabs(a[i][j]) < 1e-300) continue;
                double angle = 0.5 * atan2(2 * a[i][j], a[j][j] - a[i][i]), c = cos(angle), s = sin(angle);
                for (int k = 0; k < 4; k++) {
                    double x = a[k][i], y = a[k][j], vx = v[k][i], vy = v[k][j];
                    a[k][i] = c * x - s * y;
                    a[k][j] = s * x + c * y;
                    v[k][i] = c * vx - s * vy;
                    v[k][j] = s * vx + c * vy;
                }
                for (int k = 0; k < 4; k++) {
                    double x = a[i][k], y = a[j][k];
                    a[i][k] = c * x - s * y;
                    a[j][k] = s * x + c * y;
                }
            }
    int top = 0;
    for (int i = 1; i < 4; i++)
        if (a[i][i] > a[top][top]) top = i;
    double w = v[0][top], x = v[1][top], y = v[2][top], z = v[3][top];
    const double r[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                         2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                         2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    memcpy(map, r, sizeof r);
    return a[top][top];
}

static double angle_of(const double map[9]) {
    return acos(fmin(1, fmax(-1, 0.5 * (map[0] + map[4] + map[8] - 1))));
}

/* Correlation of both turning speeds when the stamps of samples run `scale` times as fast and come `delay` late; *gain: the
 * gyroscope's speed over alignment's. 0 where too little overlaps. */
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

/* A clock that is off: by a delay, or running at another pace. True also while it isn't sure which. */
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

static void judge_gyro(plausibility *p) {
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

static void add_turn(plausibility *p, const plausibility_interval *e) {
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

/* ---- the accelerometer against alignment's turning and moving ------------------------------------------------------ */

/* Energy of specific force in the world beside its mean, in parts of all, were its axes mapped like this. */
static double scatter_with(const plausibility *p, const double map[9]) {
    double mean[3] = {0, 0, 0};
    for (int i = 0; i < 3; i++) /* R map^T f */
        for (int j = 0; j < 3; j++)
            for (int l = 0; l < 3; l++) mean[i] += p->tensor[9 * i + 3 * j + l] * map[3 * l + j];
    double length = mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2];
    return 1 - length / p->forced / p->force_squared;
}

/* Gravity stays where it is in the world while the camera turns. True when no other axes explain the force better. */
static bool judge_axes(plausibility *p) {
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

static void judge_sign(plausibility *p) {
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

static void add_force(plausibility *p, const plausibility_interval *e) {
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

void plausibility_add(plausibility *p, const plausibility_interval *e) {
    judge_constant(p, e);
    add_turn(p, e);
    judge_gyro(p);
    if (!e->has_force) return;
    add_force(p, e);
    if (plausibility_bad(&p->accel)) return;
    bool sure = !p->suspect && (p->gyro.health == FATHOM_IMU_GOOD || p->gyro.health == FATHOM_IMU_SATURATED);
    for (int i = 3; i < 6; i++) sure = sure && p->axis[i].run < CONSTANT;
    if (sure && judge_axes(p)) judge_sign(p); /* else all may be wrong, with the clock */
}

bool plausibility_doubtful(const plausibility *p, bool translation) {
    if (plausibility_bad(&p->gyro)) return false; /* no doubt at all */
    bool doubt = p->gyro.health == FATHOM_IMU_UNCHECKED || p->suspect;
    for (int i = 0; i < 3; i++) doubt = doubt || p->axis[i].run >= CONSTANT;
    bool used = translation && !plausibility_bad(&p->accel);
    return doubt || (used && p->accel.health == FATHOM_IMU_UNCHECKED && p->forced < FORCES_MOST);
}
