/* USB inertial sensors by libusb: the Kinect 360's accelerometer (control transfers to its motor device) and
 * Xsens/Movella MTi (bulk transfers). Transfers are asynchronous; the source's thread handles their events. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "imu/kinect_motor.h"
#include "imu/usb_internal.h"
#include "monotonic.h"
#include "source_log.h"

/* ---- opening ---- */

/* The interface with a bulk endpoint each way. */
static bool find_bulk(usb_source *s, libusb_device *device) {
    struct libusb_config_descriptor *config;
    if (libusb_get_active_config_descriptor(device, &config)) return false;
    bool there = false;
    for (int i = 0; i < config->bNumInterfaces && !there; i++) {
        if (config->interface[i].num_altsetting < 1) continue;
        const struct libusb_interface_descriptor *setting = &config->interface[i].altsetting[0];
        s->bulk_in = s->bulk_out = 0;
        for (int e = 0; e < setting->bNumEndpoints; e++) {
            const struct libusb_endpoint_descriptor *end = &setting->endpoint[e];
            if ((end->bmAttributes & LIBUSB_TRANSFER_TYPE_MASK) != LIBUSB_TRANSFER_TYPE_BULK) continue;
            *(end->bEndpointAddress & LIBUSB_ENDPOINT_IN ? &s->bulk_in : &s->bulk_out) =
                end->bEndpointAddress;
        }
        there = s->bulk_in && s->bulk_out;
        s->interface = setting->bInterfaceNumber;
    }
    libusb_free_config_descriptor(config);
    if (!there) s->interface = -1;
    return there;
}

static void close_device(usb_source *s) {
    if (s->handle && s->interface >= 0) libusb_release_interface(s->handle, s->interface);
    if (s->handle) libusb_close(s->handle);
    s->handle = NULL;
    s->interface = -1;
}

/* Opens the device and claims its interface; on an error problem has the reason, and it isn't open. */
static int try_device(usb_source *s, libusb_device *device, const struct libusb_device_descriptor *d,
                      char serial[64], char *problem, size_t size) {
    char place[64];
    usb_place(device, place, sizeof place);
    int error = libusb_open(device, &s->handle);
    if (error) {
        s->handle = NULL;
        return usb_translate(error, place, problem, size);
    }
    usb_serial(s->handle, d, serial, 64);
    if (s->wanted.by_serial && strcmp(serial, s->wanted.serial)) {
        *problem = 0;
        close_device(s);
        return FATHOM_ERROR_NO_DEVICE;
    }
    if (s->kind == USB_KINECT_MOTOR) return FATHOM_OK;
    if (!find_bulk(s, device)) {
        snprintf(problem, size, "%s has no interface with bulk endpoints", place);
        close_device(s);
        return FATHOM_ERROR_PROTOCOL;
    }
    libusb_set_auto_detach_kernel_driver(s->handle, 1);
    error = libusb_claim_interface(s->handle, s->interface);
    if (!error) return FATHOM_OK;
    s->interface = -1;
    close_device(s);
    return usb_translate(error, place, problem, size);
}

static int open_device(usb_source *s, libusb_device *device, const struct libusb_device_descriptor *d,
                       bool quiet) {
    const fathom_source_options *o = &s->base.base.options;
    char problem[256], serial[64] = "";
    const int result = try_device(s, device, d, serial, problem, sizeof problem);
    if (result) {
        if (*problem && !quiet) source_fail(o, result, "usb: %s", problem);
        return result;
    }
    /* From now on only this device is accepted, wherever it is plugged in again. */
    s->wanted.by_id = true;
    s->wanted.vendor = d->idVendor;
    s->wanted.product = d->idProduct;
    s->wanted.by_serial = *serial != 0;
    snprintf(s->wanted.serial, sizeof s->wanted.serial, "%s", serial);
    imu_source_describe(&s->base, usb_kind_name(s->kind), serial, s->kind == USB_KINECT_MOTOR);
    if (s->kind == USB_KINECT_MOTOR && !quiet)
        source_warn(o, "%s: no gyroscope, so it is of no use to a scan", usb_kind_name(s->kind));
    return FATHOM_OK;
}

