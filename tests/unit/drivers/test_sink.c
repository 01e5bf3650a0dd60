/* Recordings written by a sink and read back: values, what is on the disk at any moment, full disks, folders in the way. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fathom_drivers.h"

#define WIDTH 24
#define HEIGHT 18

static char top[256], folder[300];
static char log_text[2048];

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user, (void)level;
    snprintf(log_text + strlen(log_text), sizeof log_text - strlen(log_text), "%s\n", text);
}

static int make_top(void **state) {
    (void)state;
    snprintf(top, sizeof top, "%s/fathom-sink-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    return mkdtemp(top) ? 0 : -1;
}

static int remove_top(void **state) {
    (void)state;
    char command[300];
    snprintf(command, sizeof command, "rm -rf '%s'", top);
    return system(command);
}

/* Each test writes into a folder of its own. */
static int next_folder(void **state) {
    static int number;
    (void)state;
    *log_text = 0;
    snprintf(folder, sizeof folder, "%s/%d/deep", top, number++);
    return 0;
}

static fathom_sink *open_sink(bool force) {
    fathom_sink *sink;
    const fathom_sink_options options = {
        .struct_size = sizeof options, .force = force, .header = "a test\nof two lines", .log = keep_log};
    const int result = fathom_sink_open(&sink, folder, &options);
    if (result) fail_msg("%s: %s", fathom_error_name(result), log_text);
    return sink;
}

static fathom_sink_rig usual_rig(void) {
    return (fathom_sink_rig){
        .struct_size = sizeof(fathom_sink_rig),
        .has_imu = true,
        .camera = {.width = WIDTH, .height = HEIGHT, .fx = 20.5, .fy = 21.25, .cx = 11.5, .cy = 8.5},
        .depth_units_per_metre = 5000,
        .imu_to_camera_rotation_deg = {0, 0, 90},
        .imu_to_camera_translation_m = {0.025, -0.01, 0.004},
        .imu_clock_offset_ns = -12500000,
        .gravity = 9.81};
}

static uint16_t pixels[HEIGHT][WIDTH + 6];

static int put_frame(fathom_sink *sink, int index) {
    const fathom_depth_frame frame = {.struct_size = sizeof frame,
                                      .width = WIDTH,
                                      .height = HEIGHT,
                                      .row_stride_bytes = sizeof pixels[0],
                                      .timestamp_ns = 1000000000 + index * INT64_C(33333333),
                                      .depth = pixels[0]};
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH + 6; x++) pixels[y][x] = x < WIDTH ? (uint16_t)(5000 + 100 * index + 7 * y + x) : 9;
    return fathom_sink_write_depth(sink, &frame);
}

static fathom_imu_sample sample_at(int i) {
    const float v = (float)i / 3;
    return (fathom_imu_sample){
        .timestamp_ns = 900000001 + i * INT64_C(5000000), .gyro = {v, -v, 1e-7f * v}, .accel = {9.8f, v, -1e5f * v}};
}

static fathom_sink_status status_of(fathom_sink *sink) {
    fathom_sink_status status = FATHOM_STRUCT(fathom_sink_status);
    assert_int_equal(fathom_sink_get_status(sink, &status), FATHOM_OK);
    return status;
}

static fathom_recording *read_back(void) {
    fathom_recording *recording;
    const fathom_recording_options options = {.struct_size = sizeof options, .log = keep_log};
    const int result = fathom_recording_open(&recording, folder, &options);
    if (result) fail_msg("%s: %s", fathom_error_name(result), log_text);
    return recording;
}

static int64_t size_of(const char *file) {
    char path[600];
    struct stat is;
    snprintf(path, sizeof path, "%s/%s", folder, file);
    return stat(path, &is) ? -1 : (int64_t)is.st_size;
}

/* ---- tests ---- */

