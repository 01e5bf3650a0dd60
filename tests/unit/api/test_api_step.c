/* The public API: steps. Poses against the truth, frames that can't be used, pausing, starting anew, the inertial hook,
 * samples from a second thread. test_api_step PATTERN runs the tests of that name only. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "base/se3.h"
#include "synthetic.h"

#define FRAMES 16
#define SAMPLES 1000
static synthetic_frame frames[FRAMES];
static fathom_imu_sample samples[SAMPLES];
static int sample_count;
static synthetic_log kept;

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_DESK, 0, FRAMES, frames);
    sample_count = synthetic_imu(SCENE_DESK, 0, FRAMES, "consumer", 200, SAMPLES, samples);
    return sample_count > 100 ? 0 : -1;
}

static fathom_config logged(void) {
    fathom_config c = synthetic_config(&frames[0]);
    memset(&kept, 0, sizeof kept);
    c.log = synthetic_logger;
    c.log_user = &kept;
    return c;
}

/* Pushes the samples after *next that are due at the frame. */
static void push_until(fathom *scan, int *next, int64_t stamp) {
    for (; *next < sample_count && samples[*next].timestamp_ns <= stamp; ++*next)
        assert_int_equal(fathom_push_imu(scan, &samples[*next]), FATHOM_OK);
}

static void assert_near_truth(const fathom_result *r, const synthetic_frame *f, double metres,
                              double radians) {
    double d = synthetic_distance(r->pose, f->pose), a = synthetic_angle(r->pose, f->pose);
    if (d > metres || a > radians) print_error("off by %.4f m, %.4f rad\n", d, a);
    assert_true(d <= metres && a <= radians);
}

/* The same but for rounding. */
static void assert_same_pose(fathom_pose a, fathom_pose b) {
    assert_true(synthetic_distance(a, b) < 1e-6 && synthetic_angle(a, b) < 1e-6);
}

