/* What crosses the interface: structs of any size, depth frames with all they may carry, texts of failures, the latest
 * results. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/se3.h"
#include "base/sized.h"
#include "context.h"
#include "synthetic.h"

#define FRAMES 4

static synthetic_frame frames[FRAMES];
static synthetic_context s;
static fathom_config config;

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_DESK, 0, FRAMES, frames);
    return 0;
}

static int start(void **state) {
    (void)state;
    config = synthetic_config(&frames[0]);
    s = synthetic_start(&config);
    return 0;
}

static int stop(void **state) {
    (void)state;
    synthetic_stop(&s);
    return 0;
}

/* ---- sizes ---- */

typedef struct {
    uint32_t struct_size;
    int32_t a;
    int64_t b;
} grown;

static void a_shorter_struct_keeps_the_defaults_of_what_it_lacks(void **state) {
    (void)state;
    grown whole = {0, 1, 2}, callers = {8, 10, 20};
    assert_true(sized_in(&whole, sizeof whole, &callers));
    assert_true(whole.struct_size == sizeof whole && whole.a == 10 && whole.b == 2);
}

static void a_longer_struct_is_taken_only_with_zeros_in_its_rest(void **state) {
    (void)state;
    struct {
        grown g;
        unsigned char rest[8];
    } callers = {{24, 10, 20}, {0}};
    grown whole = {0};
    assert_true(sized_in(&whole, sizeof whole, &callers) && whole.b == 20);
    callers.rest[7] = 1;
    assert_false(sized_in(&whole, sizeof whole, &callers));
}

static void what_is_written_ends_where_the_callers_struct_ends(void **state) {
    (void)state;
    struct {
        grown g;
        unsigned char rest[8];
    } callers;
    const grown whole = {sizeof whole, 10, 20};
    memset(&callers, 0x5a, sizeof callers);
    sized_out(&callers, 8, &whole, sizeof whole);
    assert_true(callers.g.struct_size == 8 && callers.g.a == 10 && callers.g.b == 0x5a5a5a5a5a5a5a5a);
    sized_out(&callers, 24, &whole, sizeof whole);
    assert_true(callers.g.struct_size == 24 && callers.g.b == 20 && callers.rest[0] == 0 && callers.rest[7] == 0);
}

