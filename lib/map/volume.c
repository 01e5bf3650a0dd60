#include "map/volume.h"

#include <math.h>
#include <string.h>

#define SETTLING 8 /* frames */

/* The table has at least two entries a block, so that a search ends soon. */
static size_t table_entries(int blocks) {
    size_t n = 1024;
    while (n < 2 * (size_t)blocks) n *= 2;
    return n;
}

size_t volume_block_cost(void) {
    return BLOCK_BYTES + sizeof(cl_int4) * 5 +
           sizeof(cl_int); /* voxels, coordinates, at most four table entries, seen */
}

void volume_init(volume *v, device *d, arena *a, const fathom_config *c, const depth_maps *maps, int blocks) {
    memset(v, 0, sizeof *v);
    const kernel_camera *camera = &maps->camera[FINEST];
    size_t entries = table_entries(blocks);
    v->capacity = blocks;
    v->surface = (kernel_surface){c->voxel_m, c->truncation_m > 0 ? c->truncation_m : 4 * c->voxel_m,
                                  (cl_uint)(entries - 1), 0};
    v->max_weight = c->max_weight;
    v->tiles = ((camera->width + TILE - 1) / TILE) * ((camera->height + TILE - 1) / TILE);
    device_buffer_make(d, a, (size_t)blocks * BLOCK_BYTES, &v->voxels);
    device_buffer_make(d, a, entries * sizeof(cl_int4), &v->table);
    device_buffer_make(d, a, (size_t)blocks * sizeof(cl_int4), &v->blocks);
    device_buffer_make(d, a, (size_t)blocks * sizeof(cl_int), &v->seen);
    device_buffer_make(d, a, (size_t)v->tiles * TILE_SLOTS * sizeof(cl_int4), &v->requests);
    device_buffer_make(d, a, (size_t)v->tiles * sizeof(cl_int), &v->counts);
    device_buffer_make(d, a, (size_t)v->tiles * sizeof(cl_float), &v->farthest);
    device_buffer_make(d, a, (size_t)v->tiles * 2 * sizeof(cl_int), &v->ranges);
    device_buffer_make(d, a, (size_t)camera->width * (size_t)camera->height * sizeof(cl_uint2), &v->planes);
    if (!d->context) return;
    v->request = device_kernel(d, "request_blocks");
    v->clear = device_kernel(d, "clear_blocks");
    v->pack_planes = device_kernel(d, "pack_planes");
    v->fuse = device_kernel(d, "fuse_blocks");
    v->clear_ranges = device_kernel(d, "clear_ranges");
    v->range_blocks = device_kernel(d, "range_blocks");
    v->raycast_near = device_kernel(d, "raycast_near");
    v->raycast = device_kernel(d, "raycast");
    v->halve_map = device_kernel(d, "halve_map");
    if (d->error == FATHOM_OK) volume_clear(v, d);
}

void volume_close(volume *v) {
    cl_kernel kernels[] = {v->request,      v->clear,   v->pack_planes,  v->fuse,     v->clear_ranges,
                           v->range_blocks, v->raycast, v->raycast_near, v->halve_map};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i]) clReleaseKernel(kernels[i]);
    device_buffer *buffers[] = {&v->voxels,   &v->table,  &v->blocks, &v->requests, &v->counts,
                                &v->farthest, &v->ranges, &v->planes, &v->seen};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) device_buffer_free(buffers[i]);
}

void volume_clear(volume *v, device *d) {
    void *table = device_map(d, &v->table, CL_MAP_WRITE);
    if (table) memset(table, 0xff, v->table.size); /* w = -1: free */
    device_unmap(d, &v->table, table);
    v->count = v->settled = v->settling = v->frames = 0;
    v->full = false;
}

/* The same search as find_block in opencl/common.cl. */
cl_int4 *volume_entry(cl_int4 *table, cl_uint mask, const cl_int4 *b) {
    cl_uint h = ((cl_uint)b->x * 73856093u) ^ ((cl_uint)b->y * 19349669u) ^ ((cl_uint)b->z * 83492791u);
    h = (h ^ (h >> 15)) & mask;
    while (table[h].w >= 0 && (table[h].x != b->x || table[h].y != b->y || table[h].z != b->z))
        h = (h + 1) & mask;
    return &table[h];
}

fathom_block volume_block(const volume *v, const cl_int4 *b, cl_short *voxels, int place) {
    fathom_block block = {.voxel_m = v->surface.voxel, .truncation_m = v->surface.truncation};
    for (int k = 0; k < 3; k++) block.index[k] = b->s[k];
    block.distances = voxels + (size_t)place * 2 * BLOCK_VOXELS;
    block.weights = (uint16_t *)block.distances + BLOCK_VOXELS;
    return block;
}

int volume_request(volume *v, device *d, depth_maps *maps, const pose *camera_to_world, bool calm) {
    kernel_rigid rigid = kernel_rigid_of(camera_to_world);
    cl_int turn = calm ? v->frames & 1 : -1;
    cl_float block_m = v->surface.voxel * BLOCK_EDGE;
    v->full = false;
    size_t rows = (size_t)(maps->camera[FINEST].height + TILE - 1) / TILE, columns = (size_t)v->tiles / rows;
    RUN_ROWS(d, v->request, columns, rows, ARG(maps->depth[FINEST].memory), ARG(maps->camera[FINEST]),
             ARG(rigid), ARG(block_m), ARG(v->surface.truncation), ARG(v->table.memory), ARG(v->surface.mask),
             ARG(v->requests.memory), ARG(v->counts.memory), ARG(v->farthest.memory), ARG(turn));
    cl_int *counts = device_map(d, &v->counts, CL_MAP_READ);
    int wanted = 0;
    for (int i = 0; counts && i < v->tiles; i++) wanted += counts[i];
    device_unmap(d, &v->counts, counts);
    return wanted;
}

