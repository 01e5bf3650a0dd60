/* Shared by the parts of the USB driver. */
#ifndef FATHOM_USB_INTERNAL_H
#define FATHOM_USB_INTERNAL_H

#include <libusb.h>

#include "address.h"
#include "imu/imu_source.h"
#include "imu/mtdata2.h"

#define USB_TRANSFERS 8
#define USB_TRANSFER_BYTES 4096
#define USB_COMMAND_MS 500
#define USB_MOST_ERRORS 8 /* failed transfers in a row after which the device counts as gone */

typedef enum { USB_KINECT_MOTOR, USB_MTI } usb_kind;

struct usb_source;

/* A transfer, pending or not. */
typedef struct {
    struct usb_source *source;
    struct libusb_transfer *transfer;
    bool pending;
    int64_t submitted_ns;
    uint8_t bytes[USB_TRANSFER_BYTES];
} usb_slot;

typedef struct usb_source {
    imu_source base;
    source_address address;
    usb_choice wanted;
    bool configure;
    libusb_context *context;
    libusb_device_handle *handle;
    usb_kind kind;
    int interface; /* claimed; -1: none */
    uint8_t bulk_in, bulk_out;
    usb_slot slots[USB_TRANSFERS];
    int slot_count;
    bool gone, halted, stopping;
    int errors, silent;
    int64_t due_ns; /* of the next control request */
    int64_t taken;  /* readings since the last poll */
    xbus_parser parser;
    mtdata2_state data;
} usb_source;

/* ---- usb_devices.c: what there is ---- */

/* False: not a device that this driver knows. */
bool usb_recognise(const struct libusb_device_descriptor *descriptor, usb_kind *kind);

const char *usb_kind_name(usb_kind kind);

/* "/dev/bus/usb/001/002" */
void usb_place(libusb_device *device, char *out, size_t size);

/* Translates libusb's errors; problem gets a description, with the fix. */
int usb_translate(int error, const char *place, char *problem, size_t size);

/* "" where there is none. */
void usb_serial(libusb_device_handle *handle, const struct libusb_device_descriptor *descriptor, char *out,
                int size);

/* The driver's enumerate. */
int usb_enumerate(fathom_source_found found, void *user, fathom_log log, void *log_user);

/* ---- usb_transfers.c: the callbacks run in the source's thread, within libusb_handle_events ---- */

/* Allocates transfers where there are none yet. */
int usb_make_slots(usb_source *source, int count);

/* 0, or libusb's error. */
int usb_submit(usb_slot *slot);

/* libusb's callback of every transfer. */
void LIBUSB_CALL usb_done(struct libusb_transfer *transfer);

/* Returns when every transfer has completed: until then its memory is in use. */
void usb_cancel_all(usb_source *source);

#endif
