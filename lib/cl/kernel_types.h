/* The structures that kernels take by value (opencl/layout.h), made from the host's. */
#ifndef FATHOM_KERNEL_TYPES_H
#define FATHOM_KERNEL_TYPES_H

#include <string.h>

#include "base/se3.h"
#include "opencl/layout.h"

/* A point of a model map: pack_point of opencl/common.cl. */
typedef struct {
    float normal[3], depth;
} kernel_point;

static inline kernel_point kernel_point_of(cl_uint2 packed) {
    const cl_uint n = packed.s[0], parts[3] = {NORMAL_X(n), NORMAL_Y(n), NORMAL_Z(n)};
    kernel_point p;
    for (int i = 0; i < 3; i++) p.normal[i] = (float)(cl_int)parts[i] / NORMAL_ONE;
    memcpy(&p.depth, &packed.s[1], sizeof p.depth);
    return p;
}

static inline kernel_camera kernel_camera_of(int width, int height, float fx, float fy, float cx, float cy) {
    kernel_camera c = {fx, fy, cx, cy, width, height, 0, 0};
    c.pitch = (width + 15) / 16 * 16 + 2 * PAD_X; /* kernels take up to sixteen pixels at once */
    c.plane = c.pitch * (height + 2 * PAD_Y);
    return c;
}

static inline int kernel_tiles(const kernel_camera *c) {
    return ((c->width + TILE - 1) / TILE) * ((c->height + TILE - 1) / TILE);
}

static inline kernel_rigid kernel_rigid_of(const pose *p) {
    kernel_rigid k;
    cl_float4 *rows[3] = {&k.x, &k.y, &k.z};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) rows[i]->s[j] = (cl_float)p->r[3 * i + j];
        rows[i]->s[3] = (cl_float)p->t[i];
    }
    return k;
}

#endif
