/* Recording folders, good and bad, made in a temporary folder. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fathom_drivers.h"
#include "recording/image_file.h"

#define WIDTH 64
#define HEIGHT 48

static char folder[256];
static char errors[2048], warnings[2048]; /* what was logged since the last open */
static int error_count, warning_count;

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user;
    char *out = level == FATHOM_LOG_ERROR ? errors : warnings;
    const size_t length = strlen(out);
    snprintf(out + length, 2048 - length, "%s\n", text);
    if (level == FATHOM_LOG_ERROR)
        error_count++;
    else
        warning_count++;
}

static void path_to(const char *file, char out[512]) {
    snprintf(out, 512, "%s/%s", folder, file);
}

static void write_text(const char *file, const char *text) {
    char path[512];
    path_to(file, path);
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    fputs(text, out);
    assert_int_equal(fclose(out), 0);
}

static void write_depth(const char *file, int width, int height, uint16_t value) {
    char path[512], error[256];
    uint16_t *pixels = malloc((size_t)width * (size_t)height * sizeof *pixels);
    assert_non_null(pixels);
    for (int i = 0; i < width * height; i++) pixels[i] = value;
    path_to(file, path);
    assert_int_equal(image_write_gray16(path, pixels, width, height, error, sizeof error), 0);
    free(pixels);
}

