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
