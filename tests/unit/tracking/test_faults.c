/* Faults injected into a simulated rig: what a bad IMU, a bad clock and bad frames do to a scan, through the public API. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/camera_path.h"
#include "simulate/imu_model.h"
#include "simulate/sensor_kinect.h"
#include "base/se3.h"
#include "synthetic.h"

#define SECOND 1000000000ll
#define DEGREES 57.29577951308232
#define BEGIN 1.0       /* seconds: the first frame; the camera moves from half a second later on */
#define DENSE_UNTIL 5.0 /* 20 frames a second until here, then 6 */
#define DENSE_RATE 20
#define SPARSE_RATE 6
#define END 31.0
#define DENSE 80
#define FRAMES (DENSE + 156 + 1)
#define IMU_RATE 200
#define SAMPLES (32 * IMU_RATE)
#define PERIOD_NS (SECOND / IMU_RATE)
#define PACE 1.5            /* times the usual 0.3 to 0.5 m/s and 25 deg/s */
#define FAULT 3.0           /* when most faults begin */
#define USUAL 4.8           /* when most runs end */
#define COVER (FAULT + 0.1) /* when the lens is covered in the second run of a fault, and for how long */
#define COVERED_S 0.5
#define WRONG_M 0.03 /* a frame fused with a pose that is further off, or turned by more, is a false accept */
#define WRONG_RAD (2 / DEGREES)

/* ---- the rig ---------------------------------------------------------------------------------------------------------- */

typedef enum { SEEN, BLANK, SATURATED, PATCH } look;

/* A frame or a sample on its way to the library; t is the true time, at which it also arrives. */
typedef struct {
    double t;
    int64_t stamp_ns;
    int source; /* the frame rendered */
    look look;
} arriving_frame;

typedef struct {
    double t;
    fathom_imu_sample sample;
} arriving_sample;

typedef struct {
    arriving_frame frames[2 * FRAMES];
    arriving_sample samples[2 * SAMPLES];
    int frame_count, sample_count;
} rig;

static struct scene scene;
static struct camera_path path;
static synthetic_frame *rendered; /* FRAMES */
static rig whole, faulty;

static double frame_time(int i) {
    return i < DENSE ? BEGIN + (double)i / DENSE_RATE : DENSE_UNTIL + (double)(i - DENSE) / SPARSE_RATE;
}

static int64_t ns(double seconds) {
    return (int64_t)llround(1e9 * seconds);
}

/* A frame of the walk, rendered when it is first wanted. */
static const synthetic_frame *frame_of(int i) {
    static const struct render_camera camera = {
        SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT, 131.25, 131.25, 79.5, 59.5};
    static float depth[SYNTHETIC_PIXELS], cosine[SYNTHETIC_PIXELS];
    synthetic_frame *f = &rendered[i];
    struct camera_pose at;
    pose p;
    if (f->timestamp_ns != 0) return f;
    camera_path_pose(&path, frame_time(i), &at);
    assert_true(render_depth(&scene, &camera, &at, 12.0, 2, depth, cosine));
    assert_true(kinect_measure(depth, cosine, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT, SYNTHETIC_WIDTH / 640.0, SYNTHETIC_SEED,
                               (uint64_t)i));
    f->timestamp_ns = ns(frame_time(i));
    for (int k = 0; k < SYNTHETIC_PIXELS; k++) f->depth[k] = (uint16_t)lround(depth[k] * SYNTHETIC_UNITS);
    memcpy(p.r, at.rotation, sizeof p.r);
    memcpy(p.t, at.position, sizeof p.t);
    f->pose = pose_give(&p);
    return f;
}

static int walk(void **state) {
    static const struct imu_mounting on_the_camera;
    struct imu_model imu;
    (void)state;
    rendered = calloc(FRAMES, sizeof *rendered);
    if (!rendered || !scene_make(&scene, SCENE_ROOM, SYNTHETIC_SEED, 0)) return -1;
    camera_path_make(&path, &scene, BEGIN + 0.5, PACE, PACE);
    for (int i = 0; i < FRAMES; i++) whole.frames[i] = (arriving_frame){frame_time(i), ns(frame_time(i)), i, SEEN};
    whole.frame_count = FRAMES;
    imu_model_make(&imu, imu_grade_of("consumer"), &on_the_camera, IMU_RATE, SYNTHETIC_SEED);
    for (whole.sample_count = 0; whole.sample_count < SAMPLES; whole.sample_count++) {
        struct imu_sample s;
        arriving_sample *a = &whole.samples[whole.sample_count];
        imu_model_next(&imu, &path, &s);
        a->t = s.stamp;
        a->sample.timestamp_ns = ns(s.stamp);
        for (int k = 0; k < 3; k++) {
            a->sample.gyro[k] = (float)s.gyro[k];
            a->sample.accel[k] = (float)s.accel[k];
        }
    }
    return 0;
}

