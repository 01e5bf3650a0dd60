#include "imu/hid_sensor.h"

#include <math.h>
#include <string.h>

/* Usages of the Sensors page. */
enum {
    ACCELERATION_X = 0x200453,
    ANGULAR_VELOCITY_X = 0x200457,
    TIMESTAMP = 0x200529,
    REPORT_INTERVAL = 0x20030E,
    REPORTING_STATE = 0x200316,
    POWER_STATE = 0x200319,
    ALL_EVENTS = 0x200841,
    FULL_POWER = 0x200851
};

/* Units as packed by 6.2.2.7, and as listed by the Sensors page, which descriptors use as well. The HID system's length
 * is the centimetre. */
static bool accel_unit(uint32_t unit, double *value) {
    switch (unit) {
    case 0:                                            /* the page's default */
    case 0x1A: *value = STANDARD_GRAVITY; return true; /* G */
    case 0xE011: *value = 0.01; return true;
    case 0x11E0: *value = 1; return true; /* m/s^2 by the page's list */
    }
    *value = STANDARD_GRAVITY;
    return false;
}

static bool gyro_unit(uint32_t unit, double *value) {
    switch (unit) {
    case 0: /* the page's default */
    case 0x15:
    case 0xF014: *value = RADIANS_PER_DEGREE; return true;
    case 0x12F0:
    case 0xF012: *value = 1; return true;
    }
    *value = RADIANS_PER_DEGREE;
    return false;
}

static bool time_unit(uint32_t unit, double *value) {
    *value = unit == 0x1001 ? 1e9 : 1e6; /* else milliseconds: the default, and 0x19 of the page's list */
    return unit == 0 || unit == 0x19 || unit == 0x1001;
}

static hid_sensor_report *report_of(hid_sensor *sensor, uint8_t report_id) {
    for (int i = 0; i < sensor->report_count; i++)
        if (sensor->reports[i].report_id == report_id) return &sensor->reports[i];
    if (sensor->report_count == HID_SENSOR_REPORTS) return NULL;
    hid_sensor_report *r = &sensor->reports[sensor->report_count++];
    *r = (hid_sensor_report){.report_id = report_id};
    return r;
}

static void add_element(hid_sensor *sensor, int field_index, uint32_t element) {
    const hid_descriptor *d = sensor->descriptor;
    const hid_field *field = &d->fields[field_index];
    const uint32_t usage = hid_field_usage(d, field, element);
    const bool accel = hid_field_within(d, field, HID_SENSOR_ACCELEROMETER_3D);
    const bool gyro = hid_field_within(d, field, HID_SENSOR_GYROMETER_3D);
    const bool is_accel = accel && usage >= ACCELERATION_X && usage < ACCELERATION_X + 3;
    const bool is_gyro = gyro && usage >= ANGULAR_VELOCITY_X && usage < ANGULAR_VELOCITY_X + 3;
    const bool is_time = (accel || gyro) && usage == TIMESTAMP;
    if (!is_accel && !is_gyro && !is_time) return;
    hid_sensor_report *r = report_of(sensor, field->report_id);
    if (!r) return;
    hid_sensor_axis *axis = is_accel  ? &r->accel[usage - ACCELERATION_X]
                            : is_gyro ? &r->gyro[usage - ANGULAR_VELOCITY_X]
                                      : &r->time;
    if (axis->count == IMU_BATCH) return;
    const bool known = is_accel  ? accel_unit(field->unit, &r->accel_unit)
                       : is_gyro ? gyro_unit(field->unit, &r->gyro_unit)
                                 : time_unit(field->unit, &r->time_unit);
    if (!known) sensor->odd_unit = field->unit;
    axis->field[axis->count] = (uint16_t)field_index;
    axis->element[axis->count++] = (uint16_t)element;
}

static int samples_in(const hid_sensor_axis axes[3]) {
    int least = axes[0].count;
    for (int i = 1; i < 3; i++)
        if (axes[i].count < least) least = axes[i].count;
    return least;
}

bool hid_sensor_find(hid_sensor *sensor, const hid_descriptor *descriptor) {
    *sensor = (hid_sensor){.descriptor = descriptor, .gravity_signed = true};
    for (int i = 0; i < descriptor->field_count; i++) {
        const hid_field *f = &descriptor->fields[i];
        if (f->kind != HID_INPUT || !(f->flags & HID_VARIABLE) || f->bits > 32) continue;
        for (uint32_t e = 0; e < f->count && e < 3 * IMU_BATCH; e++) add_element(sensor, i, e);
    }
    for (int i = 0; i < sensor->report_count; i++) {
        sensor->has_gyro |= samples_in(sensor->reports[i].gyro) > 0;
        sensor->has_accel |= samples_in(sensor->reports[i].accel) > 0;
    }
    return sensor->has_gyro || sensor->has_accel;
}

void hid_sensor_known_signs(hid_sensor *sensor, uint16_t vendor, uint16_t product) {
    static const struct {
        uint16_t vendor, product;
        bool gravity_signed, left_handed;
    } known[] = {
        /* Lenovo Legion Go S: when it is tilted, gravity goes round with its rates only if these are taken off. */
        {0x1A86, 0xE311, true, true},
    };
    for (size_t i = 0; i < sizeof known / sizeof *known; i++)
        if (known[i].vendor == vendor && known[i].product == product) {
            sensor->gravity_signed = known[i].gravity_signed;
            sensor->left_handed = known[i].left_handed;
        }
}

