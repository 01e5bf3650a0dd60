/* USB inertial sensors by libusb: the Kinect 360's accelerometer (control transfers to its motor device) and Xsens/Movella MTi
 * (bulk transfers). Transfers are asynchronous; the source's thread handles their events. */
#include <libusb.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "address.h"
#include "imu/imu_source.h"
#include "imu/kinect_motor.h"
#include "monotonic.h"
#include "imu/mtdata2.h"
#include "source_log.h"

#define XSENS 0x2639
#define TRANSFERS 8
#define TRANSFER_BYTES 4096
#define COMMAND_MS 500
#define MOST_ERRORS 8   /* failed transfers in a row after which the device counts as gone */
#define WARN_SILENT 200 /* messages without samples after which the log is told */

typedef enum { KINECT_MOTOR, MTI } usb_kind;

struct usb_source;

/* A transfer under way, or not. */
typedef struct {
    struct usb_source *source;
    struct libusb_transfer *transfer;
    bool pending;
    int64_t submitted_ns;
    uint8_t bytes[TRANSFER_BYTES];
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
    usb_slot slots[TRANSFERS];
    int slot_count;
    bool gone, halted, stopping;
    int errors, silent;
    int64_t due_ns; /* of the next control request */
    int64_t taken;  /* readings since the last poll */
    xbus_parser parser;
    mtdata2_state data;
} usb_source;

/* ---- what there is ---- */

static bool recognise(libusb_device *device, const struct libusb_device_descriptor *d, usb_kind *kind) {
    (void)device;
    if (d->idVendor == KINECT_VENDOR && d->idProduct == KINECT_MOTOR_PRODUCT) {
        *kind = KINECT_MOTOR;
        return true;
    }
    *kind = MTI;
    return d->idVendor == XSENS;
}

static void place_of(libusb_device *device, char *out, size_t size) {
    snprintf(out, size, "/dev/bus/usb/%03d/%03d", libusb_get_bus_number(device),
             libusb_get_device_address(device));
}

static const char *name_of(usb_kind kind) {
    return kind == KINECT_MOTOR ? "Microsoft Kinect 360 accelerometer" : "Xsens MTi";
}

