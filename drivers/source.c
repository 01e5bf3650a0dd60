/* Sources: the table of drivers, and their common parts. */
#include "source.h"

#include <math.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "caller_config.h"
#include "source_log.h"

/* ---- the table ---- */

/* FATHOM_WITH_...: the Makefile's switches of the same names. */
#if FATHOM_WITH_OPENNI2
#define OPENNI2 &openni2_driver
#else
#define OPENNI2 NULL
#endif
#if FATHOM_WITH_HIDAPI
#define HID &hid_driver
#else
#define HID NULL
#endif
#if FATHOM_WITH_LIBUSB
#define USB &usb_driver
#else
#define USB NULL
#endif
#if FATHOM_WITH_LIBIIO
#define IIO &iio_driver
#else
#define IIO NULL
#endif
#if FATHOM_WITH_UDP
#define UDP &udp_driver
#else
#define UDP NULL
#endif

static const struct row {
    const char *name;
    const source_driver *driver; /* NULL: not built */
    const char *what;
    const char *built_by; /* what it takes */
} rows[] = {
    {"folder", &folder_driver, "recording folders", ""},
    {"openni2", OPENNI2, "depth cameras by OpenNI2, and .oni recordings",
     "libopenni2-dev and WITH_OPENNI2=1"},
    {"hid", HID, "HID inertial sensors", "libhidapi-dev and WITH_HIDAPI=1"},
    {"usb", USB, "USB inertial sensors", "libusb-1.0-0-dev and WITH_LIBUSB=1"},
    {"iio", IIO, "inertial sensors wired to the board", "libiio-dev and WITH_LIBIIO=1"},
    {"udp", UDP, "a phone's inertial sensors by network", "WITH_UDP=1"},
};

#define ROWS (sizeof rows / sizeof *rows)

static const struct row *row_named(const char *name, size_t length) {
    for (size_t i = 0; i < ROWS; i++)
        if (strlen(rows[i].name) == length && !strncmp(rows[i].name, name, length)) return &rows[i];
    return NULL;
}

static const char *row_names(char *text, size_t size) {
    *text = 0;
    for (size_t i = 0; i < ROWS; i++)
        snprintf(text + strlen(text), size - strlen(text), "%s%s", i ? ", " : "", rows[i].name);
    return text;
}

bool fathom_source_driver(int index, fathom_source_driver_info *info) {
    const size_t given = sized_of(info);
    if (index < 0 || index >= (int)ROWS || !given) return false;
    const fathom_source_driver_info whole = {
        .name = rows[index].name, .what = rows[index].what, .built = rows[index].driver != NULL};
    sized_out(info, given, &whole, sizeof whole);
    return true;
}

/* ---- names ---- */

const char *fathom_source_state_name(int32_t state) {
    switch ((fathom_source_state)state) {
    case FATHOM_SOURCE_STOPPED: return "stopped";
    case FATHOM_SOURCE_RUNNING: return "running";
    case FATHOM_SOURCE_STALLED: return "stalled";
    case FATHOM_SOURCE_UNPLUGGED: return "unplugged";
    case FATHOM_SOURCE_AT_END: return "at end";
    }
    return "unknown";
}

/* ---- enumerating ---- */

static int say_not_built(const struct row *row, fathom_source_found found, void *user) {
    fathom_source_info info = {
        .struct_size = sizeof info, .driver = row->name, .error = FATHOM_ERROR_NOT_BUILT};
    snprintf(info.name, sizeof info.name, "%s", row->what);
    snprintf(info.problem, sizeof info.problem, "not built into this library; to build it: make with %s",
             row->built_by);
    return found(user, &info) ? FATHOM_ERROR_STOPPED : 0;
}

int fathom_sources_enumerate(const char *driver, fathom_source_found found, void *user, fathom_log log,
                             void *log_user) {
    char names[128];
    int devices = 0;
    if (!found) {
        source_say(log, log_user, FATHOM_LOG_ERROR, "fathom_sources_enumerate: found is NULL");
        return FATHOM_ERROR_ARGUMENT;
    }
    if (driver && !row_named(driver, strlen(driver))) {
        source_say(log, log_user, FATHOM_LOG_ERROR, "no driver is called '%s'; there are: %s", driver,
                   row_names(names, sizeof names));
        return FATHOM_ERROR_ARGUMENT;
    }
    for (size_t i = 0; i < ROWS; i++) {
        if (driver && strcmp(driver, rows[i].name) != 0) continue;
        const int seen = rows[i].driver ? rows[i].driver->enumerate(found, user, log, log_user)
                                        : say_not_built(&rows[i], found, user);
        if (seen < 0) return seen;
        devices += seen;
    }
    return devices;
}

/* ---- opening ---- */

#define MOST_CAPACITY 1000000

static bool in_range(double value, double most) {
    return value >= 0 && value <= most; /* false for NaN */
}