static void a_size_that_was_never_set_is_refused(void **state) {
    (void)state;
    const uint32_t sizes[] = {0, 3, 16385, UINT32_MAX};
    for (int i = 0; i < 4; i++) {
        fathom_result r = FATHOM_STRUCT(fathom_result);
        fathom_depth_frame f = synthetic_depth(frames[0].timestamp_ns, frames[0].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
        fathom_config c = config;
        char why[256] = "";
        r.struct_size = c.struct_size = sizes[i];
        assert_int_equal(fathom_step(s.scan, &f, &r), FATHOM_ERROR_ARGUMENT);
        assert_non_null(strstr(fathom_last_error(s.scan), "fathom_result"));
        assert_int_equal(fathom_memory_required(&c, why, sizeof why), FATHOM_ERROR_ARGUMENT);
        assert_non_null(strstr(why, "struct_size"));
        assert_int_equal(fathom_config_init_sized(&c, sizes[i]), FATHOM_ERROR_ARGUMENT);
        r = FATHOM_STRUCT(fathom_result);
        f.struct_size = sizes[i];
        assert_int_equal(fathom_step(s.scan, &f, &r), FATHOM_ERROR_ARGUMENT);
        assert_non_null(strstr(fathom_last_error(s.scan), "fathom_depth_frame"));
    }
}

static void called(void *user, fathom_log_level level, const char *text) {
    (void)level;
    (void)text;
    ++*(int *)user;
}

static void a_log_behind_the_end_of_the_callers_struct_is_never_called(void **state) {
    (void)state;
    int calls = 0;
    char why[256];
    fathom_config c = config;
    c.log = called;
    c.log_user = &calls;
    c.voxel_m = -1;
    c.struct_size = offsetof(fathom_config, log);
    assert_int_equal(fathom_memory_required(&c, why, sizeof why), FATHOM_ERROR_CONFIG);
    assert_non_null(strstr(why, "voxel_m"));
    assert_int_equal(calls, 0);
    c.struct_size = sizeof c;
    assert_int_equal(fathom_memory_required(&c, why, sizeof why), FATHOM_ERROR_CONFIG);
    assert_int_equal(calls, 1);
}

/* ---- poses ---- */

static void a_pose_goes_to_a_matrix_and_back(void **state) {
    (void)state;
    for (int i = 0; i < 190; i++) { /* up to half a turn */
        const double half = 0.5 * (0.1 + 0.0157 * i), x = cos(i), y = sin(i), n = 1 / sqrt(2);
        const fathom_pose p = {{i, -0.3 * i, 7}, {sin(half) * x * n, sin(half) * y * n, sin(half) * n, cos(half)}};
        fathom_pose back;
        double m[16];
        assert_int_equal(fathom_pose_to_matrix(&p, m), FATHOM_OK);
        assert_int_equal(fathom_pose_from_matrix(m, &back), FATHOM_OK);
        for (int k = 0; k < 3; k++) assert_true(fabs(back.position[k] - p.position[k]) < 1e-12);
        for (int k = 0; k < 4; k++) assert_true(fabs(back.orientation[k] - p.orientation[k]) < 1e-12);
    }
    const fathom_pose quarter = {{0}, {0, 0, sqrt(0.5), sqrt(0.5)}}; /* about z: x goes to y */
    double m[16];
    assert_int_equal(fathom_pose_to_matrix(&quarter, m), FATHOM_OK);
    assert_true(fabs(m[4] - 1) < 1e-15 && fabs(m[1] + 1) < 1e-15 && m[15] == 1);
}

static void what_is_not_rigid_is_no_pose(void **state) {
    (void)state;
    fathom_pose p = {{0}, {0, 0, 0, 1.01}}, nan = {{NAN, 0, 0}, {0, 0, 0, 1}};
    double m[16] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1}; /* a mirror */
    assert_int_equal(fathom_pose_from_matrix(m, &p), FATHOM_ERROR_ARGUMENT);
    m[10] = 1.01;
    assert_int_equal(fathom_pose_from_matrix(m, &p), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_pose_to_matrix(&p, m), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_pose_to_matrix(&nan, m), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_pose_to_matrix(NULL, m), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_pose_from_matrix(NULL, &p), FATHOM_ERROR_ARGUMENT);
}

/* ---- depth frames ---- */

