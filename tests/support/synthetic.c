#include "synthetic.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include "simulate/camera_path.h"
#include "simulate/imu_model.h"
#include "base/covariance.h"
#include "base/se3.h"

#define FIRST_S 1.0 /* the stamp of frame 0 */

static const struct render_camera camera = {SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT, 131.25, 131.25, 79.5, 59.5};

static void make_path(enum scene_kind kind, double still_s, struct scene *scene, struct camera_path *path) {
    if (!scene_make(scene, kind, SYNTHETIC_SEED, 10.0)) {
        fprintf(stderr, "no scene\n");
        exit(1);
    }
    camera_path_make(path, scene, FIRST_S + still_s, 1.0, 1.0);
}

void synthetic_render(enum scene_kind kind, double still_s, int count, synthetic_frame *frames) {
    static float depth[SYNTHETIC_PIXELS];
    struct scene scene;
    struct camera_path path;
    make_path(kind, still_s, &scene, &path);
    for (int i = 0; i < count; i++) {
        struct camera_pose at;
        camera_path_pose(&path, FIRST_S + 1e-9 * SYNTHETIC_PERIOD_NS * i, &at);
        if (!render_depth(&scene, &camera, &at, 12.0, 2, depth, NULL)) exit(1);
        frames[i].timestamp_ns = (int64_t)(FIRST_S * 1e9) + (int64_t)i * SYNTHETIC_PERIOD_NS;
        for (int k = 0; k < SYNTHETIC_PIXELS; k++)
            frames[i].depth[k] = (uint16_t)lround(depth[k] * SYNTHETIC_UNITS);
        pose p;
        memcpy(p.r, at.rotation, sizeof p.r);
        memcpy(p.t, at.position, sizeof p.t);
        frames[i].pose = pose_give(&p);
    }
    scene_free(&scene);
}

int synthetic_imu(enum scene_kind kind, double still_s, int frames, const char *grade, double rate, int most,
                  fathom_imu_sample *samples) {
    static const struct imu_mounting on_the_camera;
    struct scene scene;
    struct camera_path path;
    struct imu_model model;
    double end = FIRST_S + 1e-9 * SYNTHETIC_PERIOD_NS * (frames - 1);
    int count = 0;
    make_path(kind, still_s, &scene, &path);
    imu_model_make(&model, imu_grade_of(grade), &on_the_camera, rate, SYNTHETIC_SEED);
    while (count < most) {
        struct imu_sample s;
        imu_model_next(&model, &path, &s);
        if (s.stamp > end) break;
        if (s.stamp < FIRST_S - 0.2) continue;
        fathom_imu_sample *out = &samples[count++];
        out->timestamp_ns = (int64_t)llround(s.stamp * 1e9);
        for (int k = 0; k < 3; k++) {
            out->gyro[k] = (float)s.gyro[k];
            out->accel[k] = (float)s.accel[k];
        }
    }
    scene_free(&scene);
    return count;
}

const char *synthetic_folder(const char *name) {
    static char path[4096];
    ssize_t n = readlink("/proc/self/exe", path, sizeof path - 100);
    if (n <= 0) exit(1);
    path[n] = 0;
    snprintf(strrchr(path, '/'), 100, "/%s", name);
    mkdir(path, 0777);
    return path;
}

fathom_config synthetic_config(const synthetic_frame *first) {
    static char cache[4096];
    fathom_config c;
    fathom_config_init(&c);
    if (!*cache) snprintf(cache, sizeof cache, "%s", synthetic_folder("kernels"));
    c.depth_camera.width = SYNTHETIC_WIDTH;
    c.depth_camera.height = SYNTHETIC_HEIGHT;
    c.depth_camera.fx = camera.fx;
    c.depth_camera.fy = camera.fy;
    c.depth_camera.cx = camera.cx;
    c.depth_camera.cy = camera.cy;
    c.depth_units_per_metre = SYNTHETIC_UNITS;
    c.voxel_m = 0.02f;
    c.max_blocks = 6000;
    if (first) c.first_pose = first->pose;
    c.cache_folder = cache;
    return c;
}

synthetic_context synthetic_start(const fathom_config *config) {
    synthetic_context c = {NULL, NULL, 0};
    int64_t bytes = fathom_memory_required(config, NULL, 0);
    assert_true(bytes > 0);
    c.bytes = (size_t)bytes;
    c.block = malloc(c.bytes);
    assert_non_null(c.block);
    assert_int_equal(fathom_init(&c.scan, config, c.block, c.bytes, NULL, 0), FATHOM_OK);
    assert_non_null(c.scan);
    return c;
}

void synthetic_stop(synthetic_context *c) {
    fathom_close(c->scan);
    free(c->block);
    c->scan = NULL;
    c->block = NULL;
}

fathom_depth_frame synthetic_depth(int64_t timestamp_ns, const uint16_t *depth, int width, int height) {
    return (fathom_depth_frame){.struct_size = sizeof(fathom_depth_frame),
                                .timestamp_ns = timestamp_ns,
                                .depth = depth,
                                .width = width,
                                .height = height};
}