/* A small recording that is right in everything: three frames at 2 m. */
static int make_folder(void **state) {
    (void)state;
    char name[512];
    snprintf(folder, sizeof folder, "%s/fathom-test-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    if (!mkdtemp(folder)) return -1;
    path_to("depth", name);
    if (mkdir(name, 0700)) return -1;
    for (int i = 0; i < 3; i++) {
        snprintf(name, sizeof name, "depth/%d.png", i);
        write_depth(name, WIDTH, HEIGHT, 2000);
    }
    write_text("depth.txt", "# t file\n10.0 depth/0.png\n10.1 depth/1.png\n10.2 depth/2.png\n");
    write_text("calibration.txt", "60 61 31.5 23.5\n");
    write_text("rig.txt", "depth_scale 1000\n");
    return 0;
}

static int remove_folder(void **state) {
    (void)state;
    char command[300];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static int open_with(fathom_recording **recording, fathom_recording_options options) {
    *errors = *warnings = 0;
    error_count = warning_count = 0;
    options.struct_size = sizeof options;
    options.log = keep_log;
    return fathom_recording_open(recording, folder, &options);
}

static fathom_recording *open_good(void) {
    fathom_recording *recording;
    assert_int_equal(open_with(&recording, (fathom_recording_options){0}), FATHOM_OK);
    assert_int_equal(error_count, 0);
    return recording;
}

/* Opening fails with that code and exactly one error line that holds the words. */
static void expect_failure(int code, const char *words) {
    fathom_recording *recording;
    assert_int_equal(open_with(&recording, (fathom_recording_options){0}), code);
    assert_null(recording);
    assert_int_equal(error_count, 1);
    if (!strstr(errors, words)) fail_msg("expected \"%s\" in: %s", words, errors);
}

static void expect_one_warning(const char *words) {
    assert_int_equal(warning_count, 1);
    if (!strstr(warnings, words)) fail_msg("expected \"%s\" in: %s", words, warnings);
}

static void test_good(void **state) {
    (void)state;
    uint16_t pixels[WIDTH * HEIGHT];
    fathom_recording *r = open_good();
    assert_int_equal(warning_count, 0);
    assert_int_equal(r->frame_count, 3);
    assert_int_equal(r->camera.width, WIDTH);
    assert_int_equal(r->camera.height, HEIGHT);
    assert_true(r->frames[1].timestamp_ns == 10100000000);
    assert_int_equal(r->frames[1].line, 3);
    assert_false(r->intrinsics_assumed || r->depth_units_assumed);
    assert_int_equal(fathom_recording_read_depth(r, 2, pixels), FATHOM_OK);
    assert_int_equal(pixels[WIDTH * HEIGHT - 1], 2000);
    assert_int_equal(fathom_recording_read_depth(r, 3, pixels), FATHOM_ERROR_ARGUMENT);
    fathom_recording_close(r);
}

static void test_text_forms(void **state) {
    (void)state;
    /* CR LF, a byte order mark, blank lines, comments behind data, tabs, no newline at the end, stamps of our
     * days. */
    write_text("depth.txt", "\xEF\xBB\xBF# t file\r\n\r\n1305031453.374112 depth/0.png # first\r\n"
                            "\t1305031453.374112001\tdepth/1.png\r\n1305031454 depth/2.png");
    fathom_recording *r = open_good();
    assert_int_equal(warning_count, 0);
    assert_int_equal(r->frame_count, 3);
    assert_true(r->frames[0].timestamp_ns == 1305031453374112000);
    assert_true(r->frames[1].timestamp_ns == 1305031453374112001);
    assert_true(r->frames[2].timestamp_ns == 1305031454000000000);
    assert_string_equal(r->frames[0].file, "depth/0.png");
    fathom_recording_close(r);
    write_text("depth.txt", "-0.5 depth/0.png\n1.5e-3 depth/1.png\n");
    r = open_good();
    assert_true(r->frames[0].timestamp_ns == -500000000);
    assert_true(r->frames[1].timestamp_ns == 1500000);
    fathom_recording_close(r);
}

static void test_missing(void **state) {
    (void)state;
    char path[512];
    path_to("depth.txt", path);
    unlink(path);
    expect_failure(FATHOM_ERROR_NO_DATA, "depth.txt: No such file");
    write_text("depth.txt", "# nothing\n\n");
    expect_failure(FATHOM_ERROR_CONFIG, "depth.txt: no depth frames");
    write_text("depth.txt", "0 depth/none.png\n");
    expect_failure(FATHOM_ERROR_NO_DATA, "depth/none.png");
    fathom_recording *recording;
    *errors = 0;
    fathom_recording_options options = {.struct_size = sizeof options, .log = keep_log};
    assert_int_equal(fathom_recording_open(&recording, "/dev/null/nonexistent/folder", &options),
                     FATHOM_ERROR_NO_DATA);
    assert_non_null(strstr(errors, "/dev/null/nonexistent/folder/depth.txt"));
    write_text("depth.txt", "0 depth/0.png\n");
    write_text("imu.txt", "");
    assert_int_equal(open_with(&recording, (fathom_recording_options){.imu_file = "/dev/null/nonexistent"}),
                     FATHOM_ERROR_NO_DATA);
    assert_non_null(strstr(errors, "/dev/null/nonexistent"));
}

static void test_bad_depth_lines(void **state) {
    (void)state;
    write_text("depth.txt", "0 depth/0.png\nnot-a-time depth/1.png\n");
    expect_failure(FATHOM_ERROR_CONFIG, "depth.txt:2:");
    write_text("depth.txt", "# c\n0 depth/0.png\n0.1\n");
    expect_failure(FATHOM_ERROR_CONFIG, "depth.txt:3:");
    write_text("depth.txt", "nan depth/0.png\n");
    expect_failure(FATHOM_ERROR_CONFIG, "depth.txt:1:");
    write_text("depth.txt", "0.0,depth/0.png\n");
    expect_failure(FATHOM_ERROR_CONFIG, "depth.txt:1:");
}

static void test_stamps_go_back(void **state) {
    (void)state;
    write_text("depth.txt", "0.0 depth/0.png\n0.2 depth/1.png\n0.1 depth/2.png\n0.3 depth/2.png\n");
    fathom_recording *r = open_good();
    expect_one_warning("depth.txt:3: time stamp goes back");
    assert_int_equal(r->frame_count, 3);
    assert_true(r->frames[2].timestamp_ns == 300000000);
    fathom_recording_close(r);
    /* One stamp that leaps ahead mustn't cost all that follow. */
    write_text("depth.txt", "0.0 depth/0.png\n900 depth/1.png\n0.2 depth/2.png\n0.3 depth/2.png\n");
    r = open_good();
    expect_one_warning("depth.txt:2:");
    assert_int_equal(r->frame_count, 3);
    assert_true(r->frames[1].timestamp_ns == 200000000);
    fathom_recording_close(r);
    write_text("depth.txt", "1 depth/0.png\n1 depth/1.png\n0.5 depth/2.png\n");
    r = open_good();
    expect_one_warning("depth.txt:2: time stamp goes back: the first of 2 frames");
    assert_int_equal(r->frame_count, 1);
    fathom_recording_close(r);
}

static void test_bad_pictures(void **state) {
    (void)state;
    char path[512];
    uint16_t pixels[WIDTH * HEIGHT];
    path_to("depth/1.png", path);
    assert_int_equal(truncate(path, 60), 0);
    fathom_recording *r = open_good();
    assert_int_equal(fathom_recording_read_depth(r, 0, pixels), FATHOM_OK);
    assert_int_equal(fathom_recording_read_depth(r, 1, pixels), FATHOM_ERROR_NO_DATA);
    assert_int_equal(error_count, 1);
    assert_non_null(strstr(errors, "depth/1.png"));
    unlink(path);
    assert_int_equal(fathom_recording_read_depth(r, 1, pixels), FATHOM_ERROR_NO_DATA);
    write_depth("depth/1.png", WIDTH / 2, HEIGHT, 2000);
    assert_int_equal(fathom_recording_read_depth(r, 1, pixels), FATHOM_ERROR_SIZE);
    assert_non_null(strstr(errors, "32x48, where the recording's frames are 64x48"));
    write_depth("depth/1.png", 2 * WIDTH, HEIGHT, 2000);
    assert_int_equal(fathom_recording_read_depth(r, 1, pixels), FATHOM_ERROR_SIZE);
    assert_non_null(strstr(errors, "128x48, where the recording's frames are 64x48"));
    assert_int_equal(fathom_recording_read_depth(r, 2, pixels), FATHOM_OK);
    fathom_recording_close(r);
}

static void test_bad_intrinsics(void **state) {
    (void)state;
    static const char *const lines[] = {"0 0 31.5 23.5",       "60 -60 31.5 23.5",
                                        "nan 60 31.5 23.5",    "1 1 0.5 0.5",
                                        "60 60 31.5",          "60 60 100 23.5",
                                        "60 60 0 0",           "60 60 31.5 23.5 0 0",
                                        "60 60 31.5 23.5 abc", "60 60 31.5 23.5 0 0 0 0 inf",
                                        "60,60,31.5,23.5",     ""};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        write_text("calibration.txt", lines[i]);
        expect_failure(FATHOM_ERROR_CONFIG,
                       *lines[i] ? "calibration.txt:1:" : "calibration.txt: no intrinsics");
    }
    fathom_recording *r;
    write_text("calibration.txt", "60 60 31.5 23.5\n");
    assert_int_equal(open_with(&r, (fathom_recording_options){.camera = {.fx = 1, .fy = 1, .cx = 31, .cy = 23}}),
                     FATHOM_ERROR_ARGUMENT);
    assert_int_equal(open_with(&r, (fathom_recording_options){.camera = {.fx = 70, .fy = 71, .cx = 31, .cy = 23}}), FATHOM_OK);
    assert_float_equal(r->camera.fy, 71, 0);
    fathom_recording_close(r);
    write_text("calibration.txt", "60 60 31.5 23.5 0.1 0.2 0.3 0.4 0.5\n");
    r = open_good();
    assert_float_equal(r->camera.coefficients[4], 0.5, 0);
    assert_int_equal(r->camera.lens, FATHOM_LENS_FIVE);
    fathom_recording_close(r);
    write_text("calibration.txt", "60 60 31.5 23.5 0.1 0.2 0.3 0.4 0.5 0.6 0.7 0.8\n");
    r = open_good();
    for (int i = 0; i < 8; i++) assert_float_equal(r->camera.coefficients[i], 0.1 * (i + 1), 1e-12);
    assert_int_equal(r->camera.lens, FATHOM_LENS_RATIONAL);
    fathom_recording_close(r);
}

static void test_imu(void **state) {
    (void)state;
    write_text("imu.txt", "# t g a\n"
                          "9.90 0.1 0.2 0.3 1 2 9.8\n"
                          "9.91 0.1 nan 0.3 1 2 9.8\n" /* 3: not finite */
                          "9.92 0.1 0.2 0.3 1 2 9.8\n"
                          "9.915 0.1 0.2 0.3 1 2 9.8\n"  /* 5: goes back */
                          "9.92 0.1 0.2 0.3 1 2 9.8\n"   /* 6: again */
                          "9.93 0.1 0.2 0.3 1\n"         /* 7: short */
                          "9.94 0.1 0.2 0.3 1 2 x\n"     /* 8: no number */
                          "9.95 0.1 0.2 0.3 1 2 9.8 7\n" /* 9: long */
                          "9.96 0.1 0.2 0.3 1 2 1e300\n" /* 10: no float */
                          "9.97 -0.1 0.2 0.3 1 2 9.8\n");
    fathom_recording *r = open_good();
    expect_one_warning(
        "imu.txt:3: the first of 7 lines left out (3 unreadable, 2 not finite, 2 out of order)");
    assert_int_equal(r->imu_count, 3);
    assert_true(r->imu[2].timestamp_ns == 9970000000);
    assert_float_equal(r->imu[2].gyro[0], -0.1f, 0);
    assert_float_equal(r->imu[2].accel[2], 9.8f, 0);
    fathom_recording_close(r);
    write_text("imu.txt", "0 0 0 0 0 0 9.8\n0.01 0 0 0 0 0 9.8\n500 0 0 0 0 0 9.8\n0.02 0 0 0 0 0 9.8\n");
    r = open_good();
    assert_int_equal(r->imu_count, 3);
    assert_true(r->imu[2].timestamp_ns == 20000000);
    fathom_recording_close(r);
    assert_int_equal(open_with(&r, (fathom_recording_options){.imu_file = ""}), FATHOM_OK);
    assert_int_equal(r->imu_count, 0);
    assert_int_equal(warning_count, 0);
    fathom_recording_close(r);
}

static void test_rig(void **state) {
    (void)state;
    write_text("rig.txt", "# a rig\ndepth_scale 2000\nimu_to_camera_rotation 0 0 90\n"
                          "imu_to_camera_translation 0.01 -0.02 0.03\nimu_clock_offset -0.004\ngravity 9.81\n"
                          "color_intrinsics 500 501 320 240\ncolor_to_depth_rotation 0 0 0\n"
                          "color_to_depth_translation 0.025 0 0\nshutter rolling\n");
    fathom_recording *r = open_good();
    expect_one_warning("rig.txt:10: unknown key shutter");
    assert_float_equal(r->depth_units_per_metre, 2000, 0);
    assert_true(r->imu_clock_offset_ns == -4000000);
    /* A quarter turn about z takes x to y. */
    const double turned[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
    for (int i = 0; i < 9; i++) assert_float_equal(r->imu_to_camera_rotation[i], turned[i], 1e-12);
    assert_true(r->has_color_camera);
    assert_float_equal(r->color_to_depth.position[0], 0.025, 0);
    fathom_config config = {.struct_size = sizeof config, .gravity_m_s2 = 9.80665f};
    fathom_recording_configure(r, &config);
    assert_int_equal(config.depth_camera.width, WIDTH);
    assert_float_equal(config.depth_camera.fy, 61, 0);
    assert_float_equal(config.depth_units_per_metre, 2000, 0);
    assert_float_equal(config.imu_to_camera_translation[1], -0.02f, 0);
    assert_float_equal(config.gravity_m_s2, 9.81f, 0);
    assert_true(config.imu_clock_offset_ns == -4000000);
    fathom_recording_close(r);

    fathom_config described = {.struct_size = sizeof described, .gravity_m_s2 = 9.7f};
    described.depth_camera = (fathom_pinhole){.width = WIDTH, .height = HEIGHT};
    assert_int_equal(fathom_rig_configure(folder, &described, NULL, NULL), FATHOM_OK); /* the same without frames */
    assert_float_equal(described.depth_camera.fx, 60, 0);
    assert_float_equal(described.imu_to_camera_rotation[3], 1, 1e-6);
    assert_float_equal(described.imu_to_camera_translation[1], -0.02f, 0);
    assert_float_equal(described.gravity_m_s2, 9.81f, 0);
    assert_true(described.imu_clock_offset_ns == -4000000);

    write_text("rig.txt", "depth_scale 0\n");
    expect_failure(FATHOM_ERROR_CONFIG, "rig.txt:1: depth_scale");
    write_text("rig.txt", "depth_scale 1000\nimu_to_camera_rotation 0 90\n");
    expect_failure(FATHOM_ERROR_CONFIG, "rig.txt:2: imu_to_camera_rotation takes 3 numbers");
    write_text("rig.txt", "gravity 9.8 m/s^2\n");
    expect_failure(FATHOM_ERROR_CONFIG, "rig.txt:1:");
}

static void test_tum_defaults(void **state) {
    (void)state;
    char path[512];
    path_to("calibration.txt", path);
    unlink(path);
    path_to("rig.txt", path);
    unlink(path);
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "depth/%d.png", i);
        write_depth(path, WIDTH, HEIGHT, 10000);
    }
    fathom_recording *r = open_good();
    assert_int_equal(warning_count, 0); /* 2 m */
    assert_true(r->intrinsics_assumed && r->depth_units_assumed);
    assert_float_equal(r->camera.fx, 52.5, 1e-12);
    assert_float_equal(r->camera.cx, 31.5, 1e-12); /* the middle stays the middle */
    assert_float_equal(r->depth_units_per_metre, 5000, 0);
    fathom_recording_close(r);

    for (int i = 0; i < 3; i++) { /* millimetres, 1.5 m: 0.3 m at TUM's scale */
        snprintf(path, sizeof path, "depth/%d.png", i);
        write_depth(path, WIDTH, HEIGHT, 1500);
    }
    r = open_good();
    expect_one_warning("the median depth is 0.30 m; 1000 is likelier (1.50 m)");
    fathom_recording_close(r);
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "depth/%d.png", i);
        write_depth(path, WIDTH, HEIGHT, 45000);
    }
    r = open_good();
    expect_one_warning("the median depth is 9.00 m; 10000 is likelier (4.50 m)");
    fathom_recording_close(r);
    static const uint16_t nothing[] = {0, 65535};
    for (int k = 0; k < 2; k++) { /* frames that show nothing say nothing of the scale */
        for (int i = 0; i < 3; i++) {
            snprintf(path, sizeof path, "depth/%d.png", i);
            write_depth(path, WIDTH, HEIGHT, nothing[k]);
        }
        r = open_good();
        assert_int_equal(warning_count, 0);
        fathom_recording_close(r);
    }
    /* Who states a scale is believed. */
    assert_int_equal(open_with(&r, (fathom_recording_options){.depth_units_per_metre = 5000}), FATHOM_OK);
    assert_int_equal(warning_count, 0);
    assert_false(r->depth_units_assumed);
    fathom_recording_close(r);
}

