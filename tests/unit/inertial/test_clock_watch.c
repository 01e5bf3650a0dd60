/* lib/inertial/clock_watch: what is a leap of a clock, and what only looks like one. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "inertial/clock_watch.h"

#define MS 1000000ll
#define PERIOD (5 * MS)
#define FRAME (35 * MS)

static clock_watch w;
static int64_t last; /* the newest sample */

static int setup(void **state) {
    (void)state;
    w = (clock_watch){0};
    last = 0;
    return 0;
}

/* Samples up to a stamp, then a frame. What the watch wants added. */
static int64_t arrive(int64_t frame, int64_t until) {
    int64_t from = 0;
    if (until == last) return 0; /* nobody asks when there are no new samples */
    for (; last < until; last += PERIOD) clock_watch_samples(&w, last, last + PERIOD);
    return clock_watch_frame(&w, frame, last, PERIOD, &from);
}

/* Frames from..to-1, samples `lead` ahead of them; 0 all the way. */
static void go_on(int from, int to, int64_t lead) {
    for (int i = from; i < to; i++) assert_int_equal(arrive(i * FRAME, i * FRAME + lead), 0);
}

static void leap_to(int64_t stamp) {
    clock_watch_samples(&w, last, stamp);
    last = stamp;
}

static void a_leap_of_the_samples_is_taken_back_exactly(void **state) {
    (void)state;
    const int64_t leaps[] = {3000 * MS, 300 * MS, -2000 * MS};
    for (int k = 0; k < 3; k++) {
        setup(NULL);
        go_on(1, 20, 10 * MS);
        leap_to(last + PERIOD + leaps[k]);
        int64_t add = 0;
        int frames = 0;
        for (; frames < 12 && add == 0; frames++)
            add = arrive((20 + frames) * FRAME, (20 + frames) * FRAME + 10 * MS + leaps[k]);
        assert_int_equal(add, -leaps[k]);
        assert_in_range(frames, 5, 8); /* 0.2 s */
    }
}

static void a_leap_of_the_frames_is_followed(void **state) {
    (void)state;
    int64_t add = 0;
    go_on(1, 20, 10 * MS);
    for (int i = 20; i < 32 && add == 0; i++) add = arrive(i * FRAME + 5000 * MS, i * FRAME + 10 * MS);
    assert_in_range(add, 4990 * MS, 5010 * MS);
}

static void a_gap_is_no_leap(void **state) {
    (void)state;
    go_on(1, 20, 10 * MS);
    leap_to(100 * FRAME); /* the first sample after the gap, pushed as the one beyond a frame */
    int64_t from;
    assert_int_equal(clock_watch_frame(&w, 20 * FRAME, last, PERIOD, &from), 0);
    go_on(101, 140, 10 * MS);
}

static void samples_pushed_ahead_are_no_leap(void **state) {
    (void)state;
    for (int block = 0; block < 5; block++) /* a second's at once */
        for (int i = 0; i < 28; i++)
            assert_int_equal(arrive((block * 28 + i) * FRAME, (block + 1) * 28 * FRAME), 0);
}

static void frames_that_get_slower_on_their_way_are_no_leap(void **state) {
    (void)state;
    go_on(1, 20, 10 * MS);
    go_on(20, 60, 500 * MS);
    go_on(80, 120, 10 * MS);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_leap_of_the_samples_is_taken_back_exactly, setup),
        cmocka_unit_test_setup(a_leap_of_the_frames_is_followed, setup),
        cmocka_unit_test_setup(a_gap_is_no_leap, setup),
        cmocka_unit_test_setup(samples_pushed_ahead_are_no_leap, setup),
        cmocka_unit_test_setup(frames_that_get_slower_on_their_way_are_no_leap, setup),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
