/* HID report descriptors: what the specification allows, what breaks it, and two real ones. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "imu/hid_descriptor.h"
#include "imu/hid_nodes.h"
#include "hid_recording.h"

static hid_descriptor d;

static bool parse(const char *hex) {
    uint8_t bytes[512];
    size_t n = 0;
    for (char *end; n < sizeof bytes; hex = end) {
        const unsigned long value = strtoul(hex, &end, 16);
        if (end == hex) break;
        bytes[n++] = (uint8_t)value;
    }
    uint8_t *exact = malloc(n ? n : 1); /* so that the sanitizer sees a read past the end */
    memcpy(exact, bytes, n);
    const bool good = hid_descriptor_parse(&d, exact, n);
    free(exact);
    return good;
}

#define GAMEPAD "05 01 09 05 A1 01 "

static void fields_lie_where_they_should(void **state) {
    (void)state;
    /* X and Y of 10 bits, 4 bits of padding, then a byte of buttons in a report of its own. */
    assert_true(parse(GAMEPAD "85 07 09 30 09 31 16 00 FE 26 FF 01 75 0A 95 02 81 02 75 04 95 01 81 03 "
                              "85 08 05 09 19 01 29 08 15 00 25 01 75 01 95 08 81 02 C0"));
    assert_int_equal(d.field_count, 2);
    assert_true(d.numbered);
    assert_int_equal(hid_report_length(&d, HID_INPUT, 7), 4);
    assert_int_equal(hid_report_length(&d, HID_INPUT, 8), 2);
    assert_int_equal(hid_report_length(&d, HID_FEATURE, 7), 0);
    assert_int_equal(d.fields[0].at, 0);
    assert_int_equal(d.fields[1].at, 0);
    assert_int_equal(hid_field_usage(&d, &d.fields[0], 1), 0x10031);
    assert_int_equal(hid_field_usage(&d, &d.fields[1], 7), 0x90008);
    assert_int_equal(hid_field_usage_index(&d, &d.fields[1], 0x90003), 2);
    assert_int_equal(hid_field_usage_index(&d, &d.fields[1], 0x90009), -1);
    assert_true(hid_field_within(&d, &d.fields[1], 0x10005));

    /* x = -3, y = 511: 0x3FD | 0x1FF << 10 */
    const uint32_t packed = 0x3FD | 0x1FFu << 10;
    const uint8_t report[4] = {7, (uint8_t)packed, (uint8_t)(packed >> 8), (uint8_t)(packed >> 16)};
    int64_t value;
    assert_true(hid_field_read(&d, &d.fields[0], 0, report, sizeof report, &value));
    assert_int_equal(value, -3);
    assert_true(hid_field_read(&d, &d.fields[0], 1, report, sizeof report, &value));
    assert_int_equal(value, 511);
    assert_false(hid_field_read(&d, &d.fields[0], 2, report, sizeof report, &value));
    assert_false(hid_field_read(&d, &d.fields[0], 1, report, 3, &value));

    uint8_t written[4] = {7, 0, 0, 0xF0};
    assert_true(hid_field_write(&d, &d.fields[0], 0, written, sizeof written, -3));
    assert_true(hid_field_write(&d, &d.fields[0], 1, written, sizeof written, 511));
    assert_memory_equal(written, ((uint8_t[]){7, report[1], report[2], (uint8_t)(report[3] | 0xF0)}), 4);
    assert_false(hid_field_write(&d, &d.fields[0], 1, written, 3, 0));
}

static void values_of_32_bits(void **state) {
    (void)state;
    assert_true(parse(GAMEPAD "75 03 95 01 81 03 09 30 17 00 00 00 80 27 FF FF FF 7F 75 20 95 01 81 02 C0"));
    uint8_t report[5] = {0};
    for (int64_t v = INT32_MIN; v <= INT32_MAX; v += 429496729) {
        int64_t back;
        assert_true(hid_field_write(&d, &d.fields[0], 0, report, 5, v));
        assert_true(hid_field_read(&d, &d.fields[0], 0, report, 5, &back));
        assert_int_equal(back, v);
        assert_int_equal(report[0] & 7, 0);
    }
    assert_false(d.numbered);
    assert_int_equal(hid_report_length(&d, HID_INPUT, 0), 5);
}

