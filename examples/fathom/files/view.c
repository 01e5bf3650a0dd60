#include "fathom/files/view.h"

fathom_view view_of(int width, int height, double focal_widths) {
    fathom_view view = FATHOM_STRUCT(fathom_view);
    view.camera = (fathom_pinhole){.width = width,
                                   .height = height,
                                   .fx = focal_widths * width,
                                   .fy = focal_widths * width,
                                   .cx = 0.5 * (width - 1),
                                   .cy = 0.5 * (height - 1)};
    view.pose.orientation[3] = 1;
    return view;
}

bool view_project(const fathom_view *view, const float world[3], float out[3]) {
    const fathom_pinhole *c = &view->camera;
    double m[16], p[3] = {0};
    if (fathom_pose_to_matrix(&view->pose, m) != FATHOM_OK) return false;
    for (int k = 0; k < 3; k++)
        for (int l = 0; l < 3; l++) p[k] += m[4 * l + k] * ((double)world[l] - m[4 * l + 3]);
    if (!(p[2] > 0.05)) return false;
    out[0] = (float)(c->fx * p[0] / p[2] + c->cx);
    out[1] = (float)(c->fy * p[1] / p[2] + c->cy);
    out[2] = (float)p[2];
    return true;
}

/* In the light of the sky above the camera's left shoulder and a little from the camera itself. */
static void shade(const float normal[3], uint8_t rgb[3]) {
    const float colour[3] = {232, 226, 214};
    const float sky = 0.5f + 0.5f * (-0.45f * normal[0] - 0.70f * normal[1] - 0.55f * normal[2]);
    const float front = -normal[2], light = 0.10f + 0.62f * sky + 0.22f * (front > 0 ? front : 0);
    for (int i = 0; i < 3; i++) {
        const float c = colour[i] * light + (i == 2 ? 14 : 6) * (1 - sky);
        rgb[i] = (uint8_t)(c < 0 ? 0 : c > 255 ? 255 : c);
    }
}

void view_shade(const float *depth, const float *normals, size_t pixels, uint8_t *rgb) {
    for (size_t i = 0; i < pixels; i++)
        if (depth[i] > 0)
            shade(normals + 3 * i, rgb + 3 * i);
        else
            rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = 255;
}
