/* HID inertial sensors by hidapi (its hidraw flavour): devices of the table in hid_models.c, and any device of the HID
 * Sensor page. */
#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <hidapi.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <strings.h>
#include <unistd.h>

#include "address.h"
#include "imu/hid_models.h"
#include "imu/hid_nodes.h"
#include "imu/hid_sensor.h"
#include "imu/imu_source.h"
#include "monotonic.h"
#include "source_log.h"

#define SENSOR_HUB "/sys/bus/hid/drivers/hid-sensor-hub"
#define USUAL_INTERVAL_S 0.005 /* requested from HID sensors when options have no rate */
#define QUEUED_NS 200000       /* a read that returns sooner may have found a waiting report */

/* hidapi's first use, opening and closing aren't safe on two threads. */
static pthread_mutex_t hidapi_lock = PTHREAD_MUTEX_INITIALIZER;

/* What a device is to us. */
typedef struct {
    const hid_model *model; /* NULL: a HID sensor, or nothing */
    bool is_sensor;
    hid_sensor sensor;
    hid_descriptor descriptor;
} hid_kind;

typedef struct {
    imu_source base;
    source_address address;
    usb_choice wanted;
    char path[64];
    hid_device *handle;
    hid_kind kind;
    hid_fixed fixed;
} hid_source;

/* ---- what there is ---- */

static bool recognise(const hid_node *node, hid_kind *kind) {
    kind->model = hid_model_find(node->vendor, node->product, node->bus);
    kind->is_sensor = false;
    if (kind->model) return true;
    if (!hid_node_descriptor(node, &kind->descriptor)) return false;
    kind->is_sensor = hid_sensor_find(&kind->sensor, &kind->descriptor);
    hid_sensor_known_signs(&kind->sensor, node->vendor, node->product);
    return kind->is_sensor;
}

static void name_of(const hid_node *node, const hid_kind *kind, char *out, size_t size) {
    if (kind->model)
        snprintf(out, size, "%s%s", kind->model->name,
                 kind->model->bus == HID_BUS_BLUETOOTH ? " (Bluetooth)" : "");
    else
        snprintf(out, size, "%s", *node->name ? node->name : "HID sensor");
}

/* The error code and text for a path that can't be opened. */
static int try_access(const char *path, char *problem, size_t size) {
    const int file = open(path, O_RDWR | O_CLOEXEC | O_NONBLOCK);
    if (file >= 0) {
        close(file);
        return FATHOM_OK;
    }
    switch (errno) {
    case EACCES:
    case EPERM:
        snprintf(problem, size, "no permission for %s: %s", path, IMU_UDEV_FIX);
        return FATHOM_ERROR_PERMISSION;
    case EBUSY: snprintf(problem, size, "another program holds %s: close it", path); return FATHOM_ERROR_BUSY;
    default: snprintf(problem, size, "%s: %s", path, strerror(errno)); return FATHOM_ERROR_NO_DEVICE;
    }
}

static int tell(const hid_node *node, const hid_kind *kind, fathom_source_found found, void *user) {
    fathom_source_info info = {.struct_size = sizeof info, .driver = "hid", .kinds = FATHOM_SOURCE_IMU};
    name_of(node, kind, info.name, sizeof info.name);
    snprintf(info.serial, sizeof info.serial, "%s", node->serial);
    if (*info.serial)
        snprintf(info.uri, sizeof info.uri, "hid:%04x:%04x:%s", node->vendor, node->product, info.serial);
    else
        snprintf(info.uri, sizeof info.uri, "hid:%.31s", node->path);
    info.error = try_access(node->path, info.problem, sizeof info.problem);
    return found(user, &info);
}

