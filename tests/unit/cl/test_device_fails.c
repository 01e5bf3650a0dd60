/* OpenCL calls that fail, each that a call of the library makes in turn: the error is returned, the last good pose stays
 * and isn't called tracked, nothing more is launched, every later call says that the context is dead, and it can be closed.
 * opencl_shim.h makes the calls fail; a case is a situation and a kind of call. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "context.h"
#include "opencl_shim.h"
#include "synthetic.h"

#define FRAMES 46
#define FAR (FRAMES - 1) /* a frame that shows another part of the room */
#define MAX_SAMPLES 4000
#define MAX_TRIED 24 /* calls of a kind that are made to fail, of those that a situation makes: a search makes thousands */

static synthetic_frame frames[FRAMES];
static fathom_imu_sample samples[MAX_SAMPLES];
static int sample_count, pushed;
static synthetic_context context; /* it is used for all cases: revived when it was dead */

/* ---- what a caller does ----------------------------------------------------------------------------------------------- */

static int step_with(int index, int64_t timestamp_ns, fathom_result *r) {
    fathom_depth_frame frame = FATHOM_STRUCT(fathom_depth_frame);
    frame.timestamp_ns = timestamp_ns;
    frame.depth = frames[index].depth;
    frame.width = SYNTHETIC_WIDTH;
    frame.height = SYNTHETIC_HEIGHT;
    *r = FATHOM_STRUCT(fathom_result);
    return fathom_step(context.scan, &frame, r);
}

static void good_step(int index, int64_t timestamp_ns) {
    fathom_result r;
    assert_int_equal(step_with(index, timestamp_ns, &r), FATHOM_OK);
}

static void nothing_before(void) {
    assert_int_equal(fathom_reset(context.scan), FATHOM_OK);
    context.scan->config.fuse_behind = false;
    context.scan->config.against = FATHOM_AGAINST_MODEL;
    pushed = 0;
}

static void two_frames_before(void) {
    nothing_before();
    for (int i = 0; i < 2; i++) good_step(i, frames[i].timestamp_ns);
}

static void push_until(int64_t timestamp_ns) {
    for (; pushed < sample_count && samples[pushed].timestamp_ns <= timestamp_ns; pushed++)
        fathom_push_imu(context.scan, &samples[pushed]);
}

static void samples_before(void) {
    nothing_before();
    for (int i = 0; i < 2; i++) {
        push_until(frames[i].timestamp_ns);
        good_step(i, frames[i].timestamp_ns);
    }
    push_until(frames[2].timestamp_ns);
}

static void fusing_behind(void) {
    nothing_before();
    context.scan->config.fuse_behind = true;
    for (int i = 0; i < 2; i++) good_step(i, frames[i].timestamp_ns);
}

static void against_previous(void) {
    nothing_before();
    context.scan->config.against = FATHOM_AGAINST_PREVIOUS;
    for (int i = 0; i < 2; i++) good_step(i, frames[i].timestamp_ns);
}

/* Blocks that are dropped: until the step before the first that does. */
static int dropping_frame;

static void full_before(void) {
    nothing_before();
    for (int i = 0; i < dropping_frame; i++) good_step(i, frames[i].timestamp_ns);
}

static int first_step(fathom_result *r) { return step_with(0, frames[0].timestamp_ns, r); }
static int next_step(fathom_result *r) { return step_with(2, frames[2].timestamp_ns, r); }
static int far_step(fathom_result *r) { return step_with(FAR, frames[2].timestamp_ns, r); }
static int dropping_step(fathom_result *r) {
    return step_with(dropping_frame, frames[dropping_frame].timestamp_ns, r);
}

static int ignore(void *user, const fathom_vertex *vertices, size_t count) {
    (void)user, (void)vertices, (void)count;
    return 0;
}

static int mesh(fathom_result *r) {
    (void)r;
    int64_t count = fathom_extract_mesh(context.scan, 0, ignore, NULL);
    return count < 0 ? (int)count : count > 1000 ? FATHOM_OK : 1;
}

static int view(fathom_result *r) {
    static float depth[SYNTHETIC_PIXELS];
    (void)r;
    fathom_view v = FATHOM_STRUCT(fathom_view);
    v.camera = context.scan->config.depth_camera;
    v.pose = context.scan->result.pose;
    return fathom_cast_view(context.scan, &v, depth, NULL);
}

static int reset(fathom_result *r) {
    (void)r;
    return fathom_reset(context.scan);
}