static void units_and_exponents(void **state) {
    (void)state;
    assert_true(parse(GAMEPAD "09 30 16 01 80 26 FF 7F 36 18 FC 46 E8 03 55 0E 66 14 F0 75 10 95 01 81 02 "
                              "55 FD 34 44 09 31 81 02 55 02 09 32 81 02 C0"));
    assert_int_equal(d.fields[0].unit, 0xF014);
    assert_int_equal(d.fields[0].exponent, -2);
    assert_true(fabs(hid_field_physical(&d.fields[0], 32767) - 10) < 1e-9);
    assert_true(fabs(hid_field_physical(&d.fields[0], -32767) + 10) < 1e-9);
    assert_int_equal(d.fields[1].exponent, -3); /* as a signed byte */
    assert_true(fabs(hid_field_physical(&d.fields[1], 500) - 0.5) < 1e-12);
    assert_true(fabs(hid_field_physical(&d.fields[2], 5) - 500) < 1e-9);
    /* 0..255 with a maximum of one byte is 255, not -1 */
    assert_true(parse(GAMEPAD "09 30 15 00 25 FF 75 08 95 01 81 02 C0"));
    assert_int_equal(d.fields[0].logical_max, 255);
}

static void push_pop_and_long_items(void **state) {
    (void)state;
    assert_true(parse(GAMEPAD "15 00 25 7F 75 08 95 01 A4 25 01 75 01 95 08 09 30 81 02 B4 FE 03 F0 01 02 03 "
                              "09 31 81 02 C0"));
    assert_int_equal(d.fields[0].logical_max, 1);
    assert_int_equal(d.fields[0].bits, 1);
    assert_int_equal(d.fields[1].logical_max, 127);
    assert_int_equal(d.fields[1].bits, 8);
    assert_int_equal(d.fields[1].at, 8);
}

static void usages_with_and_without_page(void **state) {
    (void)state;
    /* the page at the main item counts, unless the usage has four bytes */
    assert_true(parse(GAMEPAD "0B 53 04 20 00 09 31 05 0D 15 00 25 01 75 08 95 03 81 02 C0"));
    assert_int_equal(hid_field_usage(&d, &d.fields[0], 0), 0x200453);
    assert_int_equal(hid_field_usage(&d, &d.fields[0], 1), 0xD0031);
    assert_int_equal(hid_field_usage(&d, &d.fields[0], 2), 0xD0031); /* the last one goes on */
}

static void refuses(const char *hex, const char *why) {
    assert_false(parse(hex));
    if (!strstr(d.error, why)) fail_msg("\"%s\" where \"%s\" was expected", d.error, why);
}

static void what_breaks_the_rules_is_refused(void **state) {
    (void)state;
    refuses("", "no collection");
    refuses("05", "cut short");
    refuses(GAMEPAD, "no end");
    refuses("C0", "without a collection");
    refuses(GAMEPAD "B4 C0", "pop without");
    refuses(GAMEPAD "A4 A4 A4 A4 A4 A4 A4 A4 A4 C0", "too many pushes");
    refuses(GAMEPAD "85 00 C0", "report number");
    refuses(GAMEPAD "86 00 01 C0", "report number");
    refuses(GAMEPAD "FE 05 F0 01", "long item");
    refuses(GAMEPAD "FE", "long item");
    refuses(GAMEPAD "09 30 25 01 75 08 95 01 81 02 85 01 09 31 81 02 C0", "some have none");
    refuses(GAMEPAD "19 05 29 01 C0", "ends before");
    refuses(GAMEPAD "19 05 75 08 95 01 81 02 C0", "one end only");
    refuses(GAMEPAD "1B 01 00 09 00 29 05 C0", "one end only");
    refuses(GAMEPAD "1B 01 00 09 00 2B 05 00 0A 00 C0", "spans pages");
    refuses(GAMEPAD "77 FF FF FF FF C0", "too large");
    refuses(GAMEPAD "97 FF FF FF FF C0", "too large");
    refuses(GAMEPAD "09 30 25 01 77 00 00 01 00 97 00 00 01 00 81 02 C0", "too long");
    refuses(GAMEPAD "09 30 15 05 25 01 75 08 95 01 81 02 C0", "above its maximum");
    refuses(GAMEPAD "55 7F C0", "exponent");
    refuses(GAMEPAD "07 00 00 01 00 C0", "usage page");
    refuses(GAMEPAD "0C C0", "reserved");
}

