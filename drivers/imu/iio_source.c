/* Inertial sensors that the kernel drives itself (I2C, SPI, HID sensors behind hid-sensor-hub), by IIO through libiio:
 * buffered capture with the kernel's time stamps. A gyroscope and an accelerometer may be one device or two. */
#include <errno.h>
#include <fcntl.h>
#include <iio.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "address.h"
#include "imu/iio_channels.h"
#include "imu/imu_source.h"
#include "monotonic.h"
#include "source_log.h"

#define BUFFER_SAMPLES 128 /* that the kernel keeps */
#define USUAL_HZ 200

typedef enum { GYRO = 0, ACCEL = 1 } sensor_kind;
static const char *const prefixes[2] = {"anglvel", "accel"};

/* Three channels of a device. */
typedef struct {
    bool there, inverted;
    struct iio_channel *axis[3];
    iio_format format[3];
    double scale[3], offset[3], mount[9];
} iio_triple;

/* A device with a buffer of its own. */
typedef struct {
    struct iio_device *device;
    struct iio_buffer *buffer;
    struct iio_channel *time;
    iio_format time_format;
    bool monotonic; /* its stamps are CLOCK_MONOTONIC's */
    iio_triple triple[2];
} iio_part;

typedef struct {
    imu_source base;
    source_address address;
    struct iio_context *context;
    iio_part parts[2];
    int part_count;
} iio_source;

/* ---- what there is ---- */

static struct iio_channel *channel_of(const struct iio_device *device, const char *prefix, int axis) {
    char id[32];
    snprintf(id, sizeof id, "%s_%c", prefix, 'x' + axis);
    return iio_device_find_channel(device, id, false);
}

static bool has(const struct iio_device *device, sensor_kind kind) {
    for (int i = 0; i < 3; i++) {
        struct iio_channel *channel = channel_of(device, prefixes[kind], i);
        if (!channel || !iio_channel_is_scan_element(channel)) return false;
    }
    return true;
}

static const char *label(const struct iio_device *device) {
    const char *name = iio_device_get_name(device);
    return name ? name : iio_device_get_id(device);
}

static int try_access(const struct iio_device *device, char *problem, size_t size) {
    char path[64];
    snprintf(path, sizeof path, "/dev/%.40s", iio_device_get_id(device));
    *problem = 0;
    if (access(path, R_OK | W_OK) == 0) return FATHOM_OK;
    if (errno == EACCES) {
        snprintf(problem, size, "no permission for %s: %s", path, IMU_UDEV_FIX);
        return FATHOM_ERROR_PERMISSION;
    }
    snprintf(problem, size, "%s: %s: the kernel gives this sensor no buffer", path, strerror(errno));
    return FATHOM_ERROR_UNSUPPORTED;
}

static int iio_enumerate(fathom_source_found found, void *user, fathom_log log, void *log_user) {
    (void)log;
    (void)log_user;
    struct iio_context *context = iio_create_local_context();
    int devices = 0, stopped = 0;
    for (unsigned i = 0; context && i < iio_context_get_devices_count(context) && !stopped; i++) {
        const struct iio_device *device = iio_context_get_device(context, i);
        const bool gyro = has(device, GYRO), accel = has(device, ACCEL);
        if (!gyro && !accel) continue;
        fathom_source_info info = {.struct_size = sizeof info, .driver = "iio", .kinds = FATHOM_SOURCE_IMU};
        snprintf(info.uri, sizeof info.uri, "iio:%s", iio_device_get_id(device));
        snprintf(info.name, sizeof info.name, "%.60s: %s", label(device),
                 gyro && accel ? "gyroscope and accelerometer"
                 : gyro        ? "gyroscope"
                               : "accelerometer");
        info.error = try_access(device, info.problem, sizeof info.problem);
        devices++;
        stopped = found(user, &info);
    }
    if (context) iio_context_destroy(context);
    if (!stopped && !devices)
        stopped = imu_source_sees_none("iio", "inertial sensors wired to the board",
                                       "the kernel drives no gyroscope or accelerometer with a buffer", found,
                                       user);
    return stopped ? FATHOM_ERROR_STOPPED : devices;
}

/* ---- opening ---- */

static bool read_number(const struct iio_channel *channel, const char *attribute, double *value) {
    return iio_channel_attr_read_double(channel, attribute, value) == 0;
}