static void rows_further_apart_give_the_same_result(void **state) {
    (void)state;
    enum { PITCH = SYNTHETIC_WIDTH + 37 };
    static uint16_t wide[PITCH * SYNTHETIC_HEIGHT];
    fathom_result tight[FRAMES], r = FATHOM_STRUCT(fathom_result);
    for (int i = 0; i < FRAMES; i++) tight[i] = synthetic_step(s.scan, &frames[i]);
    assert_int_equal(fathom_reset(s.scan), FATHOM_OK);
    memset(wide, 0xff, sizeof wide);
    for (int i = 0; i < FRAMES; i++) {
        for (int y = 0; y < SYNTHETIC_HEIGHT; y++)
            memcpy(wide + PITCH * y, frames[i].depth + SYNTHETIC_WIDTH * y, 2 * SYNTHETIC_WIDTH);
        fathom_depth_frame f = synthetic_depth(frames[i].timestamp_ns, wide, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
        f.row_stride_bytes = 2 * PITCH;
        assert_int_equal(fathom_step(s.scan, &f, &r), FATHOM_OK);
        assert_int_equal(r.state, tight[i].state);
        assert_memory_equal(&r.pose, &tight[i].pose, sizeof r.pose);
    }
}

/* Garbage below min_confidence changes no bit of what zeros there give; confidence's rows may lie apart. */
static void unsure_pixels_are_as_good_as_none(void **state) {
    (void)state;
    enum { PITCH = SYNTHETIC_WIDTH + 24 };
    static uint16_t blanked[SYNTHETIC_PIXELS], wild[SYNTHETIC_PIXELS];
    static uint8_t confidence[PITCH * SYNTHETIC_HEIGHT];
    fathom_config c = synthetic_config(&frames[0]);
    c.min_confidence = 2;
    synthetic_context clean = synthetic_start(&c), unsure = synthetic_start(&c);
    for (int i = 0; i < FRAMES; i++) {
        for (int y = 0; y < SYNTHETIC_HEIGHT; y++)
            for (int x = 0; x < SYNTHETIC_WIDTH; x++) {
                const int at = y * SYNTHETIC_WIDTH + x;
                const bool sure = (x / 3 + y / 5 + i) % 4 != 0;
                confidence[y * PITCH + x] = sure ? 2 : 1;
                blanked[at] = sure ? frames[i].depth[at] : 0;
                wild[at] = sure ? frames[i].depth[at] : (uint16_t)(4000 + 37 * at % 9000);
            }
        fathom_result a = FATHOM_STRUCT(fathom_result), b = FATHOM_STRUCT(fathom_result);
        fathom_depth_frame f = synthetic_depth(frames[i].timestamp_ns, blanked, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
        assert_int_equal(fathom_step(clean.scan, &f, &a), FATHOM_OK);
        f.depth = wild;
        f.confidence = confidence;
        f.confidence_stride_bytes = PITCH;
        assert_int_equal(fathom_step(unsure.scan, &f, &b), FATHOM_OK);
        assert_true(i == 0 ? a.state == FATHOM_FIRST : a.state == FATHOM_TRACKED);
        assert_true(a.state == b.state && a.pairs == b.pairs && a.blocks == b.blocks && a.blocks > 100);
        assert_memory_equal(&a.pose, &b.pose, sizeof a.pose);
    }
    synthetic_stop(&clean);
    synthetic_stop(&unsure);
}

static void refused(fathom_depth_frame f, const char *word) {
    fathom_result r = FATHOM_STRUCT(fathom_result);
    assert_int_equal(fathom_step(s.scan, &f, &r), FATHOM_ERROR_ARGUMENT);
    if (!strstr(fathom_last_error(s.scan), word)) print_error("%s: %s\n", word, fathom_last_error(s.scan));
    assert_non_null(strstr(fathom_last_error(s.scan), word));
}

static void what_a_frame_cannot_carry_is_refused_by_name(void **state) {
    (void)state;
    static const uint8_t confidence[SYNTHETIC_PIXELS], pixels[3 * 4 * 4];
    const fathom_depth_frame good =
        synthetic_depth(frames[0].timestamp_ns, frames[0].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    const int32_t strides[] = {2 * SYNTHETIC_WIDTH - 2, 2 * SYNTHETIC_WIDTH + 1, -2, 2};
    for (int i = 0; i < 4; i++) {
        fathom_depth_frame f = good;
        f.row_stride_bytes = strides[i];
        refused(f, "row_stride_bytes");
    }
    fathom_depth_frame f = good;
    f.exposure_ns = -1;
    refused(f, "exposure_ns");
    f.exposure_ns = 1000000001;
    refused(f, "exposure_ns");
    f = good;
    f.row_time_ns = 1000000000 / SYNTHETIC_HEIGHT + 1;
    refused(f, "row_time_ns");
    f.row_time_ns = -f.row_time_ns;
    refused(f, "row_time_ns");
    f = good;
    f.confidence = confidence;
    f.confidence_stride_bytes = SYNTHETIC_WIDTH - 1;
    refused(f, "confidence_stride_bytes");

    const fathom_image image = {.struct_size = sizeof image, .format = FATHOM_IMAGE_RGB8, .width = 4, .height = 4,
                                .data = pixels};
    fathom_image bad = image;
    f = good;
    f.image = &bad;
    bad.data = NULL;
    refused(f, "data");
    bad = image;
    bad.width = 0;
    refused(f, "0x4");
    bad = image;
    bad.format = 99;
    refused(f, "format");
    bad = image;
    bad.stride_bytes = 11;
    refused(f, "rows");
    bad = image;
    bad.size_bytes = 47;
    refused(f, "too short");
    bad = image;
    bad.format = FATHOM_IMAGE_YUYV;
    bad.width = 3;
    refused(f, "format");
    bad = image;
    bad.format = FATHOM_IMAGE_JPEG;
    refused(f, "compressed");
    bad = image;
    bad.struct_size = 0;
    refused(f, "fathom_image");

    f = good; /* and what it can is taken */
    f.exposure_ns = 1000000000;
    f.row_time_ns = -1000000000 / SYNTHETIC_HEIGHT;
    f.confidence = confidence;
    f.image = &image;
    fathom_result r = FATHOM_STRUCT(fathom_result);
    assert_int_equal(fathom_step(s.scan, &f, &r), FATHOM_OK);
    assert_int_equal(r.state, FATHOM_FIRST);
}

/* ---- distortion ---- */

/* OpenCV's formula for eight coefficients, written out: where a ray falls in the frame. */
static void seen_at(const fathom_pinhole *c, double x, double y, double *u, double *v) {
    const double *k = c->coefficients, r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
    const double radial =
        (1 + k[0] * r2 + k[1] * r4 + k[4] * r6) / (1 + k[5] * r2 + k[6] * r4 + k[7] * r6);
    *u = c->fx * (x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x)) + c->cx;
    *v = c->fy * (y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y) + c->cy;
}

/* A frame whose depth names its pixel comes out where the formula says. */
static void eight_coefficients_bend_as_opencv_bends(void **state) {
    (void)state;
    static uint16_t frame[SYNTHETIC_PIXELS];
    static float depth[SYNTHETIC_PIXELS];
    const double k[8] = {0.52, -0.71, 0.002, -0.003, 0.49, 0.40, -0.53, 0.42};
    fathom_config c = config;
    c.depth_camera.lens = FATHOM_LENS_RATIONAL;
    memcpy(c.depth_camera.coefficients, k, sizeof k);
    synthetic_context bent = synthetic_start(&c);
    fathom *f = bent.scan;
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) frame[i] = (uint16_t)(2500 + i % SYNTHETIC_WIDTH + 40 * (i / SYNTHETIC_WIDTH));
    depth_maps_make(&f->maps, &f->device, frame, 2 * SYNTHETIC_WIDTH, 0);
    const kernel_camera *m = &f->maps.camera[FINEST];
    assert_int_equal(m->width, SYNTHETIC_WIDTH);
    const float *plane = device_map(&f->device, &f->maps.depth[FINEST], CL_MAP_READ);
    assert_non_null(plane);
    for (int y = 0; y < m->height; y++)
        memcpy(depth + y * m->width, plane + (y + PAD_Y) * m->pitch + PAD_X, (size_t)m->width * sizeof *depth);
    device_unmap(&f->device, &f->maps.depth[FINEST], (void *)plane);
    int moved = 0, compared = 0;
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) {
        const int x = i % SYNTHETIC_WIDTH, y = i / SYNTHETIC_WIDTH;
        double u, v;
        seen_at(&c.depth_camera, (x - c.depth_camera.cx) / c.depth_camera.fx, (y - c.depth_camera.cy) / c.depth_camera.fy,
                &u, &v);
        const double du = u + 0.5 - floor(u + 0.5), dv = v + 0.5 - floor(v + 0.5);
        if (du < 0.01 || du > 0.99 || dv < 0.01 || dv > 0.99) continue; /* rounding decides */
        const int column = (int)floor(u + 0.5), row = (int)floor(v + 0.5);
        const bool inside = column >= 0 && row >= 0 && column < SYNTHETIC_WIDTH && row < SYNTHETIC_HEIGHT;
        const double want = inside ? (double)frame[row * SYNTHETIC_WIDTH + column] / SYNTHETIC_UNITS : 0;
        assert_true(fabs((double)depth[i] - want) < 1e-5);
        moved += column != x || row != y;
        compared++;
    }
    assert_true(compared > SYNTHETIC_PIXELS / 2 && moved > compared / 3);
    synthetic_stop(&bent);
}

