/* A sequence of any reports from any device of the table: a byte for the device, then length and bytes of each. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "imu/hid_models.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    if (size < 1) return 0;
    int rows = 0;
    while (hid_model_at(rows)) rows++;
    const hid_model *m = hid_model_at(data[0] % rows);
    hid_fixed device;
    hid_fixed_init(&device, m, NULL, 0);
    int64_t now_ns = 1;
    for (size_t at = 1; at < size;) {
        const size_t room = size - at - 1, length = data[at] < room ? data[at] : room;
        uint8_t *report = malloc(length + 1);
        memcpy(report, data + at + 1, length);
        if (length && data[at] & 1) report[0] = m->layout->report_id;
        if (m->layout->crc_seed && length >= m->layout->length && data[at] & 2) {
            const uint32_t crc = hid_crc32(m->layout->crc_seed, report, m->layout->length - 4u);
            for (int i = 0; i < 4; i++) report[m->layout->length - 4 + i] = (uint8_t)(crc >> (8 * i));
        }
        imu_reading r;
        now_ns += 1000003 * (int64_t)(1 + data[at]);
        if (hid_fixed_read(&device, report, length, data[at] & 4 ? now_ns : 0, &r) == HID_FIXED_READING) {
            if (r.samples < 1 || r.samples > IMU_BATCH || r.lost < 0) abort();
            for (int s = 0; s < r.samples; s++)
                for (int i = 0; i < 3; i++)
                    if (!isfinite(r.gyro[s][i]) || !isfinite(r.accel[s][i])) abort();
        }
        free(report);
        at += 1 + length;
    }
    return 0;
}