static void bounds_hold(void **state) {
    (void)state;
    uint8_t bytes[HID_MAX_DESCRIPTOR + 1];
    memset(bytes, 0xA1, sizeof bytes); /* collection inside collection */
    for (size_t i = 1; i < sizeof bytes; i += 2) bytes[i] = 0;
    assert_false(hid_descriptor_parse(&d, bytes, 2048));
    assert_string_equal(d.error, "collections nest too deep");
    assert_false(hid_descriptor_parse(&d, bytes, sizeof bytes));
    assert_non_null(strstr(d.error, "4096"));

    memset(bytes, 0, sizeof bytes);
    for (size_t i = 0; i < 2 * 1025; i += 2) bytes[i] = 0x09; /* usages without end */
    assert_false(hid_descriptor_parse(&d, bytes, 2 * 1025));
    assert_string_equal(d.error, "too many usages");

    const uint8_t field[] = {0x09, 0x30, 0x81, 0x02}, head[] = {0x25, 1, 0x75, 1, 0x95, 1};
    memcpy(bytes, head, sizeof head);
    for (size_t i = 0; i <= HID_MAX_FIELDS; i++) memcpy(bytes + sizeof head + 4 * i, field, 4);
    assert_false(hid_descriptor_parse(&d, bytes, sizeof head + 4 * (HID_MAX_FIELDS + 1)));
    assert_string_equal(d.error, "too many fields");

    for (size_t i = 0; i < 3 * 257; i += 3) memcpy(bytes + i, ((uint8_t[]){0xA1, 0, 0xC0}), 3);
    assert_false(hid_descriptor_parse(&d, bytes, 3 * 257));
    assert_string_equal(d.error, "too many collections");
}

/* Whatever the bytes: no crash, and what comes out can be used. */
static void use_all_of_it(const uint8_t *bytes, size_t length) {
    if (!hid_descriptor_parse(&d, bytes, length)) {
        assert_non_null(d.error);
        assert_true(d.error_at <= length);
        return;
    }
    static uint8_t report[64];
    for (int i = 0; i < d.field_count; i++) {
        const hid_field *f = &d.fields[i];
        int64_t value;
        if (hid_field_read(&d, f, f->count - 1, report, sizeof report, &value))
            assert_true(f->at + f->bits * f->count <= 8 * sizeof report);
        hid_field_physical(f, 1);
        hid_field_usage(&d, f, f->count - 1);
        hid_field_within(&d, f, 0x200073);
        assert_true(f->first_usage + f->usages <= d.usage_count);
    }
}

static void damaged_descriptors_are_harmless(void **state) {
    (void)state;
    const uint8_t good[] = {0x05, 0x20, 0x09, 0x73, 0xA1, 0x00, 0x85, 0x01, 0x0A, 0x53, 0x04, 0x16,
                            0x01, 0x80, 0x26, 0xFF, 0x7F, 0x75, 0x10, 0x95, 0x03, 0x81, 0x02, 0xC0};
    srand(5);
    for (int round = 0; round < 20000; round++) {
        const size_t length = (size_t)(rand() % (int)sizeof good) + 1;
        uint8_t *bytes = malloc(length);
        for (size_t i = 0; i < length; i++) bytes[i] = (uint8_t)(round % 2 && rand() % 6 ? good[i] : rand());
        use_all_of_it(bytes, length);
        free(bytes);
    }
}