static void test_poses(void **state) {
    (void)state;
    write_text("groundtruth.txt", "0.00 0 0 0 0 0 0 1\n"
                                  "0.02 1 2 3 0 0 1 0\n"
                                  "0.03 1 2 3 0 0 0 0\n" /* no rotation */
                                  "0.50 5 5 5 0 0 0 1\n");
    fathom_recording *r = open_good();
    expect_one_warning("groundtruth.txt:3:");
    fathom_pose pose;
    assert_int_equal(r->pose_count, 3);
    assert_int_equal(fathom_recording_pose_at(r, 10000000, &pose), FATHOM_OK);
    assert_float_equal(pose.position[2], 1.5, 1e-12);
    assert_float_equal(fabs(pose.orientation[2]), sqrt(0.5), 1e-12);
    assert_int_equal(fathom_recording_pose_at(r, 20000000, &pose), FATHOM_OK);
    assert_float_equal(pose.position[0], 1, 1e-12);
    assert_int_equal(fathom_recording_pose_at(r, 485000000, &pose), FATHOM_OK); /* the nearest, 15 ms away */
    assert_float_equal(pose.position[0], 5, 0);
    assert_int_equal(fathom_recording_pose_at(r, 515000000, &pose), FATHOM_OK);
    assert_int_equal(fathom_recording_pose_at(r, 250000000, &pose), FATHOM_ERROR_NO_DATA);
    assert_int_equal(fathom_recording_pose_at(r, -30000000, &pose), FATHOM_ERROR_NO_DATA);
    fathom_recording_close(r);
}

