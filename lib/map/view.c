#include "map/view.h"

#include <math.h>
#include <string.h>

void viewer_init(viewer *w, device *d, arena *a, const depth_maps *maps) {
    memset(w, 0, sizeof *w);
    w->width = maps->camera[FINEST].width;
    w->height = maps->camera[FINEST].height;
    device_buffer_make(d, a, (size_t)w->width * (size_t)w->height * sizeof(cl_uint2), &w->map);
}

void viewer_close(viewer *w) {
    device_buffer_free(&w->map);
}

int view_render(viewer *part, device *d, raycaster *r, const fathom_view *view, const pose *camera_to_world,
                float *depth, float *normals) {
    float near_m = view->near_m > 0 ? view->near_m : 0.1f, far_m = view->far_m > 0 ? view->far_m : 20.0f;
    const fathom_pinhole *c = &view->camera;
    for (int y0 = 0; y0 < c->height; y0 += part->height)
        for (int x0 = 0; x0 < c->width; x0 += part->width) {
            int w = c->width - x0 < part->width ? c->width - x0 : part->width;
            int h = c->height - y0 < part->height ? c->height - y0 : part->height;
            kernel_camera camera = kernel_camera_of(w, h, (float)c->fx, (float)c->fy,
                                                    (float)c->cx - (float)x0, (float)c->cy - (float)y0);
            raycast_view(r, d, &camera, camera_to_world, near_m, far_m, &part->map);
            cl_uint2 *map = device_map(d, &part->map, CL_MAP_READ);
            for (int i = 0; map && i < w * h; i++) {
                size_t at = (size_t)(y0 + i / w) * (size_t)c->width + (size_t)(x0 + i % w);
                kernel_point m = kernel_point_of(map[i]);
                float *n = m.normal, length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
                for (int k = 0; k < 3 && length > 0; k++) n[k] /= length; /* rounded, in the map */
                if (depth) depth[at] = m.depth;
                if (normals) memcpy(normals + 3 * at, m.normal, sizeof m.normal);
            }
            device_unmap(d, &part->map, map);
        }
    return d->error;
}