fathom_result synthetic_step(fathom *scan, const synthetic_frame *f) {
    fathom_depth_frame frame = synthetic_depth(f->timestamp_ns, f->depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    fathom_result r = FATHOM_STRUCT(fathom_result);
    assert_int_equal(fathom_step(scan, &frame, &r), FATHOM_OK);
    assert_true(r.timestamp_ns == f->timestamp_ns);
    synthetic_check_result(&r);
    return r;
}

fathom_result synthetic_blank(fathom *scan, int64_t timestamp_ns) {
    static const synthetic_frame blank;
    fathom_depth_frame frame = synthetic_depth(timestamp_ns, blank.depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    fathom_result r = FATHOM_STRUCT(fathom_result);
    assert_int_equal(fathom_step(scan, &frame, &r), FATHOM_OK);
    synthetic_check_result(&r);
    return r;
}

static void check_finite(const float *values, int count) {
    for (int i = 0; i < count; i++) assert_true(isfinite(values[i]));
}

void synthetic_check_result(const fathom_result *r) {
    for (int i = 0; i < 36; i++)
        assert_true(isfinite(r->pose_covariance[i]) && isfinite(r->odometry_covariance[i]));
    check_finite(r->singular_values, 6);
    const float rest[] = {r->rms_m,
                          r->weight,
                          r->prior_rotation_rad,
                          r->prior_translation_m,
                          r->innovation_sigmas,
                          r->ms_maps,
                          r->ms_align,
                          r->ms_fuse,
                          r->ms_raycast,
                          r->ms_total};
    check_finite(rest, 10);
    assert_false(isnan(r->condition));
    assert_true(r->ms_total >= 0 && r->pairs >= 0 && r->pairs <= r->overlap_pixels);
    assert_true(strcmp(fathom_state_name(r->state), "unknown") != 0);
    assert_true(strcmp(fathom_verdict_name(r->verdict), "unknown") != 0);
    pose p;
    assert_true(pose_take(&r->pose, &p) && pose_take(&r->odometry, &p));
    double c[36], e[6];
    for (int i = 0; i < 6; i++)
        for (int j = 0; j < 6; j++) {
            double scale = sqrt(r->pose_covariance[7 * i] * r->pose_covariance[7 * j]);
            assert_true(r->pose_covariance[7 * i] >= 0);
            assert_true(fabs(r->pose_covariance[6 * i + j] - r->pose_covariance[6 * j + i]) <= 1e-5 * scale);
            c[6 * i + j] = r->pose_covariance[6 * i + j];
        }
    /* positive, up to the rounding to floats: with a millionth more on its diagonal it has a Cholesky factor */
    for (int i = 0; i < 6; i++) {
        c[7 * i] = c[7 * i] * (1 + 1e-5) + 1e-20;
        e[i] = sqrt(c[7 * i]);
    }
    assert_true(isfinite(covariance_mahalanobis(c, e)));
}

static pose way(fathom_pose a, fathom_pose b) {
    pose from, to;
    assert_true(pose_take(&a, &from) && pose_take(&b, &to));
    return pose_between(&from, &to);
}

double synthetic_distance(fathom_pose a, fathom_pose b) {
    pose p = way(a, b);
    return pose_distance(&p);
}

double synthetic_angle(fathom_pose a, fathom_pose b) {
    pose p = way(a, b);
    return pose_angle(&p);
}

void synthetic_logger(void *user, fathom_log_level level, const char *text) {
    synthetic_log *log = user;
    int *counts[] = {&log->errors, &log->warnings, &log->infos};
    ++*counts[level];
    size_t left = sizeof log->text - log->used;
    int n = snprintf(log->text + log->used, left, "%s\n", text);
    log->used += (size_t)n < left ? (size_t)n : left - 1;
}

int synthetic_triangles(void *user, const fathom_vertex *vertices, size_t triangle_count) {
    synthetic_mesh *m = user;
    m->calls++;
    assert_true(triangle_count > 0);
    if (m->count + 3 * triangle_count > m->capacity) {
        m->capacity = 2 * m->capacity + 3 * triangle_count;
        m->vertices = realloc(m->vertices, m->capacity * sizeof *m->vertices);
        assert_non_null(m->vertices);
    }
    memcpy(m->vertices + m->count, vertices, 3 * triangle_count * sizeof *vertices);
    m->count += 3 * triangle_count;
    return m->stop_after > 0 && m->calls >= m->stop_after;
}

int synthetic_child(const char *argument, const char *variable, char *text, size_t size) {
    int ends[2];
    if (pipe(ends) != 0) return -1;
    fflush(NULL);
    pid_t child = fork();
    if (child < 0) return -1;
    if (child == 0) {
        char *with[] = {(char *)"test", (char *)argument, NULL};
        dup2(ends[1], 1);
        dup2(ends[1], 2);
        close(ends[0]);
        close(ends[1]);
        if (variable) putenv((char *)variable);
        execv("/proc/self/exe", with);
        _exit(127);
    }
    close(ends[1]);
    size_t used = 0;
    char part[4096];
    for (ssize_t n; (n = read(ends[0], part, sizeof part)) > 0;)
        for (ssize_t i = 0; i < n; i++)
            if (used + 1 < size) text[used++] = part[i];
    if (size > 0) text[used] = 0;
    close(ends[0]);
    int status = -1;
    waitpid(child, &status, 0);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}