static void what_is_written_is_read_back_the_same(void **state) {
    (void)state;
    fathom_sink *sink = open_sink(false);
    const fathom_sink_rig rig = usual_rig();
    assert_int_equal(fathom_sink_write_rig(sink, &rig), FATHOM_OK);
    for (int i = 0; i < 50; i++) {
        const fathom_imu_sample sample = sample_at(i);
        assert_int_equal(fathom_sink_write_imu(sink, &sample, 1), FATHOM_OK);
    }
    for (int i = 0; i < 3; i++) {
        const fathom_pose pose = {{i, 2, -3.25}, {0, 0, sin(0.1 * i), cos(0.1 * i)}};
        assert_int_equal(fathom_sink_write_pose(sink, 1000000000 + i * INT64_C(33333333), &pose), FATHOM_OK);
        assert_int_equal(put_frame(sink, i), FATHOM_OK);
    }
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);

    fathom_recording *r = read_back();
    assert_int_equal(r->frame_count, 3);
    assert_int_equal(r->imu_count, 50);
    assert_int_equal(r->pose_count, 3);
    assert_int_equal(r->camera.width, WIDTH);
    assert_true(r->camera.fx == 20.5 && r->camera.fy == 21.25 && r->camera.cx == 11.5 && r->camera.cy == 8.5);
    assert_true(r->depth_units_per_metre == 5000 && r->gravity == 9.81);
    assert_int_equal(r->imu_clock_offset_ns, -12500000);
    assert_true(fabs(r->imu_to_camera_rotation[1] + 1) < 1e-12 && r->imu_to_camera_translation[1] == -0.01);
    for (int i = 0; i < 50; i++) {
        const fathom_imu_sample wanted = sample_at(i);
        assert_memory_equal(&r->imu[i], &wanted, sizeof wanted);
    }
    for (int i = 0; i < 3; i++) {
        uint16_t got[HEIGHT * WIDTH];
        assert_int_equal(r->frames[i].timestamp_ns, 1000000000 + i * INT64_C(33333333));
        assert_int_equal(r->poses[i].timestamp_ns, r->frames[i].timestamp_ns);
        assert_true(r->poses[i].pose.position[0] == i && r->poses[i].pose.position[2] == -3.25);
        assert_int_equal(fathom_recording_read_depth(r, i, got), FATHOM_OK);
        for (int k = 0; k < HEIGHT * WIDTH; k++)
            assert_int_equal(got[k], 5000 + 100 * i + 7 * (k / WIDTH) + k % WIDTH);
    }
    assert_string_equal(log_text, "");
    fathom_recording_close(r);
}

static void distortion_is_written_where_there_is_any(void **state) {
    (void)state;
    for (int32_t lens = FATHOM_LENS_FIVE; lens <= FATHOM_LENS_RATIONAL + 1; lens++) {
        fathom_sink *sink = open_sink(true);
        fathom_sink_rig rig = usual_rig();
        rig.camera.lens = FATHOM_LENS_RATIONAL + 1;
        if (lens > FATHOM_LENS_RATIONAL) assert_int_equal(fathom_sink_write_rig(sink, &rig), FATHOM_ERROR_ARGUMENT);
        const int count = lens == FATHOM_LENS_FIVE ? 5 : 8;
        rig.camera.lens = lens == FATHOM_LENS_FIVE ? FATHOM_LENS_FIVE : FATHOM_LENS_RATIONAL;
        for (int i = 0; i < 8; i++) rig.camera.coefficients[i] = i < count ? 0.1 * (i + 1) : 0;
        assert_int_equal(fathom_sink_write_rig(sink, &rig), FATHOM_OK);
        assert_int_equal(put_frame(sink, 0), FATHOM_OK);
        assert_int_equal(fathom_sink_close(sink), lens > FATHOM_LENS_RATIONAL ? FATHOM_ERROR_ARGUMENT : FATHOM_OK); /* the first error */
        fathom_recording *r = read_back();
        assert_int_equal(r->camera.lens, rig.camera.lens);
        for (int i = 0; i < 8; i++)
            assert_true(fabs(r->camera.coefficients[i] - rig.camera.coefficients[i]) < 1e-12);
        fathom_recording_close(r);
    }
}

