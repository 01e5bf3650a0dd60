/* The public API: checks what comes from the caller, lays the context out in the caller's block, hands on. */
#include "fathom.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "api/settings.h"
#include "context.h"
#include "api/warm_up.h"
#include "base/log.h"
#include "base/stamps.h"
#include "cl/program.h"

#define STRING_(x) #x
#define STRING(x) STRING_(x)

const char *fathom_version(void) {
    return STRING(FATHOM_VERSION_MAJOR) "." STRING(FATHOM_VERSION_MINOR) "." STRING(FATHOM_VERSION_PATCH);
}

const char *fathom_error_name(int error) {
    switch (error) {
    case FATHOM_OK: return "FATHOM_OK";
    case FATHOM_ERROR_ARGUMENT: return "FATHOM_ERROR_ARGUMENT";
    case FATHOM_ERROR_CONFIG: return "FATHOM_ERROR_CONFIG";
    case FATHOM_ERROR_MEMORY: return "FATHOM_ERROR_MEMORY";
    case FATHOM_ERROR_DEVICE: return "FATHOM_ERROR_DEVICE";
    case FATHOM_ERROR_KERNEL: return "FATHOM_ERROR_KERNEL";
    case FATHOM_ERROR_TIME: return "FATHOM_ERROR_TIME";
    case FATHOM_ERROR_SIZE: return "FATHOM_ERROR_SIZE";
    case FATHOM_ERROR_STOPPED: return "FATHOM_ERROR_STOPPED";
    case FATHOM_ERROR_NO_DATA: return "FATHOM_ERROR_NO_DATA";
    }
    return error > 0 ? "FATHOM_OK" : "FATHOM_ERROR_UNKNOWN";
}

const char *fathom_state_name(fathom_state state) {
    static const char *const names[] = {"first", "tracked", "reckoned", "lost"};
    return (unsigned)state < 4 ? names[state] : "unknown";
}

const char *fathom_verdict_name(fathom_verdict verdict) {
    static const char *const names[] = {"tracking",  "no depth",   "few pairs",     "overlap",  "residual",
                                        "condition", "innovation", "contradiction", "uncertain"};
    return (unsigned)verdict < 9 ? names[verdict] : "unknown";
}

const char *fathom_imu_health_name(fathom_imu_health health) {
    static const char *const names[] = {"unchecked", "good", "saturated", "units", "scale",    "axes",
                                        "mounting",  "sign", "clock",     "stuck", "unrelated"};
    return (unsigned)health < 11 ? names[health] : "unknown";
}

/* ---- layout ------------------------------------------------------------------------------------------------------------- */

/* Tiles of the largest view that is ray-cast: the finest maps, or the wide view where maps are small. */
static int most_tiles(const fathom *f) {
    int finest = kernel_tiles(&f->maps.camera[FINEST]), wide = kernel_tiles(&f->tracker.view.wide);
    return finest > wide ? finest : wide;
}

/* Lays all parts out: only counts while the device isn't open and the arena has no base. */
static void layout(fathom *f, arena *a, int blocks) {
    depth_maps_init(&f->maps, &f->device, a, &f->config);
    mesher_init(&f->mesher, &f->device, a);
    viewer_init(&f->viewer, &f->device, a, &f->maps);
    integrator_init(&f->integrator, &f->device, a, &f->config, &f->maps);
    store_init(&f->store, &f->config);
    inertial_init(&f->inertial, a, &f->config);
    whole_mesh_init(&f->patch, &f->device, a, &f->config);
    tracker_init(&f->tracker, &f->device, a, &f->config, &f->maps, &f->raycaster, &f->inertial);
    fusing_init(&f->fusing, &f->device, &f->config, &f->maps, &f->volume, &f->integrator, &f->store);
    raycaster_init(&f->raycaster, &f->device, a, &f->volume, most_tiles(f));
    volume_init(&f->volume, &f->device, a, &f->config, blocks);
}

static int64_t bytes_with(fathom *f, int blocks, int64_t *device_bytes) {
    arena a = {NULL, 0, 0};
    arena_take(&a, sizeof(fathom));
    f->device.device_bytes = 0;
    layout(f, &a, blocks);
    *device_bytes = (int64_t)f->device.device_bytes;
    return (int64_t)a.used + ARENA_ALIGNMENT - 1;
}