/* ---- confidences and noise ---- */

static void confidences_belong_to_frames_by_stamp(void **state) {
    (void)state;
    char path[512];
    uint8_t pixels[WIDTH * HEIGHT];
    path_to("sure", path);
    assert_int_equal(mkdir(path, 0700), 0);
    write_depth("sure/a.png", WIDTH, HEIGHT, 3);
    write_depth("sure/b.png", WIDTH, HEIGHT, 200);
    write_depth("sure/small.png", WIDTH / 2, HEIGHT, 1);
    write_text("confidence.txt", "10.2 sure/b.png\n10.0 sure/a.png\n10.05 sure/a.png\n");
    write_text("rig.txt", "depth_scale 1000\nconfidence_min 7\ndepth_noise 0.001 0.002 0.003\n");
    fathom_recording *r = open_good();
    expect_one_warning("confidence.txt: 1 line without a depth frame of that stamp");
    assert_int_equal(fathom_recording_read_confidence(r, 0, pixels), FATHOM_OK);
    assert_true(pixels[0] == 3 && pixels[WIDTH * HEIGHT - 1] == 3);
    assert_int_equal(fathom_recording_read_confidence(r, 1, pixels), FATHOM_ERROR_NO_DATA);
    assert_int_equal(fathom_recording_read_confidence(r, 2, pixels), FATHOM_OK);
    assert_int_equal(pixels[7], 200);
    assert_int_equal(fathom_recording_read_confidence(r, 3, pixels), FATHOM_ERROR_ARGUMENT);
    fathom_config config;
    fathom_config_init(&config);
    fathom_recording_configure(r, &config);
    assert_true(config.min_confidence == 7 && !config.refine_depth_noise);
    assert_true(config.depth_noise_base_m == 0.001f && config.depth_noise_slope == 0.002f &&
                config.depth_noise_growth_per_m == 0.003f);
    fathom_recording_close(r);

    write_text("confidence.txt", "10.0 sure/small.png\n10.1 sure/missing.png\n");
    write_text("rig.txt", "depth_scale 1000\n");
    r = open_good();
    assert_int_equal(fathom_recording_read_confidence(r, 0, pixels), FATHOM_ERROR_SIZE);
    assert_int_equal(fathom_recording_read_confidence(r, 1, pixels), FATHOM_ERROR_NO_DATA);
    fathom_config_init(&config);
    fathom_recording_configure(r, &config);
    assert_true(config.min_confidence == 0 && config.refine_depth_noise);
    fathom_recording_close(r);

    write_text("confidence.txt", "soon sure/a.png\n");
    expect_failure(FATHOM_ERROR_CONFIG, "confidence.txt:1:");
}

