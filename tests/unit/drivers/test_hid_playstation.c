/* Devices of the table: DualShock 4 and DualSense, by generated reports and by a real recording; Nintendo's. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imu/hid_playstation.h"
#include "hid_recording.h"
#include "tilt.h"

enum { SONY = 0x054C, DUALSHOCK4 = 0x09CC, DUALSHOCK4_DONGLE = 0x0BA0, DUALSENSE = 0x0CE6 };

static hid_fixed device;
static imu_reading reading;

static void put16(uint8_t *at, int value) {
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

static void put32(uint8_t *at, uint32_t value) {
    put16(at, (int)(value & 0xFFFF));
    put16(at + 2, (int)(value >> 16));
}

/* A feature report: a gyroscope of 16, 17 and 18 counts a deg/s, an accelerometer of 8000, 8100 and 8200 a g with biases of
 * 50, -60 and 70. The order of the plus and minus readings is the caller's. */
static void make_calibration(uint8_t report[41], uint8_t id, bool triples) {
    memset(report, 0, 41);
    report[0] = id;
    const int plus[3] = {16 * 540 + 5, 17 * 540 - 7, 18 * 540 + 9},
              minus[3] = {-16 * 540 + 5, -17 * 540 - 7, -18 * 540 + 9};
    const int bias[3] = {5, -7, 9}, g[3] = {8000, 8100, 8200}, off[3] = {50, -60, 70};
    for (int i = 0; i < 3; i++) {
        put16(report + 1 + 2 * i, bias[i]);
        put16(report + (triples ? 7 + 2 * i : 7 + 4 * i), plus[i]);
        put16(report + (triples ? 13 + 2 * i : 9 + 4 * i), minus[i]);
        put16(report + 23 + 4 * i, off[i] + g[i]);
        put16(report + 25 + 4 * i, off[i] - g[i]);
    }
    put16(report + 19, 540);
    put16(report + 21, 540);
    put32(report + 37, hid_crc32(0xA3, report, 37));
}

static void crc_is_the_standard_one(void **state) {
    (void)state;
    assert_int_equal(hid_crc32('1', (const uint8_t *)"23456789", 8), 0xCBF43926);
}

/* Every way to be connected gives the same numbers from its own layout. */
static void check_connection(uint16_t product, hid_bus bus, uint8_t feature, bool triples, uint8_t id,
                             size_t length, size_t shift, bool dualsense) {
    const hid_model *model = hid_model_find(SONY, product, bus);
    assert_non_null(model);
    assert_int_equal(model->calibration_id, feature);
    uint8_t calibration[41];
    make_calibration(calibration, feature, triples);
    hid_fixed_init(&device, model, calibration, model->calibration_length);
    assert_true(device.factory_calibrated);

    uint8_t report[78] = {id};
    uint8_t *common = report + 1 + shift;
    const int gyro[3] = {160, -340, 540}, accel[3] = {50, -60 + 8100, 70 - 4100};
    for (int i = 0; i < 3; i++) {
        put16(common + (dualsense ? 15 : 12) + 2 * i, gyro[i]);
        put16(common + (dualsense ? 21 : 18) + 2 * i, accel[i]);
    }
    uint32_t ticks = dualsense ? 0xFFFFF000 : 0xFFF0;
    int64_t last = 0;
    for (int n = 0; n < 300; n++) {
        if (dualsense)
            put32(common + 27, ticks);
        else
            put16(common + 9, (int)(ticks & 0xFFFF));
        common[6] = (uint8_t)(dualsense ? n : n << 2 | 3);
        put32(report + length - 4, bus == HID_BUS_BLUETOOTH ? hid_crc32(0xA1, report, length - 4) : 0);
        const int64_t arrival = 1000000000 + n * INT64_C(4000000) + rand() % 3000000;
        assert_int_equal(hid_fixed_read(&device, report, length, arrival, &reading), HID_FIXED_READING);
        assert_int_equal(reading.lost, 0);
        assert_int_equal(reading.times, 1);
        if (n) assert_in_range(reading.device_ns[0] - last, 3999990, 4000010);
        last = reading.device_ns[0];
        ticks += dualsense ? 12000 : 750;
    }
    for (int i = 0; i < 3; i++) {
        const double rate[3] = {10, -20, 30}, force[3] = {0, 1, -0.5};
        assert_true(fabs(reading.gyro[0][i] - rate[i] * M_PI / 180) < 1e-9);
        assert_true(fabs(reading.accel[0][i] - force[i] * 9.80665) < 1e-9);
    }
    /* Damage. */
    for (size_t cut = 1; cut < length; cut++)
        assert_int_equal(hid_fixed_read(&device, report, cut, 0, &reading), HID_FIXED_MALFORMED);
    assert_int_equal(hid_fixed_read(&device, report, 0, 0, &reading), HID_FIXED_MALFORMED);
    for (size_t i = 1; i < length && bus == HID_BUS_BLUETOOTH; i++) {
        report[i] ^= 0x10;
        assert_int_equal(hid_fixed_read(&device, report, length, 0, &reading), HID_FIXED_MALFORMED);
        report[i] ^= 0x10;
    }
    report[0] ^= 0xFF;
    assert_int_equal(hid_fixed_read(&device, report, length, 0, &reading), HID_FIXED_OTHER);
}

