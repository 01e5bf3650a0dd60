/* Corrections of the navigator: accepted poses, and stillness. */
#include <math.h>
#include <string.h>

#include "base/log.h"
#include "base/stamps.h"
#include "inertial/inertial.h"
#include "inertial/start.h"
#include "inertial/strapdown.h"

#define STILL_VELOCITY 0.005 /* m/s: speed of a still hand or a tripod */
#define STILL_SPEED 0.05
#define STILL_WAY 0.005 /* m and rad between poses: no motion */
#define STILL_ANGLE 0.005
#define STILL_WATCHED_NS 150000000 /* for as long as this */
#define STILL_TURN 0.002           /* rad/s over a second */
#define MIN_MISMATCH 0.05          /* the settings' sigmas times this are those of a good sensor */
#define MAX_MISMATCH 3
#define MISMATCH_RATE 0.1 /* weight of a pose in the logarithm of the mismatch */
#define MISMATCH_JUMP 4   /* squared misfit beyond which the mismatch grows at once */
#define UNSTEADY_RATE 0.1 /* weight of a pose in the mean squares of accelerations */
#define UNSTEADY_S 0.5    /* poses further apart tell nothing of them */
/* a larger error of the gyroscope in the rotation between accepted poses is a contradiction */
#define DOUBT_RAD 0.012
#define DOUBT_SECONDS 1.0 /* poses further apart carry little information */

/* The squared angle between the rotation by poses and the prediction, with samples or without. */
static double foretold_wrongly(inertial *n, bool without, const pose *way, int64_t from_ns, int64_t to_ns) {
    inertial_motion m;
    bool doubted = n->now.doubted;
    n->now.doubted = without;
    int e = inertial_estimate(n, from_ns, to_ns, &m);
    n->now.doubted = doubted;
    if (e != FATHOM_OK) return 0;
    pose rest = pose_between(&m.motion, way);
    return fmin(pow(pose_angle(&rest), 2), 1);
}

/* Checks whether the samples still agree with the camera's rotation: detects an unnoticed leap of the clock or a loose
 * IMU. */
static void doubt(inertial *n, const measurement *m) {
    double dt = 1e-9 * ((double)m->timestamp_ns - (double)n->now.corrected_ns);
    int last = samples_find(&n->samples, m->timestamp_ns),
        first = samples_find(&n->samples, n->now.corrected_ns);
    if (!n->config->imu || n->samples.count < 2 || first < 0 || dt > DOUBT_SECONDS) return;
    double samples = last - first, wanted = 1e9 * dt / (double)n->samples.period_ns;
    if (samples < 0.5 * wanted || samples < 1) return; /* a gap */
    pose way = pose_between(&n->now.corrected, &m->camera_to_world);
    double gyro = foretold_wrongly(n, false, &way, n->now.corrected_ns, m->timestamp_ns);
    double turn = foretold_wrongly(n, true, &way, n->now.corrected_ns, m->timestamp_ns);
    n->now.gyro_error += (gyro - n->now.gyro_error) / 4;
    n->now.turn_error += (turn - n->now.turn_error) / 4;
    double much = DOUBT_RAD * DOUBT_RAD;
    bool was = n->now.doubted;
    n->now.against = gyro > fmax(much, turn) ? n->now.against + 1 : 0; /* one interval may be an error of the poses */
    n->now.doubted = was ? n->now.gyro_error > fmax(much / 4, n->now.turn_error / 2)
                     : n->now.against > 1 && n->now.gyro_error > fmax(much, 4 * n->now.turn_error);
}

/* Adapts the noise: the settings' is that of a poor sensor on a loose mount, and the distance of poses from their
 * inertial prediction shows by how much this rig is better; a sudden misfit widens the interval in which it occurred.
 * before: the state at the interval's start. Returns the mismatch for the correction by this pose, which affects the
 * mismatch from the next pose on, unless it was sudden. */
static double learn_mismatch(inertial *n, const navigator *before, const measurement *m) {
    navigation *now = &n->now;
    double known = now->mismatch, misfit = navigator_misfit(&now->state, m, known);
    if (misfit < 0 || !n->usable || n->samples.count < 2) return known;
    double factor = misfit > MISMATCH_JUMP ? sqrt(misfit / 2) : exp(0.5 * MISMATCH_RATE * (misfit - 1));
    now->mismatch = fmin(fmax(now->mismatch * factor, MIN_MISMATCH), MAX_MISMATCH);
    if (misfit <= MISMATCH_JUMP) return known;
    now->state = *before;
    navigate(n, &now->state, m->timestamp_ns);
    return now->mismatch;
}

/* Compares the rotation since the last accepted pose with the samples', and keeps it for times without samples. */
static void learn_turning(inertial *n, const measurement *m) {
    navigation *now = &n->now;
    if (m->timestamp_ns <= now->corrected_ns) return;
    double seconds = seconds_between(now->corrected_ns, m->timestamp_ns), w[3];
    doubt(n, m);
    pose way = pose_between(&now->corrected, &m->camera_to_world);
    so3_log(way.r, w);
    for (int i = 0; i < 3; i++) now->turning[i] = w[i] / seconds;
}

/* Without an IMU the motion between poses keeps its velocity, and its error is learnt from the poses: by how much the rate
 * changed, and by how much the state, which has been propagated to the measurement's time, is off. */