static void poses_follow_the_truth_from_the_first_pose_on(void **state) {
    (void)state;
    for (int imu = 0; imu < 2; imu++) {
        fathom_config c = logged();
        synthetic_context s = synthetic_start(&c);
        fathom_pose at;
        double covariance[36];
        assert_int_equal(fathom_get_pose(s.scan, &at, covariance), FATHOM_OK);
        assert_same_pose(at, frames[0].pose); /* before any frame */
        int next = 0;
        for (int i = 0; i < FRAMES; i++) {
            if (imu) push_until(s.scan, &next, frames[i].timestamp_ns);
            fathom_result r = synthetic_step(s.scan, &frames[i]);
            assert_int_equal(r.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
            assert_int_equal(r.verdict, FATHOM_VERDICT_TRACKING);
            assert_true(r.fused && !r.pool_full && r.blocks > 0);
            assert_near_truth(&r, &frames[i], i == 0 ? 1e-6 : 0.006, i == 0 ? 1e-6 : 0.004);
            if (i > 0) {
                assert_true(r.iterations > 0 && r.pairs > SYNTHETIC_PIXELS / 2 && r.weight > 0);
                assert_true(r.rms_m < 0.005 && r.condition >= 1 && r.condition < 50);
                assert_true(fabs(r.condition / (r.singular_values[0] / r.singular_values[5]) - 1) < 1e-4);
                for (int k = 1; k < 6; k++) assert_true(r.singular_values[k] <= r.singular_values[k - 1]);
                for (int k = 0; k < 6; k++) assert_true(r.pose_covariance[7 * k] > 0);
            }
            fathom_span second = FATHOM_STRUCT(fathom_span);
            assert_int_equal(fathom_get_span(s.scan, &second), FATHOM_OK);
            assert_true(second.to_ns == frames[i].timestamp_ns && second.from_ns == frames[0].timestamp_ns);
            pose from, to;
            assert_true(pose_take(&frames[0].pose, &from) && pose_take(&r.pose, &to));
            const pose way = pose_between(&from, &to); /* since the first frame: less than a second ago */
            assert_same_pose(second.motion, pose_give(&way));
            for (int k = 0; k < 6; k++) assert_true(i == 0 || second.covariance[7 * k] > 0);
            assert_int_equal(r.observed_directions, i == 0 ? 0 : 6);
            assert_true(i == 0 || (r.shared_error_m > 1e-6f && r.shared_error_m < 0.005f));
            assert_true(i == 0 || (r.weakest_sigma_m > r.shared_error_m && r.weakest_sigma_m < c.max_sigma_m));
            if (i > 2) assert_true(r.seeded && r.iterations <= 4 && r.innovation_sigmas < 3);
            assert_int_equal(fathom_get_pose(s.scan, &at, covariance), FATHOM_OK);
            assert_memory_equal(&at, &r.pose, sizeof at);
            assert_memory_equal(covariance, r.pose_covariance, sizeof covariance);
        }
        fathom_counters counters = FATHOM_STRUCT(fathom_counters);
        assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
        assert_true(counters.imu_accepted == (imu ? next : 0));
        assert_true(counters.imu_not_finite == 0 && counters.imu_out_of_order == 0 &&
                    counters.imu_overrun == 0);
        synthetic_stop(&s);
        assert_int_equal(kept.errors + kept.warnings, 0);
    }
}

/* A cut-out of the frames, odd in both directions, and maps at a half and a quarter of the size. */
static void any_size_will_do(void **state) {
    (void)state;
    static uint16_t cut[SYNTHETIC_PIXELS];
    static const int sizes[][3] = {{151, 113, 1}, {160, 120, 2}, {160, 120, 4}, {157, 97, 1}};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; k++) {
        fathom_config c = logged();
        const int width = sizes[k][0], height = sizes[k][1];
        c.depth_camera.width = width;
        c.depth_camera.height = height;
        c.align_width = width / sizes[k][2];
        c.align_height = height / sizes[k][2];
        synthetic_context s = synthetic_start(&c);
        for (int i = 0; i < FRAMES; i += 2) {
            for (int y = 0; y < height; y++)
                memcpy(cut + y * width, frames[i].depth + y * SYNTHETIC_WIDTH, (size_t)width * sizeof *cut);
            fathom_depth_frame frame = synthetic_depth(frames[i].timestamp_ns, cut, width, height);
            fathom_result r = FATHOM_STRUCT(fathom_result);
            assert_int_equal(fathom_step(s.scan, &frame, &r), FATHOM_OK);
            synthetic_check_result(&r);
            assert_int_equal(r.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
            assert_near_truth(&r, &frames[i], 0.015, 0.01);
        }
        synthetic_stop(&s);
    }
}

static void the_previous_frame_will_do_as_well(void **state) {
    (void)state;
    fathom_config c = logged();
    c.against = FATHOM_AGAINST_PREVIOUS;
    synthetic_context s = synthetic_start(&c);
    for (int i = 0; i < FRAMES; i++) {
        fathom_result r = synthetic_step(s.scan, &frames[i]);
        assert_int_equal(r.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
        assert_near_truth(&r, &frames[i], 0.012, 0.008); /* it drifts more than against the model */
    }
    fathom_result r = synthetic_blank(s.scan, frames[FRAMES - 1].timestamp_ns + 1000000);
    assert_int_equal(r.state, FATHOM_RECKONED);
    synthetic_stop(&s);
}

/* The state before there is any surface: the first pose, not trusted, nothing fused; then the first frame with one. */
static void a_covered_lens_at_the_start_waits_for_a_surface(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context s = synthetic_start(&c);
    fathom_imu_sample broken = {frames[0].timestamp_ns, {NAN, 0, 0}, {0, 0, 9.8f}};
    for (int i = 0; i < 3; i++) {
        assert_int_equal(fathom_push_imu(s.scan, &broken), FATHOM_ERROR_ARGUMENT);
        fathom_result r = synthetic_blank(s.scan, frames[i].timestamp_ns);
        assert_int_equal(r.state, FATHOM_RECKONED);
        assert_int_equal(r.verdict, FATHOM_VERDICT_NO_DEPTH);
        assert_same_pose(r.pose, frames[0].pose);
        assert_true(!r.fused && r.blocks == 0 && r.pairs == 0 && r.iterations == 0);
    }
    synthetic_frame stray =
        frames[3]; /* a few pixels see something all the same: that is no surface to start from */
    for (int k = 0; k < SYNTHETIC_PIXELS; k++)
        if (k % 457 != 0) stray.depth[k] = 0;
    stray.timestamp_ns--;
    fathom_result r = synthetic_step(s.scan, &stray);
    assert_int_equal(r.verdict, FATHOM_VERDICT_NO_DEPTH);
    synthetic_mesh mesh = {0};
    assert_true(fathom_extract_mesh(s.scan, 0, synthetic_triangles, &mesh) == 0);
    assert_int_equal(mesh.calls, 0);
    r = synthetic_step(s.scan, &frames[3]);
    assert_int_equal(r.state, FATHOM_FIRST);
    assert_same_pose(r.pose, frames[0].pose); /* the first surface is at the first pose */
    assert_int_equal(synthetic_step(s.scan, &frames[4]).state, FATHOM_TRACKED);
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_int_equal(counters.imu_not_finite, 3);
    synthetic_stop(&s);
}

static void frames_that_cannot_be_used_are_counted_and_change_nothing(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context s = synthetic_start(&c);
    fathom_result last = FATHOM_STRUCT(fathom_result), r = last;
    const int64_t stamps[] = {0, -1, -SYNTHETIC_PERIOD_NS, INT64_MIN, INT64_MAX};
    const int widths[] = {SYNTHETIC_WIDTH + 1, SYNTHETIC_HEIGHT, 0, -1, 640};
    fathom_depth_frame early = synthetic_depth(INT64_MAX, frames[0].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    assert_int_equal(fathom_step(s.scan, &early, &r), FATHOM_ERROR_TIME); /* as the very first, too */
    assert_same_pose(r.pose, frames[0].pose);
    for (int i = 0; i < 4; i++) last = synthetic_step(s.scan, &frames[i]);
    for (int i = 0; i < 5; i++) {
        fathom_depth_frame late = synthetic_depth(stamps[i], frames[4].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
        if (i < 3) late.timestamp_ns += frames[3].timestamp_ns;
        memset(&r, 0xff, sizeof r);
        r.struct_size = sizeof r;
        assert_int_equal(fathom_step(s.scan, &late, &r), FATHOM_ERROR_TIME);
        assert_memory_equal(&r, &last, sizeof r);
        fathom_depth_frame other = synthetic_depth(frames[4].timestamp_ns, frames[4].depth, widths[i], SYNTHETIC_HEIGHT);
        if (i == 1) other.height = SYNTHETIC_WIDTH; /* turned: as many pixels */
        memset(&r, 0xff, sizeof r);
        r.struct_size = sizeof r;
        assert_int_equal(fathom_step(s.scan, &other, &r), FATHOM_ERROR_SIZE);
        assert_memory_equal(&r, &last, sizeof r);
    }
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_int_equal(counters.frames_ignored, 11);
    assert_int_equal(kept.warnings, 11);
    r = synthetic_step(s.scan, &frames[4]);
    assert_int_equal(r.state, FATHOM_TRACKED);

    synthetic_context twin = synthetic_start(&c); /* which saw none of them */
    for (int i = 0; i < 5; i++) last = synthetic_step(twin.scan, &frames[i]);
    assert_memory_equal(&r.pose, &last.pose, sizeof r.pose);
    assert_memory_equal(r.pose_covariance, last.pose_covariance, sizeof r.pose_covariance);
    synthetic_stop(&twin);
    synthetic_stop(&s);
}

static void clocks_that_jump_leave_everything_finite(void **state) {
    (void)state;
    const int64_t jumps[] = {3600ll * 1000000000, 1700000000ll * 1000000000, 3900000000000000000};
    for (int k = 0; k < 3; k++)
        for (int imu = 0; imu < 2; imu++) {
            fathom_config c = logged();
            synthetic_context s = synthetic_start(&c);
            int next = 0;
            for (int i = 0; i < 3; i++) {
                if (imu) push_until(s.scan, &next, frames[i].timestamp_ns);
                synthetic_step(s.scan, &frames[i]);
            }
            fathom_depth_frame jumped = synthetic_depth(jumps[k], frames[3].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
            for (int i = 0; i < 3; i++) {
                fathom_result r = FATHOM_STRUCT(fathom_result);
                assert_int_equal(fathom_step(s.scan, &jumped, &r), FATHOM_OK);
                synthetic_check_result(&r);
                jumped.timestamp_ns += SYNTHETIC_PERIOD_NS;
                jumped.depth = frames[4 + i].depth;
            }
            fathom_imu_sample far = {INT64_MAX, {0, 0, 0}, {0, 0, 9.8f}};
            assert_int_equal(fathom_push_imu(s.scan, &far), FATHOM_ERROR_ARGUMENT);
            far.timestamp_ns = INT64_MIN;
            assert_int_equal(fathom_push_imu(s.scan, &far), FATHOM_ERROR_ARGUMENT);
            fathom_motion m = FATHOM_STRUCT(fathom_motion);
            assert_int_equal(fathom_inertial_estimate(s.scan, INT64_MIN, INT64_MAX, &m),
                             FATHOM_ERROR_ARGUMENT);
            synthetic_stop(&s);
        }
}

/* ---- pause and reset ---------------------------------------------------------------------------------------------- */

static synthetic_mesh mesh_of(fathom *scan) {
    synthetic_mesh mesh = {0};
    int64_t n = fathom_extract_mesh(scan, 0, synthetic_triangles, &mesh);
    assert_true(n >= 0 && (size_t)n * 3 == mesh.count);
    return mesh;
}

static void a_paused_scan_tracks_and_fuses_nothing(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context s = synthetic_start(&c);
    fathom_result r = FATHOM_STRUCT(fathom_result);
    assert_int_equal(fathom_pause(s.scan, true), FATHOM_OK); /* before there is a surface */
    r = synthetic_step(s.scan, &frames[0]);
    assert_true(r.state == FATHOM_RECKONED && !r.fused && r.blocks == 0);
    assert_int_equal(fathom_pause(s.scan, false), FATHOM_OK);
    for (int i = 1; i < 5; i++) r = synthetic_step(s.scan, &frames[i]);
    assert_int_equal(r.state, FATHOM_TRACKED);
    int blocks = r.blocks;
    synthetic_mesh before = mesh_of(s.scan);
    assert_true(before.count > 1000);
    assert_int_equal(fathom_pause(s.scan, true), FATHOM_OK);
    for (int i = 5; i < 10; i++) {
        r = synthetic_step(s.scan, &frames[i]);
        assert_int_equal(r.state, FATHOM_TRACKED);
        assert_true(!r.fused && r.blocks == blocks);
        double d = synthetic_distance(r.pose, frames[0].pose),
               way = synthetic_distance(frames[1].pose, frames[i].pose);
        assert_true(fabs(d - way) < 0.008); /* the world is that of frame 1 here */
    }
    synthetic_mesh after = mesh_of(s.scan);
    assert_int_equal(after.count, before.count);
    assert_memory_equal(after.vertices, before.vertices, before.count * sizeof *before.vertices);
    assert_int_equal(fathom_pause(s.scan, false), FATHOM_OK);
    r = synthetic_step(s.scan, &frames[10]);
    assert_true(r.state == FATHOM_TRACKED && r.fused && r.blocks > blocks);
    free(before.vertices);
    free(after.vertices);
    synthetic_stop(&s);
}

static void reset_starts_anew(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context s = synthetic_start(&c);
    fathom_result first[8], r = FATHOM_STRUCT(fathom_result);
    for (int round = 0; round < 2; round++) {
        int next = 0;
        for (int i = 0; i < 8; i++) {
            push_until(s.scan, &next, frames[i].timestamp_ns);
            r = synthetic_step(s.scan, &frames[i]);
            if (round == 0) {
                first[i] = r;
                continue;
            }
            assert_int_equal(r.state, first[i].state);
            assert_int_equal(r.blocks, first[i].blocks);
            assert_memory_equal(&r.pose, &first[i].pose, sizeof r.pose);
            assert_memory_equal(r.pose_covariance, first[i].pose_covariance, sizeof r.pose_covariance);
        }
        if (round == 1) break;
        for (int i = 8; i < FRAMES;
             i++) { /* another way to other surfaces, then back to the start in time, too */
            push_until(s.scan, &next, frames[i].timestamp_ns);
            synthetic_step(s.scan, &frames[i]);
        }
        fathom_depth_frame late = synthetic_depth(0, frames[0].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
        assert_int_equal(fathom_step(s.scan, &late, &r), FATHOM_ERROR_TIME);
        assert_int_equal(fathom_reset(s.scan), FATHOM_OK);
        fathom_pose at;
        assert_int_equal(fathom_get_pose(s.scan, &at, NULL), FATHOM_OK);
        assert_same_pose(at, frames[0].pose);
        synthetic_mesh mesh = mesh_of(s.scan);
        assert_int_equal(mesh.count, 0);
        fathom_counters counters = FATHOM_STRUCT(fathom_counters);
        assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
        assert_int_equal(counters.frames_ignored, 1); /* counters stay */
        assert_true(counters.imu_accepted == next);
    }
    synthetic_stop(&s);
}

static void fusing_behind_changes_nothing_but_when(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context at_once = synthetic_start(&c);
    c.fuse_behind = true;
    synthetic_context behind = synthetic_start(&c);
    int next[2] = {0, 0};
    for (int i = 0; i < FRAMES; i++) {
        push_until(at_once.scan, &next[0], frames[i].timestamp_ns);
        push_until(behind.scan, &next[1], frames[i].timestamp_ns);
        fathom_result a = synthetic_step(at_once.scan, &frames[i]),
                      b = synthetic_step(behind.scan, &frames[i]);
        assert_memory_equal(&a.pose, &b.pose, sizeof a.pose);
        assert_int_equal(a.blocks, b.blocks);
        assert_true(b.fused);
        if (i % 5) continue;
        synthetic_mesh whole = mesh_of(at_once.scan),
                       waited = mesh_of(behind.scan); /* right after the step */
        assert_true(whole.count > 0 && whole.count == waited.count);
        assert_memory_equal(whole.vertices, waited.vertices, whole.count * sizeof *whole.vertices);
        free(whole.vertices);
        free(waited.vertices);
    }
    synthetic_stop(&at_once);
    assert_int_equal(fathom_reset(behind.scan), FATHOM_OK); /* with a fusion on its way */
    synthetic_step(behind.scan, &frames[0]);
    synthetic_stop(&behind);
}

/* ---- dead reckoning ----------------------------------------------------------------------------------------------- */

static double trace(const double c[36], int from) {
    return c[7 * from] + c[7 * from + 7] + c[7 * from + 14];
}

static void an_outage_is_reckoned_and_found_back_from(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context s = synthetic_start(&c);
    double turn = 0, place = 0;
    int next = 0, blocks = 0;
    for (int i = 0; i < FRAMES; i++) {
        bool blank = i >= 7 && i < 11;
        push_until(s.scan, &next, frames[i].timestamp_ns);
        fathom_result r =
            blank ? synthetic_blank(s.scan, frames[i].timestamp_ns) : synthetic_step(s.scan, &frames[i]);
        assert_int_equal(r.state, i == 0 ? FATHOM_FIRST : blank ? FATHOM_RECKONED : FATHOM_TRACKED);
        if (blank) {
            assert_true(!r.fused && r.blocks == blocks && r.pairs == 0);
            assert_int_not_equal(r.verdict, FATHOM_VERDICT_TRACKING);
            assert_true(trace(r.pose_covariance, 0) > turn && trace(r.pose_covariance, 3) > place); /* grows */
            double sigma = sqrt(trace(r.pose_covariance, 3)), off = synthetic_distance(r.pose, frames[i].pose);
            assert_true(off < 3 * sigma + 0.006); /* and covers what it is off */
            assert_near_truth(&r, &frames[i], 0.1, 0.02);
        } else {
            assert_near_truth(&r, &frames[i], 0.008, 0.005);
        }
        if (i == 11) assert_true(trace(r.pose_covariance, 3) < 0.1 * place);
        turn = trace(r.pose_covariance, 0);
        place = trace(r.pose_covariance, 3);
        blocks = r.blocks;
    }
    synthetic_stop(&s);
}

static void a_long_outage_is_called_lost(void **state) {
    (void)state;
    fathom_config c = logged();
    c.max_reckoned_sigma_m = 0.2f;
    synthetic_context s = synthetic_start(&c);
    for (int i = 0; i < 4; i++) synthetic_step(s.scan, &frames[i]);
    bool lost = false;
    for (int i = 4; i < 60; i++) {
        fathom_result r = synthetic_blank(s.scan, frames[0].timestamp_ns + (int64_t)i * SYNTHETIC_PERIOD_NS);
        double sigma = 0;
        for (int k = 3; k < 6; k++) sigma = fmax(sigma, sqrt(r.pose_covariance[7 * k]));
        assert_int_equal(r.state, sigma > 0.2 ? FATHOM_LOST : FATHOM_RECKONED);
        assert_true(!lost || r.state == FATHOM_LOST); /* once and for all, until tracked again */
        lost = r.state == FATHOM_LOST;
    }
    assert_true(lost);
    synthetic_stop(&s);
}

/* ---- the hook ----------------------------------------------------------------------------------------------------- */

typedef struct {
    int calls, mode;
    int64_t from, to;
} hook_record;

static const synthetic_frame *frame_at(int64_t stamp) {
    for (int i = 0; i < FRAMES; i++)
        if (frames[i].timestamp_ns == stamp) return &frames[i];
    return NULL;
}

enum { HOOK_TRUTH, HOOK_NO_DATA, HOOK_NAN_MOTION, HOOK_NAN_COVARIANCE, HOOK_NEGATIVE, HOOK_NOT_RIGID };

static int true_motion(void *user, int64_t from, int64_t to, fathom_motion *motion) {
    hook_record *h = user;
    h->calls++;
    h->from = from;
    h->to = to;
    pose a, b;
    assert_true(pose_take(&frame_at(from)->pose, &a) && pose_take(&frame_at(to)->pose, &b));
    a = pose_between(&a, &b);
    motion->motion = pose_give(&a);
    for (int i = 0; i < 6; i++) motion->covariance[7 * i] = 1e-4;
    if (h->mode == HOOK_NAN_MOTION) motion->motion.position[0] = NAN;
    if (h->mode == HOOK_NAN_COVARIANCE) motion->covariance[8] = NAN;
    if (h->mode == HOOK_NEGATIVE) motion->covariance[21] = -1;
    if (h->mode == HOOK_NOT_RIGID) motion->motion.orientation[3] *= 2;
    return h->mode == HOOK_NO_DATA ? FATHOM_ERROR_NO_DATA : FATHOM_OK;
}

static void the_hook_replaces_the_estimate_when_it_has_one(void **state) {
    (void)state;
    fathom_pose own[FRAMES]; /* poses by the library's own estimate: frames far apart, so that the seed matters */
    for (int mode = -1; mode <= HOOK_NOT_RIGID; mode++) {
        fathom_config c = logged();
        hook_record record = {.mode = mode};
        if (mode >= 0) c.inertial_hook = true_motion;
        c.inertial_user = &record;
        synthetic_context s = synthetic_start(&c);
        int steps = 0;
        for (int i = 0; i < FRAMES; i += 5, steps++) {
            fathom_result r = synthetic_step(s.scan, &frames[i]);
            if (mode == -1) own[i] = r.pose;
            if (mode > HOOK_TRUTH)
                assert_memory_equal(&r.pose, &own[i], sizeof r.pose); /* as if it weren't there */
            if (mode != HOOK_TRUTH) continue;
            assert_near_truth(&r, &frames[i], 0.006, 0.004);
            if (i == 0) continue;
            assert_true(record.from == frames[i - 5].timestamp_ns && record.to == frames[i].timestamp_ns);
            assert_true(r.prior_translation_m < 0.008 && r.prior_rotation_rad < 0.006);
        }
        assert_int_equal(record.calls, mode >= 0 ? steps - 1 : 0);
        synthetic_stop(&s);
    }
}

static void the_hook_alone_carries_a_blank_frame(void **state) {
    (void)state;
    fathom_config c = logged();
    hook_record record = {.mode = HOOK_TRUTH};
    c.inertial_hook = true_motion;
    c.inertial_user = &record;
    synthetic_context s = synthetic_start(&c);
    fathom_result before = FATHOM_STRUCT(fathom_result), after = before;
    synthetic_step(s.scan, &frames[0]);
    before = synthetic_step(s.scan, &frames[1]);
    after = synthetic_blank(s.scan, frames[9].timestamp_ns);
    assert_int_equal(after.state, FATHOM_RECKONED);
    assert_true(fabs(synthetic_distance(before.pose, after.pose) -
                     synthetic_distance(frames[1].pose, frames[9].pose)) < 1e-5);
    assert_near_truth(&after, &frames[9], 0.006, 0.004);
    for (int k = 0; k < 6; k++) assert_true(after.pose_covariance[7 * k] >= 1e-4);
    synthetic_stop(&s);
}

static void the_estimate_can_be_asked_for(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context s = synthetic_start(&c);
    int next = 0;
    for (int i = 0; i < 8; i++) {
        push_until(s.scan, &next, frames[i].timestamp_ns);
        synthetic_step(s.scan, &frames[i]);
    }
    fathom_motion there = FATHOM_STRUCT(fathom_motion), back = there;
    push_until(s.scan, &next, frames[9].timestamp_ns);
    assert_int_equal(fathom_inertial_estimate(s.scan, frames[7].timestamp_ns, frames[9].timestamp_ns, &there),
                     FATHOM_OK);
    assert_int_equal(fathom_inertial_estimate(s.scan, frames[9].timestamp_ns, frames[7].timestamp_ns, &back),
                     FATHOM_OK);
    pose from, to, m, n;
    assert_true(pose_take(&frames[7].pose, &from) && pose_take(&frames[9].pose, &to));
    m = pose_between(&from, &to);
    const fathom_pose truth = pose_give(&m);
    assert_true(synthetic_angle(there.motion, truth) < 0.004 &&
                synthetic_distance(there.motion, truth) < 0.02);
    assert_true(pose_take(&there.motion, &m) && pose_take(&back.motion, &n));
    m = pose_multiply(&m, &n);
    assert_true(pose_angle(&m) < 1e-5);
    for (int k = 0; k < 6; k++) assert_true(there.covariance[7 * k] > 0);
    synthetic_stop(&s);
}

/* ---- two threads -------------------------------------------------------------------------------------------------- */

static void *push_all(void *scan) {
    for (int i = 0; i < sample_count; i++) {
        if (fathom_push_imu(scan, &samples[i]) != FATHOM_OK) return scan;
        const struct timespec pause = {0, 200000};
        nanosleep(&pause, NULL);
    }
    return NULL;
}

static void samples_are_pushed_from_a_second_thread_while_stepping(void **state) {
    (void)state;
    fathom_config c = logged();
    synthetic_context s = synthetic_start(&c);
    pthread_t thread;
    void *failed;
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    assert_int_equal(pthread_create(&thread, NULL, push_all, s.scan), 0);
    for (int i = 0; i < FRAMES; i++) {
        fathom_result r = synthetic_step(s.scan, &frames[i]);
        assert_int_equal(r.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
        assert_near_truth(&r, &frames[i], 0.008, 0.005);
        assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    }
    pthread_join(thread, &failed);
    assert_null(failed);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_int_equal(counters.imu_accepted, sample_count);
    assert_true(counters.imu_out_of_order == 0 && counters.imu_overrun == 0 && counters.imu_gaps == 0);
    synthetic_stop(&s);
}

int main(int argc, char **argv) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(poses_follow_the_truth_from_the_first_pose_on),
        cmocka_unit_test(any_size_will_do),
        cmocka_unit_test(the_previous_frame_will_do_as_well),
        cmocka_unit_test(a_covered_lens_at_the_start_waits_for_a_surface),
        cmocka_unit_test(frames_that_cannot_be_used_are_counted_and_change_nothing),
        cmocka_unit_test(clocks_that_jump_leave_everything_finite),
        cmocka_unit_test(a_paused_scan_tracks_and_fuses_nothing),
        cmocka_unit_test(reset_starts_anew),
        cmocka_unit_test(fusing_behind_changes_nothing_but_when),
        cmocka_unit_test(an_outage_is_reckoned_and_found_back_from),
        cmocka_unit_test(a_long_outage_is_called_lost),
        cmocka_unit_test(the_hook_replaces_the_estimate_when_it_has_one),
        cmocka_unit_test(the_hook_alone_carries_a_blank_frame),
        cmocka_unit_test(the_estimate_can_be_asked_for),
        cmocka_unit_test(samples_are_pushed_from_a_second_thread_while_stepping),
    };
    if (argc > 1) cmocka_set_test_filter(argv[1]);
    return cmocka_run_group_tests(tests, setup, NULL);
}