static void each_connection(void **state) {
    (void)state;
    check_connection(DUALSHOCK4, HID_BUS_USB, 0x02, false, 0x01, 64, 0, false);
    check_connection(DUALSHOCK4_DONGLE, HID_BUS_USB, 0x02, true, 0x01, 64, 0, false);
    check_connection(DUALSHOCK4, HID_BUS_BLUETOOTH, 0x05, true, 0x11, 78, 2, false);
    check_connection(DUALSENSE, HID_BUS_USB, 0x05, false, 0x01, 64, 0, true);
    check_connection(DUALSENSE, HID_BUS_BLUETOOTH, 0x05, false, 0x31, 78, 1, true);
}

static void bad_calibration_leaves_nominal_scales(void **state) {
    (void)state;
    const hid_model *model = hid_model_find(SONY, DUALSENSE, HID_BUS_BLUETOOTH);
    uint8_t good[41], bad[41];
    make_calibration(good, 0x05, false);
    hid_fixed_init(&device, model, good, sizeof good);
    assert_true(device.factory_calibrated);
    for (int i = 0; i < 41; i++) { /* the checksum */
        memcpy(bad, good, sizeof bad);
        bad[i] ^= 1;
        hid_fixed_init(&device, model, bad, sizeof bad);
        assert_false(device.factory_calibrated);
    }
    for (size_t cut = 0; cut < 41; cut++) {
        hid_fixed_init(&device, model, good, cut);
        assert_false(device.factory_calibrated);
    }
    assert_true(fabs(device.calibration.gyro_scale[0] * 32768 / 2000 - M_PI / 180) < 1e-9);

    model = hid_model_find(SONY, DUALSHOCK4, HID_BUS_USB);
    static const struct {
        int at, value;
    } senseless[] = {{23, -7950}, {19, 0}, {19, -540}, {9, 100}, {25, 4000}};
    for (size_t i = 0; i < sizeof senseless / sizeof *senseless; i++) {
        make_calibration(bad, 0x02, false);
        put16(bad + senseless[i].at, senseless[i].value);
        hid_fixed_init(&device, model, bad, 37);
        if (device.factory_calibrated)
            fail_msg("byte %d = %d was believed", senseless[i].at, senseless[i].value);
    }
    memset(bad, 0, sizeof bad);
    bad[0] = 2;
    hid_fixed_init(&device, model, bad, 37);
    assert_false(device.factory_calibrated);
    hid_fixed_init(&device, model, NULL, 0);
    assert_false(device.factory_calibrated);
}

static void lost_reports_are_counted(void **state) {
    (void)state;
    hid_fixed_init(&device, hid_model_find(SONY, DUALSHOCK4, HID_BUS_USB), NULL, 0);
    uint8_t report[64] = {1};
    int64_t lost = 0, missing = 0;
    srand(3);
    for (int n = 0; n < 10000; n++) {
        const bool drop = n && n < 9999 && rand() % 10 == 0;
        missing += drop;
        if (drop) continue;
        report[7] = (uint8_t)(n << 2);
        put16(report + 10, n * 750 & 0xFFFF);
        assert_int_equal(hid_fixed_read(&device, report, 64, 1 + n * INT64_C(4000000), &reading),
                         HID_FIXED_READING);
        lost += reading.lost;
    }
    assert_int_equal(lost, missing);
    assert_true(missing > 900);
}

