#include "imu/hid_models.h"

#include "imu/hid_playstation.h"

/* Nintendo's controllers: three samples per report, 5 ms apart, accelerometer first; nominal scales (the calibration is
 * in a flash memory that needs special commands to read). Only over Bluetooth: by cable they need a handshake first. */
static const hid_layout switch_full = {.report_id = 0x30,
                                       .length = 49,
                                       .gyro = 19,
                                       .accel = 13,
                                       .samples = 3,
                                       .stride = 12,
                                       .sample_ns = 5000000};
/* Output report 1: a counter, rumble at rest, then a subcommand: the IMU on, and reports of kind 0x30. */
static const hid_command switch_start[] = {
    {12, {0x01, 0x00, 0x00, 0x01, 0x40, 0x40, 0x00, 0x01, 0x40, 0x40, 0x40, 0x01}},
    {12, {0x01, 0x01, 0x00, 0x01, 0x40, 0x40, 0x00, 0x01, 0x40, 0x40, 0x03, 0x30}},
    {0, {0}}};
#define SWITCH_SCALES .gyro_scale = 0.070 * RADIANS_PER_DEGREE, .accel_scale = STANDARD_GRAVITY / 4096
#define SWITCH                                                                                               \
    .axes = "x to the triggers, y left, z out of the face", .bus = HID_BUS_BLUETOOTH,                        \
    .layout = &switch_full, .commands = switch_start, SWITCH_SCALES

#define PLAYSTATION                                                                                          \
    .axes = PLAYSTATION_AXES, .gyro_scale = PLAYSTATION_GYRO_SCALE, .accel_scale = PLAYSTATION_ACCEL_SCALE
#define DUALSHOCK4_USB                                                                                       \
    PLAYSTATION, .bus = HID_BUS_USB, .layout = &dualshock4_usb,                                              \
                 .calibration_id = DUALSHOCK4_CALIBRATION_USB,                                               \
                 .calibration_length = DUALSHOCK4_CALIBRATION_LENGTH
#define DUALSHOCK4_BLUETOOTH                                                                                 \
    PLAYSTATION, .bus = HID_BUS_BLUETOOTH, .layout = &dualshock4_bluetooth,                                  \
                 .calibration_id = DUALSHOCK4_CALIBRATION_BLUETOOTH,                                         \
                 .calibration_length = PLAYSTATION_CALIBRATION_LENGTH,                                       \
                 .calibrate = dualshock4_calibrate_bluetooth
#define DUALSENSE_USB                                                                                        \
    PLAYSTATION, .bus = HID_BUS_USB, .layout = &dualsense_usb, .calibration_id = DUALSENSE_CALIBRATION,      \
                 .calibration_length = PLAYSTATION_CALIBRATION_LENGTH, .calibrate = dualsense_calibrate
#define DUALSENSE_BLUETOOTH                                                                                  \
    PLAYSTATION,                                                                                             \
        .bus = HID_BUS_BLUETOOTH, .layout = &dualsense_bluetooth, .calibration_id = DUALSENSE_CALIBRATION,   \
        .calibration_length = PLAYSTATION_CALIBRATION_LENGTH, .calibrate = dualsense_calibrate_bluetooth

static const hid_model models[] = {
    {0x054C, 0x05C4, .name = "Sony DualShock 4", DUALSHOCK4_USB, .calibrate = dualshock4_calibrate_usb},
    {0x054C, 0x05C4, .name = "Sony DualShock 4", DUALSHOCK4_BLUETOOTH},
    {0x054C, 0x09CC, .name = "Sony DualShock 4 v2", DUALSHOCK4_USB, .calibrate = dualshock4_calibrate_usb},
    {0x054C, 0x09CC, .name = "Sony DualShock 4 v2", DUALSHOCK4_BLUETOOTH},
    {0x054C, 0x0BA0, .name = "Sony DualShock 4 adapter", DUALSHOCK4_USB,
     .calibrate = dualshock4_calibrate_dongle},
    {0x054C, 0x0CE6, .name = "Sony DualSense", DUALSENSE_USB},
    {0x054C, 0x0CE6, .name = "Sony DualSense", DUALSENSE_BLUETOOTH},
    {0x054C, 0x0DF2, .name = "Sony DualSense Edge", DUALSENSE_USB},
    {0x054C, 0x0DF2, .name = "Sony DualSense Edge", DUALSENSE_BLUETOOTH},
    {0x057E, 0x2006, .name = "Nintendo Joy-Con (L)", SWITCH},
    {0x057E, 0x2007, .name = "Nintendo Joy-Con (R)", SWITCH, .turn = {1, -1, -1}},
    {0x057E, 0x2009, .name = "Nintendo Switch Pro Controller", SWITCH},
};