static void the_folder_is_whole_at_any_moment(void **state) {
    (void)state;
    fathom_sink *sink = open_sink(false);
    const fathom_sink_rig rig = usual_rig();
    assert_int_equal(fathom_sink_write_rig(sink, &rig), FATHOM_OK);
    for (int i = 0; i < 4; i++) {
        const fathom_imu_sample sample = sample_at(i);
        assert_int_equal(put_frame(sink, i), FATHOM_OK);
        assert_int_equal(fathom_sink_write_imu(sink, &sample, 1), FATHOM_OK);
        assert_int_equal(fathom_sink_flush(sink), FATHOM_OK);
        fathom_recording *r = read_back(); /* as after a kill */
        assert_int_equal(r->frame_count, i + 1);
        assert_int_equal(r->imu_count, i + 1);
        fathom_recording_close(r);
        assert_int_equal(status_of(sink).frames, i + 1);
        assert_int_equal(status_of(sink).samples, i + 1);
    }
    const fathom_sink_status status = status_of(sink);
    assert_int_equal(status.imu_bytes, size_of("imu.txt"));
    assert_int_equal(status.last_ns - status.first_ns, 3 * INT64_C(33333333));
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);
}

/* A limit on the size of files takes a full disk's place. */
static void a_full_disk_is_told_and_what_came_before_stays_whole(void **state) {
    (void)state;
    struct rlimit before, narrow;
    fathom_sink *sink = open_sink(false);
    assert_int_equal(put_frame(sink, 0), FATHOM_OK);
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    narrow = (struct rlimit){4096, before.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &narrow), 0);
    int result = FATHOM_OK, given = 0;
    for (; given < 20000 && !result; given++) {
        const fathom_imu_sample sample = sample_at(given);
        result = fathom_sink_write_imu(sink, &sample, 1);
    }
    const int frame = put_frame(sink, 1); /* other files have room */
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(result, FATHOM_ERROR_WRITE);
    assert_int_equal(frame, FATHOM_OK);
    assert_non_null(strstr(fathom_sink_last_error(sink), "imu.txt: File too large"));
    const fathom_sink_status status = status_of(sink);
    assert_true(status.samples < given);
    assert_int_equal(fathom_sink_close(sink), FATHOM_ERROR_WRITE);
    assert_int_equal(size_of("imu.txt"), status.imu_bytes);
    *log_text = 0;
    fathom_recording *r = read_back();
    assert_int_equal(r->imu_count, status.samples);
    assert_int_equal(r->frame_count, 2);
    fathom_recording_close(r);
}

static void a_folder_that_isnt_empty_is_left_alone_without_force(void **state) {
    (void)state;
    fathom_sink *sink = open_sink(false);
    assert_int_equal(put_frame(sink, 0), FATHOM_OK);
    assert_int_equal(put_frame(sink, 1), FATHOM_OK);
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);
    char path[400];
    snprintf(path, sizeof path, "%s/notes.txt", folder);
    fclose(fopen(path, "w"));
    const fathom_sink_options options = {.struct_size = sizeof options, .log = keep_log};
    fathom_sink *refused = sink;
    assert_int_equal(fathom_sink_open(&refused, folder, &options), FATHOM_ERROR_WRITE);
    assert_null(refused);
    assert_non_null(strstr(log_text, "isn't empty"));
    assert_true(size_of("depth/000001.000000000.png") > 0);
    sink = open_sink(true); /* takes away the recording, and nothing else */
    assert_int_equal(size_of("depth/000001.000000000.png"), -1);
    assert_int_equal(size_of("depth/000001.033333333.png"), -1);
    assert_int_equal(size_of("notes.txt"), 0);
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);
}

