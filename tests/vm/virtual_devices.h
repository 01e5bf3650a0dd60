/* The devices that the drivers are tried with in the virtual machine. */
#ifndef VIRTUAL_DEVICES_H
#define VIRTUAL_DEVICES_H

#include "virtual_hid.h"
#include "virtual_usb.h"

/* A DualSense on uhid; its reports count in the sequence number, and so does the gyroscope's x. */
virtual_hid_kind virtual_dualsense(const char *address);

/* A device of the HID Sensor page: reports 1 (accelerometer, 0.01 g) and 2 (gyrometer, 0.1 deg/s) in turn. At rest on its back,
 * turning by 10 deg/s about z. */
virtual_hid_kind virtual_hid_sensor(void);

/* On USB: a DualSense (HID, an interrupt endpoint), an MTi (bulk), the Kinect's motor device (control). */
virtual_usb_kind virtual_usb_dualsense(void);
virtual_usb_kind virtual_mti(const char *serial);
virtual_usb_kind virtual_kinect_motor(void);

/* The report of a DualSense, number n at a rate. */
int virtual_dualsense_report(uint32_t n, int rate_hz, uint8_t *report);

/* An MTData2 message number n at a rate with so many bytes of other things in it; its length. */
int virtual_mti_message(uint32_t n, int rate_hz, int padding, uint8_t *message);

enum { MTI_IN = 2, MTI_OUT = 2, DUALSENSE_IN = 1 };

#endif
