/* A camera that is carried off to where nothing is known: how often it is looked for, and that it is found again. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "synthetic.h"

#define KNOWN 12
#define EAGER 15 /* frames that are looked for once it is lost */
#define RARE 30  /* and then one in so many */
#define AWAY 80

static synthetic_frame desk[KNOWN], room[1];
static int64_t now_ns;

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_DESK, 0, KNOWN, desk);
    synthetic_render(SCENE_ROOM, 0, 1, room);
    return 0;
}

/* What the frame shows, a period later than the frame before. */
static fathom_result see(synthetic_context *s, const synthetic_frame *frame) {
    static synthetic_frame shown;
    shown = *frame;
    shown.timestamp_ns = now_ns += SYNTHETIC_PERIOD_NS;
    return synthetic_step(s->scan, &shown);
}

static synthetic_context scanned(void) {
    fathom_config c = synthetic_config(&desk[0]);
    c.imu = false;
    c.max_reckoned_sigma_m = 0.05f;
    synthetic_context s = synthetic_start(&c);
    for (int i = 0; i < KNOWN; i++) assert_true(see(&s, &desk[i]).fused);
    return s;
}

/* Carries the camera off until it is lost; that frame has been looked for. */
static void lose(synthetic_context *s) {
    fathom_result r = FATHOM_STRUCT(fathom_result);
    for (int i = 0; i < 60 && r.state != FATHOM_LOST; i++) {
        r = see(s, &room[0]);
        assert_int_not_equal(r.state, FATHOM_TRACKED);
        assert_true(r.searched);
    }
    assert_int_equal(r.state, FATHOM_LOST);
}

static void lost_for_long_is_looked_for_now_and_then(void **state) {
    (void)state;
    synthetic_context s = scanned();
    lose(&s);
    for (int i = 1; i < AWAY; i++) {
        fathom_result r = see(&s, &room[0]);
        assert_int_equal(r.state, FATHOM_LOST);
        assert_int_equal(r.searched, i < EAGER || i % RARE == 0);
        if (!r.searched)
            assert_true(r.verdict == FATHOM_VERDICT_FEW_PAIRS && r.pairs == 0 && r.iterations == 0);
    }
    synthetic_stop(&s);
}

static void it_is_found_again(void **state) {
    (void)state;
    synthetic_context s = scanned();
    lose(&s);
    for (int i = 1; i < AWAY; i++) see(&s, &room[0]);
    fathom_result r = FATHOM_STRUCT(fathom_result);
    for (int i = 0; i < RARE && r.state != FATHOM_TRACKED; i++) r = see(&s, &desk[KNOWN - 1]);
    assert_int_equal(r.state, FATHOM_TRACKED);
    assert_true(synthetic_distance(r.pose, desk[KNOWN - 1].pose) < 0.01);
    assert_true(see(&s, &desk[KNOWN - 1]).state == FATHOM_TRACKED);
    lose(&s); /* anew */
    for (int i = 1; i < EAGER; i++) assert_true(see(&s, &room[0]).searched);
    synthetic_stop(&s);
}

static void after_a_covered_lens_the_first_frame_is_looked_for(void **state) {
    (void)state;
    synthetic_context s = scanned();
    lose(&s);
    for (int i = 1; i < EAGER + 5; i++) see(&s, &room[0]);
    fathom_result r = synthetic_blank(s.scan, now_ns += SYNTHETIC_PERIOD_NS);
    assert_int_equal(r.verdict, FATHOM_VERDICT_NO_DEPTH);
    r = see(&s, &desk[KNOWN - 1]);
    assert_int_equal(r.state, FATHOM_TRACKED);
    assert_true(synthetic_distance(r.pose, desk[KNOWN - 1].pose) < 0.01);
    synthetic_stop(&s);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lost_for_long_is_looked_for_now_and_then),
        cmocka_unit_test(it_is_found_again),
        cmocka_unit_test(after_a_covered_lens_the_first_frame_is_looked_for),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