/* The 16-bit clock of a DualShock 4 wraps after 0.35 s; pauses, and a reader that is held up, must not shift it. */
static void clocks_that_wrap(void **state) {
    (void)state;
    const double tick = 16000.0 / 3;
    whole_counter counter = {0};
    int64_t ms = 1000;
    const uint64_t first =
        whole_counter_next(&counter, (uint64_t)(ms * 1e6 / tick) & 0xFFFF, 16, tick, ms * 1000000);
    const int64_t start = ms;
    static const int pauses[] = {4, 340, 360, 900, 10000, 100000, 4};
    for (size_t i = 0; i < sizeof pauses / sizeof *pauses; i++) {
        ms += pauses[i];
        const uint64_t count = whole_counter_next(&counter, (uint64_t)((double)ms * 1e6 / tick) & 0xFFFF, 16,
                                                  tick, ms * 1000000 + rand() % 20000000);
        assert_true(fabs((double)(count - first) * tick / 1e6 - (double)(ms - start)) < 0.02);
    }
    /* held up for 5 s: 60 reports waited (arrival unknown), the rest is lost, then one that came just now */
    for (int i = 0; i < 60; i++) {
        ms += 4;
        const uint64_t count =
            whole_counter_next(&counter, (uint64_t)((double)ms * 1e6 / tick) & 0xFFFF, 16, tick, 0);
        assert_true(fabs((double)(count - first) * tick / 1e6 - (double)(ms - start)) < 0.02);
    }
    ms += 4760;
    uint64_t count =
        whole_counter_next(&counter, (uint64_t)((double)ms * 1e6 / tick) & 0xFFFF, 16, tick, ms * 1000000);
    assert_true(fabs((double)(count - first) * tick / 1e6 - (double)(ms - start)) < 0.02);
    /* a repeated and an older value don't become a wrap */
    assert_int_equal(whole_counter_next(&counter, count & 0xFFFF, 16, tick, ms * 1000000 + 4000000), count);
    assert_int_equal(whole_counter_next(&counter, (count - 700) & 0xFFFF, 16, tick, ms * 1000000 + 5000000),
                     count - 700);
    assert_int_equal(whole_counter_next(&counter, (count - 800) & 0xFFFF, 16, tick, 0), count - 800);
}

static void three_samples_a_report(void **state) {
    (void)state;
    hid_fixed_init(&device, hid_model_find(0x057E, 0x2009, HID_BUS_BLUETOOTH), NULL, 0);
    uint8_t report[49] = {0x30};
    for (int s = 0; s < 3; s++) {
        put16(report + 13 + 12 * s + 4, 4096 + s);
        put16(report + 19 + 12 * s, 100 * s);
    }
    assert_int_equal(hid_fixed_read(&device, report, 49, 1, &reading), HID_FIXED_READING);
    assert_int_equal(reading.samples, 3);
    assert_int_equal(reading.period_ns, 5000000);
    assert_int_equal(reading.times, 0);
    assert_true(fabs(reading.accel[0][2] - 9.80665) < 1e-9);
    assert_true(fabs(reading.gyro[2][0] - 200 * 0.07 * M_PI / 180) < 1e-9);
    hid_fixed_init(&device, hid_model_find(0x057E, 0x2007, HID_BUS_BLUETOOTH), NULL,
                   0); /* its chip is turned over */
    assert_int_equal(hid_fixed_read(&device, report, 49, 1, &reading), HID_FIXED_READING);
    assert_true(reading.accel[0][2] < -9 && reading.gyro[2][0] > 0);
    assert_null(hid_model_find(0x057E, 0x2009, HID_BUS_USB));
}

/* Every row can be used on a report of its own length: no offset lies beyond it. */
static void rows_stay_within_their_reports(void **state) {
    (void)state;
    const hid_model *m;
    for (int i = 0; (m = hid_model_at(i)); i++) {
        uint8_t *report = malloc(m->layout->length);
        memset(report, 0x5A, m->layout->length);
        report[0] = m->layout->report_id;
        if (m->layout->crc_seed)
            put32(report + m->layout->length - 4,
                  hid_crc32(m->layout->crc_seed, report, m->layout->length - 4u));
        hid_fixed_init(&device, m, NULL, 0);
        assert_int_equal(hid_fixed_read(&device, report, m->layout->length, 1, &reading), HID_FIXED_READING);
        assert_ptr_equal(hid_model_find(m->vendor, m->product, m->bus), m);
        assert_true(m->name && m->axes && m->gyro_scale > 0 && m->accel_scale > 0);
        free(report);
    }
}

