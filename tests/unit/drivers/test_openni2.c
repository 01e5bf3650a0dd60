/* Depth by OpenNI2: the real libOpenNI2 with virtual cameras (tests/openni2/virtual_depth.cpp) in a private folder. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dlfcn.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "recording/image_file.h"
#include "monotonic.h"
#include "source_contract.h"
#include "camera/openni2_internal.h"
#include "camera/openni2_oni.h"

#define WIDTH 64
#define HEIGHT 48
#define FRAMES 5

static char folder[256];
static char home[4096]; /* where the test was started */
static char log_text[8192];
static int log_errors, log_warnings;
static pthread_mutex_t log_lock = PTHREAD_MUTEX_INITIALIZER;

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user;
    pthread_mutex_lock(&log_lock);
    const size_t length = strlen(log_text);
    snprintf(log_text + length, sizeof log_text - length, "%s\n", text);
    log_errors += level == FATHOM_LOG_ERROR;
    log_warnings += level == FATHOM_LOG_WARNING;
    pthread_mutex_unlock(&log_lock);
}

static const char *path_to(const char *file) {
    static char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, file);
    return path;
}

static void write_text(const char *file, const char *text) {
    char part[600];
    snprintf(part, sizeof part, "%s.part", path_to(file));
    FILE *out = fopen(part, "wb");
    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
    assert_int_equal(rename(part, path_to(file)), 0);
}

/* What the virtual cameras do from now on. */
static void behave(const char *word) {
    write_text("control", word);
    usleep(30000);
}

static int start_test(void **state) {
    (void)state;
    *log_text = 0;
    log_errors = log_warnings = 0;
    behave("good");
    return 0;
}

/* ---- the recording that the cameras serve ---- */

static uint16_t pixel_of(int64_t index, int x, int y) {
    return (uint16_t)(500 + 100 * ((index - 1) % FRAMES) + 7 * x + y);
}

static int make_recording(void **state) {
    (void)state;
    char error[256];
    uint16_t pixels[WIDTH * HEIGHT];
    if (!getcwd(home, sizeof home) || chdir(folder)) return -1; /* nothing may depend on the present folder */
    mkdir("depth", 0700);
    FILE *list = fopen("depth.txt", "w");
    if (!list) return -1;
    for (int f = 0; f < FRAMES; f++) {
        char name[64];
        for (int i = 0; i < WIDTH * HEIGHT; i++) pixels[i] = pixel_of(f + 1, i % WIDTH, i / WIDTH);
        snprintf(name, sizeof name, "depth/%d.png", f);
        if (image_write_gray16(name, pixels, WIDTH, HEIGHT, error, sizeof error)) return -1;
        fprintf(list, "%d.0 %s\n", f, name);
    }
    fclose(list);
    write_text("rig.txt", "depth_scale 1000\n");
    return 0;
}

static int remove_recording(void **state) {
    (void)state;
    char command[300];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return chdir(home) || system(command) ? -1 : 0;
}

/* ---- help ---- */

static fathom_source *open_source(const char *uri, fathom_source_options options) {
    fathom_source *source = NULL;
    options.struct_size = sizeof options;
    options.log = keep_log;
    const int result = fathom_source_open(&source, uri, &options);
    if (result) fail_msg("%s: %s: %s", uri, fathom_error_name(result), log_text);
    return source;
}

static void refuses(const char *uri, int error, const char *words) {
    fathom_source *source = NULL;
    const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
    *log_text = 0;
    assert_int_equal(fathom_source_open(&source, uri, &options), error);
    assert_null(source);
    if (!strstr(log_text, words)) fail_msg("'%s' isn't in: %s", words, log_text);
}

static fathom_source_status status_of(fathom_source *source) {
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(fathom_source_get_status(source, &status), FATHOM_OK);
    return status;
}

static void check_pixels(const fathom_source_frame *frame, int factor) {
    assert_int_equal(frame->depth->width, WIDTH);
    assert_int_equal(frame->depth->height, HEIGHT);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_int_equal(frame->depth->depth[i], factor * pixel_of(frame->index, i % WIDTH, i / WIDTH));
}

/* The next frame; fails the test when there is none within two seconds. */
static fathom_source_frame next_frame(fathom_source *source) {
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    const int result = fathom_source_wait(source, 2000);
    if (result) fail_msg("%s: %s", fathom_error_name(result), log_text);
    assert_int_equal(fathom_source_read_depth(source, &frame), FATHOM_OK);
    return frame;
}