static void learn_unsteadiness(inertial *n, const measurement *m, const double turning[3], double dt) {
    navigation *now = &n->now;
    const pose predicted = navigator_camera(&now->state, n->lever), way = pose_between(&predicted, &m->camera_to_world);
    double turn = 0;
    for (int i = 0; i < 3; i++) turn += pow((now->turning[i] - turning[i]) / dt, 2) / 3;
    const double push = pow(pose_distance(&way), 2) / 3;
    now->unsteady[0] += UNSTEADY_RATE * (fmax(turn - pow(m->floors[0] / (dt * dt), 2), 0) - now->unsteady[0]);
    now->unsteady[1] += UNSTEADY_RATE * (fmax(push - pow(m->floors[3], 2), 0) * 3 / pow(dt, 3) - now->unsteady[1]);
}

/* Propagates the state to the measurement's time, and corrects it. */
static void apply(inertial *n, const measurement *m) {
    navigation *now = &n->now;
    navigator before = now->state;
    const double dt = seconds_between(before.timestamp_ns, m->timestamp_ns);
    const bool unmeasured = !(n->usable && n->samples.count > 1) || now->doubted;
    double turning[3];
    memcpy(turning, now->turning, sizeof turning);
    if (m->sound) learn_turning(n, m);
    navigate(n, &now->state, m->timestamp_ns);
    if (m->sound && unmeasured && dt > 0 && dt < UNSTEADY_S) learn_unsteadiness(n, m, turning, dt);
    double mismatch = m->sound ? learn_mismatch(n, &before, m) : now->mismatch;
    if (m->linearise) navigator_correct(&now->state, m, mismatch);
    if (!m->of_frame) return;
    now->corrected = m->camera_to_world;
    now->corrected_ns = m->timestamp_ns;
}

int inertial_measure(inertial *n, const measurement *m) {
    timeline *past = &n->past;
    if (!n->running) return FATHOM_ERROR_NO_DATA;
    int i = timeline_find(past, m->timestamp_ns), newest = past->count - 1;
    if (i < 0) {
        n->refused++;
        return FATHOM_ERROR_TIME;
    }
    n->late += i < newest;
    if (i < newest) n->now = timeline_at(past, i)->after;
    i = timeline_insert(past, i + 1);
    timeline_at(past, i)->by = *m;
    for (; i < past->count; i++) {
        apply(n, &timeline_at(past, i)->by);
        timeline_at(past, i)->after = n->now;
    }
    return FATHOM_OK;
}

/* Detected stillness corrects the navigator, with or without a pose. */
static void stand_still(inertial *n) {
    stillness *w = &n->samples.still;
    double mean[3], seconds = 1e-9 * (double)n->samples.period_ns * (w->samples - w->used);
    if (1e-9 * (double)n->samples.period_ns * w->samples < STILL_SECONDS || w->samples == w->used) return;
    /* uniform translation or a slow pan gives the same readings: the poses and the velocity must agree */
    if (!w->anchored) {
        w->anchored = true;
        w->anchor = n->now.corrected;
        w->anchor_ns = n->now.corrected_ns;
    }
    pose way = pose_between(&w->anchor, &n->now.corrected);
    const double *v = n->now.state.v;
    bool moved = pose_distance(&way) > STILL_WAY || pose_angle(&way) > STILL_ANGLE ||
                 v[0] * v[0] + v[1] * v[1] + v[2] * v[2] > STILL_SPEED * STILL_SPEED;
    if (moved) stillness_end(&n->samples.still);
    if (moved || n->now.corrected_ns - w->anchor_ns < STILL_WATCHED_NS) return;
    for (int i = 0; i < 3; i++) {
        mean[i] = (w->gyro[i] - w->used_gyro[i]) / (w->samples - w->used);
        w->used_gyro[i] = w->gyro[i];
    }
    w->used = w->samples;
    int64_t now = n->now.state.timestamp_ns;
    measurement rest = measurement_of_rest(now, STILL_VELOCITY);
    measurement bias = measurement_of_gyro_bias(now, mean, STILL_TURN / sqrt(seconds));
    inertial_measure(n, &rest);
    inertial_measure(n, &bias);
}

void inertial_advance(inertial *n, int64_t timestamp_ns) {
    measurement nothing = measurement_of_nothing(timestamp_ns);
    if (n->running && timestamp_ns < n->now.state.timestamp_ns) return;
    if (inertial_measure(n, &nothing) == FATHOM_OK) stand_still(n);
}

static void tell_doubt(inertial *n) {
    n->doubts += n->now.doubted;
    log_write(n->config, FATHOM_LOG_INFO,
              n->now.doubted
                  ? "the gyroscope contradicts the poses: the scan goes on without the IMU until they agree"
                  : "gyroscope and poses agree again");
}

int inertial_correct(inertial *n, const pose *accepted, const double information[36], const double pull[6], bool sound,
                     int64_t timestamp_ns) {
    const fathom_config *c = n->config;
    if (!n->running) {
        inertial_start(n, accepted, timestamp_ns);
        return FATHOM_OK;
    }
    bool on_time = timestamp_ns >= n->now.state.timestamp_ns, doubted = n->now.doubted;
    measurement m = measurement_of_pose(timestamp_ns, accepted, information, pull, n->lever,
                                        c->pose_noise_rad, c->pose_noise_m);
    m.of_frame = true;
    m.sound = sound;
    int e = inertial_measure(n, &m);
    if (n->now.doubted != doubted) tell_doubt(n);
    if (on_time) stand_still(n);
    return e;
}