static bool read_value(const hid_sensor *sensor, const hid_sensor_axis *axis, int i, const uint8_t *report,
                       size_t length, double *value) {
    const hid_field *f = &sensor->descriptor->fields[axis->field[i]];
    int64_t raw;
    if (!hid_field_read(sensor->descriptor, f, axis->element[i], report, length, &raw)) return false;
    if (f->logical_min < f->logical_max && (raw < f->logical_min || raw > f->logical_max)) return false;
    *value = hid_field_physical(f, raw);
    return true;
}

static bool read_axes(const hid_sensor *sensor, const hid_sensor_axis axes[3], double unit, int samples,
                      const uint8_t *report, size_t length, double values[][3]) {
    for (int s = 0; s < samples; s++)
        for (int i = 0; i < 3; i++) {
            if (!read_value(sensor, &axes[i], s, report, length, &values[s][i])) return false;
            values[s][i] *= unit;
        }
    return true;
}

/* A single time in a report is the last sample's. */
static bool read_times(hid_sensor *sensor, hid_sensor_report *r, const uint8_t *report, size_t length,
                       int64_t arrival_ns, imu_reading *out) {
    out->times = r->time.count < out->samples ? 1 : out->samples;
    for (int i = 0; i < out->times; i++) {
        const hid_field *f = &sensor->descriptor->fields[r->time.field[i]];
        int64_t raw;
        if (!hid_field_read(sensor->descriptor, f, r->time.element[i], report, length, &raw)) return false;
        const double tick = r->time_unit * pow(10, f->exponent);
        const double ns =
            (double)whole_counter_next(&sensor->clock, (uint64_t)raw, (int)f->bits, tick, arrival_ns) * tick;
        if (!(ns < 4e18)) return false;
        out->device_ns[out->samples - out->times + i] = (int64_t)ns;
    }
    return true;
}

hid_sensor_result hid_sensor_read(hid_sensor *sensor, const uint8_t *report, size_t length,
                                  int64_t arrival_ns, imu_reading *reading) {
    if (length == 0) return HID_SENSOR_MALFORMED;
    const uint8_t id = sensor->descriptor->numbered ? report[0] : 0;
    hid_sensor_report *r = NULL;
    for (int i = 0; i < sensor->report_count; i++)
        if (sensor->reports[i].report_id == id) r = &sensor->reports[i];
    if (!r)
        return hid_report_length(sensor->descriptor, HID_INPUT, id) ? HID_SENSOR_OTHER : HID_SENSOR_MALFORMED;
    *reading = (imu_reading){0};
    const int gyros = samples_in(r->gyro), accels = samples_in(r->accel);
    reading->has_gyro = gyros > 0;
    reading->has_accel = accels > 0;
    reading->samples = gyros && accels ? (gyros < accels ? gyros : accels) : gyros + accels;
    if (reading->samples == 0) return HID_SENSOR_OTHER;
    if (!read_axes(sensor, r->gyro, r->gyro_unit, gyros ? reading->samples : 0, report, length,
                   reading->gyro) ||
        !read_axes(sensor, r->accel, r->accel_unit, accels ? reading->samples : 0, report, length,
                   reading->accel) ||
        (r->time.count && !read_times(sensor, r, report, length, arrival_ns, reading)))
        return HID_SENSOR_MALFORMED;
    for (int s = 0; s < reading->samples; s++)
        for (int i = 0; i < 3; i++) {
            if (sensor->gravity_signed) reading->accel[s][i] = -reading->accel[s][i];
            if (sensor->left_handed) reading->gyro[s][i] = -reading->gyro[s][i];
        }
    return HID_SENSOR_READING;
}

/* The value that a field needs for a property; false: the field isn't one of the properties. */
static bool wanted_value(const hid_descriptor *d, const hid_field *f, double interval_s, int64_t *value) {
    const uint32_t own = hid_field_usage(d, f, 0);
    if (own == REPORT_INTERVAL) {
        double unit_ns;
        if (interval_s <= 0 || !time_unit(f->unit, &unit_ns)) return false;
        double ticks = interval_s * 1e9 / (unit_ns * pow(10, f->exponent));
        ticks = fmin(fmax(fmax(floor(ticks), 1), (double)f->logical_min), (double)f->logical_max);
        *value = (int64_t)ticks;
        return true;
    }
    /* Selectors: the property's usage is that of the collection around the list of choices. */
    const uint32_t property = f->collection >= 0 ? d->collections[f->collection].usage : 0;
    const uint32_t choice = property == POWER_STATE       ? FULL_POWER
                            : property == REPORTING_STATE ? ALL_EVENTS
                                                          : 0;
    const int index = choice ? hid_field_usage_index(d, f, choice) : -1;
    if (index < 0 || f->flags & HID_VARIABLE) return false;
    *value = f->logical_min + index;
    return true;
}

int hid_sensor_prepare(const hid_descriptor *descriptor, uint32_t sensor_usage, uint8_t report_id,
                       double interval_s, uint8_t *report, size_t length) {
    int set = 0;
    for (int i = 0; i < descriptor->field_count; i++) {
        const hid_field *f = &descriptor->fields[i];
        int64_t value;
        if (f->kind == HID_FEATURE && f->report_id == report_id &&
            hid_field_within(descriptor, f, sensor_usage) &&
            wanted_value(descriptor, f, interval_s, &value) &&
            hid_field_write(descriptor, f, 0, report, length, value))
            set++;
    }
    return set;
}