/* f is a scratch context, for counting. */
static int make_plan(fathom *f, const fathom_config *config, fathom_memory_plan *plan) {
    memset(f, 0, sizeof *f);
    memset(plan, 0, sizeof *plan);
    kernel_camera camera;
    int e = config_check(config);
    if (e == FATHOM_OK) e = depth_maps_camera(config, &camera);
    f->config = *config;
    if (e == FATHOM_OK) e = device_choose(&f->device, &f->config);
    if (e != FATHOM_OK) return e;
    int blocks = config->max_blocks;
    int64_t device_bytes, fixed = bytes_with(f, 1, &device_bytes) + device_bytes;
    if (blocks == 0) {
        int64_t room = (config->max_memory_bytes - fixed) / (int64_t)volume_block_cost();
        blocks = (int)(room < CONFIG_BLOCKS_MOST ? room : CONFIG_BLOCKS_MOST);
    }
    int64_t host_bytes = bytes_with(f, blocks > 0 ? blocks : 1, &device_bytes);
    if (blocks < CONFIG_BLOCKS_LEAST || host_bytes + device_bytes > config->max_memory_bytes) {
        log_write(config, FATHOM_LOG_ERROR,
                  "max_memory_bytes %.1f MB can't hold the settings: %.1f MB and 2 KB for each of %d blocks",
                  (double)config->max_memory_bytes / 1048576, (double)fixed / 1048576,
                  blocks > CONFIG_BLOCKS_LEAST ? blocks : CONFIG_BLOCKS_LEAST);
        return FATHOM_ERROR_MEMORY;
    }
    plan->host_bytes = host_bytes;
    plan->device_bytes = device_bytes;
    plan->blocks = blocks;
    plan->align_width = camera.width;
    plan->align_height = camera.height;
    snprintf(plan->device, sizeof plan->device, "%s", f->device.name);
    return FATHOM_OK;
}

int fathom_memory_plan_for(const fathom_config *config, fathom_memory_plan *plan) {
    if (!config || !plan) return FATHOM_ERROR_ARGUMENT;
    fathom scratch;
    return make_plan(&scratch, config, plan);
}

int64_t fathom_memory_required(const fathom_config *config) {
    fathom_memory_plan plan;
    int e = fathom_memory_plan_for(config, &plan);
    return e == FATHOM_OK ? plan.host_bytes : e;
}

/* ---- life --------------------------------------------------------------------------------------------------------------- */

static void close_parts(fathom *f) {
    volume_close(&f->volume);
    integrator_close(&f->integrator);
    raycaster_close(&f->raycaster);
    whole_mesh_close(&f->patch);
    mesher_close(&f->mesher);
    viewer_close(&f->viewer);
    tracker_close(&f->tracker);
    depth_maps_close(&f->maps);
    device_close(&f->device);
}

static void start_over(fathom *f) {
    volume_clear(&f->volume, &f->device);
    integrator_clear(&f->integrator);
    inertial_drain(&f->inertial);
    inertial_reset(&f->inertial);
    pose_from_matrix(f->config.first_pose, &f->pose);
    memset(f->covariance, 0, sizeof f->covariance);
    odometry_start(&f->odometry, &f->pose);
    f->timestamp_ns = INT64_MIN;
    f->started = f->said_full = false;
    tracker_reset(&f->tracker);
    memset(&f->result, 0, sizeof f->result);
    f->result.state = FATHOM_RECKONED;
    f->result.verdict = FATHOM_VERDICT_NO_DEPTH;
    pose_to_matrix(&f->pose, f->result.pose);
}