static void wait_for_state(fathom_source *source, fathom_source_state state) {
    for (int i = 0; i < 200 && status_of(source).state != (int32_t)state; i++) usleep(10000);
    assert_string_equal(fathom_source_state_name(status_of(source).state), fathom_source_state_name(state));
}

static void drain(fathom_source *source) {
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    while (fathom_source_read_depth(source, &frame) == FATHOM_OK) {
    }
}

/* ---- devices ---- */

static int collect(void *user, const fathom_source_info *info) {
    char *text = user;
    snprintf(text + strlen(text), 1024 - strlen(text), "%s|%s|%s|%u|%d\n", info->uri, info->name,
             info->serial, info->kinds, info->error);
    return 0;
}

static void cameras_are_listed(void **state) {
    (void)state;
    char text[1024] = "";
    assert_true(fathom_sources_enumerate("openni2", collect, text, keep_log, NULL) >= 2);
    assert_non_null(strstr(text, "openni2:virtual/depth@9/1|Virtual Depth 1|VIRTUAL-1|1|0\n"));
    assert_non_null(strstr(text, "openni2:virtual/depth@9/2|Virtual Depth 2|VIRTUAL-2|1|0\n"));
}

/* Leaves no zeros where the next call has its variables. */
static __attribute__((noinline)) void fill_stack(void) {
    volatile char bytes[65536];
    for (size_t i = 0; i < sizeof bytes; i++) bytes[i] = 'x';
}

static void a_camera_in_use_elsewhere_is_listed_without_serial(void **state) {
    (void)state;
    char text[1024] = "", line[128];
    snprintf(line, sizeof line, "openni2:virtual/depth@9/1|Virtual Depth 1||1|%d\n", FATHOM_ERROR_DEVICE);
    behave("busy");
    fill_stack();
    assert_true(fathom_sources_enumerate("openni2", collect, text, keep_log, NULL) >= 2);
    if (!strstr(text, line)) fail_msg("'%s' isn't in: %s", line, text);
}

static void pixels_stamps_and_view(void **state) {
    (void)state;
    fathom_source_frame before = {0}, frame;
    int64_t before_ns = 0;
    fathom_config config;
    fathom_config_init(&config);
    fathom_source *source = open_source("openni2:", (fathom_source_options){0});
    const fathom_source_status opened = status_of(source);
    assert_int_equal(opened.state, FATHOM_SOURCE_STOPPED);
    assert_string_equal(opened.name, "Virtual Depth 1");
    assert_string_equal(opened.serial, "VIRTUAL-1");
    assert_true(opened.depth_units_per_metre == 1000);
    assert_true(fabs(opened.camera.fx - WIDTH / 2 / tan(1.0226 / 2)) < 1e-3);
    assert_true(fabs(opened.camera.cy - 23.5) < 1e-9);
    fathom_source_configure(source, &config);
    assert_int_equal(config.depth_camera.width, WIDTH);
    assert_true(fabs(config.depth_camera.cx - 31.5) < 1e-6);

    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    for (int i = 0; i < 150; i++) {
        frame = next_frame(source);
        check_pixels(&frame, 1);
        assert_true(frame.arrival_ns <= monotonic_now_ns());
        assert_true(frame.depth->timestamp_ns <= frame.arrival_ns);
        if (i == 0) assert_true(frame.index < 20);
        if (i > 0) {
            assert_true(frame.depth->timestamp_ns > before_ns);
            assert_true(frame.device_ns > before.device_ns);
        }
        before = frame;
        before_ns = frame.depth->timestamp_ns;
    }
    const fathom_source_status status = status_of(source);
    assert_int_equal(status.state, FATHOM_SOURCE_RUNNING);
    assert_true(status.rate_hz > 60 && status.rate_hz < 140);
    assert_true(status.clock_offset_s > 0);
    assert_int_equal(status.malformed, 0);
    fathom_source_close(source);
}

/* The cameras' clocks run 1000 parts a million fast: six seconds show it. */
static void drift_is_found(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:", (fathom_source_options){0});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    fathom_source_frame frame = {0};
    for (int64_t end_ns = monotonic_now_ns() + 6000000000; monotonic_now_ns() < end_ns;)
        frame = next_frame(source);
    const double drift = status_of(source).clock_drift_ppm;
    if (drift < 300 || drift > 1300) fail_msg("%g parts a million", drift);
    assert_true(frame.depth->timestamp_ns > frame.arrival_ns - 20000000);
    fathom_source_close(source);
}