static bool format_of(const struct iio_channel *channel, iio_format *format) {
    const struct iio_data_format *f = iio_channel_get_data_format(channel);
    char text[32];
    if (f->repeat > 1) return false;
    snprintf(text, sizeof text, "%s:%c%u/%u>>%u", f->is_be ? "be" : "le", f->is_signed ? 's' : 'u', f->bits,
             f->length, f->shift);
    return iio_format_parse(text, format);
}

static bool fill_triple(iio_part *part, sensor_kind kind) {
    iio_triple *t = &part->triple[kind];
    char text[256] = "";
    for (int i = 0; i < 3; i++) {
        t->axis[i] = channel_of(part->device, prefixes[kind], i);
        t->scale[i] = 1;
        t->offset[i] = 0;
        if (!format_of(t->axis[i], &t->format[i])) return false;
        read_number(t->axis[i], "scale", &t->scale[i]);
        read_number(t->axis[i], "offset", &t->offset[i]);
    }
    if (iio_channel_attr_read(t->axis[0], "mount_matrix", text, sizeof text) <= 0)
        iio_device_attr_read(part->device, "in_mount_matrix", text, sizeof text);
    iio_mount_matrix_parse(text, t->mount);
    /* hid-sensor-accel-3d passes on the HID sensor's values, which are signed like gravity. */
    t->inverted = kind == ACCEL && !strcmp(label(part->device), "accel_3d");
    return t->there = true;
}

static bool apply_settings(iio_source *s) {
    const char *accel = address_setting(&s->address, "accel"), *gyro = address_setting(&s->address, "gyro");
    if (accel && strcmp(accel, "gravity") && strcmp(accel, "force")) return false;
    if (gyro && strcmp(gyro, "left") && strcmp(gyro, "right")) return false;
    for (int i = 0; i < s->part_count; i++) {
        if (accel) s->parts[i].triple[ACCEL].inverted = !strcmp(accel, "gravity");
        if (gyro) s->parts[i].triple[GYRO].inverted = !strcmp(gyro, "left");
    }
    return !address_unknown(&s->address);
}

static bool is_named(const struct iio_device *device, const char *name, size_t length) {
    const char *names[2] = {iio_device_get_id(device), label(device)};
    for (int i = 0; i < 2; i++)
        if (strlen(names[i]) == length && !strncmp(names[i], name, length)) return true;
    return false;
}

/* The first device of a kind, among those that are named (what: "", or names with a + between). */
static struct iio_device *find(const iio_source *s, sensor_kind kind) {
    for (unsigned i = 0; i < iio_context_get_devices_count(s->context); i++) {
        struct iio_device *device = iio_context_get_device(s->context, i);
        if (!has(device, kind)) continue;
        const char *name = s->address.what;
        if (!*name) return device;
        while (*name) {
            const size_t length = strcspn(name, "+");
            if (is_named(device, name, length)) return device;
            name += length + (name[length] == '+');
        }
    }
    return NULL;
}

static iio_part *part_of(iio_source *s, struct iio_device *device) {
    for (int i = 0; i < s->part_count; i++)
        if (s->parts[i].device == device) return &s->parts[i];
    s->parts[s->part_count] = (iio_part){.device = device};
    return &s->parts[s->part_count++];
}