int fathom_init(fathom **context, const fathom_config *config, void *memory, size_t size) {
    if (!context) return FATHOM_ERROR_ARGUMENT;
    *context = NULL;
    if (!config || !memory) return FATHOM_ERROR_ARGUMENT;
    fathom scratch;
    fathom_memory_plan plan;
    int e = make_plan(&scratch, config, &plan);
    if (e != FATHOM_OK) return e;
    if (size < (size_t)plan.host_bytes) {
        log_write(config, FATHOM_LOG_ERROR, "the block has %zu bytes; these settings need %lld", size,
                  (long long)plan.host_bytes);
        return FATHOM_ERROR_MEMORY;
    }
    size_t lost;
    arena a = {arena_align(memory, &lost), 0, 0};
    a.size = size - lost;
    /* every page is made resident now, not when the surface first grows into it: nothing is left to run short later */
    for (size_t i = 0; i < a.size && i < (size_t)plan.host_bytes; i += 4096) a.base[i] = 0;
    fathom *f = arena_take(&a, sizeof *f);
    memset(f, 0, sizeof *f);
    f->config = *config;
    f->device = scratch.device;
    f->device.config = &f->config;
    e = device_open(&f->device);
    if (e != FATHOM_OK) return e;
    layout(f, &a, plan.blocks);
    f->arena_bytes = plan.host_bytes + plan.device_bytes;
    if (f->device.error == FATHOM_OK) warm_up(f);
    if (f->device.error == FATHOM_OK) program_to_cache(&f->device);
    if (f->device.error == FATHOM_OK) start_over(f);
    if (f->device.error != FATHOM_OK) {
        e = f->device.error;
        close_parts(f);
        return e;
    }
    log_write(config, FATHOM_LOG_INFO, "OpenCL device %s, maps %dx%d, %d blocks, %.1f MB", plan.device,
              plan.align_width, plan.align_height, plan.blocks, (double)f->arena_bytes / 1048576);
    *context = f;
    return FATHOM_OK;
}

void fathom_close(fathom *f) {
    if (f) close_parts(f);
}

int fathom_reset(fathom *f) {
    if (!f) return FATHOM_ERROR_ARGUMENT;
    start_over(f);
    return f->device.error;
}

int fathom_save_kernels(fathom *f, const char *path) {
    if (!f || !path || !*path) return FATHOM_ERROR_ARGUMENT;
    return program_save(&f->device, path) ? FATHOM_OK : FATHOM_ERROR_KERNEL;
}

int fathom_pause(fathom *f, bool pause) {
    if (!f) return FATHOM_ERROR_ARGUMENT;
    f->paused = pause;
    return FATHOM_OK;
}

/* ---- input and steps ------------------------------------------------------------------------------------------------------ */

int fathom_push_imu(fathom *f, const fathom_imu_sample *sample) {
    if (!f || !sample) return FATHOM_ERROR_ARGUMENT;
    return inertial_push(&f->inertial, sample);
}

int fathom_step(fathom *f, const fathom_depth_frame *frame, fathom_result *result) {
    if (!f || !frame || !frame->depth || !result) return FATHOM_ERROR_ARGUMENT;
    int e = f->device.error;
    if (e == FATHOM_OK &&
        (frame->width != f->config.depth_width || frame->height != f->config.depth_height)) {
        log_write(&f->config, FATHOM_LOG_WARNING, "a frame of %dx%d was ignored: the settings say %dx%d",
                  frame->width, frame->height, f->config.depth_width, f->config.depth_height);
        e = FATHOM_ERROR_SIZE;
    }
    if (e == FATHOM_OK && !stamp_valid(frame->timestamp_ns)) {
        log_write(&f->config, FATHOM_LOG_WARNING,
                  "a frame stamped %lld ns was ignored: more than 126 years from zero",
                  (long long)frame->timestamp_ns);
        e = FATHOM_ERROR_TIME;
    }
    if (e == FATHOM_OK && f->timestamp_ns != INT64_MIN && frame->timestamp_ns <= f->timestamp_ns) {
        log_write(&f->config, FATHOM_LOG_WARNING,
                  "a frame stamped %.6f s was ignored: the one before has %.6f s",
                  1e-9 * (double)frame->timestamp_ns, 1e-9 * (double)f->timestamp_ns);
        e = FATHOM_ERROR_TIME;
    }
    if (e != FATHOM_OK) {
        if (e != FATHOM_ERROR_DEVICE) f->frames_ignored++;
        *result = f->result;
        return e;
    }
    step(f, frame, result);
    if (result->pool_full && !f->said_full) {
        f->said_full = true;
        log_write(&f->config, FATHOM_LOG_WARNING,
                  "the block pool is full (%d blocks): the surface no longer grows, tracking goes on",
                  f->volume.pool.capacity);
    }
    return f->device.error;
}

int fathom_inertial_estimate(fathom *f, int64_t from_ns, int64_t to_ns, fathom_motion *motion) {
    if (!f || !motion || !stamp_valid(from_ns) || !stamp_valid(to_ns)) return FATHOM_ERROR_ARGUMENT;
    inertial_motion m;
    inertial_drain(&f->inertial);
    int e = inertial_estimate(&f->inertial, from_ns, to_ns, &m);
    if (e != FATHOM_OK) return e;
    pose_to_matrix(&m.motion, motion->motion);
    for (int i = 0; i < 36; i++) motion->covariance[i] = (float)m.covariance[i];
    return FATHOM_OK;
}