static void a_camera_is_chosen_by_serial(void **state) {
    (void)state;
    fathom_source *first = open_source("openni2:VIRTUAL-1", (fathom_source_options){0});
    fathom_source *second = open_source("openni2:VIRTUAL-2", (fathom_source_options){0});
    assert_string_equal(status_of(second).name, "Virtual Depth 2");
    assert_int_equal(fathom_source_start(first), FATHOM_OK);
    assert_int_equal(fathom_source_start(second), FATHOM_OK);
    for (int i = 0; i < 5; i++) {
        fathom_source_frame frame = next_frame(first);
        check_pixels(&frame, 1);
        frame = next_frame(second);
        check_pixels(&frame, 1);
    }
    fathom_source_close(second);
    next_frame(first);
    fathom_source_close(first);
    fathom_source *named = open_source("openni2:virtual/depth@9/2", (fathom_source_options){0});
    assert_string_equal(status_of(named).serial, "VIRTUAL-2");
    fathom_source_close(named);
    refuses("openni2:VIRTUAL-3", FATHOM_ERROR_NO_DEVICE, "VIRTUAL-3: no camera of that name or serial");
    refuses("openni2:?unit=inch", FATHOM_ERROR_ARGUMENT, "unit=100um");
}

static void only_depth_is_given(void **state) {
    (void)state;
    fathom_source *source = NULL;
    const fathom_source_options options = {.struct_size = sizeof options, .kinds = FATHOM_SOURCE_IMU, .log = keep_log};
    assert_int_equal(fathom_source_open(&source, "openni2:", &options), FATHOM_ERROR_UNSUPPORTED);
    source = open_source("openni2:", (fathom_source_options){0});
    fathom_imu_sample sample;
    assert_int_equal(fathom_source_read_imu(source, &sample, 1), FATHOM_ERROR_UNSUPPORTED);
    fathom_source_close(source);
}

static void tenths_of_a_millimetre(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:VIRTUAL-1?unit=100um", (fathom_source_options){0});
    assert_true(status_of(source).depth_units_per_metre == 10000);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    const fathom_source_frame frame = next_frame(source);
    check_pixels(&frame, 10);
    fathom_source_close(source);
}

static void wishes_that_cant_be_met_are_told(void **state) {
    (void)state;
    fathom_source *source =
        open_source("openni2:", (fathom_source_options){.width = 640, .height = 480, .rate_hz = 90});
    assert_non_null(strstr(log_text, "no 640x480: taking 64x48"));
    assert_non_null(strstr(log_text, "no 90 frames a second at that size: taking 60"));
    assert_int_equal(log_errors, 0);
    fathom_source_close(source);
}

static void color_is_laid_over_the_depth(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:", (fathom_source_options){.color = true});
    assert_int_equal(status_of(source).kinds, FATHOM_SOURCE_DEPTH | FATHOM_SOURCE_COLOR);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    int colored = 0;
    for (int i = 0; i < 40; i++) {
        const fathom_source_frame frame = next_frame(source);
        check_pixels(&frame, 1);
        const fathom_image *image = frame.depth->image;
        if (!image) continue;
        const uint8_t *color = image->data;
        assert_true(image->width == WIDTH && image->height == HEIGHT && image->format == FATHOM_IMAGE_RGB8);
        assert_true(llabs(image->timestamp_ns - frame.depth->timestamp_ns) < 100000000);
        colored++;
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            assert_int_equal(color[3 * k + 1], k % WIDTH);
            assert_int_equal(color[3 * k + 2], k / WIDTH);
        }
        assert_true((uint8_t)(frame.index - color[3 * 7] + 1) <= 4);
    }
    assert_true(colored > 30);
    fathom_source_close(source);
}

static void mirrored_pictures_are_turned_round(void **state) {
    (void)state;
    setenv("VIRTUAL_DEPTH_MIRRORED", "1", 1);
    fathom_source *source = open_source("openni2:", (fathom_source_options){0});
    unsetenv("VIRTUAL_DEPTH_MIRRORED");
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    const fathom_source_frame frame = next_frame(source);
    check_pixels(&frame, 1);
    fathom_source_close(source);
}

/* ---- trouble ---- */

