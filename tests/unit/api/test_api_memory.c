/* The public API: memory, settings, arguments, names. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "synthetic.h"

#define FRAMES 4
static synthetic_frame frames[FRAMES];
static synthetic_log kept;

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_ROOM, 0, FRAMES, frames);
    return 0;
}

static fathom_config logged(void) {
    fathom_config c = synthetic_config(&frames[0]);
    memset(&kept, 0, sizeof kept);
    c.log = synthetic_logger;
    c.log_user = &kept;
    return c;
}

static void names_are_given_for_any_value(void **state) {
    (void)state;
    char version[32];
    snprintf(version, sizeof version, "%d.%d.%d", FATHOM_VERSION_MAJOR, FATHOM_VERSION_MINOR,
             FATHOM_VERSION_PATCH);
    assert_string_equal(fathom_version(), version);
    assert_string_equal(fathom_error_name(FATHOM_OK), "FATHOM_OK");
    assert_string_equal(fathom_error_name(FATHOM_ERROR_MEMORY), "FATHOM_ERROR_MEMORY");
    assert_string_equal(fathom_error_name(FATHOM_ERROR_NO_DATA), "FATHOM_ERROR_NO_DATA");
    for (int i = -9; i < 0; i++)
        for (int j = -9; j < i; j++) assert_string_not_equal(fathom_error_name(i), fathom_error_name(j));
    assert_string_equal(fathom_error_name(7), "FATHOM_OK"); /* results are positive */
    assert_string_equal(fathom_error_name(-1000), "FATHOM_ERROR_UNKNOWN");
    assert_string_equal(fathom_state_name(FATHOM_FIRST), "first");
    assert_string_equal(fathom_state_name(FATHOM_TRACKED), "tracked");
    assert_string_equal(fathom_state_name(FATHOM_RECKONED), "reckoned");
    assert_string_equal(fathom_state_name(FATHOM_LOST), "lost");
    assert_string_equal(fathom_state_name((fathom_state)99), "unknown");
    assert_string_equal(fathom_verdict_name(FATHOM_VERDICT_INNOVATION), "innovation");
    assert_string_equal(fathom_verdict_name((fathom_verdict)-1), "unknown");
}

static void default_settings_need_at_most_128_mb(void **state) {
    (void)state;
    fathom_config c;
    fathom_config_init(&c);
    fathom_memory_plan plan = FATHOM_STRUCT(fathom_memory_plan);
    assert_int_equal(c.struct_size, sizeof c);
    assert_int_equal(fathom_plan_memory(&c, &plan, NULL, 0), FATHOM_OK);
    assert_true(plan.host_bytes + plan.device_bytes <= (int64_t)128 << 20);
    assert_true(plan.host_bytes + plan.device_bytes > (int64_t)120 << 20); /* and it uses what it may */
    assert_int_equal(plan.align_width, 320);
    assert_int_equal(plan.align_height, 240);
    assert_true(plan.blocks > 40000);
    assert_true(strlen(plan.device) > 0);
    assert_true(fathom_memory_required(&c, NULL, 0) == plan.host_bytes);
    assert_true(fathom_memory_required(&c, NULL, 0) == plan.host_bytes); /* asking changes nothing */
}

static void presets_keep_to_their_memory(void **state) {
    (void)state;
    static const struct {
        fathom_preset preset;
        int width;
        float voxel_m;
        int64_t megabytes;
    } wanted[] = {{FATHOM_PRESET_TINY, 160, 0.02f, 64},
                  {FATHOM_PRESET_SMALL, 320, 0.01f, 128},
                  {FATHOM_PRESET_LARGE, 640, 0.008f, 256}};
    for (size_t i = 0; i < sizeof wanted / sizeof *wanted; i++) {
        fathom_config c;
        assert_int_equal(fathom_config_preset(&c, wanted[i].preset), FATHOM_OK);
        fathom_memory_plan plan = FATHOM_STRUCT(fathom_memory_plan);
        assert_int_equal(fathom_plan_memory(&c, &plan, NULL, 0), FATHOM_OK);
        assert_int_equal(plan.align_width, wanted[i].width);
        assert_true(c.voxel_m == wanted[i].voxel_m);
        assert_true(plan.host_bytes + plan.device_bytes <= wanted[i].megabytes << 20);
        assert_true(plan.blocks > 16000);
    }
}

