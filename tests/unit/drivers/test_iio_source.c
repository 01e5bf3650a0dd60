/* The IIO driver over a libiio that this program defines itself: what the kernel would say, and the samples it makes of it. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <errno.h>
#include <iio.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "fathom_drivers.h"
#include "monotonic.h"
#include "source_contract.h"

/* ---- the kernel's sensors ---- */

struct iio_channel {
    char id[24];
    double scale, offset;
    bool enabled;
    unsigned at; /* in a scan */
    struct iio_data_format format;
};

struct iio_buffer {
    struct iio_device *device;
};

#define STEP 24 /* three accelerations, three rates, padding, a stamp */

struct iio_device {
    const char *id, *name, *mount; /* mount NULL: says nothing */
    bool has_gyro, has_accel, has_time, monotonic, busy;
    atomic_bool is_there;
    double rate;
    struct iio_channel channels[7];
    struct iio_buffer buffer;
    bool buffering;
    int bell;
    uint8_t scans[64 * STEP], taken[64 * STEP];
    int waiting;
};

struct iio_context {
    int unused;
};

static struct iio_context context;
static struct iio_device devices[2];
static int device_count, contexts, buffers;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;

static void make_device(struct iio_device *d, const char *id, const char *name, bool gyro, bool accel) {
    *d = (struct iio_device){
        .id = id, .name = name, .has_gyro = gyro, .has_accel = accel, .has_time = true, .monotonic = true, .is_there = true};
    for (int i = 0; i < 7; i++) {
        struct iio_channel *c = &d->channels[i];
        *c = (struct iio_channel){.scale = i < 3 ? 0.01 : 0.001, .at = i < 6 ? 2u * (unsigned)i : 16};
        c->format = (struct iio_data_format){
            .length = i < 6 ? 16 : 64, .bits = i < 6 ? 16 : 64, .is_signed = true, .repeat = 1};
        if (i < 6)
            snprintf(c->id, sizeof c->id, "%s_%c", i < 3 ? "accel" : "anglvel", 'x' + i % 3);
        else
            snprintf(c->id, sizeof c->id, "timestamp");
    }
    d->buffer.device = d;
    d->bell = eventfd(0, EFD_NONBLOCK);
}

static int fresh(void **state) {
    (void)state;
    make_device(&devices[0], "iio:device0", "imu", true, true);
    make_device(&devices[1], "iio:device1", "other", false, true);
    device_count = 1;
    contexts = buffers = 0;
    return 0;
}

static int leave_nothing(void **state) {
    (void)state;
    for (int i = 0; i < 2; i++) close(devices[i].bell);
    return contexts || buffers;
}

/* A scan arrives: raw accelerations and rates, and its stamp. */
static void arrive(struct iio_device *d, const int16_t raw[6], int64_t stamp_ns) {
    const uint64_t one = 1;
    pthread_mutex_lock(&lock);
    assert_true(d->waiting < 64);
    uint8_t *scan = d->scans + STEP * d->waiting++;
    for (int i = 0; i < 6; i++) {
        const bool big = d->channels[i].format.is_be;
        scan[2 * i + big] = (uint8_t)raw[i];
        scan[2 * i + !big] = (uint8_t)(raw[i] >> 8);
    }
    memcpy(scan + 16, &stamp_ns, 8);
    pthread_mutex_unlock(&lock);
    assert_int_equal(write(d->bell, &one, sizeof one), 8);
}

int access(const char *path, int mode) {
    for (int i = 0; i < 2; i++)
        if (!strncmp(path, "/dev/", 5) && devices[i].id && !strcmp(path + 5, devices[i].id)) {
            errno = ENOENT;
            return devices[i].is_there ? 0 : -1;
        }
    return (int)syscall(SYS_faccessat, -100 /* AT_FDCWD */, path, mode, 0);
}

struct iio_context *iio_create_local_context(void) {
    contexts++;
    return &context;
}

void iio_context_destroy(struct iio_context *c) {
    (void)c;
    contexts--;
}