static void an_unplugged_camera_ends_the_source(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:VIRTUAL-1", (fathom_source_options){0});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    next_frame(source);
    const int64_t before_ns = monotonic_now_ns();
    write_text("control", "unplugged");
    int result;
    while ((result = fathom_source_wait(source, 3000)) == FATHOM_OK) drain(source);
    assert_int_equal(result, FATHOM_ERROR_UNPLUGGED);
    assert_true(monotonic_now_ns() - before_ns < 500000000);
    assert_int_equal(status_of(source).state, FATHOM_SOURCE_UNPLUGGED);
    assert_int_equal(status_of(source).unplugged, 1);
    assert_int_equal(fathom_source_wait(source, 10), FATHOM_ERROR_UNPLUGGED);
    assert_int_equal(fathom_source_stop(source), FATHOM_OK);
    assert_true(fathom_source_start(source) < 0); /* it isn't there */
    refuses("openni2:VIRTUAL-1", FATHOM_ERROR_NO_DEVICE, "VIRTUAL-1");
    behave("good");
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    const fathom_source_frame frame = next_frame(source);
    check_pixels(&frame, 1);
    fathom_source_close(source);
}

static void a_camera_that_comes_back_goes_on(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:VIRTUAL-1", (fathom_source_options){.reconnect = true});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    int64_t last_ns = 0;
    for (int round = 1; round <= 2; round++) {
        last_ns = next_frame(source).depth->timestamp_ns;
        behave("unplugged");
        wait_for_state(source, FATHOM_SOURCE_UNPLUGGED);
        drain(source);
        assert_int_equal(fathom_source_wait(source, 100), FATHOM_ERROR_TIMEOUT);
        behave("good");
        const fathom_source_frame frame = next_frame(source);
        check_pixels(&frame, 1);
        assert_true(frame.depth->timestamp_ns > last_ns);
        assert_true(frame.depth->timestamp_ns > frame.arrival_ns - 50000000);
        assert_int_equal(status_of(source).state, FATHOM_SOURCE_RUNNING);
        assert_int_equal(status_of(source).unplugged, round);
        assert_int_equal(status_of(source).reconnects, round);
    }
    behave("unplugged");
    wait_for_state(source, FATHOM_SOURCE_UNPLUGGED);
    const int64_t before_ns = monotonic_now_ns();
    fathom_source_close(source); /* while it is being looked for */
    assert_true(monotonic_now_ns() - before_ns < 500000000);
}

/* In another socket it has another address. */
static void a_camera_that_moved_goes_on_and_is_watched_there(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:VIRTUAL-1", (fathom_source_options){.reconnect = true});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    next_frame(source);
    behave("moved");
    for (int i = 0; i < 200 && status_of(source).reconnects < 1; i++) usleep(10000);
    drain(source);
    const fathom_source_frame frame = next_frame(source);
    check_pixels(&frame, 1);
    assert_int_equal(status_of(source).unplugged, 1);
    const int64_t before_ns = monotonic_now_ns();
    behave("unplugged");
    wait_for_state(source, FATHOM_SOURCE_UNPLUGGED);
    assert_true(monotonic_now_ns() - before_ns < 500000000);
    fathom_source_close(source);
}

static void a_camera_replugged_between_stop_and_start_starts(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:VIRTUAL-1", (fathom_source_options){0});
    for (int round = 0; round < 2; round++) { /* before the first start, and after a stop */
        behave("unplugged");
        behave("good");
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
        for (int i = 0; i < 5; i++) next_frame(source);
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
    }
    fathom_source_close(source);
}

static void silence_is_a_stall_and_no_unplug(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:", (fathom_source_options){.reconnect = true});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    next_frame(source);
    behave("stalled");
    wait_for_state(source, FATHOM_SOURCE_STALLED);
    drain(source);
    usleep(1200000); /* longer than libOpenNI2 isn't asked for the device */
    assert_int_equal(fathom_source_wait(source, 0), FATHOM_ERROR_TIMEOUT);
    behave("good");
    const fathom_source_frame frame = next_frame(source);
    check_pixels(&frame, 1);
    assert_int_equal(status_of(source).stalls, 1);
    assert_int_equal(status_of(source).unplugged, 0);
    fathom_source_close(source);
}

