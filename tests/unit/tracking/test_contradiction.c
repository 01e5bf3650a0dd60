/* A surface that contradicts what inertia and alignment agree on: something that stood in the room is taken away. It gives way,
 * and the scan goes on; a view that nothing agrees with does not. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <string.h>

#include "base/se3.h"
#include "synthetic.h"

#define FRAMES 90
#define GONE 40       /* from this frame on the board is away */
#define ANSWER 0.15   /* s: no contradiction lasts longer */
#define SAMPLES 1200
#define BOARD_M 0.35  /* half its side */

static synthetic_frame room[FRAMES], desk[1];
static fathom_imu_sample samples[SAMPLES];
static int sample_count;

/* A board that stands across the first camera's view, between it and the room. */
static void put_board(synthetic_frame *frame, double distance_m) {
    pose first, at;
    assert_true(pose_take(&room[0].pose, &first) && pose_take(&frame->pose, &at));
    const pose way = pose_between(&first, &at);
    const fathom_config c = synthetic_config(&room[0]);
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) {
        const double u = (i % SYNTHETIC_WIDTH - c.depth_camera.cx) / c.depth_camera.fx;
        const double v = (i / SYNTHETIC_WIDTH - c.depth_camera.cy) / c.depth_camera.fy;
        double d[3], p[3];
        for (int k = 0; k < 3; k++) d[k] = way.r[3 * k] * u + way.r[3 * k + 1] * v + way.r[3 * k + 2];
        const double z = (distance_m - way.t[2]) / d[2];
        for (int k = 0; k < 3; k++) p[k] = way.t[k] + z * d[k];
        const double units = z * SYNTHETIC_UNITS;
        if (z > 0.3 && fabs(p[0]) < BOARD_M && fabs(p[1]) < BOARD_M && (frame->depth[i] == 0 || units < frame->depth[i]))
            frame->depth[i] = (uint16_t)lround(units);
    }
}

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_ROOM, 0.3, FRAMES, room);
    synthetic_render(SCENE_DESK, 0, 1, desk);
    sample_count = synthetic_imu(SCENE_ROOM, 0.3, FRAMES, "phone", 200, SAMPLES, samples);
    for (int i = 0; i < GONE; i++) put_board(&room[i], 1.0);
    return 0;
}

static synthetic_context begin(void) {
    fathom_config c = synthetic_config(&room[0]);
    c.imu = true;
    return synthetic_start(&c);
}

/* Pushes the samples up to the frame, and steps. */
static fathom_result next(fathom *scan, int i, int *pushed, const synthetic_frame *frame) {
    while (*pushed < sample_count && samples[*pushed].timestamp_ns <= room[i].timestamp_ns + 5000000)
        assert_int_equal(fathom_push_imu(scan, &samples[(*pushed)++]), FATHOM_OK);
    synthetic_frame shown = *frame;
    shown.timestamp_ns = room[i].timestamp_ns;
    return synthetic_step(scan, &shown);
}

static void what_was_taken_away_gives_way(void **state) {
    (void)state;
    synthetic_context s = begin();
    int pushed = 0, refused = 0;
    for (int i = 0; i < GONE; i++) assert_true(next(s.scan, i, &pushed, &room[i]).fused);
    for (int i = GONE; i < FRAMES; i++) {
        const fathom_result r = next(s.scan, i, &pushed, &room[i]);
        refused += r.state != FATHOM_TRACKED;
        if (i == GONE) assert_int_equal(r.verdict, FATHOM_VERDICT_CONTRADICTION);
        if ((i - GONE) / 30.0 > ANSWER) assert_true(r.state == FATHOM_TRACKED && r.fused);
        if ((i - GONE) / 30.0 < ANSWER) assert_int_equal(r.contradicted, 1);
        assert_true(synthetic_distance(r.pose, room[i].pose) < 0.02);
        assert_true(synthetic_angle(r.pose, room[i].pose) < 0.02);
        if (i == FRAMES - 1) assert_true(isnan(r.see_through) || r.see_through < 0.01); /* the surface has learnt */
    }
    print_message("# %d frames were refused\n", refused);
    assert_true(refused >= 2);
    synthetic_stop(&s);
}

/* A caller's inertial estimate: the true motion, known to 2 mm and 2 mrad. */
static int true_motion(void *user, int64_t from_ns, int64_t to_ns, fathom_motion *motion) {
    (void)user;
    pose at[2];
    for (int i = 0, k = 0; i < FRAMES && k < 2; i++)
        if (room[i].timestamp_ns == (k ? to_ns : from_ns)) assert_true(pose_take(&room[i].pose, &at[k++]));
    const pose way = pose_between(&at[0], &at[1]);
    motion->motion = pose_give(&way);
    for (int i = 0; i < 6; i++) motion->covariance[7 * i] = 4e-6;
    return FATHOM_OK;
}

/* The frame that ends a contradiction is less sure than others: only a tenth of alignment's information counts. */
static void a_contradicted_pose_is_less_sure(void **state) {
    (void)state;
    fathom_config c = synthetic_config(&room[0]);
    c.inertial_hook = true_motion;
    synthetic_context s = synthetic_start(&c);
    double plain = 0, answered = 0;
    for (int i = 0; i < FRAMES && answered == 0; i++) {
        const fathom_result r = synthetic_step(s.scan, &room[i]);
        if (i < GONE) plain = fmax(plain, r.pose_covariance[35]);
        if (i >= GONE && r.fused) answered = r.pose_covariance[35];
    }
    assert_true(answered > 4 * plain);
    synthetic_stop(&s);
}

/* Another room: alignment finds nothing that inertia confirms. */
static void a_view_of_something_else_is_never_taken(void **state) {
    (void)state;
    synthetic_context s = begin();
    int pushed = 0;
    for (int i = 0; i < GONE; i++) assert_true(next(s.scan, i, &pushed, &room[i]).fused);
    for (int i = GONE; i < FRAMES; i++) assert_false(next(s.scan, i, &pushed, &desk[0]).fused);
    synthetic_stop(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_was_taken_away_gives_way),
        cmocka_unit_test(a_contradicted_pose_is_less_sure),
        cmocka_unit_test(a_view_of_something_else_is_never_taken),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
