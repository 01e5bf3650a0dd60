#include "virtual_devices.h"

#include <string.h>

#include "imu/mtdata2.h"

static void put16(uint8_t *at, int value) {
    at[0] = (uint8_t)value;
    at[1] = (uint8_t)(value >> 8);
}

/* ---- DualSense ---- */

static const uint8_t dualsense_descriptor[] = {
    0x05, 0x01, 0x09, 0x05, 0xA1, 0x01, 0x06, 0x00, 0xFF, 0x15, 0x00, 0x26,
    0xFF, 0x00, 0x75, 0x08, 0x85, 0x01, 0x09, 0x20, 0x95, 0x3F, 0x81, 0x02, /* input 1 */
    0x85, 0x02, 0x09, 0x21, 0x95, 0x2F, 0x91, 0x02,                         /* output 2 */
    0x85, 0x05, 0x09, 0x22, 0x95, 0x28, 0xB1, 0x02,                         /* calibration */
    0x85, 0x09, 0x09, 0x23, 0x95, 0x13, 0xB1, 0x02,                         /* address */
    0x85, 0x20, 0x09, 0x24, 0x95, 0x3F, 0xB1, 0x02,                         /* firmware */
    0xC0};

/* 16 counts a deg/s, 8192 a g. */
static int dualsense_feature(uint8_t id, uint8_t *report, const char *address) {
    memset(report, 0, 64);
    report[0] = id;
    if (id == 0x05) {
        for (int i = 0; i < 3; i++) {
            put16(report + 7 + 4 * i, 8640);
            put16(report + 9 + 4 * i, -8640);
            put16(report + 23 + 4 * i, 8192);
            put16(report + 25 + 4 * i, -8192);
        }
        put16(report + 19, 540);
        put16(report + 21, 540);
        return 41;
    }
    if (id == 0x09) {
        memcpy(report + 1, address, 6);
        return 20;
    }
    return id == 0x20 ? 64 : -1;
}

static int dualsense_feature_hid(virtual_hid *device, uint8_t id, uint8_t *report) {
    return dualsense_feature(id, report, device->kind.serial);
}

int virtual_dualsense_report(uint32_t n, int rate_hz, uint8_t *report) {
    memset(report, 0, 64);
    report[0] = 1;
    report[7] = (uint8_t)n;
    put16(report + 16, (int)(n % 1000) * 16);
    put16(report + 24, 8192);
    const uint32_t ticks = (uint32_t)((uint64_t)n * 3000000 / (unsigned)rate_hz);
    put16(report + 28, (int)(ticks & 0xFFFF));
    put16(report + 30, (int)(ticks >> 16));
    return 64;
}

static int dualsense_input(virtual_hid *device, uint32_t n, uint8_t *report) {
    const int rate = device->rate_hz;
    return virtual_dualsense_report(n, rate ? rate : 1000, report);
}

virtual_hid_kind virtual_dualsense(const char *address) {
    return (virtual_hid_kind){.name = "Sony Interactive Entertainment DualSense Wireless Controller",
                              .serial = address,
                              .vendor = 0x054C,
                              .product = 0x0CE6,
                              .descriptor = dualsense_descriptor,
                              .descriptor_length = sizeof dualsense_descriptor,
                              .feature = dualsense_feature_hid,
                              .input = dualsense_input};
}

/* ---- a HID sensor ---- */

#define USAGE(u) 0x0A, (u)&255, (u) >> 8
#define AXIS(u) USAGE(u), 0x81, 0x02
#define SELECTOR(property, first, count)                                                                     \
    USAGE(property), 0x15, 0x00, 0x25, (count)-1, 0x75, 0x08, 0x95, 0x01, 0xA1, 0x02, 0x1A, (first)&255,     \
        (first) >> 8, 0x2A, ((first) + (count)-1) & 255, ((first) + (count)-1) >> 8, 0xB1, 0x00, 0xC0
#define SENSOR(id, usage, exponent, x)                                                                       \
    0x85, id, 0x09, usage, 0xA1, 0x00, SELECTOR(0x316, 0x840, 6), SELECTOR(0x319, 0x850, 6), USAGE(0x30E),   \
        0x15, 0x00, 0x27, 0xFF, 0xFF, 0xFF, 0x7F, 0x75, 0x20, 0x95, 0x01, 0x55, 0x00, 0xB1, 0x02, 0x16,      \
        0x01, 0x80, 0x26, 0xFF, 0x7F, 0x75, 0x10, 0x95, 0x01, 0x55, exponent, AXIS(x), AXIS((x) + 1),        \
        AXIS((x) + 2), 0xC0

static const uint8_t sensor_descriptor[] = {
    0x05, 0x20, 0x09, 0x01, 0xA1, 0x01, SENSOR(1, 0x73, 0x0E, 0x453), SENSOR(2, 0x76, 0x0F, 0x457), 0xC0};

static int sensor_feature(virtual_hid *device, uint8_t id, uint8_t *report) {
    if (id != 1 && id != 2) return -1;
    memcpy(report, device->set[id], 7);
    report[0] = id;
    return 7; /* reporting state, power state, interval */
}

static int sensor_input(virtual_hid *device, uint32_t n, uint8_t *report) {
    (void)device;
    memset(report, 0, 7);
    report[0] = n % 2 ? 2 : 1;
    put16(report + 5, n % 2 ? 100 : -100); /* 10 deg/s; -1 g, signed like gravity */
    return 7;
}