static void frames_without_sense_are_left_out(void **state) {
    (void)state;
    static const char *const ways[] = {"short",   "wrong-size", "wrong-format",
                                       "cropped", "no-data",    "bad-stamp"};
    for (size_t i = 0; i < sizeof ways / sizeof *ways; i++) {
        fathom_source *source = open_source("openni2:", (fathom_source_options){0});
        *log_text = 0;
        log_warnings = 0;
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
        next_frame(source);
        behave(ways[i]);
        for (int tries = 0; tries < 1000 && status_of(source).malformed < 5; tries++) usleep(10000);
        assert_true(status_of(source).malformed >= 5);
        behave("good");
        drain(source);
        const fathom_source_frame frame = next_frame(source);
        check_pixels(&frame, 1);
        assert_int_equal(status_of(source).state, FATHOM_SOURCE_RUNNING);
        fathom_source_close(source);
        if (log_warnings != 3) fail_msg("%s: %s", ways[i], log_text); /* bounded */
        assert_non_null(strstr(log_text, "a frame is left out: it"));
    }
}

static void missing_frames_are_counted(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:", (fathom_source_options){0});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    next_frame(source);
    const int64_t before = status_of(source).lost;
    behave("losing");
    for (int i = 0; i < 30; i++) next_frame(source);
    const int64_t lost = status_of(source).lost - before;
    assert_in_range(lost, 10, 40);
    fathom_source_close(source);
}

static void a_slow_reader_is_told_of_drops(void **state) {
    (void)state;
    fathom_source *source = open_source("openni2:", (fathom_source_options){.frame_capacity = 2});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    for (int i = 0; i < 1000 && status_of(source).frames < 20; i++) usleep(10000);
    assert_true(status_of(source).frames >= 20);
    const fathom_source_frame frame = next_frame(source);
    assert_true(frame.index >= 19);
    assert_true(status_of(source).frames_dropped >= 18);
    fathom_source_close(source);
}

static void *cancel_soon(void *user) {
    static int64_t then_ns;
    usleep(50000);
    then_ns = monotonic_now_ns();
    fathom_source_cancel(user);
    return &then_ns;
}

static void a_wait_is_cancelled_at_once(void **state) {
    (void)state;
    pthread_t thread;
    void *then_ns;
    fathom_source *source = open_source("openni2:", (fathom_source_options){0});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    next_frame(source);
    behave("stalled");
    drain(source);
    assert_int_equal(pthread_create(&thread, NULL, cancel_soon, source), 0);
    assert_int_equal(fathom_source_wait(source, -1), FATHOM_ERROR_CANCELLED);
    const int64_t now_ns = monotonic_now_ns();
    pthread_join(thread, &then_ns);
    assert_true(now_ns - *(int64_t *)then_ns < 50000000);
    fathom_source_close(source);
}

static void many_openings_leave_nothing(void **state) {
    (void)state;
    for (int i = 0; i < 25; i++) {
        fathom_source *source = open_source("openni2:", (fathom_source_options){.color = i % 2});
        if (i % 3) assert_int_equal(fathom_source_start(source), FATHOM_OK);
        if (i % 3 == 2) next_frame(source);
        if (i % 5 == 0) assert_int_equal(fathom_source_stop(source), FATHOM_OK);
        fathom_source_close(source);
    }
}

/* ---- recordings ---- */

static int recorded; /* frames in scan.oni */

/* By libOpenNI2's own recorder. */
static void record(const char *file, int frames) {
    char why[256];
    OniStreamHandle stream;
    OniDeviceHandle device;
    OniRecorderHandle recorder;
    OniFrame *frame;
    assert_int_equal(openni2_hold(why, sizeof why), FATHOM_OK);
    assert_int_equal(oniDeviceOpen("virtual/depth@9/1", &device), ONI_STATUS_OK);
    assert_int_equal(oniDeviceCreateStream(device, ONI_SENSOR_DEPTH, &stream), ONI_STATUS_OK);
    assert_int_equal(oniCreateRecorder(file, &recorder), ONI_STATUS_OK);
    assert_int_equal(oniRecorderAttachStream(recorder, stream, FALSE), ONI_STATUS_OK);
    assert_int_equal(oniRecorderStart(recorder), ONI_STATUS_OK);
    assert_int_equal(oniStreamStart(stream), ONI_STATUS_OK);
    for (int i = 0; i < frames; i++) {
        assert_int_equal(oniStreamReadFrame(stream, &frame), ONI_STATUS_OK);
        oniFrameRelease(frame);
    }
    oniStreamStop(stream);
    oniRecorderStop(recorder);
    oniRecorderDestroy(&recorder);
    oniStreamDestroy(stream);
    oniDeviceClose(device);
    openni2_release();
}