static const struct situation {
    const char *name;
    void (*before)(void);
    int (*act)(fathom_result *r);
    bool steps;
    fathom_state state; /* that a step ends with when nothing fails */
} situations[] = {
    {"the first step", nothing_before, first_step, true, FATHOM_FIRST},
    {"a tracked step", two_frames_before, next_step, true, FATHOM_TRACKED},
    {"a tracked step with the IMU", samples_before, next_step, true, FATHOM_TRACKED},
    {"a tracked step, fused behind", fusing_behind, next_step, true, FATHOM_TRACKED},
    {"a tracked step against the frame before", against_previous, next_step, true, FATHOM_TRACKED},
    {"a step that drops blocks", full_before, dropping_step, true, FATHOM_TRACKED},
    {"a step that searches", two_frames_before, far_step, true, FATHOM_RECKONED},
    {"a mesh", two_frames_before, mesh, false, 0},
    {"a view", two_frames_before, view, false, 0},
    {"a reset", two_frames_before, reset, false, 0},
};
#define SITUATIONS ((int)(sizeof situations / sizeof *situations))

/* ---- a case ------------------------------------------------------------------------------------------------------------- */

typedef struct {
    const struct situation *in;
    shim_kind kind;
    int calls; /* that the situation makes */
    char title[160];
} job;

static void every_call_says_dead(const fathom_result *last) {
    fathom *f = context.scan;
    fathom_result r;
    fathom_motion m = FATHOM_STRUCT(fathom_motion);
    fathom_rig rig = FATHOM_STRUCT(fathom_rig);
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    fathom_pose at;
    double covariance[36];
    assert_int_equal(step_with(3, frames[3].timestamp_ns, &r), FATHOM_ERROR_DEVICE);
    assert_memory_equal(&r.pose, &last->pose, sizeof r.pose);
    assert_int_equal(r.state, FATHOM_LOST);
    assert_int_equal(fathom_push_imu(f, &samples[0]), FATHOM_ERROR_DEVICE);
    assert_int_equal(fathom_inertial_estimate(f, 0, 1000000, &m), FATHOM_ERROR_DEVICE);
    assert_int_equal(fathom_get_pose(f, &at, covariance), FATHOM_ERROR_DEVICE);
    assert_int_equal(fathom_get_rig(f, &rig), FATHOM_ERROR_DEVICE);
    assert_int_equal(fathom_get_counters(f, &counters), FATHOM_ERROR_DEVICE);
    assert_int_equal(mesh(&r), FATHOM_ERROR_DEVICE);
    assert_int_equal(view(&r), FATHOM_ERROR_DEVICE);
    assert_int_equal(fathom_reset(f), FATHOM_ERROR_DEVICE);
    assert_int_equal(fathom_pause(f, true), FATHOM_ERROR_DEVICE);
    assert_int_equal(fathom_save_kernels(f, synthetic_folder("kernels")), FATHOM_ERROR_DEVICE);
    assert_non_null(strstr(fathom_last_error(f), "failed"));
}

/* Only this test can do that: the shim has left the device as it was. */
static void revive(void) {
    context.scan->device.error = FATHOM_OK;
    atomic_store(&context.scan->dead, false);
}

static void fails_at(const job *j, int nth) {
    fathom_result r = FATHOM_STRUCT(fathom_result);
    revive();
    j->in->before();
    const fathom_result last = context.scan->result;
    const pose at = context.scan->pose;
    shim_fail(j->kind, nth);
    int e = j->in->act(&r);
    bool made = shim_failed();
    int later = shim_later();
    shim_start();
    if (e != FATHOM_ERROR_DEVICE || !made || later)
        print_error("call %d of %d: made %d, error %d, %d calls later\n", nth, j->calls, made, e, later);
    assert_true(made);
    assert_int_equal(e, FATHOM_ERROR_DEVICE);
    assert_int_equal(later, 0);
    if (j->in->steps) {
        assert_memory_equal(&r.pose, &last.pose, sizeof r.pose);
        assert_memory_equal(&r.odometry, &last.odometry, sizeof r.odometry);
        assert_int_equal(r.state, FATHOM_LOST);
        assert_int_equal(r.verdict, FATHOM_VERDICT_DEVICE);
        assert_false(r.fused);
    }
    assert_memory_equal(&context.scan->pose, &at, sizeof at);
    every_call_says_dead(&last);
    revive();
}

static void each_call_fails(void **state) {
    const job *j = *state;
    int tried = j->calls < MAX_TRIED ? j->calls : MAX_TRIED;
    for (int i = 0; i < tried; i++) fails_at(j, (int)((int64_t)i * (j->calls - 1) / (tried > 1 ? tried - 1 : 1)));
}

/* ---- opening and closing ----------------------------------------------------------------------------------------------- */

static fathom_config plain(void) {
    return synthetic_config(&frames[0]);
}

static int init_with(const fathom_config *c, fathom **scan, void *block, size_t bytes) {
    char why[256] = "";
    int e = fathom_init(scan, c, block, bytes, why, sizeof why);
    if (e != FATHOM_OK) {
        assert_null(*scan);
        assert_true(*why);
    }
    return e;
}