/* libusb's errors in ours; problem says it in words. */
static int translate(int error, const char *place, char *problem, size_t size) {
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

static void serial_of(libusb_device_handle *handle, const struct libusb_device_descriptor *d, char *out,
                      int size) {
    *out = 0;
    if (!d->iSerialNumber ||
        libusb_get_string_descriptor_ascii(handle, d->iSerialNumber, (unsigned char *)out, size) < 0)
        *out = 0;
}

static int usb_enumerate(fathom_source_found found, void *user, fathom_log log, void *log_user) {
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
        if (libusb_get_device_descriptor(list[i], &d) || !recognise(list[i], &d, &kind)) continue;
        fathom_source_info info = {.driver = "usb", .kinds = FATHOM_SOURCE_IMU};
        libusb_device_handle *handle;
        snprintf(info.name, sizeof info.name, "%s", name_of(kind));
        place_of(list[i], place, sizeof place);
        const int opened = libusb_open(list[i], &handle);
        info.error = translate(opened, place, info.problem, sizeof info.problem);
        if (!opened) {
            serial_of(handle, &d, info.serial, sizeof info.serial);
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

static int open_device(usb_source *s, libusb_device *device, const struct libusb_device_descriptor *d,
                       bool quiet) {
    const fathom_source_options *o = &s->base.base.options;
    char place[64], problem[256], serial[64];
    place_of(device, place, sizeof place);
    int error = libusb_open(device, &s->handle);
    if (error) s->handle = NULL;
    if (!error) serial_of(s->handle, d, serial, sizeof serial);
    if (!error && s->wanted.by_serial && strcmp(serial, s->wanted.serial)) {
        libusb_close(s->handle);
        s->handle = NULL;
        return FATHOM_ERROR_NO_DEVICE;
    }
    if (!error && s->kind == MTI) {
        if (!find_bulk(s, device))
            return quiet ? FATHOM_ERROR_PROTOCOL
                         : source_fail(o, FATHOM_ERROR_PROTOCOL,
                                       "usb: %s has no interface with bulk endpoints", place);
        libusb_set_auto_detach_kernel_driver(s->handle, 1);
        error = libusb_claim_interface(s->handle, s->interface);
        if (error) s->interface = -1;
    }
    const int result = translate(error, place, problem, sizeof problem);
    if (result) return quiet ? result : source_fail(o, result, "usb: %s", problem);
    /* From now on it is this one, wherever it is plugged in again. */
    s->wanted.by_id = true;
    s->wanted.vendor = d->idVendor;
    s->wanted.product = d->idProduct;
    s->wanted.by_serial = *serial != 0;
    snprintf(s->wanted.serial, sizeof s->wanted.serial, "%s", serial);
    imu_source_describe(&s->base, name_of(s->kind), serial, s->kind == KINECT_MOTOR);
    if (s->kind == KINECT_MOTOR && !quiet)
        source_warn(o, "%s: no gyroscope, so it is of no use to a scan", name_of(s->kind));
    return FATHOM_OK;
}

static int find_and_open(imu_source *base, bool quiet) {
    usb_source *s = (usb_source *)base;
    const fathom_source_options *o = &base->base.options;
    libusb_device **list;
    /* A context of its own each time: without udev, one that is older than a device never sees it. */
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
        if (libusb_get_device_descriptor(list[i], &d) || !recognise(list[i], &d, &s->kind)) continue;
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

/* ---- transfers; the callbacks run in the source's thread, within libusb_handle_events ---- */

static int submit(usb_slot *slot) {
    slot->submitted_ns = monotonic_now_ns();
    const int error = libusb_submit_transfer(slot->transfer);
    slot->pending = error == 0;
    if (error == LIBUSB_ERROR_NO_DEVICE) slot->source->gone = true;
    return error;
}

static void take_bulk(usb_source *s, const uint8_t *bytes, size_t length) {
    const int64_t arrival_ns = monotonic_now_ns();
    const int64_t broken = s->parser.broken;
    for (size_t taken = 0;;) {
        xbus_message message;
        bool whole;
        taken += xbus_take(&s->parser, bytes + taken, length - taken, &message, &whole);
        if (!whole) break;
        if (message.id == XBUS_ERROR)
            source_warn(&s->base.base.options, "%s: reports error %d", s->base.name,
                        message.length ? message.data[0] : -1);
        if (message.id != XBUS_MTDATA2) continue;
        imu_reading reading;
        const mtdata2_result r = mtdata2_read(&s->data, message.data, message.length, arrival_ns, &reading);
        if (r == MTDATA2_READING) {
            imu_stream_take(&s->base.stream, &reading, arrival_ns);
            s->taken++;
        } else if (r == MTDATA2_MALFORMED) {
            source_queue_count_malformed(&s->base.queue, 1);
        }
        s->silent = r == MTDATA2_OTHER ? s->silent + 1 : 0;
        if (s->silent == WARN_SILENT)
            source_warn(&s->base.base.options,
                        "%s: sends no rate of turn or acceleration: set its output so, or open it with "
                        "?configure=yes",
                        s->base.name);
    }
    if (s->parser.broken > broken) source_queue_count_malformed(&s->base.queue, s->parser.broken - broken);
}

static void take_control(usb_source *s, const usb_slot *slot) {
    imu_reading reading;
    const int64_t now_ns = monotonic_now_ns();
    if (!kinect_motor_read(libusb_control_transfer_get_data(slot->transfer),
                           (size_t)slot->transfer->actual_length, &reading)) {
        source_queue_count_malformed(&s->base.queue, 1);
        return;
    }
    imu_stream_take(&s->base.stream, &reading, slot->submitted_ns + (now_ns - slot->submitted_ns) / 2);
    s->taken++;
}

static void LIBUSB_CALL done(struct libusb_transfer *transfer) {
    usb_slot *slot = transfer->user_data;
    usb_source *s = slot->source;
    slot->pending = false;
    switch (transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED:
        s->errors = 0;
        if (s->stopping) break;
        if (s->kind == MTI)
            take_bulk(s, transfer->buffer, (size_t)transfer->actual_length);
        else
            take_control(s, slot);
        break;
    case LIBUSB_TRANSFER_NO_DEVICE: s->gone = true; break;
    case LIBUSB_TRANSFER_STALL: s->halted = true;                                   /* fall through */
    case LIBUSB_TRANSFER_OVERFLOW: source_queue_count_malformed(&s->base.queue, 1); /* fall through */
    case LIBUSB_TRANSFER_ERROR: /* some host controllers say so when a device goes */
        if (++s->errors >= MOST_ERRORS) s->gone = true;
        break;
    case LIBUSB_TRANSFER_TIMED_OUT:
    case LIBUSB_TRANSFER_CANCELLED: break;
    }
    if (s->kind == MTI && !s->stopping && !s->gone && !s->halted) submit(slot);
}

static int make_slots(usb_source *s, int count) {
    for (s->slot_count = 0; s->slot_count < count; s->slot_count++) {
        usb_slot *slot = &s->slots[s->slot_count];
        slot->source = s;
        slot->pending = false;
        if (!slot->transfer) slot->transfer = libusb_alloc_transfer(0);
        if (!slot->transfer)
            return source_fail(&s->base.base.options, FATHOM_ERROR_MEMORY, "usb: no memory for transfers");
    }
    return FATHOM_OK;
}

static bool any_pending(const usb_source *s) {
    for (int i = 0; i < s->slot_count; i++)
        if (s->slots[i].pending) return true;
    return false;
}

/* Every transfer has to come back before its memory may go. */
static void cancel_all(usb_source *s) {
    struct timeval slice = {.tv_usec = 10000};
    s->stopping = true;
    for (int i = 0; i < s->slot_count; i++)
        if (s->slots[i].pending) libusb_cancel_transfer(s->slots[i].transfer);
    while (any_pending(s)) {
        const int error = libusb_handle_events_timeout_completed(s->context, &slice, NULL);
        if (error && error != LIBUSB_ERROR_INTERRUPTED) break;
    }
}

/* ---- MTi: commands ---- */

static int send_message(usb_source *s, uint8_t id, const uint8_t *data, size_t length) {
    uint8_t message[64];
    const size_t size = xbus_build(message, sizeof message, id, data, length);
    int sent = 0;
    const int error = libusb_bulk_transfer(s->handle, s->bulk_out, message, (int)size, &sent, COMMAND_MS);
    return error ? error : sent == (int)size ? 0 : LIBUSB_ERROR_IO;
}

/* Asks for what is needed at one rate; the device keeps that for good. */
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
    int result = make_slots(s, s->kind == MTI ? TRANSFERS : 1);
    if (result || s->kind == KINECT_MOTOR) return result;
    for (int i = 0; i < s->slot_count; i++) {
        usb_slot *slot = &s->slots[i];
        libusb_fill_bulk_transfer(slot->transfer, s->handle, s->bulk_in, slot->bytes, TRANSFER_BYTES, done,
                                  slot, 0);
        if (submit(slot)) {
            cancel_all(s);
            return source_fail(o, s->gone ? FATHOM_ERROR_UNPLUGGED : FATHOM_ERROR_PROTOCOL,
                               "%s: no transfers", base->name);
        }
    }
    int error = s->configure ? configure(s) : 0;
    if (!error) error = send_message(s, XBUS_GO_TO_MEASUREMENT, NULL, 0);
    if (!error) return FATHOM_OK;
    cancel_all(s);
    return source_fail(o, error == LIBUSB_ERROR_NO_DEVICE ? FATHOM_ERROR_UNPLUGGED : FATHOM_ERROR_PROTOCOL,
                       "%s: doesn't take commands: %s", base->name, libusb_error_name(error));
}

/* ---- polling ---- */

/* Asks the motor device once a period; returns the milliseconds until something is to be done. */
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
        libusb_fill_control_transfer(slot->transfer, s->handle, slot->bytes, done, slot, COMMAND_MS);
        if (submit(slot) && ++s->errors >= MOST_ERRORS) s->gone = true;
        return IMU_SOURCE_SLICE_MS;
    }
    const int64_t left_ms = (s->due_ns - now_ns) / 1000000;
    return left_ms < IMU_SOURCE_SLICE_MS ? (int)left_ms : IMU_SOURCE_SLICE_MS;
}

static void clear_halt(usb_source *s) {
    cancel_all(s);
    s->stopping = s->halted = false;
    if (libusb_clear_halt(s->handle, s->bulk_in) == LIBUSB_ERROR_NO_DEVICE) s->gone = true;
    for (int i = 0; i < s->slot_count && !s->gone; i++) submit(&s->slots[i]);
}

static int poll_device(imu_source *base) {
    usb_source *s = (usb_source *)base;
    if (s->halted && s->kind == MTI) clear_halt(s);
    const int wait_ms = s->kind == KINECT_MOTOR ? ask_motor(s) : IMU_SOURCE_SLICE_MS;
    struct timeval slice = {.tv_usec = 1000 * (wait_ms > 0 ? wait_ms : 1)};
    s->taken = 0;
    if (!s->gone) libusb_handle_events_timeout_completed(s->context, &slice, NULL);
    if (s->gone) return FATHOM_ERROR_UNPLUGGED;
    return s->taken ? FATHOM_OK : FATHOM_ERROR_TIMEOUT;
}

static void end(imu_source *base) {
    cancel_all((usb_source *)base);
}

static void shut(imu_source *base) {
    usb_source *s = (usb_source *)base;
    if (s->context && s->handle) cancel_all(s);
    for (int i = 0; i < TRANSFERS; i++) { /* they hold on to the device, and so to the context */
        libusb_free_transfer(s->slots[i].transfer);
        s->slots[i].transfer = NULL;
    }
    if (s->handle && s->interface >= 0) libusb_release_interface(s->handle, s->interface);
    if (s->handle) libusb_close(s->handle);
    if (s->context) libusb_exit(s->context);
    s->handle = NULL;
    s->context = NULL;
    s->interface = -1;
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