static int open_devices(imu_source *base, bool quiet) {
    iio_source *s = (iio_source *)base;
    const fathom_source_options *o = &base->base.options;
    char problem[256], name[96] = "";
    s->part_count = 0;
    s->context = iio_create_local_context();
    struct iio_device *found[2] = {NULL, NULL};
    for (int kind = 0; kind < 2 && s->context; kind++) found[kind] = find(s, (sensor_kind)kind);
    /* One device with both is better than two. */
    if (found[GYRO] && has(found[GYRO], ACCEL)) found[ACCEL] = found[GYRO];
    if (!found[GYRO] && !found[ACCEL])
        return quiet ? FATHOM_ERROR_NO_DEVICE
                     : source_fail(o, FATHOM_ERROR_NO_DEVICE,
                                   "iio:%s: no such gyroscope or accelerometer with a buffer; "
                                   "'fathom devices' lists what there is",
                                   s->address.what);
    for (int kind = 0; kind < 2; kind++) {
        if (!found[kind]) continue;
        const int error = try_access(found[kind], problem, sizeof problem);
        if (error) return quiet ? error : source_fail(o, error, "iio: %s", problem);
        iio_part *part = part_of(s, found[kind]);
        if (!fill_triple(part, (sensor_kind)kind))
            return quiet ? FATHOM_ERROR_PROTOCOL
                         : source_fail(o, FATHOM_ERROR_PROTOCOL,
                                       "iio: %s stores its values in a way that isn't known",
                                       label(part->device));
        part->time = iio_device_find_channel(part->device, "timestamp", false);
        if (part->time && !format_of(part->time, &part->time_format)) part->time = NULL;
        snprintf(name + strlen(name), sizeof name - strlen(name), "%s%.40s", *name ? "+" : "",
                 label(part->device));
        if (kind == GYRO && found[ACCEL] == found[GYRO]) {
            fill_triple(part, ACCEL);
            break;
        }
    }
    if (!apply_settings(s))
        return source_fail(o, FATHOM_ERROR_ARGUMENT,
                           "iio: settings are accel=gravity or force, gyro=right or left");
    if (!found[GYRO] && !quiet) source_warn(o, "iio: %s has an accelerometer only: no use to a scan", name);
    imu_source_describe(base, name, "", !found[GYRO]);
    return FATHOM_OK;
}

/* ---- streaming ---- */

static void end(imu_source *base) {
    iio_source *s = (iio_source *)base;
    for (int i = 0; i < s->part_count; i++) {
        if (s->parts[i].buffer) iio_buffer_destroy(s->parts[i].buffer);
        s->parts[i].buffer = NULL;
    }
}

static void shut(imu_source *base) {
    iio_source *s = (iio_source *)base;
    end(base);
    if (s->context) iio_context_destroy(s->context);
    s->context = NULL;
    s->part_count = 0;
}

/* The rate belongs to the device, or to its channels. Drivers use their nearest one, or refuse. */
static void set_rate(iio_part *part, double rate) {
    if (iio_device_attr_write_double(part->device, "sampling_frequency", rate) >= 0) return;
    for (int kind = 0; kind < 2; kind++)
        if (part->triple[kind].there &&
            iio_channel_attr_write_double(part->triple[kind].axis[0], "sampling_frequency", rate) < 0) {
            /* it keeps its own */
        }
}

/* libiio has the kernel wake a reader only when the whole buffer is full. */
static void wake_at_each_sample(iio_part *part) {
    if (iio_device_buffer_attr_write(part->device, "enable", "0") < 0) return;
    if (iio_device_buffer_attr_write(part->device, "watermark", "1") < 0) {
        /* an old kernel: samples arrive late, but with correct stamps */
    }
    if (iio_device_buffer_attr_write(part->device, "enable", "1") < 0) {
        iio_buffer_destroy(part->buffer);
        part->buffer = NULL;
    }
}

static int begin_part(iio_source *s, iio_part *part) {
    const fathom_source_options *o = &s->base.base.options;
    const double rate = o->rate_hz > 0 ? o->rate_hz : USUAL_HZ;
    part->monotonic = iio_device_attr_write(part->device, "current_timestamp_clock", "monotonic") >= 0;
    set_rate(part, rate);
    for (int kind = 0; kind < 2; kind++)
        for (int i = 0; i < 3 && part->triple[kind].there; i++)
            iio_channel_enable(part->triple[kind].axis[i]);
    if (part->time) iio_channel_enable(part->time);
    part->buffer = iio_device_create_buffer(part->device, BUFFER_SAMPLES, false);
    if (part->buffer) wake_at_each_sample(part);
    if (part->buffer && !iio_buffer_set_blocking_mode(part->buffer, false)) return FATHOM_OK;
    const int error = errno == EBUSY                      ? FATHOM_ERROR_BUSY
                      : errno == EACCES || errno == EPERM ? FATHOM_ERROR_PERMISSION
                                                          : FATHOM_ERROR_UNSUPPORTED;
    return source_fail(o, error, "iio: %s gives no buffer: %s%s", label(part->device), strerror(errno),
                       error == FATHOM_ERROR_BUSY         ? ": another program reads it (iio-sensor-proxy?)"
                       : error == FATHOM_ERROR_PERMISSION ? ": " IMU_UDEV_FIX
                                                          : ": it may need a trigger");
}