static int check_options(fathom_source_options *o) {
    const char *wrong = NULL;
    if (!in_range(o->width, 16384) || !in_range(o->height, 16384) || !o->width != !o->height)
        wrong = "width and height";
    else if (!in_range(o->rate_hz, 1e6))
        wrong = "rate_hz";
    else if (!in_range(o->speed, 1e6))
        wrong = "speed";
    else if (!in_range(o->imu_capacity, MOST_CAPACITY))
        wrong = "imu_capacity";
    else if (!in_range(o->frame_capacity, 1000))
        wrong = "frame_capacity";
    if (wrong) return source_fail(o, FATHOM_ERROR_ARGUMENT, "fathom_source_options: %s: out of range", wrong);
    if (!o->imu_capacity) o->imu_capacity = 2048;
    if (!o->frame_capacity) o->frame_capacity = 3;
    if (!o->kinds) o->kinds = FATHOM_SOURCE_DEPTH | FATHOM_SOURCE_IMU | FATHOM_SOURCE_COLOR;
    return FATHOM_OK;
}

static bool is_folder(const char *path) {
    struct stat status;
    return stat(path, &status) == 0 && S_ISDIR(status.st_mode);
}

int fathom_source_open(fathom_source **source, const char *uri, const fathom_source_options *options) {
    char names[128];
    fathom_source_options checked = FATHOM_STRUCT(fathom_source_options);
    if (source) *source = NULL;
    if (options && !sized_in(&checked, sizeof checked, options)) return FATHOM_ERROR_ARGUMENT;
    if (!source || !uri)
        return source_fail(&checked, FATHOM_ERROR_ARGUMENT, "fathom_source_open: NULL argument");
    const int wrong = check_options(&checked);
    if (wrong) return wrong;
    const size_t length = strcspn(uri, ":/");
    const struct row *row = uri[length] == ':' ? row_named(uri, length) : NULL;
    const char *address = row ? uri + length + 1 : uri;
    if (!row && is_folder(uri)) row = row_named("folder", 6);
    if (!row && uri[length] == ':')
        return source_fail(&checked, FATHOM_ERROR_ARGUMENT, "%s: no driver is called '%.*s'; there are: %s",
                           uri, (int)length, uri, row_names(names, sizeof names));
    if (!row)
        return source_fail(&checked, FATHOM_ERROR_ARGUMENT,
                           "%s: neither a folder nor the name of a driver and a colon (%s)", uri,
                           row_names(names, sizeof names));
    if (!row->driver)
        return source_fail(&checked, FATHOM_ERROR_NOT_BUILT,
                           "%s: this build was made without %s; it takes %s", uri, row->what, row->built_by);
    return row->driver->open(source, address, &checked);
}

/* ---- an open source ---- */

void fathom_source_close(fathom_source *source) {
    if (!source) return;
    fathom_source_stop(source);
    source->does->close(source);
}

int fathom_source_start(fathom_source *source) {
    if (!source) return FATHOM_ERROR_ARGUMENT;
    if (source->started)
        return source_fail(&source->options, FATHOM_ERROR_ARGUMENT,
                           "fathom_source_start: it is started already");
    const int result = source->does->start(source);
    source->started = result == FATHOM_OK;
    return result;
}

int fathom_source_stop(fathom_source *source) {
    if (!source) return FATHOM_ERROR_ARGUMENT;
    if (source->started) source->does->stop(source);
    source->started = false;
    return FATHOM_OK;
}

int fathom_source_wait(fathom_source *source, int timeout_ms) {
    return source ? source->does->wait(source, timeout_ms) : FATHOM_ERROR_ARGUMENT;
}

void fathom_source_cancel(fathom_source *source) {
    if (source) source->does->cancel(source);
}

int fathom_source_read_depth(fathom_source *source, fathom_source_frame *frame) {
    const size_t given = sized_of(frame);
    if (!source || !given) return FATHOM_ERROR_ARGUMENT;
    if (!source->does->read_depth) return FATHOM_ERROR_UNSUPPORTED;
    fathom_source_frame whole;
    const int result = source->does->read_depth(source, &whole);
    if (!result) sized_out(frame, given, &whole, sizeof whole);
    return result;
}

int fathom_source_read_imu(fathom_source *source, fathom_imu_sample *samples, int capacity) {
    if (!source || !samples || capacity < 0) return FATHOM_ERROR_ARGUMENT;
    return source->does->read_imu ? source->does->read_imu(source, samples, capacity)
                                  : FATHOM_ERROR_UNSUPPORTED;
}

int fathom_source_get_status(fathom_source *source, fathom_source_status *status) {
    const size_t given = sized_of(status);
    if (!source || !given) return FATHOM_ERROR_ARGUMENT;
    fathom_source_status whole = FATHOM_STRUCT(fathom_source_status);
    const int result = source->does->status(source, &whole);
    sized_out(status, given, &whole, sizeof whole);
    return result;
}

int fathom_source_configure(fathom_source *source, fathom_config *config) {
    fathom_config whole;
    const size_t common = caller_config_take(&whole, config);
    if (!source || !common) return FATHOM_ERROR_ARGUMENT;
    if (source->does->configure) {
        source->does->configure(source, &whole);
    } else {
        fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
        const int result = source->does->status(source, &status);
        if (result || status.camera.width == 0) return result;
        whole.depth_camera = status.camera;
        whole.depth_units_per_metre = (float)status.depth_units_per_metre;
    }
    caller_config_give(config, common, &whole);
    return FATHOM_OK;
}