static int release_all(void **state) {
    (void)state;
    scene_free(&scene);
    free(rendered);
    return 0;
}

/* ---- the faults ----------------------------------------------------------------------------------------------------- */

static void lose_samples(rig *r, double from, double to) {
    int kept = 0;
    for (int i = 0; i < r->sample_count; i++)
        if (r->samples[i].t <= from || r->samples[i].t > to) r->samples[kept++] = r->samples[i];
    r->sample_count = kept;
}

static void lose_frames_before(rig *r, double from) {
    int kept = 0;
    for (int i = 0; i < r->frame_count; i++)
        if (r->frames[i].t >= from) r->frames[kept++] = r->frames[i];
    r->frame_count = kept;
}

static void shift_imu_clock(rig *r, double by) {
    for (int i = 0; i < r->sample_count; i++)
        if (r->samples[i].t > FAULT) r->samples[i].sample.timestamp_ns += ns(by);
}

static void shift_depth_clock(rig *r, double by) {
    for (int i = 0; i < r->frame_count; i++)
        if (r->frames[i].t > FAULT) r->frames[i].stamp_ns += ns(by);
}

static void none(rig *r) {
    (void)r;
}

static void gap_10ms(rig *r) {
    lose_samples(r, FAULT, FAULT + 0.01);
}

static void gap_100ms(rig *r) {
    lose_samples(r, FAULT, FAULT + 0.1);
}

static void gap_1s(rig *r) {
    lose_samples(r, FAULT, FAULT + 1);
}

static void gap_10s(rig *r) {
    lose_samples(r, FAULT, FAULT + 10);
}

static void dies(rig *r) {
    lose_samples(r, FAULT, INFINITY);
}

static void starts_late(rig *r) {
    lose_samples(r, -INFINITY, BEGIN + 2);
}

static void never_there(rig *r) {
    r->sample_count = 0;
}

static void jumps_forward(rig *r) {
    shift_imu_clock(r, 3);
}

static void jumps_a_bit(rig *r) {
    shift_imu_clock(r, 0.3);
}

static void jumps_an_hour(rig *r) {
    shift_imu_clock(r, 3600);
}

static void jumps_back(rig *r) {
    shift_imu_clock(r, -2);
}

static void jumps_in_a_gap(rig *r) {
    shift_imu_clock(r, 3);
    lose_samples(r, FAULT, FAULT + 0.7);
}

/* As in a recording: samples come in the order of their stamps, and nothing but their content is wrong. */
static void jumps_in_a_recording(rig *r) {
    for (int i = 0; i < r->sample_count; i++) {
        if (r->samples[i].t <= FAULT) continue;
        r->samples[i].t += 1;
        r->samples[i].sample.timestamp_ns += SECOND;
    }
}

static void one_stamp_far_ahead(rig *r) {
    for (int i = 0; i < r->sample_count; i++)
        if (r->samples[i].t > FAULT) {
            r->samples[i].sample.timestamp_ns += ns(1000);
            return;
        }
}

/* 6 ms ahead after half a minute. */
static void drifts(rig *r) {
    for (int i = 0; i < r->sample_count; i++)
        r->samples[i].sample.timestamp_ns += r->samples[i].sample.timestamp_ns / 5000;
}

static void doubled(rig *r) {
    for (int i = r->sample_count - 1; i >= 0; i--) r->samples[2 * i] = r->samples[2 * i + 1] = r->samples[i];
    r->sample_count *= 2;
}

static void pairs_swapped(rig *r) {
    for (int i = 0; i + 1 < r->sample_count; i += 2) {
        fathom_imu_sample s = r->samples[i].sample;
        r->samples[i].sample = r->samples[i + 1].sample;
        r->samples[i + 1].sample = s;
    }
}

