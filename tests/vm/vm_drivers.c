/* The drivers against the kernel's own HID, USB and IIO, with devices of ours. Runs as root in the virtual machine. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "fathom_drivers.h"
#include "monotonic.h"
#include "virtual_devices.h"

#define MOST 65536
static fathom_imu_sample samples[MOST];
static int sample_count;
static char last_error[512], last_warning[512];

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user;
    char *out = level == FATHOM_LOG_ERROR ? last_error : last_warning;
    snprintf(out, 512, "%s", text);
}

/* ---- helpers ---- */

typedef struct {
    const char *uri; /* of what is looked for, or its beginning */
    fathom_source_info info;
    int seen;
} lookup;

static int note(void *user, const fathom_source_info *info) {
    lookup *l = user;
    if (info->kinds && !strncmp(info->uri, l->uri, strlen(l->uri))) {
        l->info = *info;
        l->seen++;
    }
    return 0;
}

/* How many devices a driver sees whose uri begins so; waits up to 10 s for expected. */
static int look_for(const char *driver, const char *uri, int expected, fathom_source_info *info) {
    lookup l = {.uri = uri};
    for (int i = 0; i < 100; i++) {
        l.seen = 0;
        fathom_sources_enumerate(driver, note, &l, keep_log, NULL);
        if (l.seen == expected) break;
        usleep(100000);
    }
    if (info) *info = l.info;
    return l.seen;
}

static fathom_source *open_it(const char *uri, bool reconnect) {
    fathom_source *source = NULL;
    const fathom_source_options options = {.struct_size = sizeof options, .reconnect = reconnect, .log = keep_log, .imu_capacity = MOST};
    last_error[0] = 0;
    if (fathom_source_open(&source, uri, &options)) fail_msg("%s: %s", uri, last_error);
    if (fathom_source_start(source)) fail_msg("%s: %s", uri, last_error);
    return source;
}

static fathom_source_status status_of(fathom_source *source) {
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(fathom_source_get_status(source, &status), FATHOM_OK);
    return status;
}

/* Reads until so many samples have come or so long has passed; what wait said at last. */
static int gather(fathom_source *source, int most, double seconds) {
    const int64_t end_ns = monotonic_now_ns() + (int64_t)(seconds * 1e9);
    int result = FATHOM_OK;
    sample_count = 0;
    while (sample_count < most && monotonic_now_ns() < end_ns) {
        result = fathom_source_wait(source, 100);
        if (result && result != FATHOM_ERROR_TIMEOUT) break;
        sample_count += fathom_source_read_imu(source, samples + sample_count, most - sample_count);
    }
    for (int i = 1; i < sample_count; i++) assert_true(samples[i].timestamp_ns > samples[i - 1].timestamp_ns);
    return result;
}

static bool reaches(fathom_source *source, fathom_source_state state, double seconds) {
    const int64_t end_ns = monotonic_now_ns() + (int64_t)(seconds * 1e9);
    while (monotonic_now_ns() < end_ns) {
        if (status_of(source).state == (int32_t)state) return true;
        usleep(10000);
    }
    return false;
}

/* It has been found again; a silent device may be stalled by then. */
static bool comes_back(fathom_source *source, double seconds) {
    const int64_t end_ns = monotonic_now_ns() + (int64_t)(seconds * 1e9);
    while (monotonic_now_ns() < end_ns) {
        const fathom_source_status s = status_of(source);
        if (s.reconnects == 1 && s.state != FATHOM_SOURCE_UNPLUGGED) return true;
        usleep(10000);
    }
    return false;
}