static void memory_follows_the_settings(void **state) {
    (void)state;
    fathom_config c = logged();
    fathom_memory_plan few = FATHOM_STRUCT(fathom_memory_plan), many = few;
    c.max_blocks = 64;
    assert_int_equal(fathom_plan_memory(&c, &few, NULL, 0), FATHOM_OK);
    c.max_blocks = 2112;
    assert_int_equal(fathom_plan_memory(&c, &many, NULL, 0), FATHOM_OK);
    int64_t more = many.host_bytes + many.device_bytes - few.host_bytes - few.device_bytes;
    assert_true(more >= 2048 * 2048 && more < 2048 * 2200);
    c.max_blocks = 0; /* what the cap leaves */
    c.max_memory_bytes = 20 << 20;
    assert_int_equal(fathom_plan_memory(&c, &many, NULL, 0), FATHOM_OK);
    assert_true(many.host_bytes + many.device_bytes <= c.max_memory_bytes && many.blocks > 2000);
    c.max_memory_bytes = (int64_t)1 << 46; /* more than a pool can have */
    assert_int_equal(fathom_plan_memory(&c, &many, NULL, 0), FATHOM_OK);
    assert_int_equal(many.blocks, 16777216);
    assert_int_equal(kept.errors, 0);

    c.max_memory_bytes = 1 << 20; /* not even the maps */
    assert_int_equal(fathom_memory_required(&c, NULL, 0), FATHOM_ERROR_MEMORY);
    assert_int_equal(kept.errors, 1);
    assert_non_null(strstr(kept.text, "max_memory_bytes"));
    c.max_memory_bytes = 20 << 20; /* more blocks than the cap holds */
    c.max_blocks = 20000;
    assert_int_equal(fathom_memory_required(&c, NULL, 0), FATHOM_ERROR_MEMORY);
    assert_int_equal(kept.errors, 2);
}

/* Wherever the buffers lie, they count: the settings fit into just what the plan says and into no byte less, and what is
 * left of a cap is filled with blocks. */
static void the_cap_holds_what_the_device_holds_too(void **state) {
    (void)state;
    static const fathom_buffers buffers[] = {FATHOM_BUFFERS_HOST, FATHOM_BUFFERS_DEVICE};
    fathom_memory_plan plans[2];
    for (int i = 0; i < 2; i++) {
        fathom_config c = logged();
        fathom_memory_plan again = FATHOM_STRUCT(fathom_memory_plan), *plan = &plans[i];
        *plan = again;
        c.buffers = buffers[i];
        c.max_blocks = 3000;
        assert_int_equal(fathom_plan_memory(&c, plan, NULL, 0), FATHOM_OK);
        assert_true(i == 0 ? plan->device_bytes == 0 : plan->device_bytes > 3000 * 2048);
        c.max_memory_bytes = plan->host_bytes + plan->device_bytes;
        assert_int_equal(fathom_plan_memory(&c, &again, NULL, 0), FATHOM_OK);
        assert_memory_equal(&again, plan, sizeof again);
        c.max_memory_bytes--;
        assert_int_equal(fathom_plan_memory(&c, &again, NULL, 0), FATHOM_ERROR_MEMORY);
        c.max_blocks = 0;
        for (c.max_memory_bytes = 8 << 20; c.max_memory_bytes < 80 << 20; c.max_memory_bytes += 3333333) {
            assert_int_equal(fathom_plan_memory(&c, &again, NULL, 0), FATHOM_OK);
            const int64_t all = again.host_bytes + again.device_bytes;
            assert_true(all <= c.max_memory_bytes && all > c.max_memory_bytes * 3 / 4);
        }
    }
    /* the same buffers, in the block or beside it, but for what a block's end is rounded up by */
    const int64_t apart = plans[1].host_bytes + plans[1].device_bytes - plans[0].host_bytes;
    assert_true(apart <= 0 && apart > -4096);
}