static void images_are_written_beside_the_depth(void **state) {
    (void)state;
    uint8_t rgb[4 * 16];
    for (int i = 0; i < 64; i++) rgb[i] = (uint8_t)i;
    fathom_image image = {.struct_size = sizeof image,
                          .format = FATHOM_IMAGE_RGB8,
                          .width = 5,
                          .height = 4,
                          .stride_bytes = 16,
                          .timestamp_ns = 1500000000,
                          .data = rgb};
    fathom_sink *sink = open_sink(false);
    assert_int_equal(fathom_sink_write_image(sink, &image), FATHOM_OK);
    assert_true(size_of("rgb/000001.500000000.png") > 0);
    assert_true(size_of("rgb.txt") > 0);
    assert_int_equal(status_of(sink).images, 1);
    assert_int_equal(status_of(sink).frames, 0);
    image.format = FATHOM_IMAGE_JPEG;
    assert_int_equal(fathom_sink_write_image(sink, &image), FATHOM_ERROR_UNSUPPORTED);
    fathom_sink_close(sink);
}

static void confidence_is_written_beside_the_depth(void **state) {
    (void)state;
    uint8_t sure[HEIGHT][WIDTH + 3], got[HEIGHT * WIDTH];
    fathom_sink_rig rig = usual_rig();
    rig.min_confidence = 2;
    fathom_sink *sink = open_sink(false);
    for (int y = 0; y < HEIGHT; y++)
        for (int x = 0; x < WIDTH + 3; x++) sure[y][x] = x < WIDTH ? (uint8_t)((x + y) % 3) : 77;
    fathom_depth_frame frame = {.struct_size = sizeof frame,
                                .width = WIDTH,
                                .height = HEIGHT,
                                .row_stride_bytes = sizeof pixels[0],
                                .timestamp_ns = 1500000000,
                                .depth = pixels[0],
                                .confidence = sure[0],
                                .confidence_stride_bytes = sizeof sure[0]};
    assert_int_equal(fathom_sink_write_rig(sink, &rig), FATHOM_OK);
    assert_int_equal(put_frame(sink, 0), FATHOM_OK); /* without */
    assert_int_equal(fathom_sink_write_depth(sink, &frame), FATHOM_OK);
    frame.timestamp_ns++;
    frame.confidence_stride_bytes = WIDTH - 1;
    assert_int_equal(fathom_sink_write_depth(sink, &frame), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);

    fathom_recording *r = read_back();
    assert_int_equal(r->frame_count, 2);
    assert_int_equal(r->min_confidence, 2);
    assert_int_equal(fathom_recording_read_confidence(r, 0, got), FATHOM_ERROR_NO_DATA);
    assert_int_equal(fathom_recording_read_confidence(r, 1, got), FATHOM_OK);
    for (int i = 0; i < HEIGHT * WIDTH; i++) assert_int_equal(got[i], (i % WIDTH + i / WIDTH) % 3);
    fathom_recording_close(r);

    sink = open_sink(true); /* takes the old ones away */
    assert_int_equal(put_frame(sink, 0), FATHOM_OK);
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);
    assert_int_equal(size_of("confidence.txt"), -1);
    assert_int_equal(size_of("confidence/000001.500000000.png"), -1);
}