/* Opens as another user, who has no rights but those of his groups; what fathom_source_open says. */
static int open_as(int user, int group, const char *uri, char *message, size_t size) {
    int channel[2];
    assert_int_equal(pipe(channel), 0);
    const pid_t child = fork();
    if (child == 0) {
        fathom_source *source;
        const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
        if (setgid((gid_t)group) || setuid((uid_t)user)) _exit(1);
        const int result = fathom_source_open(&source, uri, &options);
        fathom_source_close(source);
        if (write(channel[1], &result, sizeof result) < 0 ||
            write(channel[1], last_error, sizeof last_error) < 0)
            _exit(1);
        _exit(0);
    }
    int result = 1;
    char text[sizeof last_error] = "";
    close(channel[1]);
    assert_int_equal(read(channel[0], &result, sizeof result), sizeof result);
    assert_true(read(channel[0], text, sizeof text) > 0);
    snprintf(message, size, "%s", text);
    close(channel[0]);
    waitpid(child, NULL, 0);
    return result;
}

static int run(const char *command) {
    return system(command);
}

/* ---- HID by uhid ---- */

static virtual_hid pad, other, sensor;
static const char first_address[] = "\x01\x22\x33\x44\x55\x66", second_address[] = "\x02\x22\x33\x44\x55\x66";
#define DUALSENSE "hid:054c:0ce6"

static void plug_pad(virtual_hid *device, const char *address, int expected) {
    const virtual_hid_kind kind = virtual_dualsense(address);
    assert_int_equal(virtual_hid_plug(device, &kind), 0);
    assert_int_equal(look_for("hid", DUALSENSE, expected, NULL), expected);
}

static void hid_is_enumerated(void **state) {
    (void)state;
    fathom_source_info info;
    plug_pad(&pad, first_address, 1);
    assert_int_equal(look_for("hid", DUALSENSE, 1, &info), 1);
    print_message("# %s, %s, serial %s\n", info.uri, info.name, info.serial);
    assert_int_equal(info.error, FATHOM_OK);
    assert_string_equal(info.name, "Sony DualSense");
    assert_true(strlen(info.serial) > 0);
    assert_int_equal(info.kinds, FATHOM_SOURCE_IMU);
    virtual_hid_unplug(&pad);
    assert_int_equal(look_for("hid", DUALSENSE, 0, NULL), 0);
}

static void hid_reads_1_khz_for_10_s_without_loss(void **state) {
    (void)state;
    plug_pad(&pad, first_address, 1);
    fathom_source *source = open_it(DUALSENSE, false);
    pad.rate_hz = 1000;
    gather(source, 10000, 25);
    pad.rate_hz = 0;
    gather(source, MOST, 0.3);
    const fathom_source_status s = status_of(source);
    print_message("# %u sent, %d received, %d lost, %d malformed, clock %.0f ppm\n", pad.sent, (int)s.samples,
                  (int)s.lost, (int)s.malformed, s.clock_drift_ppm);
    assert_int_equal(s.samples, pad.sent);
    assert_true(s.samples >= 10000);
    assert_int_equal(s.lost + s.malformed + s.samples_dropped, 0);
    fathom_source_close(source);
    virtual_hid_unplug(&pad);
}

static void hid_values_are_calibrated(void **state) {
    (void)state;
    plug_pad(&pad, first_address, 1);
    fathom_source *source = open_it(DUALSENSE, false);
    pad.rate_hz = 250;
    gather(source, 100, 10);
    assert_int_equal(sample_count, 100);
    for (int i = 1; i < 100; i++) {
        const double step = (samples[i].gyro[0] - samples[i - 1].gyro[0]) * 180 / M_PI;
        assert_true(fabs(step - 1) < 1e-3); /* a degree a second more each time */
        assert_true(fabsf(samples[i].accel[1] - 9.80665f) < 1e-4f);
        assert_in_range(samples[i].timestamp_ns - samples[i - 1].timestamp_ns, 3000000, 5000000);
    }
    fathom_source_close(source);
    virtual_hid_unplug(&pad);
}