/* The pixels below confidence_min are invalid in what the source hands on. */
static void a_source_hands_on_sure_pixels_only(void **state) {
    (void)state;
    char path[512];
    path_to("sure", path);
    assert_int_equal(mkdir(path, 0700), 0);
    write_depth("sure/a.png", WIDTH, HEIGHT, 1);
    write_depth("sure/b.png", WIDTH, HEIGHT, 2);
    write_text("confidence.txt", "10.0 sure/a.png\n10.1 sure/b.png\n");
    write_text("rig.txt", "depth_scale 1000\nconfidence_min 2\n");
    fathom_source *source;
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    assert_int_equal(fathom_source_open(&source, folder, NULL), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    const int wanted[] = {0, 2000, 2000}; /* the last has no confidences */
    for (int i = 0; i < 3; i++) {
        while (fathom_source_read_depth(source, &frame) != FATHOM_OK)
            assert_int_equal(fathom_source_wait(source, 5000), FATHOM_OK);
        assert_int_equal(frame.depth->depth[5], wanted[i]);
    }
    fathom_source_close(source);
}

/* ---- Stray Scanner folders ---- */

static void remove_file(const char *file) {
    char path[512];
    path_to(file, path);
    assert_int_equal(remove(path), 0);
}

/* Three frames of a phone's LiDAR, with the app's own files in place of ours. */
static void make_stray(void) {
    char path[512];
    remove_file("depth.txt");
    remove_file("calibration.txt");
    remove_file("rig.txt");
    path_to("confidence", path);
    assert_int_equal(mkdir(path, 0700), 0);
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "depth/%06d.png", 2 * i);
        write_depth(path, WIDTH, HEIGHT, 2000);
        snprintf(path, sizeof path, "confidence/%06d.png", 2 * i);
        write_depth(path, WIDTH, HEIGHT, (uint16_t)i);
    }
    write_text("camera_matrix.csv", "1350.0, 0.0, 959.5\n0.0, 1353.0, 719.5\n0.0, 0.0, 1.0\n");
    write_text("odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n"
                               "100.5, 000000, 1, 2, 3, 0, 0, 0, 1\n"
                               "100.6, 000002, 1.1, 2, 3, 0, 0, 0.7071, 0.7071\n"
                               "100.7, 000004, 1.2, 2, 3, 0, 0, 1, 0\n");
    write_text("imu.csv", "timestamp, a_x, a_y, a_z, alpha_x, alpha_y, alpha_z\n"
                          "100.50, -9.6, 0.1, 0.5, 0.01, 0.02, 0.03\n"
                          "100.51, -9.7, 0.2, 0.6, 0.04, 0.05, 0.06\n");
}

