/* A context's life: built inside the caller's block, started over, closed. */
#include <string.h>

#include "api/call.h"
#include "api/plan.h"
#include "api/warm_up.h"
#include "base/log.h"
#include "cl/program.h"

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
    if (f->device.error != FATHOM_OK) return;
    depth_noise_reset(&f->noise);
    integrator_clear(&f->integrator);
    inertial_drain(&f->inertial);
    inertial_reset(&f->inertial);
    pose_take(&f->config.first_pose, &f->pose);
    odometry_start(&f->odometry, &f->pose);
    span_reset(&f->span);
    memset(f->covariance, 0, sizeof f->covariance);
    f->timestamp_ns = INT64_MIN;
    f->started = f->paused = f->said_full = false;
    tracker_reset(&f->tracker);
    f->recent.count = 0;
    f->result = FATHOM_STRUCT(fathom_result);
    f->result.state = FATHOM_RECKONED;
    f->result.verdict = FATHOM_VERDICT_NO_DEPTH;
    f->result.pose = f->result.odometry = pose_give(&f->pose);
}

/* Builds the context in the block as planned with the scratch context. */
static int build(fathom *f, const fathom *scratch, const fathom_memory_plan *plan, arena *a) {
    memset(f, 0, sizeof *f);
    f->config = scratch->config;
    f->error = scratch->error;
    f->config.log_user = &f->error;
    f->device = scratch->device;
    f->device.config = &f->config;
    int e = device_open(&f->device);
    if (e != FATHOM_OK) return e;
    plan_layout(f, a, plan->blocks);
    f->arena_bytes = plan->host_bytes + plan->device_bytes;
    if (f->device.error == FATHOM_OK) warm_up(f);
    if (f->device.error == FATHOM_OK) program_to_cache(&f->device);
    if (f->device.error == FATHOM_OK) start_over(f);
    if (f->device.error != FATHOM_OK) {
        e = f->device.error;
        close_parts(f);
        return e;
    }
    log_write(&f->config, FATHOM_LOG_INFO, "OpenCL device %s, maps %dx%d, %d blocks, %.1f MB", plan->device,
               plan->align_width, plan->align_height, plan->blocks, (double)f->arena_bytes / 1048576);
    return FATHOM_OK;
}

static int init(fathom **context, fathom *scratch, const fathom_config *config, void *memory, size_t size,
                char *why, size_t why_size) {
    fathom_memory_plan plan;
    error_text *r = &scratch->error;
    int e = plan_make(scratch, config, &plan);
    if (e == FATHOM_OK && (!context || !memory))
        e = error_text_fail(r, FATHOM_ERROR_ARGUMENT, FATHOM_LOG_ERROR, "%s is NULL",
                            context ? "memory" : "context");
    if (e == FATHOM_OK && size < (size_t)plan.host_bytes)
        e = error_text_fail(r, FATHOM_ERROR_MEMORY, FATHOM_LOG_ERROR,
                            "the block has %zu bytes; these settings need %lld", size,
                            (long long)plan.host_bytes);
    if (e != FATHOM_OK) {
        error_text_copy(r, why, why_size);
        return e;
    }
    size_t lost;
    arena a = {arena_align(memory, &lost), 0, 0};
    a.size = size - lost;
    /* every page is made resident now, not when the surface first grows into it, so that memory can't run out later */
    for (size_t i = 0; i < a.size && i < (size_t)plan.host_bytes; i += 4096) a.base[i] = 0;
    fathom *f = arena_take(&a, sizeof *f);
    e = build(f, scratch, &plan, &a);
    error_text_copy(&f->error, why, why_size);
    if (e == FATHOM_OK) *context = f;
    return e;
}

int fathom_init(fathom **context, const fathom_config *config, void *memory, size_t size, char *why,
                size_t why_size) {
    fathom scratch;
    if (context) *context = NULL;
    return init(context, &scratch, config, memory, size, why, why_size);
}

void fathom_close(fathom *f) {
    if (f) close_parts(f);
}

int fathom_reset(fathom *f) {
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    start_over(f);
    return call_end(f);
}

int fathom_save_kernels(fathom *f, const char *path) {
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    if (!path || !*path) return call_refuse(f, "the kernels' path is NULL or empty");
    bool saved = program_save(&f->device, path);
    e = call_end(f);
    return e != FATHOM_OK ? e : saved ? FATHOM_OK : FATHOM_ERROR_KERNEL;
}

int fathom_pause(fathom *f, bool pause) {
    int e = call_begin(f);
    if (e == FATHOM_OK) f->paused = pause;
    return e;
}
