/* HID Sensor page devices: units, signs, batches, stamps, features, and a real one's reports. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "hid_recording.h"
#include "imu/hid_sensor.h"
#include "tilt.h"

static hid_descriptor descriptor;
static hid_sensor sensor;

/* A descriptor that grows item by item. */
static uint8_t items[1024];
static size_t item_bytes;

static void begin(void) {
    item_bytes = 0;
}

static void item(uint8_t prefix, uint32_t value, int size) {
    items[item_bytes++] = (uint8_t)(prefix | (size == 4 ? 3 : size));
    for (int i = 0; i < size; i++) items[item_bytes++] = (uint8_t)(value >> (8 * i));
}

static void open_sensor(uint8_t usage, uint8_t report_id) {
    item(0x04, 0x20, 1);
    item(0x08, usage, 1);
    item(0xA0, 0, 1);
    item(0x84, report_id, 1);
}

static void axes16(uint32_t first_usage, uint32_t unit, int exponent) {
    item(0x14, (uint32_t)-32767, 2);
    item(0x24, 32767, 2);
    item(0x64, unit, 4);
    item(0x54, (uint32_t)(exponent & 15), 1);
    item(0x74, 16, 1);
    item(0x94, 1, 1);
    for (uint32_t i = 0; i < 3; i++) {
        item(0x08, first_usage + i, 2);
        item(0x80, 2, 1);
    }
}

static void close_sensor(void) {
    item(0xC0, 0, 0);
}

static bool find(void) {
    if (!hid_descriptor_parse(&descriptor, items, item_bytes)) fail_msg("%s", descriptor.error);
    return hid_sensor_find(&sensor, &descriptor);
}