static void an_init_that_fails_leaves_nothing_open(void **state) {
    const job *j = *state;
    fathom_config c = plain();
    fathom *scan = NULL;
    bool build = j->kind == SHIM_SOURCE || j->kind == SHIM_BUILD;
    if (build) c.cache_folder = "";
    shim_start();
    size_t bytes = (size_t)fathom_memory_required(&c, NULL, 0);
    void *block = malloc(bytes);
    assert_int_equal(init_with(&c, &scan, block, bytes), FATHOM_OK);
    fathom_close(scan);
    int calls = shim_count(j->kind) - (j->kind == SHIM_FINISH), tried = calls < 6 ? calls : 6;
    assert_true(calls > 0);
    for (int i = 0; i < tried; i++) {
        shim_fail(j->kind, i * (calls - 1) / (tried > 1 ? tried - 1 : 1));
        int e = init_with(&c, &scan, block, bytes);
        assert_true(shim_failed());
        assert_int_equal(e, build ? FATHOM_ERROR_KERNEL : FATHOM_ERROR_DEVICE);
    }
    shim_start();
    free(block);
}

static void a_dead_context_closes(void **state) {
    (void)state;
    synthetic_context kept = context;
    for (int k = SHIM_ARGUMENT; k <= SHIM_FINISH; k++) {
        fathom_config c = plain();
        fathom_result r;
        context = synthetic_start(&c);
        two_frames_before();
        shim_fail((shim_kind)k, 1);
        int e = next_step(&r);
        shim_start();
        synthetic_stop(&context);
        if (k != SHIM_FILL) assert_int_equal(e, FATHOM_ERROR_DEVICE);
    }
    context = kept;
}

/* ---- main --------------------------------------------------------------------------------------------------------------- */

static int keep_none(void *user, const fathom_block *block) {
    (void)user, (void)block;
    return 0;
}

/* The pool holds little more than the first frame; returns false when no step drops blocks. */
static bool start(void) {
    fathom_config c = plain();
    fathom_result r;
    context = synthetic_start(&c);
    first_step(&r);
    synthetic_stop(&context);
    c.max_blocks = r.blocks + r.blocks / 8;
    const fathom_block_store store = {.struct_size = sizeof store, .put = keep_none};
    c.when_full = FATHOM_FULL_DROP;
    c.block_store = &store;
    context = synthetic_start(&c);
    nothing_before();
    for (dropping_frame = 0; dropping_frame < FRAMES; dropping_frame++)
        if (dropping_step(&r) != FATHOM_OK || r.blocks_dropped > 0) break;
    return dropping_frame > 2 && dropping_frame < FRAMES;
}

int main(void) {
    static job jobs[SITUATIONS * SHIM_KINDS + SHIM_KINDS];
    static struct CMUnitTest tests[sizeof jobs / sizeof *jobs + 1];
    int count = 0;
    synthetic_render(SCENE_ROOM, 0, FRAMES, frames);
    sample_count = synthetic_imu(SCENE_ROOM, 0, FRAMES, "consumer", 200, MAX_SAMPLES, samples);
    if (!start()) {
        printf("Bail out! no step drops blocks\n");
        return 1;
    }
    for (int s = 0; s < SITUATIONS; s++) {
        fathom_result r;
        situations[s].before();
        shim_start();
        int e = situations[s].act(&r);
        if (e != FATHOM_OK || (situations[s].steps && r.state != (int)situations[s].state)) {
            printf("Bail out! %s: error %d, state %d\n", situations[s].name, e, (int)r.state);
            return 1;
        }
        for (int k = 0; k < SHIM_KINDS; k++) {
            if (shim_count((shim_kind)k) == 0) continue;
            job *j = &jobs[count];
            *j = (job){&situations[s], (shim_kind)k, shim_count((shim_kind)k), ""};
            snprintf(j->title, sizeof j->title, "%s: each %s fails", j->in->name, shim_names[k]);
            tests[count++] = (struct CMUnitTest){j->title, each_call_fails, NULL, NULL, j};
        }
    }
    for (int k = 0; k < SHIM_FLUSH; k++) {
        job *j = &jobs[count];
        j->kind = (shim_kind)k;
        snprintf(j->title, sizeof j->title, "opening: %s fails", shim_names[k]);
        tests[count++] = (struct CMUnitTest){j->title, an_init_that_fails_leaves_nothing_open, NULL, NULL, j};
    }
    tests[count++] = (struct CMUnitTest){"a dead context closes", a_dead_context_closes, NULL, NULL, NULL};
    shim_start();
    int failed = _cmocka_run_group_tests("device fails", tests, (size_t)count, NULL, NULL);
    synthetic_stop(&context);
    return failed;
}