/* Sensors claimed by the kernel's hub have no hidraw node. */
static int tell_hub(fathom_source_found found, void *user, int *devices) {
    DIR *folder = opendir(SENSOR_HUB);
    int stopped = 0;
    for (struct dirent *entry; folder && !stopped && (entry = readdir(folder));) {
        unsigned bus, vendor, product, number;
        if (sscanf(entry->d_name, "%x:%x:%x.%x", &bus, &vendor, &product, &number) != 4) continue;
        char node[300];
        snprintf(node, sizeof node, SENSOR_HUB "/%s/hidraw", entry->d_name);
        if (access(node, F_OK) == 0) continue;
        fathom_source_info info = {.struct_size = sizeof info,
                                   .driver = "hid",
                                   .kinds = FATHOM_SOURCE_IMU,
                                   .error = FATHOM_ERROR_BUSY};
        snprintf(info.uri, sizeof info.uri, "hid:%04x:%04x", vendor, product);
        snprintf(info.name, sizeof info.name, "HID sensor %04x:%04x", vendor, product);
        snprintf(
            info.problem, sizeof info.problem,
            "the kernel's hid-sensor-hub has it: use the iio driver, or, as root: echo %.40s > " SENSOR_HUB
            "/unbind",
            entry->d_name);
        ++*devices;
        stopped = found(user, &info);
    }
    if (folder) closedir(folder);
    return stopped;
}

static int hid_enumerate_sources(fathom_source_found found, void *user, fathom_log log, void *log_user) {
    hid_node nodes[HID_NODES];
    hid_kind *kind = malloc(sizeof *kind);
    if (!kind) {
        source_say(log, log_user, FATHOM_LOG_ERROR, "hid: no memory");
        return FATHOM_ERROR_MEMORY;
    }
    int devices = 0, stopped = 0;
    const int count = hid_nodes_list(nodes);
    for (int i = 0; i < count && !stopped; i++) {
        if (!recognise(&nodes[i], kind)) continue;
        devices++;
        stopped = tell(&nodes[i], kind, found, user);
    }
    free(kind);
    if (!stopped) stopped = tell_hub(found, user, &devices);
    if (!stopped && !devices)
        stopped = imu_source_sees_none("hid", "HID inertial sensors",
                                       access("/sys/class/hidraw", F_OK) ? "the kernel has no hidraw"
                                       : count ? "no inertial sensor among the HID devices"
                                               : "no HID device",
                                       found, user);
    return stopped ? FATHOM_ERROR_STOPPED : devices;
}

/* ---- opening ---- */

static bool is_wanted(const hid_source *s, const hid_node *node) {
    if (*s->path && strcmp(node->path, s->path) != 0) return false;
    if (s->wanted.by_id && (node->vendor != s->wanted.vendor || node->product != s->wanted.product))
        return false;
    return !s->wanted.by_serial || !strcasecmp(node->serial, s->wanted.serial);
}

static bool apply_signs(hid_source *s) {
    const char *accel = address_setting(&s->address, "accel"), *gyro = address_setting(&s->address, "gyro");
    hid_sensor *sensor = &s->kind.sensor;
    if (accel) {
        if (strcmp(accel, "gravity") && strcmp(accel, "force")) return false;
        sensor->gravity_signed = !strcmp(accel, "gravity");
    }
    if (gyro) {
        if (strcmp(gyro, "left") && strcmp(gyro, "right")) return false;
        sensor->left_handed = !strcmp(gyro, "left");
    }
    return true;
}

/* Sets up the interpretation of an open device's samples. */
static void prepare(hid_source *s, const hid_node *node, bool quiet) {
    const fathom_source_options *o = &s->base.base.options;
    char name[96];
    name_of(node, &s->kind, name, sizeof name);
    bool accel_only = false;
    if (s->kind.model) {
        const hid_model *model = s->kind.model;
        uint8_t report[128] = {model->calibration_id};
        int length = 0;
        /* A virtual or a slow device may refuse at first; over Bluetooth asking also switches the reports to the long
         * kind. */
        for (int attempt = 0; model->calibration_id && attempt < 3 && length <= 0; attempt++) {
            memset(report, 0, sizeof report);
            report[0] = model->calibration_id;
            length = hid_get_feature_report(s->handle, report, model->calibration_length);
        }
        hid_fixed_init(&s->fixed, model, report, length > 0 ? (size_t)length : 0);
        if (model->calibrate && !s->fixed.factory_calibrated && !quiet)
            source_warn(
                o,
                "%s: no sensible factory calibration (feature report 0x%02x): nominal scales are used, "
                "which may be 5 %% off",
                name, model->calibration_id);
    } else {
        accel_only = !s->kind.sensor.has_gyro;
        if (s->kind.sensor.odd_unit && !quiet)
            source_warn(o, "%s: unit 0x%x isn't known; G and degrees a second are assumed", name,
                        s->kind.sensor.odd_unit);
    }
    if (accel_only && !quiet) source_warn(o, "%s has an accelerometer only: no use to a scan", name);
    imu_source_describe(&s->base, name, node->serial, accel_only);
}