static int begin(imu_source *base) {
    iio_source *s = (iio_source *)base;
    int result = FATHOM_OK;
    for (int i = 0; i < s->part_count && !result; i++) result = begin_part(s, &s->parts[i]);
    if (result) end(base);
    return result;
}

static void values_of(const iio_part *part, const iio_triple *t, ptrdiff_t at, double values[3]) {
    for (int i = 0; i < 3; i++) {
        const uint8_t *first = iio_buffer_first(part->buffer, t->axis[i]);
        values[i] = ((double)iio_value(&t->format[i], first + at) + t->offset[i]) * t->scale[i];
    }
    iio_mount(t->mount, values);
    for (int i = 0; i < 3 && t->inverted; i++) values[i] = -values[i];
}

static void take_scan(iio_source *s, const iio_part *part, ptrdiff_t at, int64_t arrival_ns) {
    imu_reading reading = {.samples = 1};
    reading.has_gyro = part->triple[GYRO].there;
    reading.has_accel = part->triple[ACCEL].there;
    if (reading.has_gyro) values_of(part, &part->triple[GYRO], at, reading.gyro[0]);
    if (reading.has_accel) values_of(part, &part->triple[ACCEL], at, reading.accel[0]);
    if (part->time) {
        const uint8_t *first = iio_buffer_first(part->buffer, part->time);
        const int64_t stamp_ns = iio_value(&part->time_format, first + at);
        if (part->monotonic && stamp_ns <= arrival_ns) { /* the host's clock already */
            arrival_ns = stamp_ns;
        } else {
            reading.device_ns[0] = stamp_ns;
            reading.times = 1;
        }
    }
    imu_stream_take(&s->base.stream, &reading, arrival_ns);
}

static int take_buffer(iio_source *s, iio_part *part) {
    const ssize_t bytes = iio_buffer_refill(part->buffer);
    const int64_t arrival_ns = monotonic_now_ns();
    if (bytes == -EAGAIN || bytes == -EINTR || bytes == -ETIMEDOUT) return FATHOM_ERROR_TIMEOUT;
    if (bytes < 0) return FATHOM_ERROR_UNPLUGGED;
    const ptrdiff_t step = iio_buffer_step(part->buffer);
    for (ptrdiff_t at = 0; step > 0 && at + step <= bytes; at += step) take_scan(s, part, at, arrival_ns);
    return FATHOM_OK;
}

/* The kernel doesn't wake those who poll a buffer whose device has gone. */
static bool are_there(const iio_source *s) {
    char path[64];
    for (int i = 0; i < s->part_count; i++) {
        snprintf(path, sizeof path, "/dev/%.40s", iio_device_get_id(s->parts[i].device));
        if (access(path, F_OK)) return false;
    }
    return true;
}

static int poll_buffers(imu_source *base) {
    iio_source *s = (iio_source *)base;
    struct pollfd waiting[2];
    for (int i = 0; i < s->part_count; i++)
        waiting[i] = (struct pollfd){.fd = iio_buffer_get_poll_fd(s->parts[i].buffer), .events = POLLIN};
    if (poll(waiting, (nfds_t)s->part_count, IMU_SOURCE_SLICE_MS) <= 0)
        return are_there(s) ? FATHOM_ERROR_TIMEOUT : FATHOM_ERROR_UNPLUGGED;
    for (int i = 0; i < s->part_count; i++) {
        if (!waiting[i].revents) continue;
        const int result = take_buffer(s, &s->parts[i]);
        if (result == FATHOM_ERROR_UNPLUGGED || (result && waiting[i].revents & (POLLHUP | POLLNVAL)))
            return FATHOM_ERROR_UNPLUGGED;
    }
    return FATHOM_OK;
}

/* ---- the driver ---- */

static const imu_device device = {
    .open = open_devices, .begin = begin, .poll = poll_buffers, .end = end, .shut = shut};

static int open_source(fathom_source **source, const char *address, const fathom_source_options *options) {
    source_address parsed;
    if (!address_parse(&parsed, address))
        return source_fail(options, FATHOM_ERROR_ARGUMENT, "iio:%s: settings are ?key=value&key=value",
                           address);
    iio_source *s = (iio_source *)imu_source_make(sizeof *s, &device, options);
    if (!s) return FATHOM_ERROR_MEMORY;
    s->address = parsed;
    return imu_source_open(source, &s->base);
}

const source_driver iio_driver = {.name = "iio", .enumerate = iio_enumerate, .open = open_source};