static void hid_unplugged_while_reading(void **state) {
    (void)state;
    plug_pad(&pad, first_address, 1);
    fathom_source *source = open_it(DUALSENSE, false);
    pad.rate_hz = 500;
    gather(source, 100, 10);
    virtual_hid_unplug(&pad);
    const int64_t gone_ns = monotonic_now_ns();
    assert_int_equal(gather(source, MOST, 5), FATHOM_ERROR_UNPLUGGED);
    print_message("# noticed after %.0f ms\n", (double)(monotonic_now_ns() - gone_ns) / 1e6);
    assert_int_equal(status_of(source).state, FATHOM_SOURCE_UNPLUGGED);
    assert_int_equal(status_of(source).unplugged, 1);
    assert_int_equal(fathom_source_stop(source), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_ERROR_NO_DEVICE);
    plug_pad(&pad, first_address, 1); /* started again when it is back */
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    pad.rate_hz = 500;
    gather(source, 10, 5);
    assert_int_equal(sample_count, 10);
    fathom_source_close(source);
    virtual_hid_unplug(&pad);
}

static void hid_plugged_in_again(void **state) {
    (void)state;
    plug_pad(&pad, first_address, 1);
    fathom_source *source = open_it(DUALSENSE, true);
    pad.rate_hz = 500;
    gather(source, 100, 10);
    virtual_hid_unplug(&pad);
    assert_true(reaches(source, FATHOM_SOURCE_UNPLUGGED, 5));
    plug_pad(&other, second_address, 1); /* another of the kind isn't it */
    other.rate_hz = 500;
    usleep(1500000);
    assert_int_equal(status_of(source).state, FATHOM_SOURCE_UNPLUGGED);
    plug_pad(&pad, first_address, 2);
    pad.rate_hz = 500;
    assert_true(comes_back(source, 10));
    gather(source, MOST, 0.2);
    gather(source, 200, 5);
    assert_int_equal(sample_count, 200);
    assert_int_equal(status_of(source).reconnects, 1);
    assert_int_equal(status_of(source).unplugged, 1);
    fathom_source_close(source);
    virtual_hid_unplug(&pad);
    virtual_hid_unplug(&other);
}

static void hid_one_of_two_by_serial(void **state) {
    (void)state;
    fathom_source_info info[2];
    plug_pad(&pad, first_address, 1);
    look_for("hid", DUALSENSE, 1, &info[0]);
    plug_pad(&other, second_address, 2);
    look_for("hid", DUALSENSE, 2, &info[1]);
    assert_string_not_equal(info[0].serial, info[1].serial);
    other.rate_hz = 500; /* only this one sends */
    for (int i = 0; i < 2; i++) {
        fathom_source *source = open_it(info[i].uri, false);
        gather(source, 50, i ? 5 : 0.5);
        assert_int_equal(sample_count, i ? 50 : 0);
        assert_string_equal(status_of(source).serial, info[i].serial);
        fathom_source_close(source);
    }
    virtual_hid_unplug(&pad);
    virtual_hid_unplug(&other);
}

static void hid_without_permission(void **state) {
    (void)state;
    char text[512];
    plug_pad(&pad, first_address, 1);
    assert_int_equal(open_as(1000, 1000, DUALSENSE, text, sizeof text), FATHOM_ERROR_PERMISSION);
    print_message("# %s\n", text);
    assert_non_null(strstr(text, "60-fathom-imu.rules"));
    virtual_hid_unplug(&pad);
}

static void hid_that_stops_sending(void **state) {
    (void)state;
    plug_pad(&pad, first_address, 1);
    fathom_source *source = open_it(DUALSENSE, false);
    pad.rate_hz = 250;
    gather(source, 300, 10);
    pad.rate_hz = 0;
    assert_true(reaches(source, FATHOM_SOURCE_STALLED, 3));
    gather(source, MOST, 0.2);
    assert_int_equal(fathom_source_wait(source, 100), FATHOM_ERROR_TIMEOUT);
    pad.rate_hz = 250;
    gather(source, 50, 5);
    assert_int_equal(sample_count, 50);
    assert_int_equal(status_of(source).state, FATHOM_SOURCE_RUNNING);
    assert_int_equal(status_of(source).stalls, 1);
    fathom_source_close(source);
    virtual_hid_unplug(&pad);
}

