/* The USB inertial sensors that are plugged in, and libusb's errors about them. */
#include <stdio.h>
#include <string.h>

#include "imu/kinect_motor.h"
#include "imu/usb_internal.h"
#include "source_log.h"

#define XSENS 0x2639

bool usb_recognise(const struct libusb_device_descriptor *d, usb_kind *kind) {
    if (d->idVendor == KINECT_VENDOR && d->idProduct == KINECT_MOTOR_PRODUCT) {
        *kind = USB_KINECT_MOTOR;
        return true;
    }
    *kind = USB_MTI;
    return d->idVendor == XSENS;
}

void usb_place(libusb_device *device, char *out, size_t size) {
    snprintf(out, size, "/dev/bus/usb/%03d/%03d", libusb_get_bus_number(device),
             libusb_get_device_address(device));
}

const char *usb_kind_name(usb_kind kind) {
    return kind == USB_KINECT_MOTOR ? "Microsoft Kinect 360 accelerometer" : "Xsens MTi";
}

/* Translates libusb's errors; problem gets a description. */
int usb_translate(int error, const char *place, char *problem, size_t size) {
    switch (error) {
    case LIBUSB_SUCCESS: *problem = 0; return FATHOM_OK;
    case LIBUSB_ERROR_ACCESS:
        snprintf(problem, size, "no permission for %s: %s", place, IMU_UDEV_FIX);
        return FATHOM_ERROR_PERMISSION;
    case LIBUSB_ERROR_BUSY:
        snprintf(problem, size, "another program holds %s: close it", place);
        return FATHOM_ERROR_BUSY;
    case LIBUSB_ERROR_NO_DEVICE: snprintf(problem, size, "%s is gone", place); return FATHOM_ERROR_NO_DEVICE;
    case LIBUSB_ERROR_NO_MEM: snprintf(problem, size, "%s: no memory", place); return FATHOM_ERROR_MEMORY;
    default: snprintf(problem, size, "%s: %s", place, libusb_error_name(error)); return FATHOM_ERROR_PROTOCOL;
    }
}

void usb_serial(libusb_device_handle *handle, const struct libusb_device_descriptor *d, char *out,
                      int size) {
    *out = 0;
    if (!d->iSerialNumber ||
        libusb_get_string_descriptor_ascii(handle, d->iSerialNumber, (unsigned char *)out, size) < 0)
        *out = 0;
}

int usb_enumerate(fathom_source_found found, void *user, fathom_log log, void *log_user) {
    libusb_context *context;
    libusb_device **list;
    char place[64];
    const int error = libusb_init(&context);
    if (error) {
        char problem[128];
        snprintf(problem, sizeof problem, "libusb doesn't start: %s", libusb_error_name(error));
        return imu_source_sees_none("usb", "USB inertial sensors", problem, found, user)
                   ? FATHOM_ERROR_STOPPED
                   : 0;
    }
    const ssize_t count = libusb_get_device_list(context, &list);
    if (count < 0) source_say(log, log_user, FATHOM_LOG_ERROR, "usb: %s", libusb_error_name((int)count));
    int devices = 0, stopped = 0;
    for (ssize_t i = 0; i < count && !stopped; i++) {
        struct libusb_device_descriptor d;
        usb_kind kind;
        if (libusb_get_device_descriptor(list[i], &d) || !usb_recognise(&d, &kind)) continue;
        fathom_source_info info = {.struct_size = sizeof info, .driver = "usb", .kinds = FATHOM_SOURCE_IMU};
        libusb_device_handle *handle;
        snprintf(info.name, sizeof info.name, "%s", usb_kind_name(kind));
        usb_place(list[i], place, sizeof place);
        const int opened = libusb_open(list[i], &handle);
        info.error = usb_translate(opened, place, info.problem, sizeof info.problem);
        if (!opened) {
            usb_serial(handle, &d, info.serial, sizeof info.serial);
            libusb_close(handle);
        }
        snprintf(info.uri, sizeof info.uri, "usb:%04x:%04x%s%s", d.idVendor, d.idProduct,
                 *info.serial ? ":" : "", info.serial);
        devices++;
        stopped = found(user, &info);
    }
    if (count >= 0) libusb_free_device_list(list, 1);
    libusb_exit(context);
    if (!stopped && !devices)
        stopped = imu_source_sees_none(
            "usb", "USB inertial sensors",
            "neither a Kinect 360 (its motor device) nor an Xsens MTi is plugged in", found, user);
    return stopped ? FATHOM_ERROR_STOPPED : devices;
}