static int find_and_open(imu_source *base, bool quiet) {
    usb_source *s = (usb_source *)base;
    const fathom_source_options *o = &base->base.options;
    libusb_device **list;
    /* A new context each time: without udev, a context never sees devices newer than itself. */
    int error = libusb_init(&s->context);
    if (error) {
        s->context = NULL;
        return quiet ? FATHOM_ERROR_UNSUPPORTED
                     : source_fail(o, FATHOM_ERROR_UNSUPPORTED, "usb: libusb doesn't start: %s",
                                   libusb_error_name(error));
    }
    s->interface = -1;
    const ssize_t count = libusb_get_device_list(s->context, &list);
    int result = FATHOM_ERROR_NO_DEVICE;
    bool said = false;
    for (ssize_t i = 0; i < count && result; i++) {
        struct libusb_device_descriptor d;
        if (libusb_get_device_descriptor(list[i], &d) || !usb_recognise(&d, &s->kind)) continue;
        if (s->wanted.by_id && (d.idVendor != s->wanted.vendor || d.idProduct != s->wanted.product)) continue;
        result = open_device(s, list[i], &d, quiet);
        said = result != FATHOM_ERROR_NO_DEVICE;
    }
    if (count >= 0) libusb_free_device_list(list, 1);
    if (result && !said && !quiet)
        source_fail(o, result, "usb:%s: no such device; 'fathom devices' lists what there is",
                    s->address.what);
    return result;
}

/* ---- MTi: commands ---- */

static int send_message(usb_source *s, uint8_t id, const uint8_t *data, size_t length) {
    uint8_t message[64];
    const size_t size = xbus_build(message, sizeof message, id, data, length);
    int sent = 0;
    const int error = libusb_bulk_transfer(s->handle, s->bulk_out, message, (int)size, &sent, USB_COMMAND_MS);
    return error ? error : sent == (int)size ? 0 : LIBUSB_ERROR_IO;
}

/* Requests the needed data at one rate; the device stores that permanently. */
static int configure(usb_source *s) {
    const double wanted = s->base.base.options.rate_hz > 0 ? s->base.base.options.rate_hz : 100;
    const uint16_t rate = (uint16_t)(wanted > 2000 ? 2000 : wanted);
    const uint8_t high = (uint8_t)(rate >> 8), low = (uint8_t)rate;
    const uint8_t outputs[] = {0x10, 0x20, 0xFF, 0xFF, 0x10, 0x60, 0xFF, 0xFF,
                               0x40, 0x20, high, low,  0x80, 0x20, high, low};
    const int error = send_message(s, XBUS_GO_TO_CONFIG, NULL, 0);
    return error ? error : send_message(s, XBUS_SET_OUTPUT_CONFIGURATION, outputs, sizeof outputs);
}

static int begin(imu_source *base) {
    usb_source *s = (usb_source *)base;
    const fathom_source_options *o = &base->base.options;
    s->gone = s->halted = s->stopping = false;
    s->errors = s->silent = 0;
    s->due_ns = 0;
    memset(&s->parser, 0, sizeof s->parser);
    memset(&s->data, 0, sizeof s->data);
    int result = usb_make_slots(s, s->kind == USB_MTI ? USB_TRANSFERS : 1);
    if (result || s->kind == USB_KINECT_MOTOR) return result;
    for (int i = 0; i < s->slot_count; i++) {
        usb_slot *slot = &s->slots[i];
        libusb_fill_bulk_transfer(slot->transfer, s->handle, s->bulk_in, slot->bytes, USB_TRANSFER_BYTES,
                                  usb_done, slot, 0);
        if (usb_submit(slot)) {
            usb_cancel_all(s);
            return source_fail(o, s->gone ? FATHOM_ERROR_UNPLUGGED : FATHOM_ERROR_PROTOCOL,
                               "%s: no transfers", base->name);
        }
    }
    int error = s->configure ? configure(s) : 0;
    if (!error) error = send_message(s, XBUS_GO_TO_MEASUREMENT, NULL, 0);
    if (!error) return FATHOM_OK;
    usb_cancel_all(s);
    return source_fail(o, error == LIBUSB_ERROR_NO_DEVICE ? FATHOM_ERROR_UNPLUGGED : FATHOM_ERROR_PROTOCOL,
                       "%s: doesn't take commands: %s", base->name, libusb_error_name(error));
}

/* ---- polling ---- */

