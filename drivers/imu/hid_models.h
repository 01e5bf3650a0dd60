/* HID devices whose reports have a fixed format: a table of the samples' positions. */
#ifndef FATHOM_HID_MODELS_H
#define FATHOM_HID_MODELS_H

#include "imu/imu_reading.h"

typedef enum { HID_BUS_ANY = 0, HID_BUS_USB, HID_BUS_BLUETOOTH } hid_bus;

/* The layout of an input report; offsets are bytes from the report's number, which is byte 0. Numbers are
 * little-endian, samples int16 x y z. */
typedef struct {
    uint8_t report_id;
    uint16_t length;          /* minimum */
    uint8_t gyro, accel;      /* of the first sample */
    uint8_t samples, stride;  /* in a report, and the bytes from one to the next */
    int32_t sample_ns;        /* between the samples of a report */
    uint8_t time, time_bytes; /* the sensor's clock; 0 bytes: none */
    double tick_ns;
    uint8_t sequence, sequence_shift, sequence_bits; /* counts reports; 0 bits: none */
    /* 0: none; else the last 4 of `length` bytes are a CRC-32 over this byte and the others */
    uint8_t crc_seed;
} hid_layout;

/* raw to rad/s and m/s^2: (raw - bias) * scale. */
typedef struct {
    double gyro_bias[3], gyro_scale[3], accel_bias[3], accel_scale[3];
} imu_calibration;

/* A command that makes a device stream. */
typedef struct {
    uint8_t length;
    uint8_t bytes[16];
} hid_command;

typedef struct {
    uint16_t vendor, product;
    hid_bus bus;
    const char *name;
    const char *axes; /* where x, y and z point */
    const hid_layout *layout;
    double gyro_scale, accel_scale; /* nominal; signs turn the device's axes */
    double turn[3];                 /* +1 or -1 per axis; all 0: unchanged */
    /* The factory calibration: a feature report's number (0: none), length and parser; false: it is invalid, and the
     * nominal scale stays. */
    uint8_t calibration_id;
    uint8_t calibration_length;
    bool (*calibrate)(const uint8_t *report, size_t length, imu_calibration *calibration);
    const hid_command *commands; /* sent at start; the last has length 0. NULL: none */
} hid_model;

/* NULL: not one of the table. */
const hid_model *hid_model_find(uint16_t vendor, uint16_t product, hid_bus bus);

/* A row by its number, NULL after the last. */
const hid_model *hid_model_at(int index);

/* State of an open device of the table. */
typedef struct {
    const hid_model *model;
    imu_calibration calibration;
    bool factory_calibrated;
    whole_counter clock;
    bool counting;
    uint32_t sequence;
} hid_fixed;

/* calibration: the feature report as received, with its number; NULL or invalid: nominal scales. */
void hid_fixed_init(hid_fixed *device, const hid_model *model, const uint8_t *calibration, size_t length);

typedef enum { HID_FIXED_READING, HID_FIXED_OTHER, HID_FIXED_MALFORMED } hid_fixed_result;

/* Parses an input report; arrival_ns as in whole_counter_next. OTHER: a report with another number. */
hid_fixed_result hid_fixed_read(hid_fixed *device, const uint8_t *report, size_t length, int64_t arrival_ns,
                                imu_reading *reading);

/* CRC-32 (IEEE 802.3) of a seed byte and bytes after it, as Sony's devices use it over Bluetooth. */
uint32_t hid_crc32(uint8_t seed, const uint8_t *bytes, size_t length);

#endif
