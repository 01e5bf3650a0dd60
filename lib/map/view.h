/* Views of the surface for the caller. */
#ifndef FATHOM_VIEW_H
#define FATHOM_VIEW_H

#include "map/raycast.h"

typedef struct {
    device_buffer map; /* normal and depth of a part of a view */
    int width, height; /* maximum of that part */
} viewer;

void viewer_init(viewer *w, device *d, arena *a, const depth_maps *maps);
void viewer_close(viewer *w);

/* Each of depth and normals may be NULL. */
int view_render(viewer *part, device *d, raycaster *r, const fathom_view *view, const pose *camera_to_world,
                float *depth, float *normals);

#endif
