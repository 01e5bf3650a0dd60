/* What corrects the navigator: accepted poses, and stillness. */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "inertial/inertial.h"
#include "inertial/start.h"
#include "inertial/strapdown.h"

#define STILL_VELOCITY 0.005 /* m/s: what a hand that holds still, or a tripod, moves at */
#define STILL_SPEED 0.05
#define STILL_WAY 0.005 /* m and rad between poses: no motion */
#define STILL_ANGLE 0.005
#define STILL_WATCHED_NS 150000000 /* for as long as this */
#define STILL_TURN 0.002           /* rad/s over a second */
#define MIN_MISMATCH 0.05          /* sigmas that the settings give, times this, are those of a good sensor */
#define MAX_MISMATCH 3
#define MISMATCH_RATE 0.1 /* a pose's part in the mismatch's logarithm */
#define MISMATCH_JUMP 4   /* squared misfit that makes it grow at once */
#define DOUBT_RAD 0.012   /* a turn between accepted poses that the gyroscope gets more wrong is a contradiction */
#define DOUBT_SECONDS 1.0 /* poses further apart say little */
#define EXACT 1e12        /* information, 1/rad^2 and 1/m^2, of an exact pose */

/* Detected stillness corrects the navigator, with or without a pose. */
static void stand_still(inertial *n) {
    stillness *w = &n->samples.still;
    double mean[3], seconds = 1e-9 * (double)n->samples.period_ns * (w->samples - w->used);
    if (1e-9 * (double)n->samples.period_ns * w->samples < STILL_SECONDS || w->samples == w->used) return;
    /* a slide or a slow pan at an even rate feels the same: the poses and the velocity must agree */
    if (!w->anchored) {
        w->anchored = true;
        w->anchor = n->corrected;
        w->anchor_ns = n->corrected_ns;
    }
    pose way = pose_between(&w->anchor, &n->corrected);
    const double *v = n->state.v;
    bool moved = pose_distance(&way) > STILL_WAY || pose_angle(&way) > STILL_ANGLE ||
                 v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > STILL_SPEED * STILL_SPEED;
    if (moved) stillness_end(&n->samples.still);
    if (moved || n->corrected_ns - w->anchor_ns < STILL_WATCHED_NS) return;
    for (int i = 0; i < 3; i++) {
        mean[i] = (w->gyro[i] - w->used_gyro[i]) / (w->samples - w->used);
        w->used_gyro[i] = w->gyro[i];
    }
    w->used = w->samples;
    navigator_still(&n->state, STILL_VELOCITY, mean, STILL_TURN / sqrt(seconds));
}

void inertial_advance(inertial *n, int64_t timestamp_ns) {
    if (!n->running) return;
    navigate(n, &n->state, timestamp_ns);
    stand_still(n);
}

/* The angle between the poses' way and what is foretold of it, squared; by the samples or without. */
static double foretold_wrongly(inertial *n, bool without, const pose *way, int64_t from_ns, int64_t to_ns) {
    inertial_motion m;
    bool doubted = n->doubted;
    n->doubted = without;
    int e = inertial_estimate(n, from_ns, to_ns, &m);
    n->doubted = doubted;
    if (e != FATHOM_OK) return 0;
    pose rest = pose_between(&m.motion, way);
    return fmin(pow(pose_angle(&rest), 2), 1);
}

/* Do the samples still tell of this camera's turning? A clock that leapt unseen, or a loose IMU, shows here. */
static void doubt(inertial *n, const pose *accepted, int64_t timestamp_ns) {
    double dt = 1e-9 * ((double)timestamp_ns - (double)n->corrected_ns);
    int last = samples_find(&n->samples, timestamp_ns), first = samples_find(&n->samples, n->corrected_ns);
    if (!n->config->imu || n->samples.count < 2 || first < 0 || dt > DOUBT_SECONDS) return;
    double samples = last - first, wanted = 1e9 * dt / (double)n->samples.period_ns;
    if (samples < 0.5 * wanted || samples < 1) return; /* a gap */
    pose way = pose_between(&n->corrected, accepted);
    double gyro = foretold_wrongly(n, false, &way, n->corrected_ns, timestamp_ns);
    double turn = foretold_wrongly(n, true, &way, n->corrected_ns, timestamp_ns);
    n->gyro_error += (gyro - n->gyro_error) / 4;
    n->turn_error += (turn - n->turn_error) / 4;
    double much = DOUBT_RAD * DOUBT_RAD;
    bool was = n->doubted;
    n->against = gyro > fmax(much, turn) ? n->against + 1 : 0; /* one interval may be the poses' fault */
    n->doubted = was ? n->gyro_error > fmax(much / 4, n->turn_error / 2)
                     : n->against > 1 && n->gyro_error > fmax(much, 4 * n->turn_error);
    if (n->doubted == was) return;
    n->doubts += n->doubted;
    log_write(n->config, FATHOM_LOG_INFO,
              n->doubted
                  ? "the gyroscope contradicts the poses: the scan goes on without the IMU until they agree"
                  : "gyroscope and poses agree again");
}

/* The settings' noise is that of a poor sensor on a loose mount. How much better this rig is shows in how far poses lie from
 * where inertia put them; a sudden misfit widens the stretch that it happened in. */
static void correct(inertial *n, const pose *accepted, const double information[36], const double pull[6],
                    int64_t timestamp_ns) {
    const fathom_config *c = n->config;
    double floor_rad = c->pose_noise_rad * n->mismatch, floor_m = c->pose_noise_m * n->mismatch;
    navigator before = n->state;
    navigate(n, &n->state, timestamp_ns);
    double misfit = navigator_misfit(&n->state, n->lever, accepted, information, pull, floor_rad, floor_m);
    if (misfit >= 0 && n->usable && n->samples.count > 1) {
        double factor = misfit > MISMATCH_JUMP ? sqrt(misfit / 2) : exp(0.5 * MISMATCH_RATE * (misfit - 1));
        n->mismatch = fmin(fmax(n->mismatch * factor, MIN_MISMATCH), MAX_MISMATCH);
        if (misfit > MISMATCH_JUMP) {
            n->state = before;
            navigate(n, &n->state, timestamp_ns);
            floor_rad = c->pose_noise_rad * n->mismatch;
            floor_m = c->pose_noise_m * n->mismatch;
        }
    }
    navigator_correct(&n->state, n->lever, accepted, information, pull, floor_rad, floor_m);
}

void inertial_correct(inertial *n, const pose *accepted, const double information[36], const double pull[6],
                      int64_t timestamp_ns) {
    if (n->corrected_ns != INT64_MIN && timestamp_ns > n->corrected_ns) {
        double dt = 1e-9 * ((double)timestamp_ns - (double)n->corrected_ns), w[3];
        if (n->running) doubt(n, accepted, timestamp_ns);
        pose way = pose_between(&n->corrected, accepted);
        so3_log(way.r, w);
        for (int i = 0; i < 3; i++) n->turning[i] = w[i] / dt;
    }
    if (!n->running) {
        inertial_start(n, accepted, timestamp_ns);
    } else {
        double exact[36] = {0};
        for (int i = 0; i < 6; i++) exact[7 * i] = EXACT;
        correct(n, accepted, information ? information : exact, pull, timestamp_ns);
        stand_still(n);
    }
    n->corrected = *accepted;
    n->corrected_ns = timestamp_ns;
}