static void what_the_kernel_says_of_a_device(void **state) {
    (void)state;
    hid_node node;
    assert_true(hid_node_parse(&node, "DRIVER=playstation\nHID_ID=0005:0000054C:00000CE6\nHID_NAME=Wireless\tController\n"
                                      "HID_PHYS=aa\nHID_UNIQ=11:22:33:44:55:66\nMODALIAS=hid:b0005g0001\n"));
    assert_int_equal(node.vendor, 0x054C);
    assert_int_equal(node.product, 0x0CE6);
    assert_int_equal(node.bus, HID_BUS_BLUETOOTH);
    assert_string_equal(node.name, "Wireless?Controller");
    assert_string_equal(node.serial, "11:22:33:44:55:66");
    assert_true(hid_node_parse(&node, "HID_ID=0003:00001209:00000001"));
    assert_int_equal(node.bus, HID_BUS_USB);
    assert_string_equal(node.serial, "");
    assert_false(hid_node_parse(&node, ""));
    assert_false(hid_node_parse(&node, "HID_NAME=x\nXHID_ID=0003:00001209:00000001\n"));
    assert_false(hid_node_parse(&node, "HID_ID=0003:zz\n"));
    char large[4096] = "HID_ID=0003:00001209:00000001\nHID_NAME=";
    memset(large + strlen(large), 'n', 3000);
    assert_true(hid_node_parse(&node, large));
    assert_int_equal(strlen(node.name), sizeof node.name - 1);
}

static void real_descriptors(void **state) {
    (void)state;
    static hid_recording recording;
    assert_int_equal(hid_recording_open(&recording, "dualsense-usb.hid"), 0);
    assert_true(hid_descriptor_parse(&d, recording.descriptor, recording.descriptor_length));
    assert_int_equal(hid_report_length(&d, HID_INPUT, 1), 64);
    assert_int_equal(hid_report_length(&d, HID_OUTPUT, 2), 48);
    assert_int_equal(hid_report_length(&d, HID_FEATURE, 5), 41);
    assert_int_equal(hid_report_length(&d, HID_FEATURE, 0x20), 64);
    hid_recording_close(&recording);

    assert_int_equal(hid_recording_open(&recording, "hid-sensor-legion-go-s.hid"), 0);
    assert_true(hid_descriptor_parse(&d, recording.descriptor, recording.descriptor_length));
    assert_int_equal(recording.descriptor_length, 673);
    assert_int_equal(hid_report_length(&d, HID_INPUT, 1), 9);
    assert_int_equal(hid_report_length(&d, HID_INPUT, 2), 9);
    for (size_t cut = 0; cut < recording.descriptor_length;
         cut++) { /* cut anywhere but between collections */
        uint8_t *bytes = malloc(cut + 1);
        memcpy(bytes, recording.descriptor, cut);
        use_all_of_it(bytes, cut);
        free(bytes);
    }
    hid_recording_close(&recording);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fields_lie_where_they_should),
        cmocka_unit_test(values_of_32_bits),
        cmocka_unit_test(units_and_exponents),
        cmocka_unit_test(push_pop_and_long_items),
        cmocka_unit_test(usages_with_and_without_page),
        cmocka_unit_test(what_breaks_the_rules_is_refused),
        cmocka_unit_test(bounds_hold),
        cmocka_unit_test(damaged_descriptors_are_harmless),
        cmocka_unit_test(what_the_kernel_says_of_a_device),
        cmocka_unit_test(real_descriptors),
    };
    return hid_recording_run("tests", tests, sizeof tests / sizeof *tests, 1);
}
