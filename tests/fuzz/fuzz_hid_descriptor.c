/* Any bytes as a report descriptor, then a report read through it. The first byte says how long the report is. */
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "imu/hid_sensor.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static hid_descriptor d;
    static hid_sensor sensor;
    if (size < 1) return 0;
    const size_t report_length = data[0] < size - 1 ? data[0] : size - 1;
    const uint8_t *report = data + size - report_length;
    if (!hid_descriptor_parse(&d, data + 1, size - 1 - report_length)) return 0;
    uint8_t *copy = malloc(report_length + 1);
    memcpy(copy, report, report_length);
    int64_t value;
    for (int i = 0; i < d.field_count; i++) {
        hid_field_usage(&d, &d.fields[i], d.fields[i].count - 1);
        if (hid_field_read(&d, &d.fields[i], d.fields[i].count - 1, report, report_length, &value) &&
            !hid_field_write(&d, &d.fields[i], d.fields[i].count - 1, copy, report_length, value))
            abort();
    }
    if (memcmp(copy, report, report_length)) abort(); /* what was read was written back */
    for (int id = 0; id < 256; id++) {
        hid_sensor_prepare(&d, HID_SENSOR_GYROMETER_3D, (uint8_t)id, 0.005, copy, report_length);
        hid_sensor_prepare(&d, HID_SENSOR_ACCELEROMETER_3D, (uint8_t)id, 0.005, copy, report_length);
    }
    if (hid_sensor_find(&sensor, &d)) {
        imu_reading r;
        for (int64_t t = 1; t < 4; t++)
            if (hid_sensor_read(&sensor, report, report_length, t * 1000000, &r) == HID_SENSOR_READING &&
                (r.samples < 1 || r.samples > IMU_BATCH || r.times < 0 || r.times > r.samples))
                abort();
    }
    free(copy);
    return 0;
}