int volume_allocate(volume *v, device *d) {
    cl_int first = v->count;
    cl_int *counts = device_map(d, &v->counts, CL_MAP_READ);
    cl_int4 *requests = device_map(d, &v->requests, CL_MAP_READ);
    cl_int4 *table = device_map(d, &v->table, CL_MAP_READ | CL_MAP_WRITE);
    cl_int4 *blocks = device_map(d, &v->blocks, CL_MAP_READ | CL_MAP_WRITE);
    cl_int *seen = device_map(d, &v->seen, CL_MAP_READ | CL_MAP_WRITE);
    /* tile by tile, slot by slot: the order in which places are given depends on the frame alone */
    for (int i = 0; counts && requests && table && blocks && seen && i < v->tiles; i++)
        for (int j = 0; j < counts[i]; j++) {
            cl_int4 b = requests[i * TILE_SLOTS + j];
            cl_int4 *entry = volume_entry(table, v->surface.mask, &b);
            if (entry->w >= 0) continue;
            if (v->count == v->capacity) {
                v->full = true;
                v->refused++;
                continue;
            }
            seen[v->count] = v->frames;
            b.w = v->count++;
            *entry = b;
            blocks[b.w] = b;
        }
    device_unmap(d, &v->seen, seen);
    device_unmap(d, &v->blocks, blocks);
    device_unmap(d, &v->table, table);
    device_unmap(d, &v->requests, requests);
    device_unmap(d, &v->counts, counts);
    volume_clear_blocks(v, d, first, v->count - first);
    return first;
}

void volume_clear_blocks(volume *v, device *d, int first, int count) {
    cl_int from = first;
    /* a group of one: PoCL compiles a kernel anew for each size of group, and would choose by the count */
    RUN(d, v->clear, (size_t)count, BLOCK_BYTES / 16, 1, ARG(from), ARG(v->voxels.memory));
}

void volume_fuse(volume *v, device *d, depth_maps *maps, const pose *camera_to_world, bool calm) {
    pose inverse = pose_inverse(camera_to_world);
    kernel_rigid rigid = kernel_rigid_of(&inverse);
    if (v->frames++ % SETTLING == 0) {
        v->settled = v->settling;
        v->settling = v->count;
    }
    cl_int settled = calm ? v->settled : 0, turn = v->frames & 1;
    const kernel_camera *camera = &maps->camera[FINEST];
    RUN_ROWS(d, v->pack_planes, camera->width, camera->height, ARG(maps->depth[FINEST].memory),
             ARG(maps->normals[FINEST].memory), ARG(*camera), ARG(maps->noise), ARG(v->planes.memory));
    RUN_ROWS(d, v->fuse, 64, v->count, ARG(v->planes.memory), ARG(*camera), ARG(v->farthest.memory),
             ARG(rigid), ARG(v->surface.voxel), ARG(v->surface.truncation), ARG(v->max_weight),
             ARG(v->blocks.memory), ARG(settled), ARG(turn), ARG(v->frames), ARG(v->seen.memory),
             ARG(v->voxels.memory));
}

void volume_raycast(volume *v, device *d, const kernel_camera *camera, const pose *camera_to_world,
                    float near_m, float far_m, device_buffer *model) {
    pose inverse = pose_inverse(camera_to_world);
    kernel_rigid to_camera = kernel_rigid_of(&inverse), to_world = kernel_rigid_of(camera_to_world);
    size_t tiles = (size_t)((camera->width + TILE - 1) / TILE) * (size_t)((camera->height + TILE - 1) / TILE);
    RUN(d, v->clear_ranges, tiles, 1, 0, ARG(v->ranges.memory));
    RUN(d, v->range_blocks, (size_t)v->count, 1, 1, ARG(v->blocks.memory), ARG(*camera), ARG(to_camera),
        ARG(v->surface.voxel), ARG(near_m), ARG(far_m), ARG(v->ranges.memory));
    RUN(d, v->raycast, (size_t)camera->width, (size_t)camera->height, 0, ARG(v->voxels.memory),
        ARG(v->table.memory), ARG(v->surface), ARG(*camera), ARG(to_world), ARG(v->ranges.memory),
        ARG(model->memory));
}

void volume_raycast_near(volume *v, device *d, depth_maps *maps, const pose *camera_to_world, float reach_m,
                         bool marched, device_buffer *model) {
    cl_int rays_marched = marched;
    const kernel_camera *camera = &maps->camera[FINEST];
    kernel_rigid to_world = kernel_rigid_of(camera_to_world);
    reach_m = fminf(reach_m, maps->source.max_m); /* a seed that knows nothing must not make rays endless */
    RUN(d, v->raycast_near, (size_t)((camera->width + d->lanes - 1) / d->lanes), (size_t)camera->height,
        d->cpu ? 1 : 0, ARG(v->voxels.memory), ARG(v->table.memory), ARG(v->surface), ARG(*camera),
        ARG(to_world), ARG(maps->depth[FINEST].memory), ARG(reach_m), ARG(rays_marched), ARG(model->memory));
}

void volume_halve_maps(volume *v, device *d, const kernel_camera *cameras, device_buffer model[FATHOM_LEVELS],
                       int coarsest) {
    for (int i = FINEST - 1; i >= coarsest; i--)
        RUN(d, v->halve_map, (size_t)cameras[i].width, (size_t)cameras[i].height, 0, ARG(model[i + 1].memory),
            ARG(cameras[i + 1]), ARG(cameras[i]), ARG(model[i].memory));
}
