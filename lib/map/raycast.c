#include "map/raycast.h"

#include <math.h>
#include <string.h>

void raycaster_init(raycaster *r, device *d, arena *a, const volume *from, int most_tiles) {
    memset(r, 0, sizeof *r);
    r->from = from;
    r->tiles = most_tiles;
    device_buffer_make(d, a, (size_t)most_tiles * 2 * sizeof(cl_int), &r->ranges);
    if (!d->context) return;
    r->clear_ranges = device_kernel(d, "clear_ranges");
    r->range_blocks = device_kernel(d, "range_blocks");
    r->raycast_near = device_kernel(d, "raycast_near");
    r->raycast = device_kernel(d, "raycast");
    r->halve_map = device_kernel(d, "halve_map");
}

void raycaster_close(raycaster *r) {
    cl_kernel kernels[] = {r->clear_ranges, r->range_blocks, r->raycast, r->raycast_near, r->halve_map};
    for (size_t i = 0; i < sizeof kernels / sizeof *kernels; i++)
        if (kernels[i]) clReleaseKernel(kernels[i]);
    device_buffer_free(&r->ranges);
}

void raycast_view(raycaster *r, device *d, const kernel_camera *camera, const pose *camera_to_world,
                  float near_m, float far_m, device_buffer *model) {
    pose inverse = pose_inverse(camera_to_world);
    kernel_rigid to_camera = kernel_rigid_of(&inverse), to_world = kernel_rigid_of(camera_to_world);
    RUN(d, r->clear_ranges, (size_t)kernel_tiles(camera), 1, 0, ARG(r->ranges.memory));
    RUN(d, r->range_blocks, (size_t)r->from->pool.count, 1, 1, ARG(r->from->pool.keys.memory),
        ARG(r->from->surface), ARG(*camera), ARG(to_camera), ARG(near_m), ARG(far_m), ARG(r->ranges.memory));
    RUN(d, r->raycast, (size_t)camera->width, (size_t)camera->height, 0, ARG(r->from->pool.voxels.memory),
        ARG(r->from->table.entries.memory), ARG(r->from->surface), ARG(*camera), ARG(to_world),
        ARG(r->ranges.memory), ARG(model->memory));
}

void raycast_near(raycaster *r, device *d, depth_maps *maps, const pose *camera_to_world,
                  float reach_m, bool marched, device_buffer *model) {
    cl_int rays_marched = marched;
    const kernel_camera *camera = &maps->camera[FINEST];
    kernel_rigid to_world = kernel_rigid_of(camera_to_world);
    reach_m = fminf(reach_m, maps->source.max_m); /* an unknown seed must not make rays endless */
    RUN(d, r->raycast_near, (size_t)((camera->width + d->lanes - 1) / d->lanes), (size_t)camera->height,
        d->cpu ? 1 : 0, ARG(r->from->pool.voxels.memory), ARG(r->from->table.entries.memory),
        ARG(r->from->surface), ARG(*camera), ARG(to_world), ARG(maps->depth[FINEST].memory), ARG(reach_m),
        ARG(rays_marched), ARG(model->memory));
}

void raycast_halve(raycaster *r, device *d, const kernel_camera *cameras, device_buffer model[FATHOM_LEVELS],
                   int coarsest) {
    for (int i = FINEST - 1; i >= coarsest; i--)
        RUN(d, r->halve_map, (size_t)cameras[i].width, (size_t)cameras[i].height, 0, ARG(model[i + 1].memory),
            ARG(cameras[i + 1]), ARG(cameras[i]), ARG(model[i].memory));
}
