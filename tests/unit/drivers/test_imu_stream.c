/* From readings to samples in the queue: pairing, stamps, batches, order; and uris taken apart. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "address.h"
#include "imu/iio_channels.h"
#include "imu/imu_stream.h"
#include "imu/kinect_motor.h"

#define MS INT64_C(1000000)

static source_queue queue;
static imu_stream stream;
static fathom_imu_sample samples[8192];

static int begin(void **state) {
    (void)state;
    if (source_queue_make(&queue, 8192, 0, 0, 0, false)) return -1;
    imu_stream_init(&stream, &queue);
    source_queue_start(&queue);
    return 0;
}

static int finish(void **state) {
    (void)state;
    imu_stream_free(&stream);
    source_queue_free(&queue);
    return 0;
}

static int take_all(void) {
    const int n = source_queue_read_imu(&queue, samples, 8192);
    for (int i = 1; i < n; i++) assert_true(samples[i].timestamp_ns > samples[i - 1].timestamp_ns);
    return n;
}

static fathom_source_status counts(void) {
    fathom_source_status s = {0};
    source_queue_status(&queue, &s);
    imu_stream_status(&stream, &s);
    return s;
}

/* A reading of one sensor, or both, whose values are its time in seconds. */
static imu_reading at(bool gyro, bool accel, int64_t device_ns) {
    imu_reading r = {.has_gyro = gyro,
                     .has_accel = accel,
                     .samples = 1,
                     .times = device_ns >= 0,
                     .device_ns = {device_ns}};
    for (int i = 0; i < 3; i++) r.gyro[0][i] = r.accel[0][i] = (double)device_ns * 1e-9;
    return r;
}

static void sensors_are_paired_by_their_stamps(void **state) {
    (void)state;
    /* a gyroscope at 200 a second, an accelerometer at 75, each with delays of its own; a device clock 5 s ahead */
    int gyros = 0;
    for (int64_t t = 0; t < 2000 * MS; t += MS / 3) {
        const int64_t host = 1000 * MS + t;
        if (t % (5 * MS) < MS / 3) {
            const imu_reading r = at(true, false, t + 5000 * MS);
            imu_stream_take(&stream, &r, host + 2 * MS);
            gyros++;
        }
        if (t % (13333333) < MS / 3) {
            const imu_reading r =
                at(false, true, t + 5000 * MS - 4 * MS); /* 4 ms older than when it is sent */
            imu_stream_take(&stream, &r, host + 3 * MS);
        }
    }
    const int n = take_all();
    assert_in_range(n, gyros - 5, gyros); /* the last ones wait */
    int known = 0;
    for (int i = 0; i < n; i++) {
        assert_true(fabs((double)(samples[i].timestamp_ns - 1002 * MS) * 1e-9 - (samples[i].gyro[0] - 5)) <
                    3e-3);
        if (isnan(samples[i].accel[0])) continue;
        known++;
        if (i > 8)
            assert_true(fabs(samples[i].accel[0] - samples[i].gyro[0]) < 1e-3); /* interpolated to its time */
    }
    assert_true(known > n - 5);
    assert_true(fabs(counts().clock_offset_s + 3.998) < 2e-3);
    assert_int_equal(counts().malformed, 0);
}

static void an_accelerometer_that_dies_is_not_waited_for(void **state) {
    (void)state;
    for (int i = 0; i < 1000; i++) {
        imu_reading r = at(true, false, i * 5 * MS);
        imu_stream_take(&stream, &r, 1000 * MS + i * 5 * MS);
        r = at(false, true, i * 5 * MS + MS);
        if (i < 300) imu_stream_take(&stream, &r, 1000 * MS + i * 5 * MS + MS);
    }
    const int n = take_all();
    assert_int_equal(n, 1000); /* none waits any more */
    assert_false(isnan(samples[290].accel[0]));
    assert_true(isnan(samples[330].accel[0]) && isnan(samples[999].accel[2]));
    for (int i = 0; i < 300; i++)
        assert_true(isnan(samples[i].accel[0]) || fabs(samples[i].accel[0] - samples[i].gyro[0]) < 6e-3);
}

static void without_an_accelerometer(void **state) {
    (void)state;
    for (int i = 0; i < 200; i++) {
        const imu_reading r = at(true, false, i * 5 * MS);
        imu_stream_take(&stream, &r, 1000 * MS + i * 5 * MS);
    }
    const int n = take_all();
    assert_in_range(n, 170, 200);
    assert_true(isnan(samples[n - 1].accel[0]));
}