static void a_stray_scanner_folder_is_read_as_it_is(void **state) {
    (void)state;
    uint8_t pixels[WIDTH * HEIGHT];
    uint16_t depth[WIDTH * HEIGHT];
    make_stray();
    fathom_recording *r = open_good();
    assert_int_equal(warning_count, 0);
    assert_true(r->frame_count == 3 && r->imu_count == 2 && r->pose_count == 3);
    assert_true(r->frames[1].timestamp_ns == 100600000000 && strcmp(r->frames[1].file, "depth/000002.png") == 0);
    /* 64 of the 1920 columns of the colour video; the middle stays the middle */
    assert_float_equal(r->camera.fx, 1350 / 30.0, 1e-9);
    assert_float_equal(r->camera.fy, 1353 / 30.0, 1e-9);
    assert_float_equal(r->camera.cx, 31.5, 1e-9);
    assert_float_equal(r->camera.cy, 23.5, 1e-9);
    assert_float_equal(r->depth_units_per_metre, 1000, 0);
    assert_true(!r->depth_units_assumed && !r->intrinsics_assumed);
    /* specific force points up, against CoreMotion's raw samples */
    assert_true(r->imu[1].accel[0] == 9.7f && r->imu[1].accel[1] == -0.2f && r->imu[1].gyro[2] == 0.06f);
    const double mounting[9] = {0, -1, 0, -1, 0, 0, 0, 0, -1};
    assert_memory_equal(r->imu_to_camera_rotation, mounting, sizeof mounting);
    assert_true(r->poses[1].pose.position[0] == 1.1 && fabs(r->poses[1].pose.orientation[3] - sqrt(0.5)) < 1e-4);
    assert_int_equal(fathom_recording_read_depth(r, 2, depth), FATHOM_OK);
    assert_int_equal(depth[0], 2000);
    assert_int_equal(fathom_recording_read_confidence(r, 2, pixels), FATHOM_OK);
    assert_int_equal(pixels[3], 2);
    assert_int_equal(r->min_confidence, 2);
    fathom_recording_close(r);

    write_text("rig.txt", "imu_clock_offset 0.01\nconfidence_min 1\n"); /* added by hand */
    r = open_good();
    assert_true(r->imu_clock_offset_ns == 10000000 && r->min_confidence == 1);
    fathom_recording_close(r);
}