static void another_recordings_rig_and_samples_are_copied(void **state) {
    (void)state;
    char from[300], path[600];
    snprintf(from, sizeof from, "%s/from", top);
    mkdir(from, 0700);
    snprintf(path, sizeof path, "%s/rig.txt", from);
    FILE *file = fopen(path, "w");
    fputs("# by hand\ndepth_scale 1000\nimu_clock_offset 0.25", file);
    fclose(file);
    snprintf(path, sizeof path, "%s/imu.txt", from);
    file = fopen(path, "w");
    fputs("# samples\n1.0 1 2 3 4 5 6\n1.5 1 2 3 4 5 6", file);
    fclose(file);
    fathom_sink *sink = open_sink(false);
    fathom_sink_rig rig = usual_rig();
    rig.has_imu = false;
    rig.lines_of = from;
    assert_int_equal(fathom_sink_write_rig(sink, &rig), FATHOM_OK);
    assert_int_equal(fathom_sink_copy_imu(sink, from), FATHOM_OK);
    assert_int_equal(fathom_sink_copy_imu(sink, "/dev/null/nonexistent"), FATHOM_OK); /* has none */
    assert_int_equal(status_of(sink).samples, 2);
    assert_int_equal(put_frame(sink, 0), FATHOM_OK);
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);
    fathom_recording *r = read_back();
    assert_true(r->depth_units_per_metre == 5000);
    assert_int_equal(r->imu_clock_offset_ns, 250000000);
    assert_int_equal(r->imu_count, 2);
    fathom_recording_close(r);
}

static void *write_samples(void *sink) {
    for (int i = 0; i < 2000; i++) {
        const fathom_imu_sample sample = sample_at(i);
        if (fathom_sink_write_imu(sink, &sample, 1)) return sink;
    }
    return NULL;
}

/* The thread sanitizer watches. */
static void samples_may_come_on_another_thread_than_frames(void **state) {
    (void)state;
    pthread_t thread;
    void *failed;
    fathom_sink *sink = open_sink(false);
    assert_int_equal(pthread_create(&thread, NULL, write_samples, sink), 0);
    for (int i = 0; i < 20; i++) {
        assert_int_equal(put_frame(sink, i), FATHOM_OK);
        assert_int_equal(status_of(sink).frames, i + 1);
        assert_string_equal(fathom_sink_last_error(sink), "");
    }
    pthread_join(thread, &failed);
    assert_null(failed);
    assert_int_equal(fathom_sink_flush(sink), FATHOM_OK);
    assert_int_equal(status_of(sink).samples, 2000);
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);
}

static void wrong_arguments_are_refused(void **state) {
    (void)state;
    fathom_sink *sink;
    const fathom_imu_sample sample = sample_at(0);
    fathom_depth_frame frame = FATHOM_STRUCT(fathom_depth_frame);
    const fathom_pose nowhere = {{NAN, 0, 0}, {0, 0, 0, 1}};
    assert_int_equal(fathom_sink_open(NULL, folder, NULL), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_open(&sink, "", NULL), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_open(&sink, folder, &(fathom_sink_options){0}), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_write_imu(NULL, &sample, 1), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_close(NULL), FATHOM_OK);
    sink = open_sink(false);
    assert_int_equal(fathom_sink_write_depth(sink, &frame), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_write_imu(sink, NULL, 1), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_write_pose(sink, 0, &nowhere), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_write_rig(sink, &(fathom_sink_rig){0}), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_sink_close(sink), FATHOM_OK);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(what_is_written_is_read_back_the_same, next_folder),
        cmocka_unit_test_setup(distortion_is_written_where_there_is_any, next_folder),
        cmocka_unit_test_setup(the_folder_is_whole_at_any_moment, next_folder),
        cmocka_unit_test_setup(a_full_disk_is_told_and_what_came_before_stays_whole, next_folder),
        cmocka_unit_test_setup(a_folder_that_isnt_empty_is_left_alone_without_force, next_folder),
        cmocka_unit_test_setup(images_are_written_beside_the_depth, next_folder),
        cmocka_unit_test_setup(confidence_is_written_beside_the_depth, next_folder),
        cmocka_unit_test_setup(another_recordings_rig_and_samples_are_copied, next_folder),
        cmocka_unit_test_setup(samples_may_come_on_another_thread_than_frames, next_folder),
        cmocka_unit_test_setup(wrong_arguments_are_refused, next_folder),
    };
    return cmocka_run_group_tests(tests, make_top, remove_top);
}
