/* drivers/clock_map: stamps of a device's clock on the host's, from arrivals that are late by chance. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>

#include "clock_map.h"

#define S 1e9

static uint32_t random_state;

static double uniform(void) {
    random_state = random_state * 1664525u + 1013904223u;
    return random_state / 4294967296.0;
}

/* Mostly short, now and then long; with a constant part of nothing. */
static double delay_s(void) {
    const double short_s = -3e-4 * log(1 - 0.999 * uniform());
    return uniform() < 0.02 ? short_s + 0.02 * uniform() : short_s;
}

/* A device whose clock reads `ahead` more than the host's at zero and runs `ppm` fast. */
typedef struct {
    double ahead_s, ppm;
} device;

static int64_t read_clock(const device *d, double host_s) {
    return (int64_t)llrint(S * (d->ahead_s + host_s * (1 + 1e-6 * d->ppm)));
}

typedef struct {
    double worst_s, rms_s, least_step_s, most_step_s;
} outcome;

/* Samples at `rate` from..to of the host's clock; the outcome counts those after `after`. */
static outcome run(clock_map *map, const device *d, double rate, double from, double to, double after) {
    outcome o = {.least_step_s = INFINITY};
    double sum = 0;
    int64_t last_ns = 0;
    int count = 0;
    for (double t = from; t < to; t += 1 / rate) {
        const int64_t arrival_ns = (int64_t)llrint(S * (t + delay_s()));
        const int64_t stamp_ns = clock_map_stamp(map, read_clock(d, t), arrival_ns);
        if (last_ns) {
            assert_true(stamp_ns > last_ns);
            if (t > after) {
                o.least_step_s = fmin(o.least_step_s, (stamp_ns - last_ns) / S);
                o.most_step_s = fmax(o.most_step_s, (stamp_ns - last_ns) / S);
            }
        }
        last_ns = stamp_ns;
        if (t <= after) continue;
        const double error = stamp_ns / S - t;
        o.worst_s = fmax(o.worst_s, fabs(error));
        sum += error * error;
        count++;
    }
    o.rms_s = sqrt(sum / count);
    return o;
}

static int setup(void **state) {
    (void)state;
    random_state = 1;
    return 0;
}

static void stamps_are_much_better_than_arrivals(void **state) {
    (void)state;
    clock_map map = {0};
    const device d = {.ahead_s = 12345.678, .ppm = 0};
    const outcome o = run(&map, &d, 1000, 100, 130, 102);
    assert_true(o.worst_s < 5e-5);
    assert_true(o.rms_s < 3e-5);
    assert_true(fabs(clock_map_offset_s(&map) + 12345.678) < 5e-5);
}

static void drift_is_tracked(void **state) {
    (void)state;
    static const double drifts[] = {100, -100, 40, -3000, 10000};
    for (size_t i = 0; i < sizeof drifts / sizeof *drifts; i++) {
        clock_map map = {0};
        const device d = {.ahead_s = -77, .ppm = drifts[i]};
        const outcome o = run(&map, &d, 500, 100, 190, 140);
        const double off = fabs(clock_map_drift_ppm(&map) - drifts[i]);
        assert_true(o.worst_s < 2e-4);
        assert_true(off < 5 + 0.02 * fabs(drifts[i]));
    }
}

static void a_camera_of_thirty_frames_a_second(void **state) {
    (void)state;
    clock_map map = {0};
    const device d = {.ahead_s = 3, .ppm = 60};
    const outcome o = run(&map, &d, 30, 0.5, 90, 20);
    assert_true(o.worst_s < 3e-4);
    assert_true(o.least_step_s > 0.97 / 30 && o.most_step_s < 1.03 / 30);
}

static void the_first_arrivals_may_be_late(void **state) {
    (void)state;
    clock_map map = {0};
    const device d = {.ahead_s = 0, .ppm = 20};
    clock_map_stamp(&map, read_clock(&d, 1.0), (int64_t)(1.03 * S));
    clock_map_stamp(&map, read_clock(&d, 1.005), (int64_t)(1.031 * S));
    const outcome o = run(&map, &d, 200, 1.01, 5, 2);
    assert_true(o.worst_s < 3e-4);
}

/* What was meant to come one by one comes at once. */
static void a_burst_after_a_pause_of_the_reader(void **state) {
    (void)state;
    clock_map map = {0};
    const device d = {.ahead_s = 9, .ppm = 50};
    run(&map, &d, 200, 1, 20, 10);
    const int64_t late_ns = (int64_t)(21.5 * S);
    for (double t = 20; t < 21.5; t += 0.005) {
        const int64_t stamp_ns = clock_map_stamp(&map, read_clock(&d, t), late_ns);
        assert_true(fabs(stamp_ns / S - t) < 3e-4);
    }
    assert_int_equal(map.leaps, 0);
    assert_true(run(&map, &d, 200, 21.5, 25, 21.5).worst_s < 3e-4);
}