static void accelerometers_alone_pass(void **state) {
    (void)state;
    imu_stream_restart(&stream, true);
    uint8_t bytes[10] = {0, 0, 0, 0, 819 >> 8, 819 & 255, 0xFF, 0x9A, 0, 0};
    imu_reading r;
    assert_true(kinect_motor_read(bytes, sizeof bytes, &r));
    imu_stream_take(&stream, &r, 1000 * MS);
    assert_int_equal(take_all(), 1);
    assert_true(isnan(samples[0].gyro[0]));
    assert_true(fabs(samples[0].accel[1] - 9.80665) < 1e-5);
    assert_true(samples[0].accel[2] < 0);
    assert_false(kinect_motor_read(bytes, 9, &r));
    bytes[2] = 0x7F;
    assert_false(kinect_motor_read(bytes, sizeof bytes, &r));
}

static void batches_are_spread(void **state) {
    (void)state;
    /* three samples a report, 5 ms apart, no device clock, and reports that arrive with jitter */
    for (int i = 0; i < 100; i++) {
        imu_reading r = at(true, true, -1);
        r.samples = 3;
        r.period_ns = 5 * MS;
        imu_stream_take(&stream, &r, 1000 * MS + i * 15 * MS + rand() % MS);
    }
    assert_int_equal(take_all(), 300);
    for (int i = 3; i < 300; i += 3)
        assert_int_equal(samples[i + 1].timestamp_ns - samples[i].timestamp_ns, 5 * MS);
    /* four samples with the last one's stamp: the rest between it and the report before */
    imu_stream_restart(&stream, false);
    for (int i = 0; i < 100; i++) {
        imu_reading r = at(true, true, 0);
        r.samples = 4;
        r.device_ns[3] = i * 8 * MS;
        imu_stream_take(&stream, &r, 9000 * MS + i * 8 * MS);
    }
    assert_int_equal(take_all(), 400);
    for (int i = 8; i < 399; i++)
        assert_in_range(samples[i + 1].timestamp_ns - samples[i].timestamp_ns, 1900000, 2100000);
}

static void repeated_and_late_ones_are_dropped(void **state) {
    (void)state;
    const int64_t stamps[] = {0, 5, 10, 10, 15, 12, 20};
    for (size_t i = 0; i < sizeof stamps / sizeof *stamps; i++) {
        const imu_reading r = at(true, true, stamps[i] * MS);
        imu_stream_take(&stream, &r, 1000 * MS + (int64_t)i * 5 * MS);
    }
    assert_int_equal(take_all(), 5);
    assert_int_equal(counts().malformed, 2);
}

static void a_clock_that_starts_again_is_followed(void **state) {
    (void)state;
    for (int i = 0; i < 400; i++) {
        const imu_reading r = at(true, true, (i < 200 ? 7000 + 5 * i : 5 * (i - 200)) * MS);
        imu_stream_take(&stream, &r, 1000 * MS + i * 5 * MS);
    }
    assert_int_equal(take_all(), 400);
    assert_in_range(samples[399].timestamp_ns - 1000 * MS, 1990 * MS, 1996 * MS);
}

static void losses_are_counted(void **state) {
    (void)state;
    imu_reading r = at(true, true, 0);
    r.lost = 7;
    imu_stream_take(&stream, &r, 1000 * MS);
    assert_int_equal(counts().lost, 7);
}

/* Only the gyroscope's do, although the accelerometer's arrive sooner. */
static void accelerometer_reports_dont_teach_the_clock(void **state) {
    (void)state;
    for (int i = 0; i < 400; i++) {
        imu_reading r = at(true, false, i * 5 * MS);
        imu_stream_take(&stream, &r, 1000 * MS + i * 5 * MS + 5 * MS);
        r = at(false, true, i * 5 * MS + MS);
        imu_stream_take(&stream, &r, 1000 * MS + i * 5 * MS + 2 * MS);
    }
    assert_true(fabs(counts().clock_offset_s - 1.005) < 1e-6);
}

static fathom_imu_sample paired[8];
static int pairs;

static void keep_pair(void *user, const fathom_imu_sample *sample) {
    (void)user;
    paired[pairs++] = *sample;
}

static void across_a_long_gap_the_accelerometer_isnt_interpolated(void **state) {
    (void)state;
    imu_pair pair;
    const double one[3] = {1, 1, 1}, three[3] = {3, 3, 3};
    for (int gap_ms = 90; gap_ms <= 300; gap_ms += 210) {
        imu_pair_init(&pair, keep_pair, NULL);
        pairs = 0;
        assert_true(imu_pair_accel(&pair, 1000 * MS, one));
        assert_true(imu_pair_gyro(&pair, (1000 + gap_ms / 2) * MS, one));
        assert_true(imu_pair_accel(&pair, (1000 + gap_ms) * MS, three));
        assert_int_equal(pairs, 1);
        if (gap_ms == 90)
            assert_true(fabsf(paired[0].accel[1] - 2) < 1e-6f);
        else
            assert_true(isnan(paired[0].accel[0]) && isnan(paired[0].accel[2]));
    }
}

/* ---- IIO ---- */