#define SENSOR "hid:1209:0001"

static void hid_sensors_are_found_and_set(void **state) {
    (void)state;
    fathom_source_info info;
    const virtual_hid_kind kind = virtual_hid_sensor();
    assert_int_equal(virtual_hid_plug(&sensor, &kind), 0);
    assert_int_equal(look_for("hid", SENSOR, 1, &info), 1);
    assert_int_equal(info.error, FATHOM_OK);
    fathom_source *source = open_it(SENSOR, false);
    for (int id = 1; id <= 2; id++) { /* all events, full power, 5 ms */
        const uint8_t expected[7] = {(uint8_t)id, 1, 1, 5, 0, 0, 0};
        assert_memory_equal(sensor.set[id], expected, 7);
    }
    sensor.rate_hz = 400; /* 200 of each */
    gather(source, 400, 10);
    assert_int_equal(sample_count, 400);
    for (int i = 20; i < 400; i++) {
        assert_true(fabsf(samples[i].accel[2] - 9.80665f) < 1e-4f); /* specific force */
        assert_true(fabs(samples[i].gyro[2] - 10 * M_PI / 180) < 1e-5);
    }
    sensor.rate_hz = 0;
    usleep(200000);
    const int64_t malformed = status_of(source).malformed;
    const uint8_t out_of_range[7] = {2, 0x00, 0x80, 0, 0, 0, 0}, empty[1] = {2}, unknown[3] = {9, 1, 2};
    virtual_hid_send(&sensor, out_of_range, sizeof out_of_range);
    virtual_hid_send(&sensor, unknown, sizeof unknown);
    virtual_hid_send(&sensor, empty, sizeof empty);
    for (int i = 0; i < 100 && status_of(source).malformed < malformed + 3; i++) usleep(20000);
    print_message("# %d of 3 malformed reports came through the kernel\n",
                  (int)(status_of(source).malformed - malformed));
    assert_in_range(status_of(source).malformed - malformed, 1, 3);
    sensor.rate_hz = 400;
    gather(source, 10, 5);
    gather(source, 100, 5);
    assert_int_equal(sample_count, 100); /* it goes on */
    fathom_source_close(source);
    virtual_hid_unplug(&sensor);
}

/* ---- USB by USB/IP ---- */

static void tick(struct timespec *due, int rate_hz) {
    due->tv_nsec += 1000000000 / rate_hz;
    if (due->tv_nsec >= 1000000000) {
        due->tv_nsec -= 1000000000;
        due->tv_sec++;
    }
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, due, NULL);
}

/* Sends at a rate while it is to. What nobody waits for is sent at the next tick. */
typedef struct {
    virtual_usb *device;
    pthread_t thread;
    atomic_bool stop;
    int rate_hz, padding; /* padding < 0: DualSense reports */
    atomic_uint sent, bytes, late;
} usb_sender;

static void *send_usb(void *user) {
    usb_sender *s = user;
    struct timespec due;
    uint8_t bytes[2200];
    clock_gettime(CLOCK_MONOTONIC, &due);
    while (!s->stop) {
        tick(&due, s->rate_hz);
        const int length = s->padding < 0 ? virtual_dualsense_report(s->sent, s->rate_hz, bytes)
                                          : virtual_mti_message(s->sent, s->rate_hz, s->padding, bytes);
        if (virtual_usb_send(s->device, s->padding < 0 ? DUALSENSE_IN : MTI_IN, bytes, length)) {
            s->sent++;
            s->bytes += (unsigned)length;
        } else {
            s->late++;
        }
    }
    return NULL;
}

static void start_sending(usb_sender *s, virtual_usb *device, int rate_hz, int padding) {
    memset(s, 0, sizeof *s);
    s->device = device;
    s->rate_hz = rate_hz;
    s->padding = padding;
    pthread_create(&s->thread, NULL, send_usb, s);
}