static void coefficients_that_the_lens_does_not_use_are_refused(void **state) {
    (void)state;
    char why[256];
    fathom_config c = config;
    c.depth_camera.coefficients[0] = 0.1; /* and no lens */
    assert_int_equal(fathom_memory_required(&c, why, sizeof why), FATHOM_ERROR_CONFIG);
    assert_non_null(strstr(why, "coefficients[0]"));
    c.depth_camera.lens = FATHOM_LENS_FIVE;
    assert_true(fathom_memory_required(&c, why, sizeof why) > 0);
    c.depth_camera.coefficients[5] = 0.1;
    assert_int_equal(fathom_memory_required(&c, why, sizeof why), FATHOM_ERROR_CONFIG);
}

/* ---- errors ---- */

static void a_failing_init_says_why_without_a_log(void **state) {
    (void)state;
    char why[256] = "", small[8] = "", block[64];
    fathom *scan;
    fathom_config c = config;
    c.log = NULL;
    assert_int_equal(fathom_init(&scan, &c, block, sizeof block, why, sizeof why), FATHOM_ERROR_MEMORY);
    assert_non_null(strstr(why, "64 bytes"));
    assert_int_equal(fathom_init(&scan, &c, block, sizeof block, small, sizeof small), FATHOM_ERROR_MEMORY);
    assert_int_equal(strlen(small), 7);
    c.device = "no such device";
    assert_int_equal(fathom_init(&scan, &c, block, sizeof block, why, sizeof why), FATHOM_ERROR_DEVICE);
    assert_non_null(strstr(why, "no such device"));
    assert_int_equal(fathom_init(&scan, NULL, block, sizeof block, why, sizeof why), FATHOM_ERROR_ARGUMENT);
    assert_non_null(strstr(why, "config"));
}

