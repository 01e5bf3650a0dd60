/* Callers built against an older or a newer fathom_drivers.h: nothing is read or written beyond what they have. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fathom_drivers.h"

#define UNTOUCHED 0xA5

static char folder[256];

static int make_recording(void **state) {
    (void)state;
    char path[300];
    const fathom_depth_frame frame = {.struct_size = sizeof frame,
                                      .width = 16,
                                      .height = 16,
                                      .depth = (const uint16_t[256]){[5] = 7},
                                      .timestamp_ns = 1000000000};
    fathom_sink *sink;
    snprintf(folder, sizeof folder, "%s/fathom-structs-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    if (!mkdtemp(folder)) return -1;
    if (fathom_sink_open(&sink, folder, NULL) || fathom_sink_write_depth(sink, &frame) || fathom_sink_close(sink)) return -1;
    snprintf(path, sizeof path, "%s/rig.txt", folder);
    FILE *rig = fopen(path, "w");
    if (!rig) return -1;
    fputs("depth_scale 2000\nimu_to_camera_translation 1 2 3\n", rig);
    fclose(rig);
    return 0;
}

static int remove_recording(void **state) {
    (void)state;
    char command[300];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

/* Room for any struct and 64 bytes beyond, that says it holds size bytes. */
static void *callers(size_t size) {
    static union {
        int64_t aligned;
        unsigned char bytes[4096];
    } room;
    const uint32_t claimed = (uint32_t)size;
    memset(room.bytes, UNTOUCHED, sizeof room.bytes);
    memcpy(room.bytes, &claimed, sizeof claimed);
    return room.bytes;
}

static void are(const void *from, size_t begin, size_t end, int value) {
    for (size_t i = begin; i < end; i++) assert_int_equal(((const unsigned char *)from)[i], value);
}

static fathom_source *open_folder(void) {
    fathom_source *source;
    assert_int_equal(fathom_source_open(&source, folder, NULL), FATHOM_OK);
    return source;
}

static void an_older_callers_status_isnt_overrun(void **state) {
    (void)state;
    fathom_source *source = open_folder();
    const size_t old = offsetof(fathom_source_status, camera);
    fathom_source_status *status = callers(old);
    assert_int_equal(fathom_source_get_status(source, status), FATHOM_OK);
    assert_int_equal(status->kinds, FATHOM_SOURCE_DEPTH);
    assert_int_equal(status->struct_size, old);
    are(status, old, old + 500, UNTOUCHED);
    fathom_source_close(source);
}

static void a_newer_callers_status_is_zero_beyond_the_librarys(void **state) {
    (void)state;
    fathom_source *source = open_folder();
    const size_t newer = sizeof(fathom_source_status) + 40;
    fathom_source_status *status = callers(newer);
    assert_int_equal(fathom_source_get_status(source, status), FATHOM_OK);
    assert_int_equal(status->camera.width, 16);
    assert_int_equal(status->struct_size, newer);
    are(status, sizeof *status, newer, 0);
    are(status, newer, newer + 64, UNTOUCHED);
    fathom_source_close(source);
}

static void an_older_callers_frame_isnt_overrun(void **state) {
    (void)state;
    fathom_source *source = open_folder();
    const size_t old = offsetof(fathom_source_frame, arrival_ns);
    fathom_source_frame *frame = callers(old);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    assert_int_equal(fathom_source_wait(source, 2000), FATHOM_OK);
    assert_int_equal(fathom_source_read_depth(source, frame), FATHOM_OK);
    assert_int_equal(frame->depth->depth[5], 7);
    are(frame, old, old + 200, UNTOUCHED);
    fathom_source_close(source);
}

static void an_older_callers_options_take_defaults(void **state) {
    (void)state;
    fathom_source *source;
    const size_t old = offsetof(fathom_source_options, reconnect); /* beyond it lies garbage */
    fathom_source_options *options = callers(old);
    options->kinds = FATHOM_SOURCE_DEPTH;
    assert_int_equal(fathom_source_open(&source, folder, options), FATHOM_OK);
    fathom_source_close(source);
}

static void a_newer_callers_options_must_be_zero_beyond_the_librarys(void **state) {
    (void)state;
    fathom_source *source;
    const size_t newer = sizeof(fathom_source_options) + 16;
    fathom_source_options *options = callers(newer);
    *options = FATHOM_STRUCT(fathom_source_options);
    options->struct_size = (uint32_t)newer;
    assert_int_equal(fathom_source_open(&source, folder, options), FATHOM_ERROR_ARGUMENT);
    memset(options + 1, 0, 16);
    assert_int_equal(fathom_source_open(&source, folder, options), FATHOM_OK);
    fathom_source_close(source);
}

static void structs_without_a_size_are_refused(void **state) {
    (void)state;
    fathom_source *source;
    fathom_recording *recording;
    fathom_source_frame frame = {0};
    fathom_source_status status = {0};
    fathom_source_driver_info driver = {0};
    fathom_config config = {0};
    assert_int_equal(fathom_source_open(&source, folder, &(fathom_source_options){0}), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_recording_open(&recording, folder, &(fathom_recording_options){0}), FATHOM_ERROR_ARGUMENT);
    assert_null(recording);
    source = open_folder();
    assert_int_equal(fathom_source_read_depth(source, &frame), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_get_status(source, &status), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_source_configure(source, &config), FATHOM_ERROR_ARGUMENT);
    assert_false(fathom_source_driver(0, &driver));
    fathom_source_close(source);
}

/* What this library doesn't know of stays as the caller set it. */
static void a_config_of_another_length_is_filled_in_as_far_as_it_goes(void **state) {
    (void)state;
    const size_t old = offsetof(fathom_config, imu_to_camera_translation), newer = sizeof(fathom_config) + 24;
    fathom_source *source = open_folder();
    fathom_config *config = callers(old);
    assert_int_equal(fathom_source_configure(source, config), FATHOM_OK);
    assert_int_equal(config->depth_camera.width, 16);
    are(config, old, old + 400, UNTOUCHED);
    config = callers(newer);
    assert_int_equal(fathom_source_configure(source, config), FATHOM_OK);
    assert_true(config->imu_to_camera_translation[2] == 3 && config->depth_units_per_metre == 2000);
    assert_int_equal(config->struct_size, newer);
    are(config, sizeof *config, newer + 64, UNTOUCHED);
    fathom_source_close(source);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_older_callers_status_isnt_overrun),
        cmocka_unit_test(a_newer_callers_status_is_zero_beyond_the_librarys),
        cmocka_unit_test(an_older_callers_frame_isnt_overrun),
        cmocka_unit_test(an_older_callers_options_take_defaults),
        cmocka_unit_test(a_newer_callers_options_must_be_zero_beyond_the_librarys),
        cmocka_unit_test(structs_without_a_size_are_refused),
        cmocka_unit_test(a_config_of_another_length_is_filled_in_as_far_as_it_goes),
    };
    return cmocka_run_group_tests(tests, make_recording, remove_recording);
}