static void stop_sending(usb_sender *s) {
    s->stop = true;
    pthread_join(s->thread, NULL);
    s->device = NULL;
}

static virtual_usb usb;
static usb_sender sender;
#define MTI_URI "usb:2639:0300"

static void plug_mti(const char *serial) {
    const virtual_usb_kind kind = virtual_mti(serial);
    assert_int_equal(virtual_usb_plug(&usb, &kind), 0);
    assert_int_equal(look_for("usb", MTI_URI, 1, NULL), 1);
}

static void interrupt_500_hz_for_10_s_without_loss(void **state) {
    (void)state;
    const virtual_usb_kind kind = virtual_usb_dualsense();
    assert_int_equal(virtual_usb_plug(&usb, &kind), 0);
    assert_int_equal(look_for("hid", DUALSENSE, 1, NULL), 1);
    fathom_source *source = open_it(DUALSENSE, false);
    start_sending(&sender, &usb, 500, -1);
    gather(source, 5000, 20);
    stop_sending(&sender);
    gather(source, MOST, 0.3);
    const fathom_source_status s = status_of(source);
    print_message("# %u sent, %d received, %d lost; serial %s\n", sender.sent, (int)s.samples, (int)s.lost,
                  s.serial);
    assert_in_range(s.samples, 5000, sender.sent);
    assert_int_equal(s.lost + s.malformed, 0);
    start_sending(&sender, &usb, 500, -1);
    gather(source, 50, 5);
    stop_sending(&sender);
    virtual_usb_unplug(&usb);
    assert_int_equal(gather(source, MOST, 5), FATHOM_ERROR_UNPLUGGED);
    fathom_source_close(source);
}

static void bulk_1_mb_a_second_for_10_s_without_loss(void **state) {
    (void)state;
    plug_mti("MT-1");
    fathom_source *source = open_it(MTI_URI, false);
    start_sending(&sender, &usb, 600, 1700);
    const int64_t start_ns = monotonic_now_ns();
    gather(source, 6000, 25);
    const double seconds = (double)(monotonic_now_ns() - start_ns) * 1e-9;
    stop_sending(&sender);
    gather(source, MOST, 0.3);
    const fathom_source_status s = status_of(source);
    print_message("# %.2f MB/s for %.1f s: %u messages sent, %d received, %d lost, %d malformed\n",
                  sender.bytes / seconds / 1e6, seconds, sender.sent, (int)s.samples, (int)s.lost,
                  (int)s.malformed);
    assert_int_equal(s.samples, sender.sent);
    assert_int_equal(s.lost + s.malformed, 0);
    assert_true(sender.bytes / seconds > 0.95e6);
    assert_string_equal(s.serial, "MT-1");
    fathom_source_close(source);
    virtual_usb_unplug(&usb);
}

static void mti_unplugged_and_plugged_in_again(void **state) {
    (void)state;
    plug_mti("MT-1");
    fathom_source *source = open_it(MTI_URI, true);
    start_sending(&sender, &usb, 400, 0);
    gather(source, 100, 5);
    assert_int_equal(sample_count, 100);
    assert_true(samples[99].accel[2] == 9.8125f);
    stop_sending(&sender);
    virtual_usb_unplug(&usb);
    assert_true(reaches(source, FATHOM_SOURCE_UNPLUGGED, 5));
    plug_mti("MT-1");
    assert_true(comes_back(source, 10));
    start_sending(&sender, &usb, 400, 0);
    gather(source, 100, 5);
    assert_int_equal(sample_count, 100);
    assert_int_equal(status_of(source).reconnects, 1);
    stop_sending(&sender);
    fathom_source_close(source);

    source = open_it(MTI_URI, false); /* and without wanting it back */
    start_sending(&sender, &usb, 400, 0);
    gather(source, 100, 5);
    stop_sending(&sender);
    virtual_usb_unplug(&usb);
    assert_int_equal(gather(source, MOST, 5), FATHOM_ERROR_UNPLUGGED);
    fathom_source_close(source);
}