static void a_clock_that_is_reset_is_followed(void **state) {
    (void)state;
    static const double leaps[] = {-1000, 500, -0.3, 0.3};
    for (size_t i = 0; i < sizeof leaps / sizeof *leaps; i++) {
        clock_map map = {0};
        device d = {.ahead_s = 1000, .ppm = -30};
        run(&map, &d, 200, 1, 20, 10);
        const int64_t before_ns = map.last_stamp_ns;
        d.ahead_s += leaps[i];
        const outcome o = run(&map, &d, 200, 20, 40, 21);
        assert_int_equal(map.leaps, 1);
        assert_true(map.last_stamp_ns > before_ns);
        assert_true(o.worst_s < 3e-4);
    }
}

static void a_device_that_was_opened_anew(void **state) {
    (void)state;
    clock_map map = {0};
    device d = {.ahead_s = 0, .ppm = 0};
    run(&map, &d, 200, 1, 1.03, 1);
    clock_map_restart(&map);
    d.ahead_s = -1; /* again from where it was a second ago */
    const outcome o = run(&map, &d, 200, 2, 4, 2.5);
    assert_true(o.worst_s < 3e-4);
}

/* Goes back by less than shows at once, or stands still: the arrivals all get late. */
static void a_clock_that_stood_still_is_found(void **state) {
    (void)state;
    clock_map map = {0};
    device d = {.ahead_s = 5, .ppm = 0};
    run(&map, &d, 200, 1, 10, 5);
    d.ahead_s -= 3; /* it begins again where it stopped, three seconds later */
    const outcome o = run(&map, &d, 200, 13, 25, 17);
    assert_int_equal(map.leaps, 1);
    assert_true(o.worst_s < 3e-4);
}

static void stamps_are_never_in_the_future(void **state) {
    (void)state;
    clock_map map = {0};
    const device d = {.ahead_s = 0, .ppm = -200};
    for (double t = 1; t < 30; t += 0.002) {
        const int64_t arrival_ns = (int64_t)llrint(S * (t + delay_s()));
        assert_true(clock_map_stamp(&map, read_clock(&d, t), arrival_ns) <= arrival_ns);
    }
}

static void extreme_stamps_are_survived(void **state) {
    (void)state;
    static const int64_t odd[] = {INT64_MAX, INT64_MIN, 0, -1, 1, INT64_MAX - 1, INT64_MIN + 1, 1000000000};
    clock_map map = {0};
    int64_t last_ns = 0;
    for (int i = 0; i < 4000; i++) {
        const int64_t arrival_ns = 1000000 * (int64_t)(i + 1);
        const int64_t device_ns = odd[(int)(8 * uniform())] ^ (int64_t)(1e6 * uniform());
        const int64_t stamp_ns = clock_map_stamp(&map, device_ns, arrival_ns);
        assert_true(i == 0 || stamp_ns > last_ns);
        assert_true(isfinite(clock_map_offset_s(&map)) && isfinite(clock_map_drift_ppm(&map)));
        last_ns = stamp_ns;
    }
}

static void another_stamp_of_the_clock(void **state) {
    (void)state;
    clock_map map = {0};
    const device d = {.ahead_s = 50, .ppm = 80};
    run(&map, &d, 100, 1, 30, 10);
    assert_true(fabs(clock_map_at(&map, read_clock(&d, 29.5)) / S - 29.5) < 3e-4);
}

/* ---- counters ---- */

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(stamps_are_much_better_than_arrivals, setup),
        cmocka_unit_test_setup(drift_is_tracked, setup),
        cmocka_unit_test_setup(a_camera_of_thirty_frames_a_second, setup),
        cmocka_unit_test_setup(the_first_arrivals_may_be_late, setup),
        cmocka_unit_test_setup(a_burst_after_a_pause_of_the_reader, setup),
        cmocka_unit_test_setup(a_clock_that_is_reset_is_followed, setup),
        cmocka_unit_test_setup(a_device_that_was_opened_anew, setup),
        cmocka_unit_test_setup(a_clock_that_stood_still_is_found, setup),
        cmocka_unit_test_setup(stamps_are_never_in_the_future, setup),
        cmocka_unit_test_setup(extreme_stamps_are_survived, setup),
        cmocka_unit_test_setup(another_stamp_of_the_clock, setup),
    };
    return cmocka_run_group_tests_name("clock_map", tests, NULL, NULL);
}