static void the_last_error_stays_until_the_next(void **state) {
    (void)state;
    fathom_result r = FATHOM_STRUCT(fathom_result);
    fathom_depth_frame f = synthetic_depth(1, frames[0].depth, 3, 4);
    assert_string_equal(fathom_last_error(s.scan), "");
    assert_string_equal(fathom_last_error(NULL), "");
    assert_int_equal(fathom_step(s.scan, &f, &r), FATHOM_ERROR_SIZE);
    assert_non_null(strstr(fathom_last_error(s.scan), "3x4"));
    synthetic_step(s.scan, &frames[0]);
    assert_non_null(strstr(fathom_last_error(s.scan), "3x4"));
    assert_int_equal(fathom_get_pose(s.scan, NULL, NULL), FATHOM_ERROR_ARGUMENT);
    assert_non_null(strstr(fathom_last_error(s.scan), "pose"));
}

static void a_full_ring_says_so(void **state) {
    (void)state;
    int full = 0;
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    for (int i = 0; i < 10000; i++) {
        const fathom_imu_sample sample = {i * INT64_C(1000000), {0}, {0, -9.8f, 0}};
        const int e = fathom_push_imu(s.scan, &sample);
        assert_true(e == FATHOM_OK || e == FATHOM_ERROR_FULL);
        full += e == FATHOM_ERROR_FULL;
    }
    assert_true(full > 1000);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_int_equal(counters.imu_overrun, full);
    assert_string_equal(fathom_error_name(FATHOM_ERROR_FULL), "FATHOM_ERROR_FULL");
}

