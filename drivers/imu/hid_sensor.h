/* Devices of the HID Sensor usage page (0x20; HID Usage Tables, "Sensors Page"): accelerometer 3D and gyrometer 3D,
 * found by the report descriptor. */
#ifndef FATHOM_HID_SENSOR_H
#define FATHOM_HID_SENSOR_H

#include "imu/hid_descriptor.h"
#include "imu/imu_reading.h"

enum { HID_SENSOR_ACCELEROMETER_3D = 0x200073, HID_SENSOR_GYROMETER_3D = 0x200076 };

#define HID_SENSOR_REPORTS 4

/* Positions of one axis's values in a report, oldest first; a batch has several. */
typedef struct {
    int count;
    uint16_t field[IMU_BATCH], element[IMU_BATCH];
} hid_sensor_axis;

typedef struct {
    uint8_t report_id;
    hid_sensor_axis gyro[3], accel[3], time;
    double gyro_unit, accel_unit, time_unit; /* rad/s, m/s^2, ns of the fields' unit */
} hid_sensor_report;

typedef struct {
    const hid_descriptor *descriptor;
    hid_sensor_report reports[HID_SENSOR_REPORTS];
    int report_count;
    bool has_gyro, has_accel;
    whole_counter clock; /* one for all reports: they are stamped by one device */
    uint32_t odd_unit;   /* an unknown unit, in place of which the page's default is used; 0: none */
    /* By the convention of this page's sensors (Windows', for which they are built) the accelerometer is signed like
     * gravity: z, which points up, reads -1 g at rest, the opposite of specific force; and the gyrometer is
     * right-handed. Set so by hid_sensor_find; to be changed for devices that differ. */
    bool gravity_signed, left_handed;
} hid_sensor;

/* Finds the sensors in a descriptor, which must outlive *sensor. False: no three axes of an accelerometer or a
 * gyrometer. */
bool hid_sensor_find(hid_sensor *sensor, const hid_descriptor *descriptor);

/* Sets the signs of devices that are known to differ from the convention. */
void hid_sensor_known_signs(hid_sensor *sensor, uint16_t vendor, uint16_t product);

typedef enum { HID_SENSOR_READING, HID_SENSOR_OTHER, HID_SENSOR_MALFORMED } hid_sensor_result;

/* Parses an input report; arrival_ns as in whole_counter_next. OTHER: it has no inertial data. MALFORMED: too short, or
 * a value outside its logical range. */
hid_sensor_result hid_sensor_read(hid_sensor *sensor, const uint8_t *report, size_t length,
                                  int64_t arrival_ns, imu_reading *reading);

/* Sets the fields of a feature report so that a sensor (one of the two usages) sends all its samples: power on, all
 * events, and the interval (0: unchanged). report holds its present content, with its number first where reports are
 * numbered. Returns the number of fields that were set; 0: the report doesn't concern the sensor. */
int hid_sensor_prepare(const hid_descriptor *descriptor, uint32_t sensor_usage, uint8_t report_id,
                       double interval_s, uint8_t *report, size_t length);

#endif