/* Each seventh sample arrives 20 ms late, after four younger ones. */
static void stragglers(rig *r) {
    for (int i = 0; i + 4 < r->sample_count; i += 7) {
        fathom_imu_sample s = r->samples[i].sample;
        for (int k = 0; k < 4; k++) r->samples[i + k].sample = r->samples[i + k + 1].sample;
        r->samples[i + 4].sample = s;
    }
}

static void spoil(rig *r, double from, double to, int every, float gyro, float accel) {
    for (int i = 0; i < r->sample_count; i++) {
        if (r->samples[i].t <= from || r->samples[i].t > to || i % every) continue;
        for (int k = 0; k < 3; k++) {
            if (gyro != 0) r->samples[i].sample.gyro[k] = (i / every + k) % 2 ? gyro : -gyro;
            if (accel != 0) r->samples[i].sample.accel[k] = (i / every + k) % 2 ? accel : -accel;
        }
    }
}

static void nan_burst(rig *r) {
    spoil(r, FAULT, FAULT + 0.5, 1, NAN, NAN);
}

static void no_accelerometer(rig *r) {
    spoil(r, -INFINITY, INFINITY, 1, 0, NAN);
}

static void accelerometer_dies(rig *r) {
    spoil(r, FAULT, INFINITY, 1, 0, NAN);
}

static void absurd_samples(rig *r) {
    spoil(r, FAULT, FAULT + 1, 20, 1e30f, -1e30f);
}

static void gyro_spikes(rig *r) {
    spoil(r, FAULT, FAULT + 1, 20, 30, 0);
}

static void accel_spikes(rig *r) {
    spoil(r, FAULT, FAULT + 1, 20, 0, 150);
}

/* Nothing from before the middle of a walk. */
static void moving_start(rig *r) {
    lose_samples(r, -INFINITY, FAULT);
    lose_frames_before(r, FAULT);
}

static void frames_late(rig *r) {
    for (int i = 0; i + 1 < r->frame_count; i++) {
        if (r->frames[i].t < FAULT || r->frames[i].t > FAULT + 1 || i % 4) continue;
        arriving_frame late = r->frames[i];
        late.t = r->frames[i + 1].t;
        r->frames[i] = r->frames[i + 1];
        r->frames[++i] = late;
    }
}

static void frames_twice(rig *r) {
    for (int i = r->frame_count - 1; i >= 0; i--) r->frames[2 * i] = r->frames[2 * i + 1] = r->frames[i];
    r->frame_count *= 2;
}

static void depth_clock_jumps(rig *r) {
    shift_depth_clock(r, 5);
}

static void depth_clock_jumps_a_bit(rig *r) {
    shift_depth_clock(r, 0.3);
}

static void look_like(rig *r, double from, double to, look l) {
    for (int i = 0; i < r->frame_count; i++)
        if (r->frames[i].t >= from && r->frames[i].t < to) r->frames[i].look = l;
}

static void saturated_frames(rig *r) {
    look_like(r, FAULT, FAULT + 0.3, SATURATED);
}

static void patches(rig *r) {
    look_like(r, FAULT, FAULT + 0.3, PATCH);
}

/* The second run of a fault: half a second of it with a covered lens. */
typedef enum { NOT_RUN, TRACKS_AGAIN, MAY_BE_LOST } covered;

/* What must come of it: without a covered lens every frame is tracked, but for those that say nothing. */
typedef struct {
    const char *name;
    void (*inject)(rig *r);
    double until;  /* the run's end, seconds */
    int untracked; /* frames that may be not tracked */
    covered covered;
    int not_finite, out_of_order, implausible, gaps, leaps, ignored; /* counted; -1: whatever */
} fault;

