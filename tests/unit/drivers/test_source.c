/* Sources: names, addresses, the queue between threads, and a recording folder as a source. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <unistd.h>

#include "fathom_drivers.h"
#include "recording/image_file.h"
#include "monotonic.h"
#include "source_contract.h"
#include "source_queue.h"

#define WIDTH 32
#define HEIGHT 24
#define FRAMES 30
#define SAMPLES 240

static char folder[256];
static char log_text[4096];
static int log_errors, log_warnings;

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user;
    const size_t length = strlen(log_text);
    snprintf(log_text + length, sizeof log_text - length, "%s\n", text);
    log_errors += level == FATHOM_LOG_ERROR;
    log_warnings += level == FATHOM_LOG_WARNING;
}

static int clear_log(void **state) {
    (void)state;
    *log_text = 0;
    log_errors = log_warnings = 0;
    return 0;
}

static double seconds_since(int64_t then_ns) {
    return 1e-9 * (double)(monotonic_now_ns() - then_ns);
}

/* ---- a recording: frames 33 ms apart from 10 s on, samples every 4 ms from 9.95 s on ---- */

static uint16_t pixel_of(int frame, int i) {
    return (uint16_t)(1000 + 10 * frame + i % 7);
}

static FILE *create(const char *file) {
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, file);
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    return out;
}

static void write_samples(double from_s, double period_s, int count, double offset_s) {
    FILE *imu = create("imu.txt"), *rig = create("rig.txt");
    for (int i = 0; i < count; i++) fprintf(imu, "%.6f %d 0 0 0 0 9.8\n", from_s + period_s * i - offset_s, i);
    fprintf(rig, "depth_scale 1000\nimu_clock_offset %g\nimu_to_camera_rotation 0 0 90\n", offset_s);
    fclose(imu);
    fclose(rig);
}

