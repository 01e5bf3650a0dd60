#include "api/plan.h"

#include <stdio.h>
#include <string.h>

#include "api/config.h"
#include "api/settings.h"
#include "base/log.h"
#include "base/sized.h"

/* Tiles of the largest ray-cast view: the finest maps, or the wide view where maps are small. */
static int max_tiles(const fathom *f) {
    int finest = kernel_tiles(&f->maps.camera[FINEST]), wide = kernel_tiles(&f->tracker.view.wide);
    return finest > wide ? finest : wide;
}

void plan_layout(fathom *f, arena *a, int blocks) {
    depth_noise_init(&f->noise, &f->config);
    depth_maps_init(&f->maps, &f->device, a, &f->config);
    mesher_init(&f->mesher, &f->device, a);
    viewer_init(&f->viewer, &f->device, a, &f->maps);
    integrator_init(&f->integrator, &f->device, a, &f->config, &f->maps);
    store_init(&f->store, &f->config);
    inertial_init(&f->inertial, a, &f->config);
    f->recent.results = arena_take(a, FATHOM_RECENT * sizeof *f->recent.results);
    span_init(&f->span, a);
    whole_mesh_init(&f->patch, &f->device, a, &f->config);
    tracker_init(&f->tracker, &f->device, a, &f->config, &f->maps, &f->raycaster, &f->inertial);
    fusing_init(&f->fusing, &f->device, &f->config, &f->maps, &f->volume, &f->integrator, &f->store);
    raycaster_init(&f->raycaster, &f->device, a, &f->volume, max_tiles(f));
    volume_init(&f->volume, &f->device, a, &f->config, blocks);
}

static int64_t bytes_with(fathom *f, int blocks, int64_t *device_bytes) {
    arena a = {NULL, 0, 0};
    arena_take(&a, sizeof(fathom));
    f->device.device_bytes = 0;
    plan_layout(f, &a, blocks);
    *device_bytes = (int64_t)f->device.device_bytes;
    return (int64_t)a.used + ARENA_ALIGNMENT - 1;
}

int plan_make(fathom *f, const fathom_config *given, fathom_memory_plan *plan) {
    memset(f, 0, sizeof *f);
    memset(plan, 0, sizeof *plan);
    kernel_camera camera;
    const fathom_config *config = &f->config;
    int e = config_take(given, &f->config, &f->error);
    if (e == FATHOM_OK) e = config_check(config);
    if (e == FATHOM_OK && !store_init(&f->store, config))
        e = error_text_fail(&f->error, FATHOM_ERROR_CONFIG, FATHOM_LOG_ERROR,
                            "block_store's struct_size isn't set, or it has calls of a later version: "
                            "FATHOM_STRUCT(fathom_block_store)");
    if (e == FATHOM_OK) e = depth_maps_camera(config, &camera);
    if (e == FATHOM_OK) e = device_choose(&f->device, config);
    if (e != FATHOM_OK) return e;
    int blocks = config->max_blocks;
    int64_t device_bytes, fixed = bytes_with(f, 1, &device_bytes) + device_bytes;
    if (blocks == 0) {
        int64_t room = (config->max_memory_bytes - fixed) / (int64_t)volume_block_cost();
        blocks = (int)(room < CONFIG_MAX_BLOCKS ? room : CONFIG_MAX_BLOCKS);
    }
    int64_t host_bytes = bytes_with(f, blocks > 0 ? blocks : 1, &device_bytes);
    if (blocks < CONFIG_MIN_BLOCKS || host_bytes + device_bytes > config->max_memory_bytes) {
        log_write(config, FATHOM_LOG_ERROR,
                   "max_memory_bytes %.1f MB can't hold the settings: %.1f MB and 2 KB for each of %d blocks",
                   (double)config->max_memory_bytes / 1048576, (double)fixed / 1048576,
                   blocks > CONFIG_MIN_BLOCKS ? blocks : CONFIG_MIN_BLOCKS);
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

/* Plans with a scratch context. */
static int make(const fathom_config *config, fathom_memory_plan *plan, char *why, size_t why_size) {
    fathom scratch;
    int e = plan_make(&scratch, config, plan);
    error_text_copy(&scratch.error, why, why_size);
    return e;
}

int fathom_plan_memory(const fathom_config *config, fathom_memory_plan *plan, char *why, size_t why_size) {
    fathom_memory_plan whole;
    const size_t size = sized_of(plan);
    if (size == 0) {
        const error_text r = {
            .text = "plan is NULL, or its struct_size isn't set: FATHOM_STRUCT(fathom_memory_plan)"};
        error_text_copy(&r, why, why_size);
        return FATHOM_ERROR_ARGUMENT;
    }
    int e = make(config, &whole, why, why_size);
    sized_out(plan, size, &whole, sizeof whole);
    return e;
}

int64_t fathom_memory_required(const fathom_config *config, char *why, size_t why_size) {
    fathom_memory_plan plan;
    int e = make(config, &plan, why, why_size);
    return e == FATHOM_OK ? plan.host_bytes : e;
}