/* Requests data of the motor device once per period; returns the milliseconds until the next action. */
static int ask_motor(usb_source *s) {
    usb_slot *slot = &s->slots[0];
    const int64_t now_ns = monotonic_now_ns();
    if (slot->pending) return IMU_SOURCE_SLICE_MS;
    if (now_ns >= s->due_ns) {
        const double rate =
            s->base.base.options.rate_hz > 0 ? s->base.base.options.rate_hz : KINECT_MOTOR_USUAL_HZ;
        s->due_ns =
            (s->due_ns && now_ns - s->due_ns < 100000000 ? s->due_ns : now_ns) + (int64_t)(1e9 / rate);
        libusb_fill_control_setup(slot->bytes, KINECT_MOTOR_REQUEST_TYPE, KINECT_MOTOR_REQUEST, 0, 0,
                                  KINECT_MOTOR_BYTES);
        libusb_fill_control_transfer(slot->transfer, s->handle, slot->bytes, usb_done, slot, USB_COMMAND_MS);
        if (usb_submit(slot) && ++s->errors >= USB_MOST_ERRORS) s->gone = true;
        return IMU_SOURCE_SLICE_MS;
    }
    const int64_t left_ms = (s->due_ns - now_ns) / 1000000;
    return left_ms < IMU_SOURCE_SLICE_MS ? (int)left_ms : IMU_SOURCE_SLICE_MS;
}

static void clear_halt(usb_source *s) {
    usb_cancel_all(s);
    s->stopping = s->halted = false;
    if (libusb_clear_halt(s->handle, s->bulk_in) == LIBUSB_ERROR_NO_DEVICE) s->gone = true;
    for (int i = 0; i < s->slot_count && !s->gone; i++) usb_submit(&s->slots[i]);
}

static int poll_device(imu_source *base) {
    usb_source *s = (usb_source *)base;
    if (s->halted && s->kind == USB_MTI) clear_halt(s);
    const int wait_ms = s->kind == USB_KINECT_MOTOR ? ask_motor(s) : IMU_SOURCE_SLICE_MS;
    struct timeval slice = {.tv_usec = 1000 * (wait_ms > 0 ? wait_ms : 1)};
    s->taken = 0;
    if (!s->gone) libusb_handle_events_timeout_completed(s->context, &slice, NULL);
    if (s->gone) return FATHOM_ERROR_UNPLUGGED;
    return s->taken ? FATHOM_OK : FATHOM_ERROR_TIMEOUT;
}

static void end(imu_source *base) {
    usb_cancel_all((usb_source *)base);
}

static void shut(imu_source *base) {
    usb_source *s = (usb_source *)base;
    if (s->context && s->handle) usb_cancel_all(s);
    for (int i = 0; i < USB_TRANSFERS; i++) { /* they reference the device, and so the context */
        libusb_free_transfer(s->slots[i].transfer);
        s->slots[i].transfer = NULL;
    }
    close_device(s);
    if (s->context) libusb_exit(s->context);
    s->context = NULL;
}

static const imu_device device = {
    .open = find_and_open, .begin = begin, .poll = poll_device, .end = end, .shut = shut};

/* ---- the driver ---- */

static int open_source(fathom_source **source, const char *address, const fathom_source_options *options) {
    source_address parsed;
    if (!address_parse(&parsed, address))
        return source_fail(options, FATHOM_ERROR_ARGUMENT, "usb:%s: settings are ?key=value&key=value",
                           address);
    const char *wish = address_setting(&parsed, "configure");
    if (address_unknown(&parsed) || (wish && strcmp(wish, "yes") && strcmp(wish, "no")))
        return source_fail(options, FATHOM_ERROR_ARGUMENT, "usb:%s: the one setting is configure=yes or no",
                           address);
    usb_source *s = (usb_source *)imu_source_make(sizeof *s, &device, options);
    if (!s) return FATHOM_ERROR_MEMORY;
    s->interface = -1;
    s->configure = wish && !strcmp(wish, "yes");
    s->address = parsed;
    if (!address_usb(&s->wanted, s->address.what)) {
        fathom_source_close(&s->base.base);
        return source_fail(
            options, FATHOM_ERROR_ARGUMENT,
            "usb:%s: should be usb:, usb:VENDOR:PRODUCT or usb:VENDOR:PRODUCT:SERIAL (hexadecimal)",
            parsed.what);
    }
    return imu_source_open(source, &s->base);
}

const source_driver usb_driver = {.name = "usb", .enumerate = usb_enumerate, .open = open_source};