/* Reads to the end and returns the frames; the pixels follow each other as recorded. result: what ended it. */
static int play(fathom_source *source, int *result) {
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    int count = 0, first = -1;
    int64_t last_ns = -1;
    while ((*result = fathom_source_wait(source, 5000)) == FATHOM_OK)
        while (fathom_source_read_depth(source, &frame) == FATHOM_OK) {
            assert_true(frame.depth->timestamp_ns > last_ns);
            last_ns = frame.depth->timestamp_ns;
            if (first < 0) first = (frame.depth->depth[0] - 500) / 100;
            frame.index = first + 1 + count++;
            check_pixels(&frame, 1);
        }
    return count;
}

static void a_recording_plays_back_the_same_pixels(void **state) {
    (void)state;
    int result;
    record("scan.oni", 40);
    fathom_source *source = open_source("openni2:scan.oni", (fathom_source_options){0});
    for (int round = 0; round < 2; round++) { /* a second start begins anew */
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
        recorded = play(source, &result);
        assert_int_equal(result, FATHOM_ERROR_ENDED);
        assert_in_range(recorded, 40, 60);
        assert_int_equal(status_of(source).state, FATHOM_SOURCE_AT_END);
        assert_int_equal(status_of(source).frames_dropped, 0);
        assert_int_equal(status_of(source).lost, 0);
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
    }
    fathom_source_close(source);
}

static void a_second_start_is_refused_and_the_source_goes_on(void **state) {
    (void)state;
    check_source_contract("openni2:VIRTUAL-1", NULL);
    check_source_contract("openni2:scan.oni", NULL);
}

static void a_recording_plays_at_its_pace(void **state) {
    (void)state;
    int result;
    fathom_source *source =
        open_source("openni2:scan.oni", (fathom_source_options){.speed = 2, .frame_capacity = 99});
    const int64_t start_ns = monotonic_now_ns();
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    assert_int_equal(play(source, &result), recorded);
    assert_int_equal(result, FATHOM_ERROR_ENDED);
    const double took = 1e-9 * (double)(monotonic_now_ns() - start_ns), wanted = (recorded - 1) / 100.0 / 2;
    assert_true(took > 0.95 * wanted && took < wanted + 0.4);
    fathom_source_close(source);
}

static void copy_part(const char *from, const char *to, long bytes) {
    char data[65536];
    FILE *in = fopen(from, "rb"), *out = fopen(to, "wb");
    assert_true(in && out);
    while (bytes > 0) {
        const size_t part = fread(data, 1, bytes < (long)sizeof data ? (size_t)bytes : sizeof data, in);
        if (!part) break;
        assert_int_equal(fwrite(data, 1, part, out), part);
        bytes -= (long)part;
    }
    fclose(in);
    fclose(out);
}

/* The recorder leaves the latter half of its file unused. However much is missing of the other: the frames before, then an error that says so, or none at all and an error at opening. */
static void a_recording_that_was_cut(void **state) {
    (void)state;
    struct stat is;
    assert_int_equal(stat("scan.oni", &is), 0);
    for (int tenths = 0; tenths <= 9; tenths += 3) {
        fathom_source *source = NULL;
        const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
        int ended = FATHOM_OK;
        copy_part("scan.oni", "cut.oni", is.st_size / 2 * tenths / 10 + 20);
        *log_text = 0;
        log_errors = 0;
        const int result = fathom_source_open(&source, "openni2:cut.oni", &options);
        if (result == FATHOM_OK) {
            assert_int_equal(fathom_source_start(source), FATHOM_OK);
            const int frames = play(source, &ended);
            if (frames >= recorded)
                fail_msg("%d frames of %d in %d tenths: %s", frames, recorded, tenths, log_text);
            assert_int_equal(ended, FATHOM_ERROR_PROTOCOL);
            assert_non_null(strstr(log_text, "the recording breaks off here"));
        } else {
            assert_int_equal(result, FATHOM_ERROR_PROTOCOL);
            assert_non_null(strstr(log_text, "cut.oni: "));
        }
        assert_true(log_errors >= 1);
        fathom_source_close(source);
    }
}

static uint8_t *scan_bytes;
static long scan_size;