static void mti_stalls_and_sends_rubbish(void **state) {
    (void)state;
    uint8_t bytes[2200];
    plug_mti("MT-1");
    fathom_source *source = open_it(MTI_URI, false);
    start_sending(&sender, &usb, 400, 0);
    gather(source, 500, 10);
    stop_sending(&sender);
    assert_true(reaches(source, FATHOM_SOURCE_STALLED, 5));
    const int64_t before = status_of(source).malformed;
    int length = virtual_mti_message(0, 400, 0, bytes);
    bytes[20] ^= 1;
    assert_true(virtual_usb_send(&usb, MTI_IN, bytes, length));
    memset(bytes, 0xFA, sizeof bytes);
    assert_true(virtual_usb_send(&usb, MTI_IN, bytes, 500));
    assert_true(virtual_usb_send(&usb, MTI_IN, bytes, 0));
    start_sending(&sender, &usb, 400, 0);
    gather(source, MOST, 0.3);
    gather(source, 100, 5);
    assert_int_equal(sample_count, 100);
    stop_sending(&sender);
    assert_true(status_of(source).malformed > before);
    assert_int_equal(status_of(source).state, FATHOM_SOURCE_RUNNING);
    /* stop and start, with transfers under way */
    for (int i = 0; i < 5; i++) {
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
    }
    start_sending(&sender, &usb, 400, 0);
    gather(source, 100, 5);
    assert_int_equal(sample_count, 100);
    stop_sending(&sender);
    fathom_source_close(source);
    virtual_usb_unplug(&usb);
}

static void usb_without_permission_or_busy(void **state) {
    (void)state;
    char text[512];
    plug_mti("MT-1");
    assert_int_equal(open_as(1000, 1000, MTI_URI, text, sizeof text), FATHOM_ERROR_PERMISSION);
    assert_non_null(strstr(text, "60-fathom-imu.rules"));
    fathom_source *source = open_it(MTI_URI, false), *second;
    const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
    assert_int_equal(fathom_source_open(&second, MTI_URI, &options), FATHOM_ERROR_BUSY);
    print_message("# %s\n", last_error);
    fathom_source_close(source);
    virtual_usb_unplug(&usb);
    assert_int_equal(fathom_source_open(&second, MTI_URI, &options), FATHOM_ERROR_NO_DEVICE);
}

static void kinects_accelerometer(void **state) {
    (void)state;
    const virtual_usb_kind kind = virtual_kinect_motor();
    assert_int_equal(virtual_usb_plug(&usb, &kind), 0);
    assert_int_equal(look_for("usb", "usb:045e:02b0", 1, NULL), 1);
    fathom_source *source = open_it("usb:045e:02b0", false);
    gather(source, 100, 10);
    assert_int_equal(sample_count, 100);
    const double seconds = (double)(samples[99].timestamp_ns - samples[0].timestamp_ns) * 1e-9;
    print_message("# %.1f a second\n", 99 / seconds);
    assert_true(fabs(99 / seconds - 50) < 5);
    assert_true(fabsf(samples[50].accel[1] - 9.80665f) < 1e-4f && isnan(samples[50].gyro[0]));
    virtual_usb_unplug(&usb);
    assert_int_equal(gather(source, MOST, 5), FATHOM_ERROR_UNPLUGGED);
    fathom_source_close(source);
}

/* Unplugs after a while, in whatever the driver is doing by then. */
static void *unplug_soon(void *microseconds) {
    usleep((useconds_t)(intptr_t)microseconds);
    if (pad.plugged) virtual_hid_unplug(&pad);
    if (usb.plugged) virtual_usb_unplug(&usb);
    return NULL;
}