static const fault faults[] = {
    {"nothing is wrong", none, USUAL, 0, TRACKS_AGAIN, 0, 0, 0, 0, 0, 0},
    {"gap of 10 ms", gap_10ms, USUAL, 0, NOT_RUN, 0, 0, 0, 0, 0, 0},
    {"gap of 100 ms", gap_100ms, USUAL, 0, TRACKS_AGAIN, 0, 0, 0, 1, 0, 0},
    {"gap of 1 s", gap_1s, USUAL, 0, NOT_RUN, 0, 0, 0, 1, 0, 0},
    {"gap of 10 s", gap_10s, FAULT + 11, 0, NOT_RUN, 0, 0, 0, 1, 0, 0},
    {"dies", dies, USUAL, 0, MAY_BE_LOST, 0, 0, 0, 0, 0, 0},
    {"starts late", starts_late, USUAL, 0, NOT_RUN, 0, 0, 0, 0, 0, 0},
    {"never there", never_there, USUAL, 0, MAY_BE_LOST, 0, 0, 0, 0, 0, 0},
    {"IMU clock 3 s ahead", jumps_forward, USUAL, 0, TRACKS_AGAIN, 0, 0, 0, 1, 1, 0},
    {"IMU clock 0.3 s ahead", jumps_a_bit, USUAL, 0, NOT_RUN, 0, 0, 0, 1, 1, 0},
    {"IMU clock an hour ahead", jumps_an_hour, USUAL, 0, NOT_RUN, 0, 0, 0, 1, 1, 0},
    {"IMU clock 2 s back", jumps_back, USUAL, 0, TRACKS_AGAIN, 0, 50, 0, 0, 1, 0},
    {"IMU clock 3 s ahead after a gap", jumps_in_a_gap, USUAL, 0, NOT_RUN, 0, 0, 0, 1, 1, 0},
    {"IMU clock 1 s ahead in a recording", jumps_in_a_recording, USUAL + 2, 0, NOT_RUN, 0, 0, 0, 1, 0, 0},
    {"one stamp far ahead", one_stamp_far_ahead, USUAL, 0, TRACKS_AGAIN, 0, 50, 0, 1, 0, 0},
    {"IMU clock drifts by 200 ppm", drifts, END, 0, NOT_RUN, 0, 0, 0, 0, 0, 0},
    {"doubled samples", doubled, USUAL, 0, TRACKS_AGAIN, 0, -1, 0, 0, 0, 0},
    {"swapped pairs", pairs_swapped, USUAL, 0, NOT_RUN, 0, -1, 0, 0, 0, 0},
    {"stragglers", stragglers, USUAL, 0, NOT_RUN, 0, -1, 0, 0, 0, 0},
    {"NaN for 0.5 s", nan_burst, USUAL, 0, MAY_BE_LOST, 100, 0, 0, 1, 0, 0},
    {"no accelerometer", no_accelerometer, USUAL, 0, TRACKS_AGAIN, 0, 0, 0, 0, 0, 0},
    {"accelerometer dies", accelerometer_dies, USUAL, 0, NOT_RUN, 0, 0, 0, 0, 0, 0},
    {"absurd samples", absurd_samples, USUAL, 0, NOT_RUN, 0, 0, 10, 0, 0, 0},
    {"gyro spikes", gyro_spikes, USUAL, 0, TRACKS_AGAIN, 0, 0, 10, 0, 0, 0},
    {"accelerometer spikes", accel_spikes, USUAL, 0, NOT_RUN, 0, 0, 10, 0, 0, 0},
    {"a start in motion", moving_start, USUAL, 0, NOT_RUN, 0, 0, 0, 0, 0, 0},
    {"frames late", frames_late, USUAL, 0, NOT_RUN, 0, 0, 0, 0, 0, 6},
    {"frames twice", frames_twice, USUAL, 0, NOT_RUN, 0, 0, 0, 0, 0, 76},
    {"depth clock 5 s ahead", depth_clock_jumps, USUAL, 6, NOT_RUN, 0, 0, 0, 0, 1, 0},
    {"depth clock 0.3 s ahead", depth_clock_jumps_a_bit, USUAL, 3, NOT_RUN, 0, 0, 0, 0, 1, 0},
    {"frames of 65535", saturated_frames, USUAL, 6, NOT_RUN, 0, 0, 0, 0, 0, 0},
    {"frames of a few pixels", patches, USUAL, 6, NOT_RUN, 0, 0, 0, 0, 0, 0},
};

/* ---- a run ------------------------------------------------------------------------------------------------------------ */

/* What is seen of the surface from one place. */
typedef struct {
    fathom_view view;
    float depth[SYNTHETIC_PIXELS];
} sight;