static void load_scan(void) {
    FILE *file = fopen("scan.oni", "rb");
    assert_true(file && !fseek(file, 0, SEEK_END) && (scan_size = ftell(file)) > 0);
    rewind(file);
    scan_bytes = malloc((size_t)scan_size);
    assert_non_null(scan_bytes);
    assert_int_equal(fread(scan_bytes, 1, (size_t)scan_size, file), scan_size);
    fclose(file);
}

/* Opens scan.oni with other bytes at `at`, and reads it to its end: what ended it. */
static int read_changed(long at, const void *bytes, size_t count, char *why, size_t size) {
    oni_file *file;
    oni_description about;
    uint16_t pixels[WIDTH * HEIGHT];
    int64_t stamp_ns;
    int number, result;
    uint8_t before[32];
    memcpy(before, scan_bytes + at, count);
    memcpy(scan_bytes + at, bytes, count);
    FILE *stream = fmemopen(scan_bytes, (size_t)scan_size, "rb");
    assert_non_null(stream);
    result = oni_open(&file, stream, &about, why, size);
    while (!result || result == FATHOM_ERROR_SIZE) {
        if (about.width * about.height != WIDTH * HEIGHT) {
            result = FATHOM_ERROR_UNSUPPORTED;
            break;
        }
        result = oni_next(file, pixels, &stamp_ns, &number, why, size);
    }
    oni_close(file);
    memcpy(scan_bytes + at, before, count);
    return result;
}

static long place_of(const char *words) {
    const uint8_t *place = memmem(scan_bytes, (size_t)scan_size, words, strlen(words));
    assert_non_null(place);
    return (long)(place - scan_bytes);
}

static void a_damaged_recording_ends_with_an_error(void **state) {
    (void)state;
    char why[256];
    const uint8_t huge[4] = {0xff, 0xff, 0xff, 0x7f};
    load_scan();
    const long name = place_of("xnMapOutputMode"), view = place_of("xnFOV");
    assert_int_equal(read_changed(4, scan_bytes + 4, 4, why, sizeof why), FATHOM_ERROR_ENDED);
    assert_int_equal(read_changed(24, "X", 1, why, sizeof why),
                     FATHOM_ERROR_PROTOCOL); /* a record's first byte */
    assert_non_null(strstr(why, "at byte 24: no record"));
    assert_int_equal(read_changed(name - 4, huge, 4, why, sizeof why),
                     FATHOM_ERROR_PROTOCOL); /* the name's size */
    assert_int_equal(read_changed(name - 4 - 16, huge, 4, why, sizeof why),
                     FATHOM_ERROR_PROTOCOL); /* the record's */
    assert_int_equal(read_changed(name + 16 + 4, huge, 4, why, sizeof why),
                     FATHOM_ERROR_PROTOCOL); /* the width */
    assert_non_null(strstr(why, "frame size"));
    assert_int_equal(read_changed(view + 6 + 4, "\0\0\0\0\0\0\360\177", 8, why, sizeof why),
                     FATHOM_ERROR_UNSUPPORTED);
    assert_non_null(strstr(why, "field of view"));
    assert_int_equal(read_changed(place_of("16zT"), "rar!", 4, why, sizeof why), FATHOM_ERROR_UNSUPPORTED);
    uint32_t random = 7;
    int whole = 0;
    for (int i = 0; i < 1000; i++) {
        random = random * 1664525u + 1013904223u;
        const uint8_t byte = (uint8_t)(random >> 8);
        const long at = (long)(random >> 12) % (i % 2 ? 2048 : scan_size / 2 - 1);
        whole += read_changed(at, &byte, 1, why, sizeof why) == FATHOM_ERROR_ENDED;
    }
    assert_in_range(whole, 300, 999);
    free(scan_bytes);
}

static void what_is_no_recording_is_refused(void **state) {
    (void)state;
    write_text("text.oni", "this is no recording at all, only some words that stand in a file\n");
    write_text("empty.oni", "");
    refuses("openni2:text.oni", FATHOM_ERROR_PROTOCOL, "text.oni: it doesn't begin as a recording does");
    refuses("openni2:empty.oni", FATHOM_ERROR_PROTOCOL, "empty.oni");
    refuses("openni2:missing.oni", FATHOM_ERROR_NO_DATA, "missing.oni: No such file");
}

/* ---- a private libOpenNI2 ---- */

/* Of the leak sanitizer, where the program is built with it. */
void __lsan_do_leak_check(void) __attribute__((weak));

