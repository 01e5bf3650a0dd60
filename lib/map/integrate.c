#include "map/integrate.h"

#include <string.h>

#define SETTLING 8 /* frames */

void integrator_init(integrator *g, device *d, arena *a, const fathom_config *c, const depth_maps *maps) {
    const kernel_camera *camera = &maps->camera[FINEST];
    memset(g, 0, sizeof *g);
    g->max_weight = c->max_weight;
    g->tiles = kernel_tiles(camera);
    device_buffer_make(d, a, (size_t)g->tiles * TILE_SLOTS * sizeof(cl_int4), &g->requests);
    device_buffer_make(d, a, (size_t)g->tiles * sizeof(cl_int), &g->counts);
    device_buffer_make(d, a, (size_t)g->tiles * sizeof(cl_float), &g->farthest);
    device_buffer_make(d, a, (size_t)camera->width * (size_t)camera->height * sizeof(cl_uint2), &g->planes);
    if (!d->context) return;
    g->request = device_kernel(d, "request_blocks");
    g->mark_seen = device_kernel(d, "mark_seen");
    g->clear = device_kernel(d, "clear_blocks");
    g->pack_planes = device_kernel(d, "pack_planes");
    g->fuse = device_kernel(d, "fuse_blocks");
}

void integrator_close(integrator *g) {
    cl_kernel kernels[] = {g->request, g->mark_seen, g->clear, g->pack_planes, g->fuse};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i]) clReleaseKernel(kernels[i]);
    device_buffer *buffers[] = {&g->requests, &g->counts, &g->farthest, &g->planes};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) device_buffer_free(buffers[i]);
}

void integrator_clear(integrator *g) {
    g->before += g->frames;
    g->settled = g->settling = g->frames = 0;
    g->full = false;
}

int64_t integrator_generation(const integrator *g) {
    return g->before + g->frames;
}

int integrator_request(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world,
                       bool calm) {
    kernel_rigid rigid = kernel_rigid_of(camera_to_world);
    cl_int turn = calm ? g->frames & 1 : -1;
    cl_float block_m = v->surface.voxel * BLOCK_EDGE;
    g->full = false;
    size_t rows = (size_t)(maps->camera[FINEST].height + TILE - 1) / TILE, columns = (size_t)g->tiles / rows;
    RUN_ROWS(d, g->request, columns, rows, ARG(maps->depth[FINEST].memory), ARG(maps->camera[FINEST]),
             ARG(rigid), ARG(block_m), ARG(v->surface.truncation), ARG(v->table.entries.memory),
             ARG(v->surface.mask), ARG(v->surface.submap), ARG(g->requests.memory), ARG(g->counts.memory),
             ARG(g->farthest.memory), ARG(turn));
    cl_int *counts = device_map(d, &g->counts, CL_MAP_READ);
    int wanted = 0;
    for (int i = 0; counts && i < g->tiles; i++) wanted += counts[i];
    device_unmap(d, &g->counts, counts);
    return wanted;
}

void integrator_mark_seen(integrator *g, device *d, volume *v, depth_maps *maps,
                          const pose *camera_to_world) {
    pose inverse = pose_inverse(camera_to_world);
    kernel_rigid rigid = kernel_rigid_of(&inverse);
    cl_int frame = g->frames + 1;
    RUN(d, g->mark_seen, (size_t)v->pool.count, 1, 1, ARG(maps->camera[FINEST]), ARG(g->farthest.memory),
        ARG(rigid), ARG(v->surface), ARG(v->pool.keys.memory), ARG(frame), ARG(v->pool.seen.memory));
}

int integrator_allocate(integrator *g, device *d, volume *v) {
    volume_view view;
    int first = v->pool.count;
    cl_int *counts = device_map(d, &g->counts, CL_MAP_READ);
    cl_int4 *requests = device_map(d, &g->requests, CL_MAP_READ);
    bool mapped = volume_map(v, d, CL_MAP_READ | CL_MAP_WRITE, false, &view);
    /* tile by tile, slot by slot: the order of the places depends on the frame alone */
    for (int i = 0; counts && requests && mapped && i < g->tiles; i++)
        for (int j = 0; j < counts[i]; j++) {
            const cl_int4 *key = &requests[i * TILE_SLOTS + j];
            if (volume_place(&view, key) >= 0) continue;
            if (v->pool.count == v->pool.capacity) {
                g->full = true;
                g->refused++;
                continue;
            }
            volume_add(v, &view, key, g->frames + 1);
        }
    volume_unmap(v, d, &view);
    device_unmap(d, &g->requests, requests);
    device_unmap(d, &g->counts, counts);
    integrator_clear_blocks(g, d, v, first, v->pool.count - first);
    return first;
}

void integrator_clear_blocks(integrator *g, device *d, volume *v, int first, int count) {
    cl_int from = first;
    /* a group of one: PoCL compiles a kernel for each group size, and would choose the size by the count */
    RUN(d, g->clear, (size_t)count, BLOCK_SHORTS / 8, 1, ARG(from), ARG(v->pool.voxels.memory));
}

void integrator_fuse(integrator *g, device *d, volume *v, depth_maps *maps, const pose *camera_to_world,
                     bool calm) {
    pose inverse = pose_inverse(camera_to_world);
    kernel_rigid rigid = kernel_rigid_of(&inverse);
    if (g->frames++ % SETTLING == 0) {
        g->settled = g->settling;
        g->settling = v->pool.count;
    }
    cl_int settled = calm ? g->settled : 0, turn = g->frames & 1;
    const kernel_camera *camera = &maps->camera[FINEST];
    RUN_ROWS(d, g->pack_planes, camera->width, camera->height, ARG(maps->depth[FINEST].memory),
             ARG(maps->smooth.memory), ARG(maps->raw_m), ARG(maps->normals[FINEST].memory), ARG(*camera), ARG(maps->noise), ARG(g->planes.memory));
    RUN_ROWS(d, g->fuse, 64, v->pool.count, ARG(g->planes.memory), ARG(*camera), ARG(g->farthest.memory),
             ARG(rigid), ARG(v->surface), ARG(g->max_weight), ARG(v->pool.keys.memory), ARG(settled),
             ARG(turn), ARG(g->frames), ARG(v->pool.seen.memory), ARG(v->pool.voxels.memory));
}