/* Every call may find the device gone: it must end with an error of its own, or go on, and leave nothing behind. */
static void vanish(const char *uri, int rounds, int step_us) {
    int opened = 0, started = 0;
    for (int i = 0; i < rounds; i++) {
        const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
        fathom_source *source;
        pthread_t thread;
        if (!strcmp(uri, DUALSENSE))
            plug_pad(&pad, first_address, 1);
        else
            plug_mti("MT-1");
        pad.rate_hz = 500;
        pthread_create(&thread, NULL, unplug_soon, (void *)(intptr_t)(i * step_us));
        int result = fathom_source_open(&source, uri, &options);
        opened += !result;
        if (!result) result = fathom_source_start(source);
        started += !result;
        if (!result) assert_true(fathom_source_wait(source, 50) <= 0);
        if (source) fathom_source_read_imu(source, samples, MOST);
        fathom_source_stop(source);
        fathom_source_close(source);
        pthread_join(thread, NULL);
        look_for(strncmp(uri, "hid", 3) ? "usb" : "hid", uri, 0, NULL);
    }
    print_message("# gone in %d rounds, of which %d had been opened and %d started\n", rounds, opened,
                  started);
    assert_true(started > 0);
}

static void hid_that_vanishes_in_any_call(void **state) {
    (void)state;
    vanish(DUALSENSE, 30, 3000);
}

static void mti_that_vanishes_in_any_call(void **state) {
    (void)state;
    vanish(MTI_URI, 30, 3000);
}

/* A test that fails leaves its devices plugged in. */
static int unplug_all(void **state) {
    (void)state;
    if (sender.device) stop_sending(&sender);
    if (pad.plugged) virtual_hid_unplug(&pad);
    if (other.plugged) virtual_hid_unplug(&other);
    if (sensor.plugged) virtual_hid_unplug(&sensor);
    if (usb.plugged) virtual_usb_unplug(&usb);
    return 0;
}

/* ---- udev ---- */

static void udev_rules_let_the_group_in(void **state) {
    (void)state;
    char text[512];
    assert_int_equal(run("systemd-udevd --daemon --resolve-names=early && udevadm control --ping"), 0);
    plug_pad(&pad, first_address, 1);
    run("udevadm settle");
    assert_int_equal(open_as(1000, 44, DUALSENSE, text, sizeof text), FATHOM_OK);
    assert_int_equal(open_as(1000, 1000, DUALSENSE, text, sizeof text), FATHOM_ERROR_PERMISSION);
    virtual_hid_unplug(&pad);
    const virtual_hid_kind kind = virtual_hid_sensor();
    assert_int_equal(virtual_hid_plug(&sensor, &kind), 0);
    assert_int_equal(look_for("hid", SENSOR, 1, NULL), 1);
    run("udevadm settle");
    assert_int_equal(open_as(1000, 44, SENSOR, text, sizeof text), FATHOM_OK);
    virtual_hid_unplug(&sensor);
    plug_mti("MT-1");
    run("udevadm settle");
    assert_int_equal(open_as(1000, 44, MTI_URI, text, sizeof text), FATHOM_OK);
    virtual_usb_unplug(&usb);
}

/* ---- IIO through hid-sensor-hub ---- */