const hid_model *hid_model_at(int index) {
    return index >= 0 && index < (int)(sizeof models / sizeof *models) ? &models[index] : NULL;
}

const hid_model *hid_model_find(uint16_t vendor, uint16_t product, hid_bus bus) {
    const hid_model *m;
    for (int i = 0; (m = hid_model_at(i)); i++)
        if (m->vendor == vendor && m->product == product && (m->bus == bus || m->bus == HID_BUS_ANY))
            return m;
    return NULL;
}

uint32_t hid_crc32(uint8_t seed, const uint8_t *bytes, size_t length) {
    uint32_t crc = 0xFFFFFFFF;
    for (size_t i = 0; i <= length; i++) {
        crc ^= i == 0 ? seed : bytes[i - 1];
        for (int bit = 0; bit < 8; bit++) crc = crc >> 1 ^ (crc & 1 ? 0xEDB88320 : 0);
    }
    return ~crc;
}

void hid_fixed_init(hid_fixed *device, const hid_model *model, const uint8_t *calibration, size_t length) {
    *device = (hid_fixed){.model = model};
    device->factory_calibrated =
        calibration && model->calibrate && model->calibrate(calibration, length, &device->calibration);
    for (int i = 0; i < 3; i++) {
        if (!device->factory_calibrated) {
            device->calibration.gyro_scale[i] = model->gyro_scale;
            device->calibration.accel_scale[i] = model->accel_scale;
        }
        if (model->turn[i] < 0) {
            device->calibration.gyro_scale[i] *= -1;
            device->calibration.accel_scale[i] *= -1;
        }
    }
}

/* Reports missing between the last one and this one. */
static int64_t count_lost(hid_fixed *device, const uint8_t *report) {
    const hid_layout *l = device->model->layout;
    if (!l->sequence_bits) return 0;
    const uint32_t mask = (1u << l->sequence_bits) - 1;
    const uint32_t now = (uint32_t)report[l->sequence] >> l->sequence_shift & mask;
    const uint32_t step = (now - device->sequence) & mask;
    const bool known = device->counting;
    device->counting = true;
    device->sequence = now;
    return known && step > 1 ? (int64_t)step - 1 : 0;
}

hid_fixed_result hid_fixed_read(hid_fixed *device, const uint8_t *report, size_t length, int64_t arrival_ns,
                                imu_reading *reading) {
    const hid_layout *l = device->model->layout;
    const imu_calibration *c = &device->calibration;
    if (length == 0) return HID_FIXED_MALFORMED;
    if (report[0] != l->report_id) return HID_FIXED_OTHER;
    if (length < l->length) return HID_FIXED_MALFORMED;
    if (l->crc_seed && hid_crc32(l->crc_seed, report, l->length - 4u) != little_u32(report + l->length - 4))
        return HID_FIXED_MALFORMED;

    *reading =
        (imu_reading){.has_gyro = true, .has_accel = true, .samples = l->samples, .period_ns = l->sample_ns};
    reading->lost = count_lost(device, report) * l->samples;
    for (int s = 0; s < l->samples; s++)
        for (int i = 0; i < 3; i++) {
            const size_t at = (size_t)s * l->stride + 2 * (size_t)i;
            reading->gyro[s][i] = (little_i16(report + l->gyro + at) - c->gyro_bias[i]) * c->gyro_scale[i];
            reading->accel[s][i] =
                (little_i16(report + l->accel + at) - c->accel_bias[i]) * c->accel_scale[i];
        }
    if (l->time_bytes) {
        const uint64_t raw = l->time_bytes == 4 ? little_u32(report + l->time) : little_u16(report + l->time);
        const uint64_t ticks =
            whole_counter_next(&device->clock, raw, 8 * l->time_bytes, l->tick_ns, arrival_ns);
        const double ns = (double)ticks * l->tick_ns;
        if (!(ns < 4e18)) return HID_FIXED_MALFORMED;
        reading->device_ns[l->samples - 1] = (int64_t)ns;
        reading->times = 1;
    }
    return HID_FIXED_READING;
}
