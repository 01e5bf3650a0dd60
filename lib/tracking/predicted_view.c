#include "tracking/predicted_view.h"

#include <math.h>
#include <string.h>

#define LEAST_WIDTH 40 /* pixels; coarser ones are larger than the differences to be detected */

void model_view_init(model_view *w, device *d, arena *a, const fathom_config *config,
                     const depth_maps *maps) {
    memset(w, 0, sizeof *w);
    while (w->level < FINEST && maps->camera[w->level].width < LEAST_WIDTH) w->level++;
    const kernel_camera *c = &maps->camera[w->level];
    w->same = *c;
    int more_x = c->width / 2, more_y = c->height / 2;
    w->wide = kernel_camera_of(c->width + 2 * more_x, c->height + 2 * more_y, c->fx, c->fy,
                               c->cx + (float)more_x, c->cy + (float)more_y);
    w->near_m = fmaxf(0.5f * config->min_depth_m, 0.05f);
    w->far_m = config->max_depth_m;
    device_buffer_make(d, a, (size_t)w->wide.width * (size_t)w->wide.height * sizeof(cl_uint2), &w->map);
}

void model_view_close(model_view *w) {
    device_buffer_free(&w->map);
}

void model_view_cast(model_view *w, device *d, raycaster *r, const pose *camera_to_world) {
    raycast_view(r, d, &w->same, camera_to_world, w->near_m, w->far_m, &w->map);
}

void model_view_cast_wide(model_view *w, device *d, raycaster *r, const pose *camera_to_world) {
    raycast_view(r, d, &w->wide, camera_to_world, w->near_m, w->far_m, &w->map);
}

double model_view_part(model_view *w, device *d, raycaster *r, const pose *camera_to_world) {
    int pixels = w->same.width * w->same.height, seen = 0;
    model_view_cast(w, d, r, camera_to_world);
    const cl_uint2 *model = device_map(d, &w->map, CL_MAP_READ);
    for (int i = 0; model && i < pixels; i++) seen += kernel_point_of(model[i]).depth > 0;
    device_unmap(d, &w->map, (void *)model);
    return (double)seen / pixels;
}

void model_view_compare(model_view *w, device *d, depth_maps *maps, raycaster *r, const pose *camera_to_world,
                        float tolerance_m, comparison *out) {
    const kernel_camera *c = &w->same;
    memset(out, 0, sizeof *out);
    model_view_cast(w, d, r, camera_to_world);
    const cl_uint2 *model = device_map(d, &w->map, CL_MAP_READ);
    const float *depth = device_map(d, &maps->depth[w->level], CL_MAP_READ);
    const float *normals = device_map(d, &maps->normals[w->level], CL_MAP_READ);
    for (int y = 0; model && depth && normals && y < c->height; y++)
        for (int x = 0; x < c->width; x++) {
            int at = (y + PAD_Y) * c->pitch + x + PAD_X;
            float z = depth[at], weight = sqrtf(fminf(fmaxf(normals[3 * c->plane + at], 0), 1));
            kernel_point m = kernel_point_of(model[y * c->width + x]);
            if (!(z > 0 && weight > 0 && m.depth > 0)) continue;
            out->visible += weight;
            float apart = z - m.depth;
            float slope = m.normal[0] * ((float)x - c->cx) / c->fx +
                          m.normal[1] * ((float)y - c->cy) / c->fy + m.normal[2];
            float sigma = maps->noise.base + maps->noise.slope * z + maps->noise.growth * z * z;
            if (fabsf(apart * slope) < tolerance_m + 3 * sigma)
                out->agree += weight;
            else if (apart > 0)
                out->through += weight;
        }
    device_unmap(d, &maps->normals[w->level], (void *)normals);
    device_unmap(d, &maps->depth[w->level], (void *)depth);
    device_unmap(d, &w->map, (void *)model);
}