static void a_block_one_byte_short_is_refused_untouched(void **state) {
    (void)state;
    fathom_config c = logged();
    int64_t bytes = fathom_memory_required(&c, NULL, 0);
    assert_true(bytes > 0);
    size_t size = (size_t)bytes;
    unsigned char *block = malloc(size), *pattern = malloc(size);
    assert_true(block && pattern);
    for (size_t i = 0; i < size; i++) pattern[i] = (unsigned char)(i * 151 + (i >> 8));
    memcpy(block, pattern, size);
    const size_t sizes[] = {size - 1, size / 2, 128, 1, 0};
    for (int i = 0; i < 5; i++) {
        fathom *scan = (fathom *)&kept;
        kept.errors = 0;
        assert_int_equal(fathom_init(&scan, &c, block, sizes[i], NULL, 0), FATHOM_ERROR_MEMORY);
        assert_null(scan);
        assert_memory_equal(block, pattern, size);
        assert_int_equal(kept.errors, 1);
    }
    char number[32];
    snprintf(number, sizeof number, "%zu", size);
    assert_non_null(strstr(kept.text, number)); /* it says what it needs */
    free(pattern);
    free(block);
}

static void an_unaligned_block_will_do_and_its_neighbours_are_safe(void **state) {
    (void)state;
    fathom_config c = synthetic_config(&frames[0]);
    size_t size = (size_t)fathom_memory_required(&c, NULL, 0);
    unsigned char *memory = malloc(size + 1024), *aligned;
    assert_non_null(memory);
    aligned = memory + 128 - (uintptr_t)memory % 128;
    const size_t offsets[] = {0, 1, 8, 64, 127};
    fathom_pose reference = {0};
    for (int i = 0; i < 5; i++) {
        unsigned char *block = aligned + offsets[i];
        memset(memory, 0xa5, size + 1024);
        fathom *scan;
        assert_int_equal(fathom_init(&scan, &c, block, size, NULL, 0), FATHOM_OK);
        assert_true((uintptr_t)scan % FATHOM_ALIGNMENT == 0);
        fathom_result r = FATHOM_STRUCT(fathom_result);
        for (int k = 0; k < FRAMES; k++) r = synthetic_step(scan, &frames[k]);
        assert_int_equal(r.state, FATHOM_TRACKED);
        if (i == 0) reference = r.pose;
        assert_memory_equal(&r.pose, &reference, sizeof reference); /* wherever it lies */
        synthetic_mesh mesh = {0};
        assert_true(fathom_extract_mesh(scan, 0, synthetic_triangles, &mesh) > 0);
        free(mesh.vertices);
        fathom_close(scan);
        for (unsigned char *p = memory; p < block; p++) assert_int_equal(*p, 0xa5);
        for (unsigned char *p = block + size; p < memory + size + 1024; p++) assert_int_equal(*p, 0xa5);
    }
    free(memory);
}

