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

/* A matt surface in the light of the sky above the camera's left shoulder and a little from the camera itself. */
static void shade(const float normal[3], float depth, uint8_t rgb[3]) {
    if (depth <= 0) {
        rgb[0] = rgb[1] = rgb[2] = 255;
        return;
    }
    float sky = 0.5f + 0.5f * (-0.45f * normal[0] - 0.70f * normal[1] - 0.55f * normal[2]),
          front = -normal[2];
    float light = 0.10f + 0.62f * sky + 0.22f * (front > 0 ? front : 0);
    const float colour[3] = {232, 226, 214};
    for (int i = 0; i < 3; i++) {
        float c = colour[i] * light + (i == 2 ? 14 : 6) * (1 - sky);
        rgb[i] = (uint8_t)(c < 0 ? 0 : c > 255 ? 255 : c);
    }
}

int view_render(viewer *part, device *d, raycaster *r, const fathom_view *view, const pose *camera_to_world,
                float *depth, float *normals, uint8_t *rgb) {
    float near_m = view->near_m > 0 ? view->near_m : 0.1f, far_m = view->far_m > 0 ? view->far_m : 20.0f;
    for (int y0 = 0; y0 < view->height; y0 += part->height)
        for (int x0 = 0; x0 < view->width; x0 += part->width) {
            int w = view->width - x0 < part->width ? view->width - x0 : part->width;
            int h = view->height - y0 < part->height ? view->height - y0 : part->height;
            kernel_camera camera =
                kernel_camera_of(w, h, view->fx, view->fy, view->cx - (float)x0, view->cy - (float)y0);
            raycast_view(r, d, &camera, camera_to_world, near_m, far_m, &part->map);
            cl_uint2 *map = device_map(d, &part->map, CL_MAP_READ);
            for (int i = 0; map && i < w * h; i++) {
                size_t at = (size_t)(y0 + i / w) * (size_t)view->width + (size_t)(x0 + i % w);
                kernel_point m = kernel_point_of(map[i]);
                float *n = m.normal, length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
                for (int k = 0; k < 3 && length > 0; k++) n[k] /= length; /* rounded, in the map */
                if (depth) depth[at] = m.depth;
                if (normals) memcpy(normals + 3 * at, m.normal, sizeof m.normal);
                if (rgb) shade(m.normal, m.depth, rgb + 3 * at);
            }
            device_unmap(d, &part->map, map);
        }
    return d->error;
}