static void every_call_on_a_dead_context_says_so(void **state) {
    (void)state;
    fathom *f = s.scan;
    fathom_result r = synthetic_step(f, &frames[0]);
    fathom_depth_frame next = synthetic_depth(frames[1].timestamp_ns, frames[1].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    fathom_motion motion = FATHOM_STRUCT(fathom_motion);
    fathom_rig rig = FATHOM_STRUCT(fathom_rig);
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    fathom_pose at;
    f->device.error = FATHOM_ERROR_DEVICE; /* as a failed call leaves it */
    const int dead = FATHOM_ERROR_DEVICE;
    assert_int_equal(fathom_step(f, &next, &r), dead);
    assert_int_equal(fathom_reset(f), dead);
    assert_int_equal(fathom_pause(f, true), dead);
    assert_int_equal(fathom_get_pose(f, &at, NULL), dead);
    assert_int_equal(fathom_get_rig(f, &rig), dead);
    assert_int_equal(fathom_get_counters(f, &counters), dead);
    assert_int_equal(fathom_inertial_estimate(f, 0, 1, &motion), dead);
    fathom_span second = FATHOM_STRUCT(fathom_span);
    assert_int_equal(fathom_get_span(f, &second), dead);
    assert_int_equal(fathom_get_recent(f, &r, 1), dead);
    assert_int_equal(fathom_save_kernels(f, "/dev/null"), dead);
    assert_int_equal(fathom_extract_mesh(f, 0, synthetic_triangles, NULL), dead);
    assert_int_equal(r.state, FATHOM_FIRST); /* the last result is repeated */
    f->device.error = FATHOM_OK;
}

/* ---- the latest results, pause ---- */

static void the_latest_results_come_oldest_first(void **state) {
    (void)state;
    static fathom_result got[FATHOM_RECENT + 5];
    got[0].struct_size = sizeof got[0];
    assert_int_equal(fathom_get_recent(s.scan, got, 5), 0);
    for (int i = 0; i < FATHOM_RECENT + 3; i++) synthetic_blank(s.scan, 1 + i);
    assert_int_equal(fathom_get_recent(s.scan, got, FATHOM_RECENT + 5), FATHOM_RECENT);
    for (int i = 0; i < FATHOM_RECENT; i++) assert_true(got[i].timestamp_ns == 4 + i && got[i].struct_size == sizeof got[i]);
    assert_int_equal(fathom_get_recent(s.scan, got, 2), 2); /* the latest two */
    assert_true(got[0].timestamp_ns == FATHOM_RECENT + 2 && got[1].timestamp_ns == FATHOM_RECENT + 3);
    assert_int_equal(fathom_get_recent(s.scan, NULL, 0), 0);
    assert_int_equal(fathom_get_recent(s.scan, NULL, 1), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_get_recent(s.scan, got, -1), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_reset(s.scan), FATHOM_OK);
    assert_int_equal(fathom_get_recent(s.scan, got, 5), 0);
}

static void reset_ends_a_pause(void **state) {
    (void)state;
    assert_int_equal(fathom_pause(s.scan, true), FATHOM_OK);
    assert_int_equal(fathom_reset(s.scan), FATHOM_OK);
    assert_int_equal(synthetic_step(s.scan, &frames[0]).state, FATHOM_FIRST);
    assert_true(synthetic_step(s.scan, &frames[1]).fused);
}

/* A field that is appended must lie beyond the older struct's size, not in its padding. */
static void growing_structs_end_without_padding(void **state) {
    (void)state;
#define ENDS_WITH(type, field) assert_int_equal(offsetof(type, field) + sizeof((type *)0)->field, sizeof(type))
    ENDS_WITH(fathom_motion, covariance);
    ENDS_WITH(fathom_config, unused);
    ENDS_WITH(fathom_memory_plan, device);
    ENDS_WITH(fathom_image, data);
    ENDS_WITH(fathom_depth_frame, image);
    ENDS_WITH(fathom_result, contradicted);
    ENDS_WITH(fathom_span, covariance);
    ENDS_WITH(fathom_rig, clock_sigma_ns);
    ENDS_WITH(fathom_counters, blocks_lost);
    ENDS_WITH(fathom_view, far_m);
    ENDS_WITH(fathom_setting, unused);
}

int main(void) {
#define WITH_CONTEXT(test) cmocka_unit_test_setup_teardown(test, start, stop)
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_shorter_struct_keeps_the_defaults_of_what_it_lacks),
        cmocka_unit_test(a_longer_struct_is_taken_only_with_zeros_in_its_rest),
        cmocka_unit_test(what_is_written_ends_where_the_callers_struct_ends),
        WITH_CONTEXT(a_size_that_was_never_set_is_refused),
        WITH_CONTEXT(a_log_behind_the_end_of_the_callers_struct_is_never_called),
        cmocka_unit_test(a_pose_goes_to_a_matrix_and_back),
        cmocka_unit_test(what_is_not_rigid_is_no_pose),
        WITH_CONTEXT(rows_further_apart_give_the_same_result),
        WITH_CONTEXT(unsure_pixels_are_as_good_as_none),
        WITH_CONTEXT(what_a_frame_cannot_carry_is_refused_by_name),
        WITH_CONTEXT(eight_coefficients_bend_as_opencv_bends),
        WITH_CONTEXT(coefficients_that_the_lens_does_not_use_are_refused),
        WITH_CONTEXT(a_failing_init_says_why_without_a_log),
        WITH_CONTEXT(the_last_error_stays_until_the_next),
        WITH_CONTEXT(a_full_ring_says_so),
        WITH_CONTEXT(every_call_on_a_dead_context_says_so),
        WITH_CONTEXT(the_latest_results_come_oldest_first),
        WITH_CONTEXT(reset_ends_a_pause),
        cmocka_unit_test(growing_structs_end_without_padding),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
