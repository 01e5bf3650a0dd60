/* Any bytes as the calibration of any device of the table: what is believed must be finite and near the nominal. */
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
    const size_t length = size - 1;
    uint8_t *report = malloc(length + 1);
    memcpy(report, data + 1, length);
    if (length) report[0] = m->calibration_id;
    if (length >= 41) { /* a checksum that holds, so that it isn't the end of everything */
        const uint32_t crc = hid_crc32(0xA3, report, 37);
        for (int i = 0; i < 4; i++) report[37 + i] = (uint8_t)(crc >> (8 * i));
    }
    hid_fixed device;
    hid_fixed_init(&device, m, report, length);
    for (int i = 0; i < 3; i++)
        if (!(fabs(device.calibration.gyro_scale[i] / m->gyro_scale) < 2) ||
            !(fabs(device.calibration.accel_scale[i] / m->accel_scale) < 2) ||
            !isfinite(device.calibration.accel_bias[i]))
            abort();
    free(report);
    return 0;
}