typedef struct {
    int frames, untracked, refused, false_accepts, sagging;
    double worst_m, worst_deg; /* of the frames that were fused */
    double final_m, final_deg;
    fathom_state last;
    fathom_counters counters;
    double kept;  /* part of the sight before the fault that is still there */
    double close; /* part of the mesh within 4 cm of the truth */
} outcome;

static const uint16_t *pixels_of(const arriving_frame *f) {
    static uint16_t depth[SYNTHETIC_PIXELS];
    if (f->look == SEEN) return frame_of(f->source)->depth;
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) {
        int x = i % SYNTHETIC_WIDTH - 80, y = i / SYNTHETIC_WIDTH - 60;
        bool patch = f->look == PATCH && x >= 0 && x < 16 && y >= 0 && y < 16;
        depth[i] = f->look == SATURATED ? 65535 : patch ? frame_of(f->source)->depth[i] : 0;
    }
    return depth;
}

static void take_sight(fathom *scan, sight *s) {
    assert_int_equal(fathom_cast_view(scan, &s->view, s->depth, NULL), FATHOM_OK);
}

static double part_kept(fathom *scan, const sight *before) {
    static sight after;
    int seen = 0, kept = 0;
    after.view = before->view;
    take_sight(scan, &after);
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) {
        seen += before->depth[i] > 0;
        kept += before->depth[i] > 0 && fabsf(after.depth[i] - before->depth[i]) < 0.04f;
    }
    assert_true(seen > SYNTHETIC_PIXELS / 4);
    return (double)kept / seen;
}

static double part_close(fathom *scan) {
    static synthetic_mesh mesh;
    size_t close = 0;
    mesh.count = 0;
    assert_true(fathom_extract_mesh(scan, 0, synthetic_triangles, &mesh) > 1000);
    for (size_t i = 0; i < mesh.count; i++) {
        const float *p = mesh.vertices[i].position;
        close += fabs(scene_distance(&scene, p[0], p[1], p[2])) < 0.04;
    }
    return (double)close / (double)mesh.count;
}

static double position_sigma(const fathom_result *r) {
    return sqrt(fmax(r->pose_covariance[21], fmax(r->pose_covariance[28], r->pose_covariance[35])));
}