/* The recording: held still, turned about x by 60 degrees and back, held still again. */
static void a_real_dualsense(void **state) {
    (void)state;
    static hid_recording recording;
    assert_int_equal(hid_recording_open(&recording, "dualsense-usb.hid"), 0);
    uint8_t calibration[64];
    const size_t length =
        hid_recording_feature("dualsense-usb-features.txt", 0x05, calibration, sizeof calibration);
    assert_int_equal(length, 41);
    hid_fixed_init(&device, hid_model_find(SONY, DUALSENSE, HID_BUS_USB), calibration, length);
    assert_true(device.factory_calibrated);

    int reports = 0;
    int64_t last = 0, lost = 0, shortest = INT64_MAX, longest = 0, first_ns = 0;
    double still[2][3] = {{0}}, fastest = 0, turned[4][3];
    static const double mirror[4][3] = {{1, 1, 1}, {-1, 1, 1}, {1, 1, -1}, {-1, -1, -1}};
    for (; hid_recording_next(&recording); reports++) {
        assert_int_equal(
            hid_fixed_read(&device, recording.report, recording.length, recording.at_ns + 1, &reading),
            HID_FIXED_READING);
        lost += reading.lost;
        const int64_t step = reading.device_ns[0] - last;
        if (reports) {
            assert_true(step > 0);
            shortest = step < shortest ? step : shortest;
            longest = step > longest ? step : longest;
        } else {
            first_ns = reading.device_ns[0];
        }
        last = reading.device_ns[0];
        if (reports < 200)
            for (int i = 0; i < 3; i++) still[0][i] += reading.accel[0][i] / 200;
        if (reports >= 2100 && reports < 2200)
            for (int i = 0; i < 3; i++) still[1][i] += reading.accel[0][i] / 100;
        for (int k = 0; k < 4; k++) {
            if (reports == 200) memcpy(turned[k], still[0], sizeof turned[k]);
            double rate[3];
            for (int i = 0; i < 3; i++) rate[i] = mirror[k][i] * reading.gyro[0][i];
            if (reports > 200 && reports < 2150) tilt_turn(turned[k], rate, (double)step * 1e-9);
        }
        for (int i = 0; i < 3; i++) fastest = fmax(fastest, fabs(reading.gyro[0][i]));
    }
    const double seconds = (double)recording.at_ns * 1e-9, device_s = (double)(last - first_ns) * 1e-9;
    hid_recording_close(&recording);
    double size[2];
    for (int k = 0; k < 2; k++)
        size[k] = sqrt(still[k][0] * still[k][0] + still[k][1] * still[k][1] + still[k][2] * still[k][2]) /
                  STANDARD_GRAVITY;
    print_message("# %d reports, %d lost, %.3f to %.3f ms apart, %.4f s by its clock, %.4f by the host's\n",
                  reports, (int)lost, (double)shortest / 1e6, (double)longest / 1e6, device_s, seconds);
    print_message("# still: %.4f and %.4f g, (%.2f %.2f %.2f) m/s^2; fastest %.0f deg/s\n", size[0], size[1],
                  still[0][0], still[0][1], still[0][2], fastest / RADIANS_PER_DEGREE);
    assert_int_equal(reports, 2239);
    assert_int_equal(lost, 0);
    assert_true(shortest > 3500000 && longest < 4500000);
    assert_true(fabs(device_s / seconds - 1) < 0.001);
    assert_true(fabs(size[0] - 1) < 0.02 && fabs(size[1] - 1) < 0.02);
    assert_true(still[0][1] > 0.8 * 9.8 &&
                still[0][2] > 0); /* held as one does: the face up and towards the player */
    assert_true(fastest > 1 && fastest < 2000 * RADIANS_PER_DEGREE);

    double off[4];
    for (int k = 0; k < 4; k++) off[k] = tilt_angle(turned[k], still[1]) / RADIANS_PER_DEGREE;
    print_message(
        "# up after 8 s by the rates: %.1f deg off; %.1f with x, %.1f with z, %.1f with all mirrored\n",
        off[0], off[1], off[2], off[3]);
    assert_true(off[0] < 4);
    for (int k = 1; k < 4; k++) assert_true(off[k] > 1.5 * off[0]);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(crc_is_the_standard_one),
        cmocka_unit_test(each_connection),
        cmocka_unit_test(bad_calibration_leaves_nominal_scales),
        cmocka_unit_test(lost_reports_are_counted),
        cmocka_unit_test(clocks_that_wrap),
        cmocka_unit_test(three_samples_a_report),
        cmocka_unit_test(rows_stay_within_their_reports),
        cmocka_unit_test(a_real_dualsense),
    };
    return hid_recording_run("tests", tests, sizeof tests / sizeof *tests, 1);
}