virtual_hid_kind virtual_hid_sensor(void) {
    return (virtual_hid_kind){.name = "fathom virtual sensors",
                              .serial = "sensor-1",
                              .vendor = 0x1209,
                              .product = 0x0001,
                              .descriptor = sensor_descriptor,
                              .descriptor_length = sizeof sensor_descriptor,
                              .feature = sensor_feature,
                              .input = sensor_input};
}

/* ---- on USB ---- */

#define DEVICE(vendor, product, class)                                                                       \
    {                                                                                                        \
        18, 1, 0x00, 0x02, class, 0, 0, 64, (vendor)&255, (vendor) >> 8, (product)&255, (product) >> 8, 0,   \
            1, 1, 2, 3, 1                                                                                    \
    }
#define CONFIG(length, interfaces) 9, 2, (length)&255, (length) >> 8, interfaces, 1, 0, 0xC0, 50
#define ENDPOINT(address, type, size, interval) 7, 5, address, type, (size)&255, (size) >> 8, interval

static const uint8_t dualsense_device[] = DEVICE(0x054C, 0x0CE6, 0);
static const uint8_t dualsense_config[] = {CONFIG(41, 1),
                                           9,
                                           4,
                                           0,
                                           0,
                                           2,
                                           3,
                                           0,
                                           0,
                                           0,
                                           9,
                                           0x21,
                                           0x11,
                                           0x01,
                                           0,
                                           1,
                                           0x22,
                                           sizeof dualsense_descriptor,
                                           0,
                                           ENDPOINT(0x81, 3, 64, 4),
                                           ENDPOINT(0x03, 3, 64, 6)};

static int dualsense_control(virtual_usb *device, const uint8_t setup[8], uint8_t *data) {
    (void)device;
    if (setup[0] == 0x81 && setup[1] == 6 && setup[3] == 0x22) {
        memcpy(data, dualsense_descriptor, sizeof dualsense_descriptor);
        return sizeof dualsense_descriptor;
    }
    if (setup[0] == 0xA1 && setup[1] == 1)
        return dualsense_feature(setup[2], data, "\x66\x55\x44\x33\x22\x11");
    return setup[0] & 0x80 ? -1 : 0; /* set idle, output reports */
}

virtual_usb_kind virtual_usb_dualsense(void) {
    return (virtual_usb_kind){
        .port = 0,
        .device = dualsense_device,
        .config = dualsense_config,
        .strings = {"Sony Interactive Entertainment", "DualSense Wireless Controller", "USB0001"},
        .control = dualsense_control};
}

static const uint8_t mti_device[] = DEVICE(0x2639, 0x0300, 0xFF);
static const uint8_t mti_config[] = {
    CONFIG(32, 1), 9, 4, 0, 0, 2, 0xFF, 0, 0, 0, ENDPOINT(0x82, 2, 512, 0), ENDPOINT(0x02, 2, 512, 0)};

virtual_usb_kind virtual_mti(const char *serial) {
    return (virtual_usb_kind){
        .port = 1, .device = mti_device, .config = mti_config, .strings = {"Xsens", "MTi", serial}};
}

static const uint8_t kinect_device[] = DEVICE(0x045E, 0x02B0, 0);
static const uint8_t kinect_config[] = {CONFIG(18, 1), 9, 4, 0, 0, 0, 0xFF, 0, 0, 0};

static int kinect_control(virtual_usb *device, const uint8_t setup[8], uint8_t *data) {
    (void)device;
    if (setup[0] != 0xC0 || setup[1] != 0x32) return -1;
    memcpy(data, (uint8_t[]){0, 0, 0, 10, 819 >> 8, 819 & 255, 0xFF, 0xF6, 0, 0}, 10);
    return 10;
}

virtual_usb_kind virtual_kinect_motor(void) {
    return (virtual_usb_kind){.port = 2,
                              .device = kinect_device,
                              .config = kinect_config,
                              .strings = {"Microsoft", "Xbox NUI Motor", NULL},
                              .control = kinect_control};
}

static size_t put_big(uint8_t *at, uint64_t value, int bytes) {
    for (int i = 0; i < bytes; i++) at[i] = (uint8_t)(value >> (8 * (bytes - 1 - i)));
    return (size_t)bytes;
}

int virtual_mti_message(uint32_t n, int rate_hz, int padding, uint8_t *message) {
    uint8_t data[2048];
    size_t at = put_big(data, 0x102002, 3);
    at += put_big(data + at, n & 0xFFFF, 2);
    at += put_big(data + at, 0x106004, 3);
    at += put_big(data + at, (uint64_t)n * 10000 / (unsigned)rate_hz, 4);
    const float rate[3] = {(float)(n % 1000), 0, 0}, force[3] = {0, 0, 9.8125f};
    for (int k = 0; k < 2; k++) {
        at += put_big(data + at, k ? 0x40200C : 0x80200C, 3);
        for (int i = 0; i < 3; i++) {
            uint32_t bits;
            memcpy(&bits, k ? &force[i] : &rate[i], 4);
            at += put_big(data + at, bits, 4);
        }
    }
    while (padding > 3) { /* magnetic field and the like */
        const int size = padding > 203 ? 200 : padding - 3;
        at += put_big(data + at, 0xC02000 + (uint64_t)size, 3);
        memset(data + at, 0x5A, (size_t)size);
        at += (size_t)size;
        padding -= 3 + size;
    }
    return (int)xbus_build(message, 2100, XBUS_MTDATA2, data, at);
}
