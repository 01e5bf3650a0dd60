/* For tests: recordings of HID devices in hid-recorder's format (R: descriptor, E: time, length, bytes). */
#ifndef HID_RECORDING_H
#define HID_RECORDING_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef struct {
    FILE *file;
    uint8_t descriptor[4096];
    size_t descriptor_length;
    int64_t at_ns; /* of the present report */
    uint8_t report[256];
    size_t length;
} hid_recording;

/* name: a file of ../shared/data/hid. Returns 0, or -1 when it isn't there. */
int hid_recording_open(hid_recording *recording, const char *name);
/* Goes to the next report; 0 at the end. */
int hid_recording_next(hid_recording *recording);
void hid_recording_close(hid_recording *recording);

/* Reads a line `0xID: hex` of the device's file of feature reports; returns its length, 0 when it isn't there. */
size_t hid_recording_feature(const char *name, uint8_t id, uint8_t *bytes, size_t capacity);

/* Runs a group of tests of which the last `real` need recordings; without those they are counted as skipped. */
struct CMUnitTest;
int hid_recording_run(const char *group, const struct CMUnitTest *tests, size_t count, size_t real);

#endif