static void a_stray_scanner_folder_with_faults(void **state) {
    (void)state;
    make_stray();
    /* columns that later versions append; a row that goes back, one that isn't a number, one that is cut */
    write_text("odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw, fx, fy, cx, cy\n"
                               "100.5, 000000, 1, 2, 3, 0, 0, 0, 1, 1350, 1350, 960, 720\n"
                               "100.4, 000001, 1, 2, 3, 0, 0, 0, 1, 1350, 1350, 960, 720\n"
                               "100.6, 000002, nan, 2, 3, 0, 0, 0, 1, 1350, 1350, 960, 720\n"
                               "100.7, 000004, 1, 2, 3, 0, 0, 0, 1, 1350, 1350, 960, 720\n"
                               "100.8, 000005, 1, 2");
    fathom_recording *r = open_good();
    assert_int_equal(r->frame_count, 2);
    assert_int_equal(r->pose_count, 2);
    assert_non_null(strstr(warnings, "odometry.csv:3: the first of 3 lines left out (2 unreadable, 0 not finite, 1 out of order)"));
    fathom_recording_close(r);
    remove_file("imu.csv");
    r = open_good();
    assert_int_equal(r->imu_count, 0);
    fathom_recording_close(r);
    write_text("camera_matrix.csv", "1350.0, 0.0\n");
    expect_failure(FATHOM_ERROR_CONFIG, "camera_matrix.csv:1: expected three rows");
    write_text("camera_matrix.csv", "13.0, 0.0, 959.5\n0.0, 13.0, 719.5\n0.0, 0.0, 1.0\n");
    expect_failure(FATHOM_ERROR_CONFIG, "camera_matrix.csv");
    write_text("odometry.csv", "timestamp, frame, x, y, z, qx, qy, qz, qw\n");
    expect_failure(FATHOM_ERROR_CONFIG, "odometry.csv: no frames");
}

int main(void) {
#define CASE(test) cmocka_unit_test_setup_teardown(test, make_folder, remove_folder)
    const struct CMUnitTest tests[] = {
        CASE(test_good),
        CASE(test_text_forms),
        CASE(test_missing),
        CASE(test_bad_depth_lines),
        CASE(test_stamps_go_back),
        CASE(test_bad_pictures),
        CASE(test_bad_intrinsics),
        CASE(test_imu),
        CASE(test_rig),
        CASE(test_tum_defaults),
        CASE(test_poses),
        CASE(confidences_belong_to_frames_by_stamp),
        CASE(a_source_hands_on_sure_pixels_only),
        CASE(a_stray_scanner_folder_is_read_as_it_is),
        CASE(a_stray_scanner_folder_with_faults),
    };
    return cmocka_run_group_tests_name("recording", tests, NULL, NULL);
}