/* libOpenNI2 looks for drivers only beside itself. In a folder of our own it finds the virtual cameras and the player
 * of recordings and nothing else; the program is started once more with that folder first in line. */
static int start_again(char **arguments) {
    char self[4096], library[4096], path[4600], command[16384], *slash;
    Dl_info info;
    if (!dladdr((void *)(intptr_t)oniInitialize, &info)) return -1;
    const ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    if (length <= 0 || !realpath(info.dli_fname, library)) return -1;
    self[length] = 0;
    if (!(slash = strrchr(library, '/'))) return -1;
    *slash = 0;
    snprintf(folder, sizeof folder, "%s/fathom-openni2-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    if (!mkdtemp(folder)) return -1;
    snprintf(path, sizeof path, "%.*s/openni2/libVirtualDepth.so.0", (int)(strrchr(self, '/') - self), self);
    snprintf(command, sizeof command,
             "cd '%s' && mkdir -p OpenNI2/Drivers && cp '%s'/libOpenNI2.so.0 . && "
             "cp '%s'/OpenNI2/Drivers/libOniFile.so.0 OpenNI2/Drivers/ && cp '%s' OpenNI2/Drivers/",
             folder, library, library, path);
    if (system(command)) return -1;
    setenv("LD_LIBRARY_PATH", folder, 1);
    setenv("VIRTUAL_DEPTH_FOLDER", folder, 1);
    setenv("VIRTUAL_DEPTH_CONTROL", path_to("control"), 1);
    return execv(self, arguments);
}

int main(int count, char **arguments) {
    const char *private_folder = getenv("VIRTUAL_DEPTH_FOLDER");
    if (!private_folder && start_again(arguments)) {
        perror("test_openni2: no private libOpenNI2");
        return 1;
    }
    snprintf(folder, sizeof folder, "%s", private_folder);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(cameras_are_listed, start_test),
        cmocka_unit_test_setup(a_camera_in_use_elsewhere_is_listed_without_serial, start_test),
        cmocka_unit_test_setup(pixels_stamps_and_view, start_test),
        cmocka_unit_test_setup(drift_is_found, start_test),
        cmocka_unit_test_setup(a_camera_is_chosen_by_serial, start_test),
        cmocka_unit_test_setup(only_depth_is_given, start_test),
        cmocka_unit_test_setup(tenths_of_a_millimetre, start_test),
        cmocka_unit_test_setup(wishes_that_cant_be_met_are_told, start_test),
        cmocka_unit_test_setup(color_is_laid_over_the_depth, start_test),
        cmocka_unit_test_setup(mirrored_pictures_are_turned_round, start_test),
        cmocka_unit_test_setup(an_unplugged_camera_ends_the_source, start_test),
        cmocka_unit_test_setup(a_camera_that_comes_back_goes_on, start_test),
        cmocka_unit_test_setup(a_camera_that_moved_goes_on_and_is_watched_there, start_test),
        cmocka_unit_test_setup(a_camera_replugged_between_stop_and_start_starts, start_test),
        cmocka_unit_test_setup(silence_is_a_stall_and_no_unplug, start_test),
        cmocka_unit_test_setup(frames_without_sense_are_left_out, start_test),
        cmocka_unit_test_setup(missing_frames_are_counted, start_test),
        cmocka_unit_test_setup(a_slow_reader_is_told_of_drops, start_test),
        cmocka_unit_test_setup(a_wait_is_cancelled_at_once, start_test),
        cmocka_unit_test_setup(many_openings_leave_nothing, start_test),
        cmocka_unit_test_setup(a_recording_plays_back_the_same_pixels, start_test),
        cmocka_unit_test_setup(a_second_start_is_refused_and_the_source_goes_on, start_test),
        cmocka_unit_test_setup(a_recording_plays_at_its_pace, start_test),
        cmocka_unit_test_setup(a_recording_that_was_cut, start_test),
        cmocka_unit_test_setup(a_damaged_recording_ends_with_an_error, start_test),
        cmocka_unit_test_setup(what_is_no_recording_is_refused, start_test),
    };
    if (count > 1) cmocka_set_test_filter(arguments[1]);
    const int failed = cmocka_run_group_tests_name("openni2", tests, make_recording, remove_recording);
    if (__lsan_do_leak_check) __lsan_do_leak_check(); /* while the drivers are loaded, and have names */
    return failed;
}