static int open_node(hid_source *s, const hid_node *node, bool quiet) {
    const fathom_source_options *o = &s->base.base.options;
    char problem[256] = "";
    const int error = try_access(node->path, problem, sizeof problem);
    if (error) return quiet ? error : source_fail(o, error, "hid: %s", problem);
    pthread_mutex_lock(&hidapi_lock);
    s->handle = hid_init() ? NULL : hid_open_path(node->path);
    pthread_mutex_unlock(&hidapi_lock);
    if (!s->handle)
        return quiet ? FATHOM_ERROR_NO_DEVICE
                     : source_fail(o, FATHOM_ERROR_NO_DEVICE, "hid: %s can't be opened", node->path);
    prepare(s, node, quiet);
    /* From now on only this device is accepted, wherever it is plugged in again. */
    s->path[0] = 0;
    s->wanted.by_id = true;
    s->wanted.vendor = node->vendor;
    s->wanted.product = node->product;
    snprintf(s->wanted.serial, sizeof s->wanted.serial, "%s", node->serial);
    s->wanted.by_serial = s->wanted.serial[0] != 0;
    return FATHOM_OK;
}

static int find_and_open(imu_source *base, bool quiet) {
    hid_source *s = (hid_source *)base;
    hid_node nodes[HID_NODES];
    const int count = hid_nodes_list(nodes);
    int result = FATHOM_ERROR_NO_DEVICE;
    bool seen = false, known = false;
    for (int i = 0; i < count && !s->handle; i++) {
        if (!is_wanted(s, &nodes[i])) continue;
        seen = true;
        if (!recognise(&nodes[i], &s->kind)) continue;
        known = true;
        if (!apply_signs(s)) {
            result = source_fail(&base->base.options, FATHOM_ERROR_ARGUMENT,
                                 "hid: settings are accel=gravity or force, gyro=right or left");
            break;
        }
        result = open_node(s, &nodes[i], quiet);
    }
    if (!known && !quiet && seen)
        source_fail(&base->base.options, result,
                    "hid:%s is there, but isn't an inertial sensor that is known", s->address.what);
    else if (!known && !quiet)
        source_fail(&base->base.options, result,
                    "hid:%s: no such device; 'fathom devices' lists what there is", s->address.what);
    return result;
}

static void shut(imu_source *base) {
    hid_source *s = (hid_source *)base;
    if (s->handle) hid_close(s->handle);
    s->handle = NULL;
}

/* ---- streaming ---- */

static void prepare_sensor(hid_source *s, uint32_t usage) {
    const double rate = s->base.base.options.rate_hz;
    const hid_descriptor *d = &s->kind.descriptor;
    for (int id = 0; id < 256; id++) {
        uint8_t report[512] = {(uint8_t)id};
        const size_t length = hid_report_length(d, HID_FEATURE, (uint8_t)id);
        const size_t room = length + (d->numbered ? 0 : 1); /* hidapi has the number always, 0 for none */
        if (!length || room > sizeof report) continue;
        uint8_t *content = d->numbered ? report : report + 1;
        if (hid_get_feature_report(s->handle, report, room) < 0) continue;
        report[0] = (uint8_t)id;
        if (hid_sensor_prepare(d, usage, (uint8_t)id, rate > 0 ? 1 / rate : USUAL_INTERVAL_S, content,
                               length) > 0 &&
            hid_send_feature_report(s->handle, report, room) < 0)
            source_warn(&s->base.base.options, "%s: doesn't take its settings (feature report %d)",
                        s->base.name, id);
    }
}