unsigned iio_context_get_devices_count(const struct iio_context *c) {
    (void)c;
    return (unsigned)device_count;
}

struct iio_device *iio_context_get_device(const struct iio_context *c, unsigned i) {
    (void)c;
    return &devices[i];
}

const char *iio_device_get_id(const struct iio_device *d) {
    return d->id;
}

const char *iio_device_get_name(const struct iio_device *d) {
    return d->name;
}

struct iio_channel *iio_device_find_channel(const struct iio_device *d, const char *id, bool output) {
    assert_false(output);
    for (int i = 0; i < 7; i++) {
        const bool there = i < 3 ? d->has_accel : i < 6 ? d->has_gyro : d->has_time;
        if (there && !strcmp(d->channels[i].id, id)) return (struct iio_channel *)&d->channels[i];
    }
    return NULL;
}

bool iio_channel_is_scan_element(const struct iio_channel *c) {
    (void)c;
    return true;
}

int iio_channel_attr_read_double(const struct iio_channel *c, const char *name, double *value) {
    if (!strcmp(name, "scale"))
        *value = c->scale;
    else if (!strcmp(name, "offset") && c->offset != 0)
        *value = c->offset;
    else
        return -ENOENT;
    return 0;
}

const struct iio_data_format *iio_channel_get_data_format(const struct iio_channel *c) {
    return &c->format;
}

ssize_t iio_channel_attr_read(const struct iio_channel *c, const char *name, char *text, size_t size) {
    (void)c, (void)name, (void)text, (void)size;
    return -ENOENT;
}

ssize_t iio_device_attr_read(const struct iio_device *d, const char *name, char *text, size_t size) {
    if (strcmp(name, "in_mount_matrix") || !d->mount) return -ENOENT;
    return snprintf(text, size, "%s", d->mount);
}

ssize_t iio_device_attr_write(const struct iio_device *d, const char *name, const char *text) {
    return !strcmp(name, "current_timestamp_clock") && !strcmp(text, "monotonic") && d->monotonic ? 1 : -EINVAL;
}

int iio_device_attr_write_double(const struct iio_device *d, const char *name, double value) {
    assert_string_equal(name, "sampling_frequency");
    ((struct iio_device *)d)->rate = value;
    return 0;
}

int iio_channel_attr_write_double(const struct iio_channel *c, const char *name, double value) {
    (void)c, (void)name, (void)value;
    return -ENOENT;
}

void iio_channel_enable(struct iio_channel *c) {
    c->enabled = true;
}

struct iio_buffer *iio_device_create_buffer(const struct iio_device *d, size_t samples, bool cyclic) {
    assert_true(samples > 0 && !cyclic);
    if (d->busy) {
        errno = EBUSY;
        return NULL;
    }
    buffers++;
    return (struct iio_buffer *)&d->buffer;
}

void iio_buffer_destroy(struct iio_buffer *b) {
    (void)b;
    buffers--;
}

ssize_t iio_device_buffer_attr_write(const struct iio_device *d, const char *name, const char *text) {
    (void)d, (void)name, (void)text;
    return 1;
}

int iio_buffer_set_blocking_mode(struct iio_buffer *b, bool blocking) {
    (void)b;
    assert_false(blocking);
    return 0;
}

int iio_buffer_get_poll_fd(struct iio_buffer *b) {
    return b->device->bell;
}

ssize_t iio_buffer_refill(struct iio_buffer *b) {
    struct iio_device *d = b->device;
    uint64_t rings;
    pthread_mutex_lock(&lock);
    if (read(d->bell, &rings, sizeof rings) < 0) { /* none yet */
    }
    const int scans = d->waiting;
    memcpy(d->taken, d->scans, sizeof d->taken);
    d->waiting = 0;
    pthread_mutex_unlock(&lock);
    return scans ? scans * STEP : -EAGAIN;
}

ptrdiff_t iio_buffer_step(const struct iio_buffer *b) {
    (void)b;
    return STEP;
}

void *iio_buffer_first(const struct iio_buffer *b, const struct iio_channel *c) {
    assert_true(c->enabled);
    return b->device->taken + c->at;
}

