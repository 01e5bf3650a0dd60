/* Structures that kernels take by value: the same layout as in opencl/. */
#ifndef FATHOM_KERNEL_TYPES_H
#define FATHOM_KERNEL_TYPES_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <string.h>

#include "base/se3.h"

/* opencl/common.cl */
#define PAD_X 8
#define PAD_Y 2
#define TILE 8
#define BLOCK_EDGE 8
#define BLOCK_VOXELS 512
#define BLOCK_BYTES (4 * BLOCK_VOXELS)

typedef struct {
    cl_float fx, fy, cx, cy;
    cl_int width, height;
    cl_int pitch; /* floats from row to row of a padded plane */
    cl_int plane; /* floats in a padded plane */
} kernel_camera;

typedef struct {
    cl_float4 x, y, z;
} kernel_rigid;

/* opencl/maps.cl */
typedef struct {
    cl_float fx, fy, cx, cy;
    cl_float k1, k2, p1, p2, k3, k4, k5, k6;
    cl_int lens;
    cl_int width, height;
    cl_int factor;
    cl_float metres_per_unit;
    cl_float min_m, max_m;
} kernel_depth_source;

/* opencl/align.cl */
#define SUMS 35
typedef struct {
    cl_float distance2;
    cl_float cos_angle;
    cl_float huber;
    cl_float4 centre;
} kernel_pair_limits;

/* opencl/volume.cl */
#define TILE_SLOTS 64
#define WEIGHT_ONE 64.0f

/* opencl/raycast.cl */
typedef struct {
    cl_float voxel, truncation;
    cl_uint mask;
    cl_float min_weight;
} kernel_surface;

/* A point of a model map: pack_point of opencl/common.cl. */
typedef struct {
    float normal[3], depth;
} kernel_point;

static inline kernel_point kernel_point_of(cl_uint2 packed) {
    const cl_uint n = packed.s[0], bits[3] = {n & 0xffe00000u, n << 11 & 0xffe00000u, n << 22};
    kernel_point p;
    for (int i = 0; i < 3; i++) p.normal[i] = (float)(cl_int)bits[i] / 2145386496.0f;
    memcpy(&p.depth, &packed.s[1], sizeof p.depth);
    return p;
}

static inline kernel_camera kernel_camera_of(int width, int height, float fx, float fy, float cx, float cy) {
    kernel_camera c = {fx, fy, cx, cy, width, height, 0, 0};
    c.pitch = (width + 15) / 16 * 16 + 2 * PAD_X; /* kernels take up to sixteen pixels at once */
    c.plane = c.pitch * (height + 2 * PAD_Y);
    return c;
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