static int begin(imu_source *base) {
    hid_source *s = (hid_source *)base;
    if (s->kind.is_sensor) {
        if (s->kind.sensor.has_accel) prepare_sensor(s, HID_SENSOR_ACCELEROMETER_3D);
        if (s->kind.sensor.has_gyro) prepare_sensor(s, HID_SENSOR_GYROMETER_3D);
        return FATHOM_OK;
    }
    for (const hid_command *c = s->kind.model->commands; c && c->length; c++)
        if (hid_write(s->handle, c->bytes, c->length) < 0)
            return source_fail(&base->base.options, FATHOM_ERROR_PROTOCOL, "%s: doesn't take commands",
                               base->name);
    return FATHOM_OK;
}

/* Passes a report's readings on; false: it is invalid. */
static bool take(hid_source *s, const uint8_t *report, size_t length, int64_t known_ns, int64_t arrival_ns) {
    imu_reading reading;
    if (s->kind.is_sensor) {
        const hid_sensor_result r = hid_sensor_read(&s->kind.sensor, report, length, known_ns, &reading);
        if (r == HID_SENSOR_READING) imu_stream_take(&s->base.stream, &reading, arrival_ns);
        return r != HID_SENSOR_MALFORMED;
    }
    const hid_fixed_result r = hid_fixed_read(&s->fixed, report, length, known_ns, &reading);
    if (r == HID_FIXED_READING) imu_stream_take(&s->base.stream, &reading, arrival_ns);
    return r != HID_FIXED_MALFORMED;
}

static int poll_device(imu_source *base) {
    hid_source *s = (hid_source *)base;
    uint8_t report[4096];
    const int64_t asked_ns = monotonic_now_ns();
    const int length = hid_read_timeout(s->handle, report, sizeof report, IMU_SOURCE_SLICE_MS);
    const int64_t arrival_ns = monotonic_now_ns();
    if (length < 0) return FATHOM_ERROR_UNPLUGGED;
    if (length == 0) return FATHOM_ERROR_TIMEOUT;
    const bool waited = arrival_ns - asked_ns > QUEUED_NS;
    if (!take(s, report, (size_t)length, waited ? arrival_ns : 0, arrival_ns))
        source_queue_count_malformed(&base->queue, 1);
    return FATHOM_OK;
}

/* ---- the driver ---- */

static const imu_device device = {.open = find_and_open, .begin = begin, .poll = poll_device, .shut = shut};

/* A path, or an address for address_usb. */
static bool parse_what(hid_source *s) {
    const char *what = s->address.what;
    if (*what != '/') return address_usb(&s->wanted, what);
    const size_t size = strlen(what) + 1;
    if (size > sizeof s->path) return false;
    memcpy(s->path, what, size);
    return true;
}

static int open_source(fathom_source **source, const char *address, const fathom_source_options *options) {
    source_address parsed;
    if (!address_parse(&parsed, address))
        return source_fail(options, FATHOM_ERROR_ARGUMENT, "hid:%s: settings are ?key=value&key=value",
                           address);
    address_setting(&parsed, "accel");
    address_setting(&parsed, "gyro");
    if (address_unknown(&parsed))
        return source_fail(options, FATHOM_ERROR_ARGUMENT,
                           "hid: no setting is called '%s'; there are: accel, gyro",
                           address_unknown(&parsed));
    hid_source *s = (hid_source *)imu_source_make(sizeof *s, &device, options);
    if (!s) return FATHOM_ERROR_MEMORY;
    s->address = parsed;
    if (!parse_what(s)) {
        fathom_source_close(&s->base.base);
        return source_fail(
            options, FATHOM_ERROR_ARGUMENT,
            "hid:%s: should be hid:, hid:VENDOR:PRODUCT, hid:VENDOR:PRODUCT:SERIAL (hexadecimal) or "
            "hid:/dev/hidraw0",
            parsed.what);
    }
    return imu_source_open(source, &s->base);
}

const source_driver hid_driver = {.name = "hid", .enumerate = hid_enumerate_sources, .open = open_source};