static void put16(uint8_t *at, int value) {
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

/* What (100, -200, 300) becomes with a unit and an exponent. */
static void check_unit(uint8_t usage, uint32_t first, uint32_t unit, int exponent, double scale, bool known) {
    begin();
    open_sensor(usage, 3);
    axes16(first, unit, exponent);
    close_sensor();
    assert_true(find());
    assert_int_equal(sensor.odd_unit, known ? 0 : unit);
    uint8_t report[7] = {3};
    put16(report + 1, 100);
    put16(report + 3, -200);
    put16(report + 5, 300);
    imu_reading r;
    assert_int_equal(hid_sensor_read(&sensor, report, sizeof report, 1, &r), HID_SENSOR_READING);
    assert_int_equal(r.samples, 1);
    assert_int_equal(r.times, 0);
    const bool accel = usage == 0x73;
    assert_int_equal(r.has_accel, accel);
    assert_int_equal(r.has_gyro, !accel);
    const double raw[3] = {100, -200, 300};
    for (int i = 0; i < 3; i++) {
        /* an accelerometer of this page is signed like gravity */
        const double expected = raw[i] * scale * (accel ? -1 : 1);
        assert_true(fabs((accel ? r.accel : r.gyro)[0][i] - expected) < 1e-9 * fabs(expected));
    }
    if (accel) {
        sensor.gravity_signed = false;
        hid_sensor_read(&sensor, report, sizeof report, 1, &r);
        assert_true(r.accel[0][0] > 0);
    }
}

static void units_and_signs(void **state) {
    (void)state;
    const double g = 9.80665, degree = M_PI / 180;
    check_unit(0x73, 0x453, 0, -2, g / 100, true);
    check_unit(0x73, 0x453, 0x1A, -3, g / 1000, true);
    check_unit(0x73, 0x453, 0xE011, 0, 0.01, true); /* cm/s^2 */
    check_unit(0x73, 0x453, 0xE011, 2, 1, true);
    check_unit(0x73, 0x453, 0x11E0, -2, 0.01, true);
    check_unit(0x73, 0x453, 0x1234, -2, g / 100, false);
    check_unit(0x76, 0x457, 0, -1, degree / 10, true);
    check_unit(0x76, 0x457, 0x15, -1, degree / 10, true);
    check_unit(0x76, 0x457, 0xF014, 0, degree, true);
    check_unit(0x76, 0x457, 0xF012, -3, 0.001, true);
    check_unit(0x76, 0x457, 0x12F0, -3, 0.001, true);
}

static void reports_that_are_wrong(void **state) {
    (void)state;
    begin();
    open_sensor(0x76, 3);
    axes16(0x457, 0, 0);
    item(0x84, 4, 1); /* another report of the same sensor, without axes */
    item(0x08, 0x201, 2);
    item(0x80, 2, 1);
    close_sensor();
    assert_true(find());
    imu_reading r;
    uint8_t report[7] = {3};
    assert_int_equal(hid_sensor_read(&sensor, report, 0, 1, &r), HID_SENSOR_MALFORMED);
    for (size_t n = 1; n < sizeof report; n++)
        assert_int_equal(hid_sensor_read(&sensor, report, n, 1, &r), HID_SENSOR_MALFORMED);
    assert_int_equal(hid_sensor_read(&sensor, report, 7, 1, &r), HID_SENSOR_READING);
    put16(report + 1, -32768); /* below the logical minimum: a null value */
    assert_int_equal(hid_sensor_read(&sensor, report, 7, 1, &r), HID_SENSOR_MALFORMED);
    report[0] = 4;
    assert_int_equal(hid_sensor_read(&sensor, report, 3, 1, &r), HID_SENSOR_OTHER);
    report[0] = 9;
    assert_int_equal(hid_sensor_read(&sensor, report, 7, 1, &r), HID_SENSOR_MALFORMED);
}

static void batches_and_times(void **state) {
    (void)state;
    begin();
    open_sensor(0x76, 1);
    for (int i = 0; i < 4; i++) axes16(0x457, 0, -1);
    item(0x08, 0x529, 2); /* one time stamp, milliseconds / 10, 16 bits */
    item(0x14, 0, 1);
    item(0x24, 0xFFFF, 4);
    item(0x64, 0x19, 1);
    item(0x54, 0xF, 1);
    item(0x80, 2, 1);
    close_sensor();
    assert_true(find());
    uint8_t report[27] = {1};
    imu_reading r;
    int64_t last = -1;
    for (int n = 0; n < 4000; n++) { /* 4 ms apart: 40 ticks; 16 bits last 6.5 s */
        for (int s = 0; s < 4; s++) put16(report + 1 + 6 * s, 4 * n + s);
        put16(report + 25, 40 * n);
        assert_int_equal(hid_sensor_read(&sensor, report, sizeof report, 1 + n * INT64_C(4000000), &r),
                         HID_SENSOR_READING);
        assert_int_equal(r.samples, 4);
        assert_int_equal(r.times, 1);
        for (int s = 0; s < 4; s++) assert_true(fabs(r.gyro[s][0] - (4 * n + s) * 0.1 * M_PI / 180) < 1e-9);
        if (n) assert_int_equal(r.device_ns[3] - last, 4000000);
        last = r.device_ns[3];
    }
}

static void both_in_one_report(void **state) {
    (void)state;
    begin();
    item(0x04, 0x20, 1);
    item(0x08, 0x01, 1);
    item(0xA0, 1, 1);
    open_sensor(0x73, 1);
    axes16(0x453, 0, -3);
    close_sensor();
    open_sensor(0x76, 1);
    axes16(0x457, 0, -1);
    close_sensor();
    item(0xC0, 0, 0);
    assert_true(find());
    assert_true(sensor.has_gyro && sensor.has_accel);
    uint8_t report[13] = {1};
    put16(report + 5, -1000);
    put16(report + 7, 900);
    imu_reading r;
    assert_int_equal(hid_sensor_read(&sensor, report, sizeof report, 1, &r), HID_SENSOR_READING);
    assert_true(r.has_gyro && r.has_accel);
    assert_true(fabs(r.accel[0][2] - 9.80665) < 1e-9);
    assert_true(fabs(r.gyro[0][0] - M_PI / 2) < 1e-9);
}

static void two_axes_are_no_sensor(void **state) {
    (void)state;
    begin();
    open_sensor(0x73, 1);
    item(0x74, 8, 1);
    item(0x94, 1, 1);
    item(0x24, 100, 1);
    for (uint32_t i = 0; i < 2; i++) {
        item(0x08, 0x453 + i, 2);
        item(0x80, 2, 1);
    }
    close_sensor();
    assert_false(find());
}

static void power_and_interval_are_set(void **state) {
    (void)state;
    static hid_recording recording;
    assert_int_equal(hid_recording_open(&recording, "hid-sensor-legion-go-s.hid"), 0);
    assert_true(hid_descriptor_parse(&descriptor, recording.descriptor, recording.descriptor_length));
    hid_recording_close(&recording);
    const size_t length = hid_report_length(&descriptor, HID_FEATURE, 1);
    uint8_t report[64] = {1};
    assert_true(length <= sizeof report);
    /* connection, reporting state, power state, sensor state, interval (32 bits, ms) */
    assert_int_equal(hid_sensor_prepare(&descriptor, HID_SENSOR_ACCELEROMETER_3D, 1, 0.005, report, length),
                     3);
    const uint8_t expected[9] = {1, 0, 1, 1, 0, 5, 0, 0, 0};
    assert_memory_equal(report, expected, 9);
    assert_int_equal(hid_sensor_prepare(&descriptor, HID_SENSOR_ACCELEROMETER_3D, 1, 0.0001, report, length),
                     3);
    assert_int_equal(report[5], 1); /* not 0 */
    assert_int_equal(hid_sensor_prepare(&descriptor, HID_SENSOR_ACCELEROMETER_3D, 2, 0.005, report, length),
                     0);
    assert_int_equal(hid_sensor_prepare(&descriptor, HID_SENSOR_GYROMETER_3D, 2, 0.005, report, length), 3);
    assert_int_equal(hid_sensor_prepare(&descriptor, HID_SENSOR_GYROMETER_3D, 2, 0, report, length), 2);
    assert_int_equal(hid_sensor_prepare(&descriptor, HID_SENSOR_GYROMETER_3D, 2, 0.005, report, 4), 2);
}

/* Ticks of a tenth of a millisecond: seconds by 10^-4, or milliseconds by 10^-1. */
static void the_interval_is_asked_for_in_the_units_exponent(void **state) {
    (void)state;
    const struct {
        uint32_t unit;
        int exponent, ticks;
    } cases[] = {{0x1001, -4, 50}, {0x1001, -3, 5}, {0x1001, 0, 1}, {0, -1, 50}, {0, 0, 5}, {0x19, -3, 5000}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint8_t report[3] = {7};
        begin();
        open_sensor(0x76, 7);
        item(0x14, 0, 1);
        item(0x24, 32767, 2);
        item(0x64, cases[i].unit, 4);
        item(0x54, (uint32_t)(cases[i].exponent & 15), 1);
        item(0x74, 16, 1);
        item(0x94, 1, 1);
        item(0x08, 0x30E, 2); /* report interval */
        item(0xB0, 2, 1);
        close_sensor();
        assert_true(hid_descriptor_parse(&descriptor, items, item_bytes));
        assert_int_equal(hid_sensor_prepare(&descriptor, HID_SENSOR_GYROMETER_3D, 7, 0.005, report, sizeof report), 1);
        assert_int_equal(report[1] | report[2] << 8, cases[i].ticks);
    }
}

/* The recording: lies on its back for 0.8 s, is tilted about, lies again from 6.6 s on. */
#define REAL 1024
static struct { double at, gyro[3], accel[3]; } real[REAL];
static int real_count;

static int load_real(bool left_handed) {
    static hid_recording recording;
    assert_int_equal(hid_recording_open(&recording, "hid-sensor-legion-go-s.hid"), 0);
    assert_true(hid_descriptor_parse(&descriptor, recording.descriptor, recording.descriptor_length));
    assert_true(hid_sensor_find(&sensor, &descriptor));
    assert_true(sensor.has_gyro && sensor.has_accel);
    hid_sensor_known_signs(&sensor, 0x1A86, 0xE311);
    assert_true(sensor.gravity_signed && sensor.left_handed);
    sensor.left_handed = left_handed;
    int reports = 0;
    real_count = 0;
    for (; hid_recording_next(&recording); reports++) {
        imu_reading r;
        assert_int_equal(
            hid_sensor_read(&sensor, recording.report, recording.length, recording.at_ns + 1, &r),
            HID_SENSOR_READING);
        assert_int_equal(r.samples, 1);
        assert_true(r.has_gyro != r.has_accel);
        if (r.has_accel) memcpy(real[real_count].accel, r.accel[0], sizeof r.accel[0]);
        if (r.has_gyro) { /* comes after its accelerometer */
            memcpy(real[real_count].gyro, r.gyro[0], sizeof r.gyro[0]);
            real[real_count++].at = (double)recording.at_ns * 1e-9;
        }
    }
    hid_recording_close(&recording);
    return reports;
}

static void mean_accel(int first, int count, double mean[3]) {
    for (int i = 0; i < 3; i++) {
        mean[i] = 0;
        for (int s = 0; s < count; s++) mean[i] += real[first + s].accel[i] / count;
    }
}

static void a_real_device(void **state) {
    (void)state;
    const int reports = load_real(true);
    assert_int_equal(reports, 1538);
    assert_int_equal(real_count, 769);
    const int still[2] = {10, 700};
    for (int k = 0; k < 2; k++) {
        double mean[3], rates = 0;
        const int count = 60;
        mean_accel(still[k], count, mean);
        const double size = sqrt(mean[0] * mean[0] + mean[1] * mean[1] + mean[2] * mean[2]);
        for (int s = 0; s < count; s++)
            for (int i = 0; i < 3; i++) rates += real[still[k] + s].gyro[i] * real[still[k] + s].gyro[i];
        print_message("# still: (%.3f %.3f %.3f) m/s^2, %.4f g, %.2f deg/s rms\n", mean[0], mean[1], mean[2],
                      size / STANDARD_GRAVITY, sqrt(rates / count) / RADIANS_PER_DEGREE);
        assert_true(fabs(size / STANDARD_GRAVITY - 1) < 0.02);
        assert_true(mean[2] > 0.98 * size); /* z, out of the screen, is up */
        assert_true(sqrt(rates / count) < 0.5 * RADIANS_PER_DEGREE);
    }
}

/* How far "up", turned by the rates, is from the accelerometer's after 0.4 s, on average. */
static double disagreement(bool turn) {
    const int step = 40, window = 16;
    double sum = 0;
    int n = 0;
    for (int s = 0; s + step + window < real_count; s += step, n++) {
        double up[3], after[3];
        mean_accel(s, window, up);
        mean_accel(s + step, window, after);
        for (int i = s + window / 2; turn && i < s + step + window / 2; i++)
            tilt_turn(up, real[i].gyro, real[i + 1].at - real[i].at);
        sum += tilt_angle(up, after);
    }
    return sum / n / RADIANS_PER_DEGREE;
}

static void a_real_devices_gyrometer_agrees_with_its_accelerometer(void **state) {
    (void)state;
    load_real(true);
    const double agree = disagreement(true), unturned = disagreement(false);
    load_real(false);
    const double mirrored = disagreement(true);
    print_message("# tilt after 0.4 s: %.2f deg off; %.2f without the rates, %.2f with them right-handed\n",
                  agree, unturned, mirrored);
    assert_true(agree < 0.25 * unturned);
    assert_true(mirrored > unturned);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(units_and_signs),
        cmocka_unit_test(reports_that_are_wrong),
        cmocka_unit_test(batches_and_times),
        cmocka_unit_test(both_in_one_report),
        cmocka_unit_test(two_axes_are_no_sensor),
        cmocka_unit_test(power_and_interval_are_set),
        cmocka_unit_test(the_interval_is_asked_for_in_the_units_exponent),
        cmocka_unit_test(a_real_device),
        cmocka_unit_test(a_real_devices_gyrometer_agrees_with_its_accelerometer),
    };
    return hid_recording_run("tests", tests, sizeof tests / sizeof *tests, 3);
}