/* ---- tests ---- */

static char errors[1024];

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user;
    if (level == FATHOM_LOG_ERROR) snprintf(errors, sizeof errors, "%s", text);
}

static fathom_source *start(const char *uri) {
    fathom_source *source;
    const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
    assert_int_equal(fathom_source_open(&source, uri, &options), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    return source;
}

/* What becomes of one scan. */
static fathom_imu_sample one(const char *uri, const int16_t raw[6]) {
    fathom_imu_sample sample;
    fathom_source *source = start(uri);
    arrive(&devices[0], raw, monotonic_now_ns());
    assert_int_equal(fathom_source_wait(source, 2000), FATHOM_OK);
    assert_int_equal(fathom_source_read_imu(source, &sample, 1), 1);
    fathom_source_close(source);
    return sample;
}

static void are(const float got[3], double x, double y, double z) {
    const double wanted[3] = {x, y, z};
    for (int i = 0; i < 3; i++)
        if (!(fabs(got[i] - wanted[i]) < 1e-5))
            fail_msg("%g %g %g isn't %g %g %g", (double)got[0], (double)got[1], (double)got[2], x, y, z);
}

static const int16_t raw[6] = {100, -200, 980, 10, 20, -30};

static void the_offset_is_added_before_the_scale(void **state) {
    (void)state;
    for (int i = 0; i < 6; i++) devices[0].channels[i].offset = 50 + i;
    const fathom_imu_sample s = one("iio:", raw);
    are(s.accel, 0.01 * (100 + 50), 0.01 * (-200 + 51), 0.01 * (980 + 52));
    are(s.gyro, 0.001 * (10 + 53), 0.001 * (20 + 54), 0.001 * (-30 + 55));
}

static void hid_sensors_accelerometers_are_turned_into_specific_force(void **state) {
    (void)state;
    devices[0].name = "accel_3d";
    const fathom_imu_sample s = one("iio:", raw);
    are(s.accel, -1, 2, -9.8);
    are(s.gyro, 0.01, 0.02, -0.03);
}

static void other_accelerometers_keep_their_sign(void **state) {
    (void)state;
    are(one("iio:", raw).accel, 1, -2, 9.8);
}

static void signs_can_be_set(void **state) {
    (void)state;
    const fathom_imu_sample s = one("iio:?accel=gravity&gyro=left", raw);
    are(s.accel, -1, 2, -9.8);
    are(s.gyro, -0.01, -0.02, 0.03);
    fresh(NULL);
    devices[0].name = "accel_3d";
    are(one("iio:?accel=force&gyro=right", raw).accel, 1, -2, 9.8);
}

static void the_mount_matrix_turns_both_sensors(void **state) {
    (void)state;
    devices[0].mount = "0, 1, 0; -1, 0, 0; 0, 0, 1";
    const fathom_imu_sample s = one("iio:", raw);
    are(s.accel, -2, -1, 9.8);
    are(s.gyro, 0.02, -0.01, -0.03);
}

static void big_endian_values_are_read(void **state) {
    (void)state;
    for (int i = 0; i < 6; i++) devices[0].channels[i].format.is_be = true;
    are(one("iio:", raw).accel, 1, -2, 9.8);
}

static void monotonic_stamps_are_kept_as_they_are(void **state) {
    (void)state;
    fathom_imu_sample samples[3];
    fathom_source *source = start("iio:");
    const int64_t now_ns = monotonic_now_ns() - 100000000;
    for (int i = 0; i < 3; i++) arrive(&devices[0], raw, now_ns + 5000000 * i);
    for (int n = 0; n < 3;) {
        assert_int_equal(fathom_source_wait(source, 2000), FATHOM_OK);
        n += fathom_source_read_imu(source, samples + n, 3 - n);
    }
    for (int i = 0; i < 3; i++) assert_int_equal(samples[i].timestamp_ns, now_ns + 5000000 * i);
    fathom_source_close(source);
}

static void another_clocks_stamps_are_mapped(void **state) {
    (void)state;
    fathom_imu_sample sample;
    devices[0].monotonic = false;
    fathom_source *source = start("iio:");
    const int64_t now_ns = monotonic_now_ns();
    arrive(&devices[0], raw, 1700000000000000000);
    assert_int_equal(fathom_source_wait(source, 2000), FATHOM_OK);
    assert_int_equal(fathom_source_read_imu(source, &sample, 1), 1);
    assert_true(llabs(sample.timestamp_ns - now_ns) < 2000000000);
    fathom_source_close(source);
}

static void without_a_stamp_the_arrival_counts(void **state) {
    (void)state;
    devices[0].has_time = false;
    const int64_t before_ns = monotonic_now_ns();
    const fathom_imu_sample s = one("iio:", raw);
    assert_true(s.timestamp_ns >= before_ns && s.timestamp_ns <= monotonic_now_ns());
}

static void the_rate_is_set(void **state) {
    (void)state;
    fathom_source *source;
    const fathom_source_options options = {.struct_size = sizeof options, .rate_hz = 417};
    assert_int_equal(fathom_source_open(&source, "iio:", &options), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    assert_true(devices[0].rate == 417);
    fathom_source_close(source);
    source = start("iio:");
    assert_true(devices[0].rate == 200);
    fathom_source_close(source);
}

static void two_devices_make_one_source(void **state) {
    (void)state;
    fathom_imu_sample sample;
    device_count = 2;
    make_device(&devices[0], "iio:device0", "gyro", true, false);
    fathom_source *source = start("iio:gyro+other");
    const int64_t now_ns = monotonic_now_ns() - 50000000;
    arrive(&devices[1], raw, now_ns);
    arrive(&devices[1], raw, now_ns + 10000000);
    arrive(&devices[0], raw, now_ns + 5000000);
    assert_int_equal(fathom_source_wait(source, 2000), FATHOM_OK);
    assert_int_equal(fathom_source_read_imu(source, &sample, 1), 1);
    assert_int_equal(sample.timestamp_ns, now_ns + 5000000);
    are(sample.accel, 1, -2, 9.8);
    are(sample.gyro, 0.01, 0.02, -0.03);
    fathom_source_close(source);
}

static void a_device_that_goes_ends_the_source(void **state) {
    (void)state;
    fathom_source *source = start("iio:");
    devices[0].is_there = false;
    assert_int_equal(fathom_source_wait(source, 2000), FATHOM_ERROR_UNPLUGGED);
    fathom_source_close(source);
}

static void a_buffer_that_another_program_reads_is_busy(void **state) {
    (void)state;
    fathom_source *source;
    const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
    devices[0].busy = true;
    assert_int_equal(fathom_source_open(&source, "iio:", &options), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_ERROR_BUSY);
    assert_non_null(strstr(errors, "another program"));
    fathom_source_close(source);
}

static void sample_now(void) {
    arrive(&devices[0], raw, monotonic_now_ns());
    usleep(1000);
}

static void a_second_start_is_refused_and_the_source_goes_on(void **state) {
    (void)state;
    check_source_contract("iio:", sample_now);
}

#define IIO(test) cmocka_unit_test_setup_teardown(test, fresh, leave_nothing)

int main(void) {
    const struct CMUnitTest tests[] = {
        IIO(the_offset_is_added_before_the_scale),
        IIO(hid_sensors_accelerometers_are_turned_into_specific_force),
        IIO(other_accelerometers_keep_their_sign),
        IIO(signs_can_be_set),
        IIO(the_mount_matrix_turns_both_sensors),
        IIO(big_endian_values_are_read),
        IIO(monotonic_stamps_are_kept_as_they_are),
        IIO(another_clocks_stamps_are_mapped),
        IIO(without_a_stamp_the_arrival_counts),
        IIO(the_rate_is_set),
        IIO(two_devices_make_one_source),
        IIO(a_device_that_goes_ends_the_source),
        IIO(a_buffer_that_another_program_reads_is_busy),
        IIO(a_second_start_is_refused_and_the_source_goes_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