int fathom_pose(fathom *f, float matrix[16], float covariance[36]) {
    if (!f || !matrix) return FATHOM_ERROR_ARGUMENT;
    pose_to_matrix(&f->pose, matrix);
    for (int i = 0; covariance && i < 36; i++) covariance[i] = (float)f->covariance[i];
    return FATHOM_OK;
}

int fathom_get_rig(fathom *f, fathom_rig *rig) {
    if (!f || !rig) return FATHOM_ERROR_ARGUMENT;
    inertial_rig(&f->inertial, rig);
    return FATHOM_OK;
}

int fathom_get_counters(fathom *f, fathom_counters *counters) {
    if (!f || !counters) return FATHOM_ERROR_ARGUMENT;
    inertial_drain(&f->inertial);
    memset(counters, 0, sizeof *counters);
    inertial_count(&f->inertial, counters);
    counters->frames_ignored = f->frames_ignored;
    counters->blocks_dropped = f->store.dropped;
    counters->blocks_restored = f->store.restored;
    counters->blocks_refused = f->integrator.refused;
    return FATHOM_OK;
}

/* ---- surface -------------------------------------------------------------------------------------------------------------- */

static int view_check(const fathom *f, const fathom_view *v, pose *at) {
    bool good = v->width >= 1 && v->width <= 16384 && v->height >= 1 && v->height <= 16384 && v->fx > 0 &&
                v->fy > 0 && isfinite(v->fx) && isfinite(v->fy) && isfinite(v->cx) && isfinite(v->cy) &&
                v->near_m >= 0 && v->far_m >= 0 && pose_from_matrix(v->pose, at);
    if (!good)
        log_write(&f->config, FATHOM_LOG_ERROR, "the view's size, intrinsics, range or pose is not valid");
    return good ? FATHOM_OK : FATHOM_ERROR_ARGUMENT;
}

int fathom_model_maps(fathom *f, const fathom_view *view, float *depth, float *normals) {
    pose at;
    if (!f || !view) return FATHOM_ERROR_ARGUMENT;
    int e = view_check(f, view, &at);
    return e != FATHOM_OK
               ? e
               : view_render(&f->viewer, &f->device, &f->raycaster, view, &at, depth, normals, NULL);
}

int fathom_shaded_view(fathom *f, const fathom_view *view, uint8_t *rgb) {
    pose at;
    if (!f || !view || !rgb) return FATHOM_ERROR_ARGUMENT;
    int e = view_check(f, view, &at);
    return e != FATHOM_OK ? e : view_render(&f->viewer, &f->device, &f->raycaster, view, &at, NULL, NULL, rgb);
}

int64_t fathom_extract_mesh(fathom *f, float min_weight, fathom_triangles triangles, void *user) {
    if (!f || !triangles || !(min_weight >= 0)) return FATHOM_ERROR_ARGUMENT;
    if (f->device.error != FATHOM_OK) return f->device.error;
    return mesh_extract(&f->mesher, &f->device, &f->volume, min_weight, triangles, user);
}

int64_t fathom_extract_whole_mesh(fathom *f, float min_weight, const int32_t *dropped, size_t count,
                                  fathom_triangles triangles, void *user) {
    const int32_t most = 1 << 27; /* voxels are counted in 32 bits */
    if (count == 0) return fathom_extract_mesh(f, min_weight, triangles, user);
    if (!f || !triangles || !dropped || !(min_weight >= 0)) return FATHOM_ERROR_ARGUMENT;
    if (f->patch.pool.capacity == 0 || !f->config.block_in) {
        log_write(&f->config, FATHOM_LOG_ERROR,
                  "a mesh of dropped blocks needs FATHOM_FULL_DROP and block_in");
        return FATHOM_ERROR_ARGUMENT;
    }
    for (size_t i = 0; i < 3 * count; i++)
        if (dropped[i] < -most || dropped[i] > most) return FATHOM_ERROR_ARGUMENT;
    if (f->device.error != FATHOM_OK) return f->device.error;
    return whole_mesh_extract(&f->patch, &f->volume, &f->mesher, &f->device, &f->store, dropped, count, min_weight,
                              triangles, user);
}