static void null_arguments_are_refused(void **state) {
    (void)state;
    fathom_config c = synthetic_config(&frames[0]);
    fathom_memory_plan plan = FATHOM_STRUCT(fathom_memory_plan);
    char small[64];
    fathom *scan = (fathom *)small;
    assert_int_equal(fathom_memory_required(NULL, NULL, 0), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_plan_memory(NULL, &plan, NULL, 0), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_plan_memory(&c, NULL, NULL, 0), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_init(NULL, &c, small, sizeof small, NULL, 0), FATHOM_ERROR_ARGUMENT);
    assert_int_equal(fathom_init(&scan, NULL, small, sizeof small, NULL, 0), FATHOM_ERROR_ARGUMENT);
    assert_null(scan);
    scan = (fathom *)small;
    assert_int_equal(fathom_init(&scan, &c, NULL, 1 << 30, NULL, 0), FATHOM_ERROR_ARGUMENT);
    assert_null(scan);
    fathom_close(NULL);

    synthetic_context s = synthetic_start(&c);
    fathom_depth_frame frame = synthetic_depth(frames[0].timestamp_ns, frames[0].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    fathom_depth_frame hollow = synthetic_depth(frames[0].timestamp_ns, NULL, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    fathom_imu_sample sample = {0};
    fathom_result result = FATHOM_STRUCT(fathom_result);
    fathom_motion motion = FATHOM_STRUCT(fathom_motion);
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    fathom_view view = FATHOM_STRUCT(fathom_view);
    fathom_pose pose;
    float depth[16];
    const int refused = FATHOM_ERROR_ARGUMENT;
    assert_int_equal(fathom_reset(NULL), refused);
    assert_int_equal(fathom_pause(NULL, true), refused);
    assert_int_equal(fathom_push_imu(NULL, &sample), refused);
    assert_int_equal(fathom_push_imu(s.scan, NULL), refused);
    assert_int_equal(fathom_step(NULL, &frame, &result), refused);
    assert_int_equal(fathom_step(s.scan, NULL, &result), refused);
    assert_int_equal(fathom_step(s.scan, &hollow, &result), refused);
    assert_int_equal(fathom_step(s.scan, &frame, NULL), refused);
    assert_int_equal(fathom_inertial_estimate(NULL, 0, 1, &motion), refused);
    assert_int_equal(fathom_inertial_estimate(s.scan, 0, 1, NULL), refused);
    assert_int_equal(fathom_inertial_estimate(s.scan, 0, 1, &motion), FATHOM_ERROR_NO_DATA);
    assert_int_equal(fathom_get_pose(NULL, &pose, NULL), refused);
    assert_int_equal(fathom_get_pose(s.scan, NULL, NULL), refused);
    assert_int_equal(fathom_get_pose(s.scan, &pose, NULL), FATHOM_OK);
    fathom_span second = FATHOM_STRUCT(fathom_span);
    assert_int_equal(fathom_get_span(NULL, &second), refused);
    assert_int_equal(fathom_get_span(s.scan, NULL), refused);
    assert_int_equal(fathom_get_span(s.scan, &second), FATHOM_ERROR_NO_DATA);
    assert_int_equal(fathom_get_counters(NULL, &counters), refused);
    assert_int_equal(fathom_get_counters(s.scan, NULL), refused);
    assert_int_equal(fathom_cast_view(NULL, &view, depth, NULL), refused);
    assert_int_equal(fathom_cast_view(s.scan, NULL, depth, NULL), refused);
    assert_int_equal(fathom_extract_mesh(NULL, 0, synthetic_triangles, NULL), refused);
    assert_int_equal(fathom_extract_mesh(s.scan, 0, NULL, NULL), refused);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_int_equal(counters.frames_ignored, 0);
    assert_int_equal(synthetic_step(s.scan, &frames[0]).state, FATHOM_FIRST); /* none of it did harm */
    synthetic_stop(&s);
}

/* ---- settings ----------------------------------------------------------------------------------------------------- */

typedef struct {
    const char *name; /* as the log must have it */
    size_t at;
    char type; /* i: int, f: float, d: double, l: int64 */
    double low, high;
} bad_setting;
#define INT(field, low, high)                                                                                \
    { #field, offsetof(fathom_config, field), 'i', low, high }
#define FLOAT(field, low, high)                                                                              \
    { #field, offsetof(fathom_config, field), 'f', low, high }
#define DOUBLE(field, low, high)                                                                             \
    { #field, offsetof(fathom_config, field), 'd', low, high }

static const bad_setting bad_settings[] = {
    INT(min_confidence, -1, 256),
    INT(depth_camera.width, 15, 4097),
    INT(depth_camera.height, 0, 1 << 30),
    DOUBLE(depth_camera.fx, 0, INFINITY),
    DOUBLE(depth_camera.fy, -525, INFINITY),
    DOUBLE(depth_camera.cx, -INFINITY, INFINITY),
    DOUBLE(depth_camera.cy, -INFINITY, INFINITY),
    INT(depth_camera.lens, -1, 3),
    DOUBLE(depth_camera.coefficients[0], -1e6, 1e6),
    DOUBLE(depth_camera.coefficients[1], -1e6, 1e6),
    DOUBLE(depth_camera.coefficients[4], -1e6, 1e6),
    DOUBLE(depth_camera.coefficients[7], -1e6, 1e6),
    FLOAT(depth_units_per_metre, 0, INFINITY),
    FLOAT(min_depth_m, -1, 1e9),
    FLOAT(max_depth_m, 0.1, INFINITY),
    FLOAT(depth_noise_base_m, 0, 10),
    FLOAT(depth_noise_growth_per_m, -0.1, 10),
    INT(align_width, -1, 1 << 20),
    INT(align_height, -1, 1 << 20),
    INT(max_align_width, 15, 4097),
    INT(max_iterations[0], -1, 101),
    INT(max_iterations[1], -1, 101),
    INT(max_iterations[2], -1, 101),
    INT(max_seeded_iterations[0], -1, 101),
    INT(max_seeded_iterations[1], -1, 101),
    INT(max_seeded_iterations[2], -1, 101),
    FLOAT(max_seed_sigma_m, -1, 1e9),
    FLOAT(max_model_reuse_m, -1, INFINITY),
    FLOAT(max_model_reuse_rad, -1, INFINITY),
    FLOAT(min_evident_fraction, -1, INFINITY),
    FLOAT(max_evident_sigmas, -1, INFINITY),
    FLOAT(max_pair_distance_m, 0, 100),
    FLOAT(max_pair_angle_rad, 0, 4),
    FLOAT(huber_m, 0, INFINITY),
    FLOAT(min_update_rad, -1, 10),
    FLOAT(min_update_m, -1, 10),
    FLOAT(min_error_decrease, -INFINITY, 10),
    FLOAT(min_overlap, -0.1, 1.1),
    INT(min_pairs, -1, 2000000000),
    FLOAT(max_rms_m, 0, INFINITY),
    FLOAT(max_condition, 0.5, INFINITY),
    FLOAT(max_innovation_sigmas, 0, INFINITY),
    FLOAT(voxel_m, 0, 2),
    FLOAT(truncation_m, -1, 100),
    INT(max_blocks, 63, 16777217),
    FLOAT(max_weight, 0, 10000),
    {"max_memory_bytes", offsetof(fathom_config, max_memory_bytes), 'l', 0, 2e15},
    FLOAT(imu_to_camera_translation[0], -100, 100),
    FLOAT(imu_to_camera_translation[1], -100, 100),
    FLOAT(imu_to_camera_translation[2], -100, 100),
    {"imu_clock_offset_ns", offsetof(fathom_config, imu_clock_offset_ns), 'l', -5e18, 5e18},
    FLOAT(gravity_m_s2, -1, 1000),
    FLOAT(gyro_noise_rad_s_sqrthz, -1, 100),
    FLOAT(gyro_bias_sigma_rad_s, -1, 100),
    FLOAT(accel_noise_m_s2_sqrthz, -1, 1000),
    FLOAT(accel_bias_sigma_m_s2, -1, 1000),
    FLOAT(seed_noise_rad, 0, 100),
    FLOAT(seed_noise_m, 0, 100),
    FLOAT(motion_sigma_m_s2, -1, 10000),
    FLOAT(motion_sigma_rad_s2, -1, 10000),
    FLOAT(max_reckoned_sigma_m, 0, 1e6),
    INT(max_imu_samples, -1, 1 << 30),
    {"against", offsetof(fathom_config, against), 'i', -1, 2},
    {"when_full", offsetof(fathom_config, when_full), 'i', -1, 2},
    {"buffers", offsetof(fathom_config, buffers), 'i', -1, 3},
};

static void assert_refused(const fathom_config *c, const char *name) {
    char memory[256];
    fathom *scan = (fathom *)memory;
    kept.errors = 0;
    kept.used = 0;
    int64_t required = fathom_memory_required(c, NULL, 0);
    if (required != FATHOM_ERROR_CONFIG || kept.errors != 1 || !strstr(kept.text, name))
        print_error("%s: %lld, log: %s\n", name, (long long)required, kept.text);
    assert_int_equal(required, FATHOM_ERROR_CONFIG);
    assert_int_equal(kept.errors, 1);
    assert_non_null(strstr(kept.text, name));
    assert_int_equal(fathom_init(&scan, c, memory, sizeof memory, NULL, 0), FATHOM_ERROR_CONFIG);
    assert_null(scan);
}

static void each_bad_setting_is_refused_by_name(void **state) {
    (void)state;
    for (size_t i = 0; i < sizeof bad_settings / sizeof *bad_settings; i++) {
        const bad_setting *b = &bad_settings[i];
        const double values[] = {b->low, b->high, NAN};
        for (int k = 0; k < (b->type == 'f' || b->type == 'd' ? 3 : 2); k++) {
            fathom_config c = logged();
            char *at = (char *)&c + b->at;
            int whole = b->type == 'i' ? (int)values[k] : 0;
            int64_t wide = b->type == 'l' ? (int64_t)values[k] : 0;
            float real = (float)values[k];
            if (b->type == 'i') memcpy(at, &whole, sizeof whole);
            if (b->type == 'l') memcpy(at, &wide, sizeof wide);
            if (b->type == 'f') memcpy(at, &real, sizeof real);
            if (b->type == 'd') memcpy(at, &values[k], sizeof values[k]);
            assert_refused(&c, b->name);
        }
    }
}

static void settings_that_disagree_are_refused(void **state) {
    (void)state;
    fathom_config c = logged();
    memset(c.max_iterations, 0, sizeof c.max_iterations);
    assert_refused(&c, "iterations");
    c = logged();
    memset(c.max_seeded_iterations, 0, sizeof c.max_seeded_iterations);
    assert_refused(&c, "max_seeded_iterations");
    c = logged();
    c.first_pose.orientation[0] = 2;
    assert_refused(&c, "first_pose");
    c = logged();
    c.first_pose.position[0] = NAN;
    assert_refused(&c, "first_pose");
    c = logged();
    memset(c.imu_to_camera_rotation, 0, sizeof c.imu_to_camera_rotation);
    assert_refused(&c, "imu_to_camera_rotation");
    c = logged();
    c.imu_to_camera_rotation[8] = -1; /* a mirror */
    assert_refused(&c, "imu_to_camera_rotation");
    c = logged();
    c.align_width = 60; /* 160 is no multiple */
    c.align_height = 45;
    assert_refused(&c, "alignment size");
    c = logged();
    c.align_width = 80;
    c.align_height = 120;
    assert_refused(&c, "alignment size");
    c = logged();
    c.align_width = 80; /* with its height left out */
    assert_refused(&c, "alignment size");
    c = logged();
    c.depth_camera.width = 4093; /* a prime */
    c.depth_camera.height = 3067;
    assert_refused(&c, "align_width");
    c = logged();
    c.align_width = 80;
    c.align_height = 60;
    assert_true(fathom_memory_required(&c, NULL, 0) > 0);
}

static void without_a_log_the_library_is_silent(void **state) {
    (void)state;
    fathom_config c = synthetic_config(&frames[0]);
    c.depth_camera.fx = -1;
    assert_int_equal(fathom_memory_required(&c, NULL, 0), FATHOM_ERROR_CONFIG);
    c.depth_camera.fx = 100;
    c.device = "no such device";
    assert_int_equal(fathom_memory_required(&c, NULL, 0), FATHOM_ERROR_DEVICE);
    c = logged();
    c.device = "no such device";
    assert_int_equal(fathom_memory_required(&c, NULL, 0), FATHOM_ERROR_DEVICE);
    assert_int_equal(kept.errors, 1);
    assert_non_null(strstr(kept.text, "no such device"));
}

/* The block is the caller's again after fathom_close, and good for the next scan; buffers of the device's own will do. */
static void a_block_serves_again_and_again(void **state) {
    (void)state;
    fathom_config c = logged();
    fathom_pose poses[4];
    size_t size = (size_t)fathom_memory_required(&c, NULL, 0);
    void *block = malloc(size);
    assert_non_null(block);
    for (int round = 0; round < 4; round++) {
        fathom *scan;
        c.buffers = round == 3 ? FATHOM_BUFFERS_DEVICE : FATHOM_BUFFERS_HOST;
        if (round == 3) {
            fathom_memory_plan plan = FATHOM_STRUCT(fathom_memory_plan);
            assert_int_equal(fathom_plan_memory(&c, &plan, NULL, 0), FATHOM_OK);
            assert_true(plan.device_bytes > 4 << 20 && (size_t)plan.host_bytes < size / 4);
        }
        assert_int_equal(fathom_init(&scan, &c, block, size, NULL, 0), FATHOM_OK);
        for (int k = 0; k < FRAMES; k++)
            poses[round] = synthetic_step(scan, &frames[k]).pose;
        fathom_close(scan);
        memset(block, round * 85, size);
    }
    for (int round = 1; round < 4; round++) assert_memory_equal(&poses[round], &poses[0], sizeof *poses);
    assert_int_equal(kept.errors, 0);
    free(block);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(names_are_given_for_any_value),
        cmocka_unit_test(default_settings_need_at_most_128_mb),
        cmocka_unit_test(presets_keep_to_their_memory),
        cmocka_unit_test(memory_follows_the_settings),
        cmocka_unit_test(the_cap_holds_what_the_device_holds_too),
        cmocka_unit_test(a_block_one_byte_short_is_refused_untouched),
        cmocka_unit_test(an_unaligned_block_will_do_and_its_neighbours_are_safe),
        cmocka_unit_test(null_arguments_are_refused),
        cmocka_unit_test(each_bad_setting_is_refused_by_name),
        cmocka_unit_test(settings_that_disagree_are_refused),
        cmocka_unit_test(without_a_log_the_library_is_silent),
        cmocka_unit_test(a_block_serves_again_and_again),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