static void iio_through_the_sensor_hub(void **state) {
    (void)state;
    fathom_source_info info;
    if (run("load-sensor-hub")) {
        print_message("# not tried: this kernel has no hid-sensor-hub\n");
        return;
    }
    const virtual_hid_kind kind = virtual_hid_sensor();
    assert_int_equal(virtual_hid_plug(&sensor, &kind), 0);
    sensor.rate_hz = 400;
    const int seen = look_for("iio", "iio:", 2, &info);
    run("for d in /sys/bus/iio/devices/iio:*; do echo \"# $(basename $d) $(cat $d/name)\"; done");
    assert_int_equal(seen, 2);
    fathom_source *source = open_it("iio:", false);
    gather(source, 400, 15);
    const fathom_source_status s = status_of(source);
    print_message("# %s: %d samples, %.0f a second, %d malformed; last: %.3f %.3f %.3f, %.4f %.4f %.4f\n",
                  s.name, sample_count, s.rate_hz, (int)s.malformed,
                  sample_count ? samples[sample_count - 1].accel[0] : NAN,
                  sample_count ? samples[sample_count - 1].accel[1] : NAN,
                  sample_count ? samples[sample_count - 1].accel[2] : NAN,
                  sample_count ? samples[sample_count - 1].gyro[0] : NAN,
                  sample_count ? samples[sample_count - 1].gyro[1] : NAN,
                  sample_count ? samples[sample_count - 1].gyro[2] : NAN);
    assert_int_equal(sample_count, 400);
    for (int i = 50; i < 400; i++) {
        assert_true(fabsf(samples[i].accel[2] - 9.80665f) < 0.01f);
        assert_true(fabs(samples[i].gyro[2] - 10 * M_PI / 180) < 1e-3);
    }
    assert_int_equal(look_for("hid", SENSOR, 1, &info), 1); /* the hid driver says who has it */
    assert_int_equal(info.error, FATHOM_ERROR_BUSY);
    assert_non_null(strstr(info.problem, "iio"));
    virtual_hid_unplug(&sensor);
    assert_int_equal(gather(source, MOST, 5), FATHOM_ERROR_UNPLUGGED);
    fathom_source_close(source);

    /* and back again */
    assert_int_equal(virtual_hid_plug(&sensor, &kind), 0);
    sensor.rate_hz = 400;
    assert_int_equal(look_for("iio", "iio:", 2, NULL), 2);
    source = open_it("iio:gyro_3d+accel_3d", true);
    gather(source, 50, 10);
    virtual_hid_unplug(&sensor);
    assert_true(reaches(source, FATHOM_SOURCE_UNPLUGGED, 5));
    assert_int_equal(virtual_hid_plug(&sensor, &kind), 0);
    sensor.rate_hz = 400;
    assert_true(comes_back(source, 10));
    gather(source, MOST, 0.2);
    gather(source, 50, 10);
    assert_int_equal(sample_count, 50);
    fathom_source_close(source);
}

int main(int argc, char **argv) {
    if (argc > 1 && *argv[1]) cmocka_set_test_filter(argv[1]);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_teardown(hid_is_enumerated, unplug_all),
        cmocka_unit_test_teardown(hid_reads_1_khz_for_10_s_without_loss, unplug_all),
        cmocka_unit_test_teardown(hid_values_are_calibrated, unplug_all),
        cmocka_unit_test_teardown(hid_unplugged_while_reading, unplug_all),
        cmocka_unit_test_teardown(hid_plugged_in_again, unplug_all),
        cmocka_unit_test_teardown(hid_one_of_two_by_serial, unplug_all),
        cmocka_unit_test_teardown(hid_without_permission, unplug_all),
        cmocka_unit_test_teardown(hid_that_stops_sending, unplug_all),
        cmocka_unit_test_teardown(hid_sensors_are_found_and_set, unplug_all),
        cmocka_unit_test_teardown(interrupt_500_hz_for_10_s_without_loss, unplug_all),
        cmocka_unit_test_teardown(bulk_1_mb_a_second_for_10_s_without_loss, unplug_all),
        cmocka_unit_test_teardown(mti_unplugged_and_plugged_in_again, unplug_all),
        cmocka_unit_test_teardown(mti_stalls_and_sends_rubbish, unplug_all),
        cmocka_unit_test_teardown(usb_without_permission_or_busy, unplug_all),
        cmocka_unit_test_teardown(kinects_accelerometer, unplug_all),
        cmocka_unit_test_teardown(hid_that_vanishes_in_any_call, unplug_all),
        cmocka_unit_test_teardown(mti_that_vanishes_in_any_call, unplug_all),
        cmocka_unit_test_teardown(udev_rules_let_the_group_in, unplug_all),
        cmocka_unit_test_teardown(iio_through_the_sensor_hub, unplug_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
