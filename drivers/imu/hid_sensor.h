/* Devices of the HID Sensor usage page (0x20; HID Usage Tables, "Sensors Page"): accelerometer 3D and gyrometer 3D,
 * found by the report descriptor. */
#ifndef FATHOM_HID_SENSOR_H
#define FATHOM_HID_SENSOR_H

#include "imu/hid_descriptor.h"
#include "imu/imu_reading.h"

enum { HID_SENSOR_ACCELEROMETER_3D = 0x200073, HID_SENSOR_GYROMETER_3D = 0x200076 };

#define HID_SENSOR_REPORTS 4

/* Where the values of one axis stand in a report, oldest first: a batch has more than one. */
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
    uint32_t odd_unit;   /* a unit that isn't known: the page's default was taken in its place; 0: none */
    /* By the convention of this page's sensors (Windows', for which they are built) the accelerometer is signed like
     * gravity: z, which points up, reads -1 g at rest, the opposite of specific force; and the gyrometer is
     * right-handed. Set so by hid_sensor_find; for a device that does otherwise change it. */
    bool gravity_signed, left_handed;
} hid_sensor;

/* Finds what a descriptor has; it must stay where it is. False: no three axes of an accelerometer or a gyrometer. */
bool hid_sensor_find(hid_sensor *sensor, const hid_descriptor *descriptor);

/* Sets the signs of devices that are known to part from the convention. */
void hid_sensor_known_signs(hid_sensor *sensor, uint16_t vendor, uint16_t product);

typedef enum { HID_SENSOR_READING, HID_SENSOR_OTHER, HID_SENSOR_MALFORMED } hid_sensor_result;

/* Reads an input report; arrival_ns as whole_counter_next has it. OTHER: it has no data of ours. MALFORMED: too short,
 * or a value outside its logical range. */
hid_sensor_result hid_sensor_read(hid_sensor *sensor, const uint8_t *report, size_t length,
                                  int64_t arrival_ns, imu_reading *reading);

/* What a feature report must hold for a sensor (one of the two usages) to send all its samples: power on, all events,
 * and the interval (0: as it is). report holds what the device says now, with its number first where there are numbers.
 * Returns how many fields were set: 0 means that the report has nothing to do with it. */
int hid_sensor_prepare(const hid_descriptor *descriptor, uint32_t sensor_usage, uint8_t report_id,
                       double interval_s, uint8_t *report, size_t length);

#endif