static int make_folder(void **state) {
    (void)state;
    char path[512], error[256];
    uint16_t pixels[WIDTH * HEIGHT];
    snprintf(folder, sizeof folder, "%s/fathom-test-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    if (!mkdtemp(folder)) return -1;
    snprintf(path, sizeof path, "%s/depth", folder);
    if (mkdir(path, 0700)) return -1;
    FILE *list = create("depth.txt");
    for (int f = 0; f < FRAMES; f++) {
        for (int i = 0; i < WIDTH * HEIGHT; i++) pixels[i] = pixel_of(f, i);
        snprintf(path, sizeof path, "%s/depth/%02d.png", folder, f);
        if (image_write_gray16(path, pixels, WIDTH, HEIGHT, error, sizeof error)) return -1;
        fprintf(list, "%.6f depth/%02d.png\n", 10 + f * 0.033, f);
    }
    fclose(list);
    write_samples(9.95, 0.004, SAMPLES, 0.001);
    return 0;
}

static int remove_folder(void **state) {
    (void)state;
    char command[300];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static fathom_source *open_folder(fathom_source_options options) {
    fathom_source *source = NULL;
    options.struct_size = sizeof options;
    options.log = keep_log;
    assert_int_equal(fathom_source_open(&source, folder, &options), FATHOM_OK);
    assert_non_null(source);
    return source;
}

static fathom_source_status status_of(fathom_source *source) {
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(fathom_source_get_status(source, &status), FATHOM_OK);
    return status;
}

/* ---- names and addresses ---- */

static void every_error_has_its_name(void **state) {
    (void)state;
    for (int e = FATHOM_ERROR_UNSUPPORTED; e <= FATHOM_ERROR_TIMEOUT; e++)
        assert_int_equal(strncmp(fathom_error_name(e), "FATHOM_ERROR_", 13), 0);
    assert_string_equal(fathom_error_name(FATHOM_ERROR_UNPLUGGED), "FATHOM_ERROR_UNPLUGGED");
    assert_string_equal(fathom_error_name(FATHOM_ERROR_CONFIG), "FATHOM_ERROR_CONFIG");
    assert_non_null(fathom_error_name(-12345));
    assert_string_equal(fathom_source_state_name(FATHOM_SOURCE_STALLED), "stalled");
    assert_non_null(fathom_source_state_name((fathom_source_state)99));
}

static void refuses(const char *uri, fathom_source_options options, int error, const char *words) {
    fathom_source *source = (fathom_source *)&options;
    clear_log(NULL);
    options.struct_size = sizeof options;
    options.log = keep_log;
    assert_int_equal(fathom_source_open(&source, uri, &options), error);
    assert_null(source);
    assert_int_equal(log_errors, 1);
    if (!strstr(log_text, words)) fail_msg("'%s' isn't in: %s", words, log_text);
}

static void wrong_addresses_are_refused(void **state) {
    (void)state;
    const fathom_source_options none = {.struct_size = sizeof none, 0};
    refuses("", none, FATHOM_ERROR_ARGUMENT, "openni2");
    refuses("nowhere", none, FATHOM_ERROR_ARGUMENT, "nowhere: neither a folder");
    refuses("kinect:0", none, FATHOM_ERROR_ARGUMENT, "no driver is called 'kinect'");
    refuses("/no/such/folder", none, FATHOM_ERROR_ARGUMENT, "/no/such/folder");
    refuses("folder:", none, FATHOM_ERROR_ARGUMENT, "folder");
    refuses("folder:/no/such", none, FATHOM_ERROR_NO_DATA, "/no/such/depth.txt");
    refuses(NULL, none, FATHOM_ERROR_ARGUMENT, "NULL");
    assert_int_equal(fathom_source_open(NULL, "folder:x", NULL), FATHOM_ERROR_ARGUMENT);
}

static void wrong_options_are_refused(void **state) {
    (void)state;
    refuses(folder, (fathom_source_options){.width = -1, .height = 3}, FATHOM_ERROR_ARGUMENT, "width");
    refuses(folder, (fathom_source_options){.width = 640}, FATHOM_ERROR_ARGUMENT, "width");
    refuses(folder, (fathom_source_options){.rate_hz = NAN}, FATHOM_ERROR_ARGUMENT, "rate_hz");
    refuses(folder, (fathom_source_options){.speed = -1}, FATHOM_ERROR_ARGUMENT, "speed");
    refuses(folder, (fathom_source_options){.imu_capacity = -5}, FATHOM_ERROR_ARGUMENT, "imu_capacity");
    refuses(folder, (fathom_source_options){.frame_capacity = 100000}, FATHOM_ERROR_ARGUMENT,
            "frame_capacity");
}

static void null_sources_are_refused(void **state) {
    (void)state;
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    fathom_imu_sample sample;
    fathom_config config;
    fathom_config_init(&config);
    assert_int_equal(fathom_source_start(NULL), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_stop(NULL), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_wait(NULL, 0), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_read_depth(NULL, &frame), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_read_imu(NULL, &sample, 1), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_get_status(NULL, &status), FATHOM_ERROR_ARGUMENT);
    fathom_source_cancel(NULL);
    fathom_source_configure(NULL, &config);
    fathom_source_close(NULL);
}

static int collect(void *user, const fathom_source_info *info) {
    char *names = user;
    assert_non_null(info->driver);
    if (info->error == FATHOM_OK && info->kinds)
        assert_true(strlen(info->uri) > 0);
    else if (info->error)
        assert_true(strlen(info->problem) > 0);
    if (!strstr(names, info->driver))
        snprintf(names + strlen(names), 256 - strlen(names), "%s ", info->driver);
    return 0;
}

static int stop_at_once(void *user, const fathom_source_info *info) {
    (void)info;
    ++*(int *)user;
    return 1;
}

/* Those that aren't built say so. */
static void every_driver_is_named(void **state) {
    (void)state;
    char names[256] = "";
    fathom_source_driver_info driver = FATHOM_STRUCT(fathom_source_driver_info);
    int drivers = 0, calls = 0;
    assert_true(fathom_sources_enumerate("folder", collect, names, keep_log, NULL) == 0);
    assert_string_equal(names, "folder ");
    for (; fathom_source_driver(drivers, &driver); drivers++) {
        *names = 0;
        if (driver.built) continue;
        assert_int_equal(fathom_sources_enumerate(driver.name, collect, names, NULL, NULL), 0);
        assert_non_null(strstr(names, driver.name));
        char uri[64];
        snprintf(uri, sizeof uri, "%s:", driver.name);
        refuses(uri, (fathom_source_options){0}, FATHOM_ERROR_NOT_BUILT, "made without");
    }
    assert_int_equal(drivers, 6);
    assert_false(fathom_source_driver(-1, &driver));
    assert_int_equal(fathom_sources_enumerate("kinect", collect, names, keep_log, NULL),
                     FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sources_enumerate(NULL, NULL, NULL, keep_log, NULL), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sources_enumerate("folder", stop_at_once, &calls, NULL, NULL),
                     FATHOM_ERROR_STOPPED);
    assert_int_equal(calls, 1);
}

/* ---- the queue ---- */

static source_queue queue;

static void push_frame(int index) {
    source_slot *slot = source_queue_next_frame(&queue);
    slot->frame.index = index;
    for (int i = 0; i < WIDTH * HEIGHT; i++) slot->depth[i] = (uint16_t)index;
    source_queue_push_frame(&queue, slot);
}

static void the_oldest_gives_way_and_is_counted(void **state) {
    (void)state;
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    fathom_source_frame held = FATHOM_STRUCT(fathom_source_frame), frame = held;
    fathom_imu_sample samples[20];
    assert_int_equal(source_queue_make(&queue, 8, 3, WIDTH, HEIGHT, false), FATHOM_OK);
    source_queue_start(&queue);
    push_frame(0);
    assert_int_equal(source_queue_read_depth(&queue, &held), FATHOM_OK);
    for (int i = 1; i <= 10; i++) push_frame(i);
    for (int i = 0; i < WIDTH * HEIGHT; i++)
        assert_int_equal(held.depth->depth[i], 0); /* the reader's, still */
    for (int i = 8; i <= 10; i++) {
        assert_int_equal(source_queue_wait(&queue, 0), FATHOM_OK);
        assert_int_equal(source_queue_read_depth(&queue, &frame), FATHOM_OK);
        assert_int_equal(frame.index, i);
        assert_int_equal(frame.depth->depth[5], i);
        assert_int_equal(frame.depth->width, WIDTH);
    }
    assert_int_equal(source_queue_read_depth(&queue, &frame), FATHOM_ERROR_TIMEOUT);
    for (int i = 0; i < 13; i++) source_queue_push_imu(&queue, &(fathom_imu_sample){.timestamp_ns = i});
    assert_int_equal(source_queue_read_imu(&queue, samples, 3), 3);
    assert_int_equal(samples[0].timestamp_ns, 5);
    assert_int_equal(source_queue_read_imu(&queue, samples, 20), 5);
    assert_int_equal(samples[4].timestamp_ns, 12);
    assert_int_equal(source_queue_read_imu(&queue, samples, 20), 0);
    source_queue_count_lost(&queue, 2);
    source_queue_count_malformed(&queue, 3);
    source_queue_status(&queue, &status);
    assert_int_equal(status.frames, 11);
    assert_int_equal(status.frames_dropped, 7);
    assert_int_equal(status.samples, 13);
    assert_int_equal(status.samples_dropped, 5);
    assert_int_equal(status.lost, 2);
    assert_int_equal(status.malformed, 3);
    assert_int_equal(status.state, FATHOM_SOURCE_RUNNING);
    source_queue_stop(&queue);
    assert_int_equal(source_queue_wait(&queue, 10), FATHOM_ERROR_ARGUMENT); /* not started */
    source_queue_free(&queue);
}

/* The reader gives back a slot of a lower number meanwhile. */
static void the_slot_to_fill_is_the_same_until_it_is_pushed(void **state) {
    (void)state;
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    assert_int_equal(source_queue_make(&queue, 0, 2, WIDTH, HEIGHT, false), FATHOM_OK);
    source_queue_start(&queue);
    push_frame(0);
    push_frame(1);
    assert_int_equal(source_queue_read_depth(&queue, &frame), FATHOM_OK);
    source_slot *slot = source_queue_next_frame(&queue);
    assert_ptr_equal(source_queue_next_frame(&queue), slot);
    assert_int_equal(source_queue_read_depth(&queue, &frame), FATHOM_OK);
    assert_ptr_equal(source_queue_next_frame(&queue), slot);
    source_queue_push_frame(&queue, slot);
    assert_ptr_not_equal(source_queue_next_frame(&queue), slot);
    source_queue_stop(&queue);
    source_queue_free(&queue);
}

static void what_is_left_is_read_before_the_end(void **state) {
    (void)state;
    fathom_imu_sample sample;
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(source_queue_make(&queue, 8, 0, 0, 0, false), FATHOM_OK);
    source_queue_start(&queue);
    source_queue_push_imu(&queue, &(fathom_imu_sample){.timestamp_ns = 1});
    source_queue_end(&queue, FATHOM_ERROR_UNPLUGGED);
    assert_int_equal(source_queue_wait(&queue, 100), FATHOM_OK);
    assert_int_equal(source_queue_read_imu(&queue, &sample, 1), 1);
    assert_int_equal(source_queue_wait(&queue, 100), FATHOM_ERROR_UNPLUGGED);
    assert_int_equal(source_queue_wait(&queue, -1), FATHOM_ERROR_UNPLUGGED);
    source_queue_status(&queue, &status);
    assert_int_equal(status.state, FATHOM_SOURCE_UNPLUGGED);
    assert_int_equal(status.unplugged, 1);
    source_queue_stop(&queue);
    source_queue_free(&queue);
}

static void a_device_that_comes_back(void **state) {
    (void)state;
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(source_queue_make(&queue, 8, 0, 0, 0, false), FATHOM_OK);
    source_queue_start(&queue);
    source_queue_unplugged(&queue);
    source_queue_unplugged(&queue);
    source_queue_status(&queue, &status);
    assert_int_equal(status.state, FATHOM_SOURCE_UNPLUGGED);
    assert_int_equal(source_queue_wait(&queue, 1), FATHOM_ERROR_TIMEOUT); /* it is looked for */
    source_queue_replugged(&queue);
    source_queue_status(&queue, &status);
    assert_int_equal(status.state, FATHOM_SOURCE_RUNNING);
    assert_int_equal(status.unplugged, 1);
    assert_int_equal(status.reconnects, 1);
    source_queue_stop(&queue);
    source_queue_free(&queue);
}

static void silence_is_a_stall(void **state) {
    (void)state;
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    assert_int_equal(source_queue_make(&queue, 4, 0, 0, 0, false), FATHOM_OK);
    source_queue_start(&queue);
    source_queue_push_imu(&queue, &(fathom_imu_sample){0});
    usleep(300000);
    source_queue_status(&queue, &status);
    assert_int_equal(status.state, FATHOM_SOURCE_RUNNING);
    usleep(300000);
    source_queue_status(&queue, &status);
    assert_int_equal(status.state, FATHOM_SOURCE_STALLED);
    source_queue_push_imu(&queue, &(fathom_imu_sample){0});
    source_queue_status(&queue, &status);
    assert_int_equal(status.state, FATHOM_SOURCE_RUNNING);
    assert_int_equal(status.stalls, 1);
    source_queue_stop(&queue);
    source_queue_free(&queue);
}

/* Two threads, as fast as they can; every sample is read or counted as dropped, in order. */
#define MANY 50000

static void *fill(void *user) {
    for (int i = 0; i < MANY; i++) {
        if (user && !source_queue_wait_for_room(&queue, false)) break;
        source_queue_push_imu(&queue, &(fathom_imu_sample){.timestamp_ns = i});
    }
    source_queue_end(&queue, FATHOM_ERROR_ENDED);
    return NULL;
}

static int64_t drain(bool patient) {
    pthread_t thread;
    fathom_imu_sample samples[16];
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    int64_t read = 0, last = -1;
    assert_int_equal(source_queue_make(&queue, 64, 0, 0, 0, false), FATHOM_OK);
    source_queue_start(&queue);
    assert_int_equal(pthread_create(&thread, NULL, fill, patient ? &queue : NULL), 0);
    int result;
    while ((result = source_queue_wait(&queue, 5000)) == FATHOM_OK)
        for (int n; (n = source_queue_read_imu(&queue, samples, 16)) > 0; read += n)
            for (int i = 0; i < n; i++) {
                assert_true(samples[i].timestamp_ns > last);
                last = samples[i].timestamp_ns;
            }
    assert_int_equal(result, FATHOM_ERROR_ENDED);
    pthread_join(thread, NULL);
    source_queue_status(&queue, &status);
    assert_int_equal(status.samples, MANY);
    assert_int_equal(read + status.samples_dropped, MANY);
    assert_int_equal(last, MANY - 1);
    assert_int_equal(status.state, FATHOM_SOURCE_AT_END);
    source_queue_stop(&queue);
    source_queue_free(&queue);
    return status.samples_dropped;
}

static void two_threads_lose_nothing_uncounted(void **state) {
    (void)state;
    drain(false);
    assert_int_equal(drain(true), 0);
}

/* ---- waiting ---- */

static int64_t cancelled_ns;

static void *cancel_soon(void *user) {
    usleep(50000);
    cancelled_ns = monotonic_now_ns();
    fathom_source_cancel(user);
    return NULL;
}

static fathom_source *signalled;

static void on_alarm(int number) {
    (void)number;
    cancelled_ns = monotonic_now_ns();
    fathom_source_cancel(signalled);
}

static void a_wait_is_cancelled_at_once(void **state) {
    (void)state;
    pthread_t thread;
    fathom_source *source =
        open_folder((fathom_source_options){.speed = 0.001, .kinds = FATHOM_SOURCE_DEPTH});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    assert_int_equal(pthread_create(&thread, NULL, cancel_soon, source), 0);
    assert_int_equal(fathom_source_wait(source, -1), FATHOM_ERROR_CANCELLED);
    assert_true(seconds_since(cancelled_ns) < 0.05);
    pthread_join(thread, NULL);

    /* before the wait */
    fathom_source_cancel(source);
    assert_int_equal(fathom_source_wait(source, -1), FATHOM_ERROR_CANCELLED);

    /* from a signal handler */
    signalled = source;
    signal(SIGALRM, on_alarm);
    const struct itimerval soon = {.it_value = {.tv_usec = 50000}};
    setitimer(ITIMER_REAL, &soon, NULL);
    assert_int_equal(fathom_source_wait(source, 5000), FATHOM_ERROR_CANCELLED);
    assert_true(seconds_since(cancelled_ns) < 0.05);
    signal(SIGALRM, SIG_DFL);

    /* and then a wait works as before */
    const int64_t before_ns = monotonic_now_ns();
    assert_int_equal(fathom_source_wait(source, 80), FATHOM_ERROR_TIMEOUT);
    assert_true(seconds_since(before_ns) > 0.079 && seconds_since(before_ns) < 0.5);
    assert_int_equal(fathom_source_wait(source, 0), FATHOM_ERROR_TIMEOUT);
    const int64_t stop_ns = monotonic_now_ns();
    fathom_source_close(source); /* doesn't wait for the next frame */
    assert_true(seconds_since(stop_ns) < 0.5);
}

/* ---- a folder ---- */

/* Reads it to its end as a rig would: the samples first. */
static void read_all(fathom_source *source, int *frames, int *samples) {
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    fathom_imu_sample some[32];
    int64_t newest_ns = 0;
    int result;
    *frames = *samples = 0;
    while ((result = fathom_source_wait(source, 5000)) == FATHOM_OK) {
        for (int n; (n = fathom_source_read_imu(source, some, 32)) > 0;) {
            for (int i = 0; i < n; i++, ++*samples) assert_true((int)some[i].gyro[0] == *samples);
            newest_ns = some[n - 1].timestamp_ns + 1000000;
        }
        while (fathom_source_read_depth(source, &frame) == FATHOM_OK) {
            assert_int_equal(frame.index, *frames);
            assert_int_equal(frame.depth->timestamp_ns, 10000000000 + *frames * INT64_C(33000000));
            assert_int_equal(frame.depth->width, WIDTH);
            assert_true(frame.arrival_ns <= monotonic_now_ns());
            for (int i = 0; i < WIDTH * HEIGHT; i++)
                assert_int_equal(frame.depth->depth[i], pixel_of(*frames, i));
            ++*frames;
        }
    }
    assert_int_equal(result, FATHOM_ERROR_ENDED);
    assert_true(newest_ns > 0);
}

/* Queues far smaller than the recording: the reader's pace is the folder's. */
static void at_full_speed_nothing_is_dropped(void **state) {
    (void)state;
    int frames, samples;
    fathom_source *source = open_folder((fathom_source_options){.imu_capacity = 5, .frame_capacity = 1});
    for (int round = 1; round <= 2; round++) { /* a second start begins anew */
        assert_int_equal(status_of(source).state, round == 1 ? FATHOM_SOURCE_STOPPED : FATHOM_SOURCE_AT_END);
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
        assert_int_equal(fathom_source_start(source), FATHOM_ERROR_ARGUMENT);
        read_all(source, &frames, &samples);
        assert_int_equal(frames, FRAMES);
        assert_int_equal(samples, SAMPLES);
        assert_int_equal(status_of(source).frames, FRAMES * round);
        assert_int_equal(status_of(source).frames_dropped, 0);
        assert_int_equal(status_of(source).samples_dropped, 0);
        assert_int_equal(status_of(source).stalls, 0);
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
    }
    fathom_source_close(source);
}

/* The recording lasts 1.007 s from its first sample to its last frame. */
static void at_a_pace_it_takes_its_time(void **state) {
    (void)state;
    int frames, samples;
    fathom_source *source = open_folder((fathom_source_options){.speed = 2, .frame_capacity = 40});
    const int64_t start_ns = monotonic_now_ns();
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    read_all(source, &frames, &samples);
    const double took = seconds_since(start_ns);
    assert_true(took > 0.5 && took < 0.8);
    assert_int_equal(frames, FRAMES);
    assert_int_equal(samples, SAMPLES);
    fathom_source_close(source);
}

static void at_a_pace_a_slow_reader_loses_frames(void **state) {
    (void)state;
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    fathom_source *source = open_folder((fathom_source_options){.speed = 10, .frame_capacity = 2});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    for (int i = 0; i < 1000 && status_of(source).frames < FRAMES; i++) usleep(10000);
    assert_true(status_of(source).frames >= FRAMES);
    assert_int_equal(status_of(source).frames_dropped, FRAMES - 2);
    assert_int_equal(fathom_source_read_depth(source, &frame), FATHOM_OK);
    assert_int_equal(frame.index, FRAMES - 2);
    fathom_source_close(source);
}

static void one_kind_only(void **state) {
    (void)state;
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    fathom_imu_sample samples[SAMPLES];
    fathom_config config;
    fathom_config_init(&config);
    fathom_source *source =
        open_folder((fathom_source_options){.kinds = FATHOM_SOURCE_IMU, .imu_capacity = SAMPLES});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    for (int i = 0; i < 1000 && status_of(source).samples < SAMPLES; i++) usleep(10000);
    assert_true(status_of(source).samples >= SAMPLES);
    assert_int_equal(fathom_source_read_depth(source, &frame), FATHOM_ERROR_TIMEOUT);
    assert_int_equal(fathom_source_read_imu(source, samples, SAMPLES), SAMPLES);
    assert_int_equal(fathom_source_wait(source, 1000), FATHOM_ERROR_ENDED);
    assert_int_equal(status_of(source).camera.width, 0);
    fathom_source_configure(source, &config);
    assert_int_equal(config.depth_camera.width, 640);
    assert_int_equal(config.imu_clock_offset_ns, 1000000);
    fathom_source_close(source);

    source = open_folder((fathom_source_options){.kinds = FATHOM_SOURCE_DEPTH});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    assert_int_equal(fathom_source_wait(source, 1000), FATHOM_OK);
    assert_int_equal(fathom_source_read_imu(source, samples, SAMPLES), 0);
    fathom_source_configure(source, &config);
    assert_int_equal(config.depth_camera.width, WIDTH);
    assert_true(config.depth_units_per_metre == 1000);
    assert_true(fabsf(config.imu_to_camera_rotation[1] + 1) < 1e-6f);
    fathom_source_close(source);
}

static void at_a_pace_samples_come_when_they_are_due_on_the_depth_clock(void **state) {
    (void)state;
    write_samples(9.95, 0.004, SAMPLES, 5);
    fathom_source *source = open_folder((fathom_source_options){.speed = 1, .kinds = FATHOM_SOURCE_IMU});
    const int64_t start_ns = monotonic_now_ns();
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    for (int i = 0; i < 10; i++) {
        usleep(10000);
        const int64_t samples = status_of(source).samples;
        assert_true((double)samples <= seconds_since(start_ns) / 0.004 + 1);
    }
    assert_int_equal(fathom_source_wait(source, 1000), FATHOM_OK); /* and no later */
    fathom_source_close(source);
    write_samples(9.95, 0.004, SAMPLES, 0.001);
}

/* With frame_capacity 1 the folder waits for the reader when it has the samples for the second frame. */
static void samples_come_before_a_frame_by_the_depth_clock(void **state) {
    (void)state;
    write_samples(9.95, 0.004, SAMPLES, 0.1);
    fathom_source *source = open_folder((fathom_source_options){.frame_capacity = 1});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    for (int i = 0; i < 500 && status_of(source).frames < 1; i++) usleep(2000);
    usleep(50000);
    /* 9.950, 9.954 ... 10.030, and one beyond the frame at 10.033 */
    assert_int_equal(status_of(source).samples, 22);
    fathom_source_close(source);
    write_samples(9.95, 0.004, SAMPLES, 0.001);
}

static void samples_from_more_than_ten_seconds_before_the_first_frame_are_left_out(void **state) {
    (void)state;
    fathom_imu_sample sample;
    write_samples(-5, 0.1, 160, 0.25);
    fathom_source *source = open_folder((fathom_source_options){0});
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    assert_int_equal(fathom_source_wait(source, 1000), FATHOM_OK);
    while (fathom_source_read_imu(source, &sample, 1) == 0) usleep(1000);
    assert_int_equal((int)sample.gyro[0], 50); /* at 0 s on the depth clock */
    fathom_source_close(source);
    write_samples(9.95, 0.004, SAMPLES, 0.001);
}

/* A frame cut short is left out, and the recording goes on. */
static void a_damaged_frame_is_counted(void **state) {
    (void)state;
    char path[512];
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    int frames = 0;
    snprintf(path, sizeof path, "%s/depth/07.png", folder);
    assert_int_equal(truncate(path, 60), 0);
    fathom_source *source = open_folder((fathom_source_options){.kinds = FATHOM_SOURCE_DEPTH});
    clear_log(NULL);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    while (fathom_source_wait(source, 5000) == FATHOM_OK)
        while (fathom_source_read_depth(source, &frame) == FATHOM_OK)
            assert_true(frame.index != 7 && ++frames);
    assert_int_equal(frames, FRAMES - 1);
    assert_int_equal(status_of(source).malformed, 1);
    assert_int_equal(log_errors, 0);
    assert_int_equal(log_warnings, 1);
    assert_non_null(strstr(log_text, "07.png"));
    fathom_source_close(source);
}

static void a_second_start_is_refused_and_the_source_goes_on(void **state) {
    (void)state;
    check_source_contract(folder, NULL);
}

static atomic_bool looking;

static void *look_and_cancel(void *source) {
    while (looking) {
        assert_int_equal(status_of(source).camera.width, WIDTH);
        fathom_source_cancel(source);
    }
    return NULL;
}

/* What the header allows; the thread sanitizer watches. */
static void status_and_cancel_may_run_beside_everything_but_close(void **state) {
    (void)state;
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    fathom_imu_sample samples[16];
    pthread_t thread;
    fathom_source *source = open_folder((fathom_source_options){.imu_capacity = 5, .frame_capacity = 1});
    looking = true;
    assert_int_equal(pthread_create(&thread, NULL, look_and_cancel, source), 0);
    for (int round = 0; round < 3; round++) {
        int result, frames = 0;
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
        while ((result = fathom_source_wait(source, 5000)) == FATHOM_OK || result == FATHOM_ERROR_CANCELLED) {
            while (fathom_source_read_depth(source, &frame) == FATHOM_OK) frames++;
            while (fathom_source_read_imu(source, samples, 16) > 0) {
            }
        }
        assert_int_equal(result, FATHOM_ERROR_ENDED);
        assert_int_equal(frames, FRAMES);
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
    }
    looking = false;
    pthread_join(thread, NULL);
    fathom_source_close(source);
}

/* Stopped and closed at any moment. */
static void it_can_be_closed_at_any_time(void **state) {
    (void)state;
    for (int i = 0; i < 40; i++) {
        fathom_source *source =
            open_folder((fathom_source_options){.speed = i % 2 ? 1 : 0, .imu_capacity = 4});
        if (i % 4) assert_int_equal(fathom_source_start(source), FATHOM_OK);
        usleep((useconds_t)(i * 200));
        if (i % 3 == 0) assert_int_equal(fathom_source_stop(source), FATHOM_OK);
        fathom_source_close(source);
    }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_error_has_its_name),
        cmocka_unit_test(wrong_addresses_are_refused),
        cmocka_unit_test(wrong_options_are_refused),
        cmocka_unit_test(null_sources_are_refused),
        cmocka_unit_test(every_driver_is_named),
        cmocka_unit_test(the_oldest_gives_way_and_is_counted),
        cmocka_unit_test(the_slot_to_fill_is_the_same_until_it_is_pushed),
        cmocka_unit_test(what_is_left_is_read_before_the_end),
        cmocka_unit_test(a_device_that_comes_back),
        cmocka_unit_test(silence_is_a_stall),
        cmocka_unit_test(two_threads_lose_nothing_uncounted),
        cmocka_unit_test_setup(a_wait_is_cancelled_at_once, clear_log),
        cmocka_unit_test_setup(at_full_speed_nothing_is_dropped, clear_log),
        cmocka_unit_test_setup(at_a_pace_it_takes_its_time, clear_log),
        cmocka_unit_test_setup(at_a_pace_a_slow_reader_loses_frames, clear_log),
        cmocka_unit_test_setup(at_a_pace_samples_come_when_they_are_due_on_the_depth_clock, clear_log),
        cmocka_unit_test_setup(samples_come_before_a_frame_by_the_depth_clock, clear_log),
        cmocka_unit_test_setup(samples_from_more_than_ten_seconds_before_the_first_frame_are_left_out, clear_log),
        cmocka_unit_test_setup(one_kind_only, clear_log),
        cmocka_unit_test_setup(a_second_start_is_refused_and_the_source_goes_on, clear_log),
        cmocka_unit_test_setup(status_and_cancel_may_run_beside_everything_but_close, clear_log),
        cmocka_unit_test_setup(it_can_be_closed_at_any_time, clear_log),
        cmocka_unit_test_setup(a_damaged_frame_is_counted, clear_log),
    };
    return cmocka_run_group_tests_name("source", tests, make_folder, remove_folder);
}