static void iio_formats(void **state) {
    (void)state;
    iio_format f;
    const uint8_t bytes[8] = {0x12, 0x34, 0x56, 0xF8, 0, 0, 0, 0x80};
    assert_true(iio_format_parse("le:s16/16>>0", &f));
    assert_int_equal(iio_value(&f, bytes), 0x3412);
    assert_true(iio_format_parse("be:s12/16>>4\n", &f));
    assert_int_equal(iio_value(&f, bytes), 0x123);
    assert_int_equal(iio_value(&f, bytes + 3), -128); /* F8 00 */
    assert_true(iio_format_parse("be:u12/16>>4", &f));
    assert_int_equal(iio_value(&f, bytes + 3), 0xF80);
    assert_true(iio_format_parse("le:s32/32>>0", &f));
    assert_int_equal(iio_value(&f, bytes), (int32_t)0xF8563412);
    assert_true(iio_format_parse("le:s64/64>>0", &f));
    assert_true(iio_value(&f, bytes) < 0);
    assert_true(iio_format_parse("le:u8/8", &f));
    assert_int_equal(iio_value(&f, bytes + 3), 0xF8);
    static const char *const wrong[] = {"",
                                        "le",
                                        "xx:s16/16>>0",
                                        "le:q16/16>>0",
                                        "le:s17/16>>0",
                                        "le:s0/16>>0",
                                        "be:s-1/16>>4",
                                        "le:s16/16>>-1",
                                        "le:s12/16>>5",
                                        "le:s16/24>>0",
                                        "le:s16/16X2>>0",
                                        "le:s16/16>>"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++)
        if (iio_format_parse(wrong[i], &f)) fail_msg("'%s' was taken", wrong[i]);
}

static void mount_matrices(void **state) {
    (void)state;
    double m[9], v[3] = {1, 2, 3};
    assert_true(iio_mount_matrix_parse("0, 1, 0; -1, 0, 0; 0, 0, 1\n", m));
    iio_mount(m, v);
    assert_true(v[0] == 2 && v[1] == -1 && v[2] == 3);
    static const char *const wrong[] = {"",
                                        "1, 0, 0; 0, 1, 0",
                                        "0, 0, 0; 0, 0, 0; 0, 0, 0",
                                        "2, 0, 0; 0, 1, 0; 0, 0, 1",
                                        "1, 1, 0; 0, 1, 0; 0, 0, 1",
                                        "nan, 0, 0; 0, 1, 0; 0, 0, 1",
                                        "(null)"};
    for (size_t i = 0; i < sizeof wrong / sizeof *wrong; i++) {
        assert_false(iio_mount_matrix_parse(wrong[i], m));
        assert_true(m[0] == 1 && m[1] == 0 && m[8] == 1);
    }
}

/* ---- uris ---- */

static void uris(void **state) {
    (void)state;
    source_address a;
    assert_true(address_parse(&a, "1.2.3.4:5?format=json&time=ms"));
    assert_string_equal(a.what, "1.2.3.4:5");
    assert_string_equal(address_setting(&a, "time"), "ms");
    assert_string_equal(address_unknown(&a), "format");
    assert_string_equal(address_setting(&a, "format"), "json");
    assert_null(address_unknown(&a));
    assert_null(address_setting(&a, "from"));
    assert_true(address_parse(&a, ""));
    assert_true(address_parse(&a, "x?a="));
    assert_string_equal(address_setting(&a, "a"), "");
    assert_false(address_parse(&a, "x?a"));
    assert_false(address_parse(&a, "x?"));
    assert_false(address_parse(&a, "x?a=1&a=2&a=3&a=4&a=5&a=6&a=7&a=8&a=9"));
    char text[600];
    memset(text, 'y', sizeof text);
    text[599] = 0;
    assert_false(address_parse(&a, text));
    text[0] = '?';
    text[1] = 'k';
    text[2] = '=';
    assert_false(address_parse(&a, text));
}

#define QUEUED(test) cmocka_unit_test_setup_teardown(test, begin, finish)

int main(void) {
    const struct CMUnitTest tests[] = {
        QUEUED(sensors_are_paired_by_their_stamps),
        QUEUED(an_accelerometer_that_dies_is_not_waited_for),
        QUEUED(without_an_accelerometer),
        QUEUED(accelerometers_alone_pass),
        QUEUED(batches_are_spread),
        QUEUED(repeated_and_late_ones_are_dropped),
        QUEUED(a_clock_that_starts_again_is_followed),
        QUEUED(losses_are_counted),
        QUEUED(accelerometer_reports_dont_teach_the_clock),
        cmocka_unit_test(across_a_long_gap_the_accelerometer_isnt_interpolated),
        cmocka_unit_test(iio_formats),
        cmocka_unit_test(mount_matrices),
        cmocka_unit_test(uris),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