static outcome run(const rig *r, double until) {
    static sight before;
    outcome o = {.counters = FATHOM_STRUCT(fathom_counters)};
    fathom_config config = synthetic_config(frame_of(r->frames[0].source));
    config.voxel_m = 0.03f;
    synthetic_context c = synthetic_start(&config);
    fathom_result last = {.struct_size = sizeof last, .timestamp_ns = INT64_MIN};
    before.view = FATHOM_STRUCT(fathom_view);
    for (int i = 0, next = 0; i < r->frame_count && r->frames[i].t < until; i++) {
        const arriving_frame *f = &r->frames[i];
        const synthetic_frame *truth = frame_of(f->source);
        for (; next < r->sample_count && r->samples[next].t <= f->t; next++)
            fathom_push_imu(c.scan, &r->samples[next].sample);
        if (f->t >= FAULT && before.view.camera.width == 0 && i > 0) {
            before.view.camera = config.depth_camera;
            before.view.pose = truth->pose;
            take_sight(c.scan, &before);
        }
        fathom_depth_frame frame = synthetic_depth(f->stamp_ns, pixels_of(f), SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
        fathom_result result = FATHOM_STRUCT(fathom_result);
        int e = fathom_step(c.scan, &frame, &result);
        if (f->stamp_ns <= last.timestamp_ns) { /* refused: nothing has changed */
            assert_int_equal(e, FATHOM_ERROR_TIME);
            assert_memory_equal(&result, &last, sizeof result);
            o.refused++;
            continue;
        }
        assert_int_equal(e, FATHOM_OK);
        synthetic_check_result(&result);
        assert_true(result.blocks >= last.blocks);
        assert_true(!result.fused || result.state <= FATHOM_TRACKED);
        double m = synthetic_distance(result.pose, truth->pose),
               rad = synthetic_angle(result.pose, truth->pose);
        if (result.state >= FATHOM_RECKONED) {
            o.untracked += f->look != BLANK;
            if (o.frames > 0 && last.state >= FATHOM_RECKONED)
                o.sagging += position_sigma(&result) <= position_sigma(&last);
        }
        if (result.fused) {
            o.false_accepts += m > WRONG_M || rad > WRONG_RAD;
            o.worst_m = fmax(o.worst_m, m);
            o.worst_deg = fmax(o.worst_deg, rad * DEGREES);
        }
        o.frames++;
        o.final_m = m;
        o.final_deg = rad * DEGREES;
        o.last = result.state;
        last = result;
    }
    assert_int_equal(fathom_get_counters(c.scan, &o.counters), FATHOM_OK);
    assert_int_equal(o.counters.frames_ignored, o.refused);
    o.kept = before.view.camera.width ? part_kept(c.scan, &before) : 1;
    o.close = part_close(c.scan);
    synthetic_stop(&c);
    return o;
}

static void report(const char *name, bool blank, const outcome *o) {
    print_message(
        "%s%s: %d of %d not tracked, ends %s, %.4f m %.2f deg off; fused at most %.4f m %.2f deg off; "
        "%d wrong, kept %.3f, near %.3f; dropped: not finite %lld, order %lld, implausible %lld, frames "
        "%lld; gaps %lld, leaps %lld, doubts %lld\n",
        name, blank ? ", lens covered" : "", o->untracked, o->frames, fathom_state_name(o->last), o->final_m,
        o->final_deg, o->worst_m, o->worst_deg, o->false_accepts, o->kept, o->close,
        (long long)o->counters.imu_not_finite, (long long)o->counters.imu_out_of_order,
        (long long)o->counters.imu_implausible, (long long)o->counters.frames_ignored,
        (long long)o->counters.imu_gaps, (long long)o->counters.imu_clock_leaps,
        (long long)o->counters.imu_doubts);
}

static bool counted(const char *what, int64_t count, int expected) {
    if (expected < 0 || count == expected) return true;
    print_message("  %s: %lld, not %d\n", what, (long long)count, expected);
    return false;
}

static bool as_expected(const fault *f, bool lens_covered, const outcome *o) {
    bool good = o->sagging == 0 && o->kept > 0.95 && o->false_accepts == 0;
    if (!lens_covered || f->covered == TRACKS_AGAIN)
        good &= o->last == FATHOM_TRACKED && o->untracked <= f->untracked && o->final_m < 0.02 &&
                o->final_deg < 1 && o->close > 0.95;
    good &= counted("not finite", o->counters.imu_not_finite, f->not_finite);
    good &= counted("out of order", o->counters.imu_out_of_order, f->out_of_order);
    good &= counted("implausible", o->counters.imu_implausible, f->implausible);
    good &= counted("gaps", o->counters.imu_gaps, f->gaps);
    good &= counted("leaps", o->counters.imu_clock_leaps, f->leaps);
    good &= counted("doubts", o->counters.imu_doubts, f->inject == jumps_in_a_recording);
    good &= counted("frames ignored", o->counters.frames_ignored, f->ignored);
    good &= counted("overrun", o->counters.imu_overrun, 0);
    good &= counted("blocks refused", o->counters.blocks_refused, 0);
    return good;
}

/* A case: a fault, perhaps with a covered lens. */
typedef struct {
    const fault *fault;
    bool lens_covered;
    char title[80];
} job;

static void is_survived(void **state) {
    const job *j = *state;
    faulty = whole;
    j->fault->inject(&faulty);
    if (j->lens_covered) look_like(&faulty, COVER, COVER + COVERED_S, BLANK);
    outcome o = run(&faulty, j->fault->until);
    bool good = as_expected(j->fault, j->lens_covered, &o);
    if (!good) report(j->fault->name, j->lens_covered, &o);
    assert_true(good);
}

#define FAULTS (sizeof faults / sizeof *faults)

int main(void) {
    static job jobs[2 * FAULTS];
    static struct CMUnitTest tests[2 * FAULTS];
    size_t count = 0;
    for (size_t i = 0; i < FAULTS; i++)
        for (int lens_covered = 0; lens_covered < (faults[i].covered == NOT_RUN ? 1 : 2); lens_covered++) {
            job *j = &jobs[count];
            *j = (job){&faults[i], lens_covered, ""};
            snprintf(j->title, sizeof j->title, "%s%s", j->fault->name, lens_covered ? ", lens covered" : "");
            tests[count++] = (struct CMUnitTest){j->title, is_survived, NULL, NULL, j};
        }
    return _cmocka_run_group_tests("faults", tests, count, walk, release_all);
}
