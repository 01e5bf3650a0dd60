#include "frame/depth_maps.h"

#include <math.h>
#include <string.h>

#include "base/log.h"

#define SMOOTHING_REACH 4.0f /* sigma; beyond, a neighbour belongs to another surface */

#define NEAREST_M 1e-6f /* no depth is below */
#define NEAR_M 1.0f      /* a surface that is rough up to here is rough everywhere */

/* Sigma of the slope, per pixel, of independent depths of sigma 1: of the central difference, and of that after the 5x5
 * binomial. */
#define RAW_SLOPE 0.71f
#define SMOOTH_SLOPE 0.15f

int depth_maps_camera(const fathom_config *c, kernel_camera *camera) {
    const fathom_pinhole *p = &c->depth_camera;
    int width = c->align_width, height = c->align_height;
    if (width == 0 && height == 0) {
        int factor = 1;
        while (p->width / factor > c->max_align_width || p->width % factor || p->height % factor) {
            if (++factor > 64) {
                log_write(c, FATHOM_LOG_ERROR,
                           "depth of %dx%d has no whole fraction up to %d wide: set align_width",
                           p->width, p->height, c->max_align_width);
                return FATHOM_ERROR_CONFIG;
            }
        }
        width = p->width / factor;
        height = p->height / factor;
    }
    if (width < 16 || height < 16 || p->width % width || p->height % height ||
        p->width / width != p->height / height) {
        log_write(c, FATHOM_LOG_ERROR,
                   "alignment size %dx%d is not depth size %dx%d over one whole number, or below 16", width,
                   height, p->width, p->height);
        return FATHOM_ERROR_CONFIG;
    }
    /* the centre of n averaged pixels is in their middle */
    float n = (float)(p->width / width), shift = 0.5f * (n - 1);
    *camera = kernel_camera_of(width, height, (float)p->fx / n, (float)p->fy / n, ((float)p->cx - shift) / n,
                               ((float)p->cy - shift) / n);
    return FATHOM_OK;
}

/* The depth at which sigma reaches that; INFINITY: never. */
static float depth_of_sigma(const kernel_noise *n, float sigma) {
    const float over = sigma - n->base;
    if (over <= 0) return 0;
    if (n->growth <= 0) return n->slope > 0 ? over / n->slope : INFINITY;
    return 2 * over / (n->slope + sqrtf(n->slope * n->slope + 4 * n->growth * over));
}

/* The depth from which on a surface is so rough that pairs are lost by their normals' angle: two sigma of its slope are
 * the maximum angle. A constant part of the noise makes what is near rough instead. 0: everywhere. */
static float rough_from(const kernel_noise *n, const kernel_camera *camera, int factor, float slope,
                        float angle_rad) {
    const float limit = 0.5f * angle_rad * (float)factor / (slope * camera->fx) - n->slope;
    const float root = limit * limit - 4 * n->growth * n->base;
    if (limit <= 0 || root < 0) return 0;
    const float sum = limit + sqrtf(root);
    if (2 * n->base / sum > NEAR_M) return 0;
    return n->growth > 0 ? sum / (2 * n->growth) : INFINITY;
}

void depth_maps_set_noise(depth_maps *m, const fathom_config *c, const kernel_noise *noise) {
    const float thick = 2 * (c->truncation_m > 0 ? c->truncation_m : 4 * c->voxel_m);
    m->noise = *noise;
    m->raw_m = rough_from(noise, &m->camera[FINEST], m->source.factor, RAW_SLOPE, c->max_pair_angle_rad);
    m->once_m = fmaxf(
        rough_from(noise, &m->camera[FINEST], m->source.factor, SMOOTH_SLOPE, c->max_pair_angle_rad), NEAREST_M);
    m->source.max_m = fmaxf(fminf(c->max_depth_m, depth_of_sigma(noise, thick)), c->min_depth_m);
}

void depth_maps_init(depth_maps *m, device *d, arena *a, const fathom_config *c) {
    memset(m, 0, sizeof *m);
    depth_maps_camera(c, &m->camera[FINEST]);
    for (int i = FINEST - 1; i >= 0; i--) {
        kernel_camera f = m->camera[i + 1];
        m->camera[i] = kernel_camera_of(f.width / 2, f.height / 2, f.fx / 2, f.fy / 2, (f.cx - 0.5f) / 2,
                                        (f.cy - 0.5f) / 2);
    }
    const fathom_pinhole *p = &c->depth_camera;
    float k[8] = {0};
    for (int i = 0; i < (p->lens == FATHOM_LENS_PINHOLE ? 0 : p->lens == FATHOM_LENS_FIVE ? 5 : 8); i++)
        k[i] = (float)p->coefficients[i];
    m->source = (kernel_depth_source){.fx = (float)p->fx,
                                      .fy = (float)p->fy,
                                      .cx = (float)p->cx,
                                      .cy = (float)p->cy,
                                      .k1 = k[0],
                                      .k2 = k[1],
                                      .p1 = k[2],
                                      .p2 = k[3],
                                      .k3 = k[4],
                                      .k4 = k[5],
                                      .k5 = k[6],
                                      .k6 = k[7],
                                      .lens = p->lens,
                                      .width = p->width,
                                      .height = p->height,
                                      .factor = p->width / m->camera[FINEST].width,
                                      .metres_per_unit = 1.0f / c->depth_units_per_metre,
                                      .min_m = c->min_depth_m};
    m->min_confidence = c->min_confidence;
    const kernel_noise noise = {c->depth_noise_base_m, c->depth_noise_slope, c->depth_noise_growth_per_m};
    depth_maps_set_noise(m, c, &noise);
    device_buffer_make(d, a, (size_t)p->width * (size_t)p->height * 2, &m->raw);
    device_buffer_make(d, a, (size_t)m->camera[FINEST].plane * 4, &m->smooth);
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        device_buffer_make(d, a, (size_t)m->camera[i].plane * 4, &m->depth[i]);
        device_buffer_make(d, a, (size_t)m->camera[i].plane * 16, &m->normals[i]);
    }
    if (!d->context) return;
    device_clear(d, &m->smooth); /* the margins stay invalid */
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        device_clear(d, &m->depth[i]);
        device_clear(d, &m->normals[i]);
    }
    m->convert = device_kernel(d, "convert_depth");
    m->smoothing = device_kernel(d, "smooth_depth");
    m->halve = device_kernel(d, "halve_depth");
    m->normal = device_kernel(d, "normal_map");
    m->pack = device_kernel(d, "pack_map");
}

void depth_maps_close(depth_maps *m) {
    cl_kernel kernels[] = {m->convert, m->smoothing, m->halve, m->normal, m->pack};
    for (int i = 0; i < 5; i++)
        if (kernels[i]) clReleaseKernel(kernels[i]);
    device_buffer_free(&m->raw);
    device_buffer_free(&m->smooth);
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        device_buffer_free(&m->depth[i]);
        device_buffer_free(&m->normals[i]);
    }
}

static void blank_unsure(const depth_maps *m, const fathom_depth_frame *frame, uint16_t *raw) {
    const int width = m->source.width;
    for (int y = 0; y < m->source.height; y++)
        for (int x = 0; x < width; x++)
            if (!depth_maps_sure(m, frame, x, y)) raw[y * width + x] = 0;
}

void depth_maps_take(depth_maps *m, device *d, const fathom_depth_frame *frame, int coarsest) {
    void *raw = device_map(d, &m->raw, CL_MAP_WRITE);
    if (!raw) return;
    const size_t row_bytes = (size_t)m->source.width * 2, rows = (size_t)m->source.height;
    const size_t stride_bytes = (size_t)frame->row_stride_bytes;
    if (stride_bytes == row_bytes)
        memcpy(raw, frame->depth, row_bytes * rows);
    else
        for (size_t y = 0; y < rows; y++)
            memcpy((char *)raw + row_bytes * y, (const char *)frame->depth + stride_bytes * y, row_bytes);
    if (frame->confidence && m->min_confidence > 0) blank_unsure(m, frame, raw);
    device_unmap(d, &m->raw, raw);
    depth_maps_compute(m, d, coarsest);
}

void depth_maps_make(depth_maps *m, device *d, const uint16_t *depth, size_t stride_bytes, int coarsest) {
    const fathom_depth_frame frame = {.depth = depth, .row_stride_bytes = (int32_t)stride_bytes};
    depth_maps_take(m, d, &frame, coarsest);
}

void depth_maps_compute(depth_maps *m, device *d, int coarsest) {
    kernel_camera *c = &m->camera[FINEST];
    RUN_ROWS(d, m->convert, (c->width + 7) / 8, c->height, ARG(m->raw.memory), ARG(m->source), ARG(*c),
             ARG(m->noise), ARG(m->depth[FINEST].memory));
    cl_float reach = SMOOTHING_REACH;
    cl_int step = 1;
    cl_float from = NEAREST_M;
    const bool rough = m->once_m < m->source.max_m;
    device_buffer *first = rough ? &m->normals[FINEST] : &m->smooth; /* written over with the normals */
    RUN_ROWS(d, m->smoothing, c->width, c->height, ARG(m->depth[FINEST].memory), ARG(*c), ARG(m->noise),
             ARG(reach), ARG(step), ARG(from), ARG(first->memory));
    if (rough) {
        step = 2;
        from = m->once_m;
        RUN_ROWS(d, m->smoothing, c->width, c->height, ARG(first->memory), ARG(*c), ARG(m->noise), ARG(reach),
                 ARG(step), ARG(from), ARG(m->smooth.memory));
    }
    for (int i = FINEST - 1; i >= coarsest; i--) {
        kernel_camera *f = &m->camera[i + 1];
        c = &m->camera[i];
        RUN_ROWS(d, m->halve, c->width, c->height, ARG(m->depth[i + 1].memory), ARG(*f), ARG(*c),
                 ARG(m->noise), ARG(m->depth[i].memory));
    }
    for (int i = FINEST; i >= coarsest; i--) {
        c = &m->camera[i];
        device_buffer *depth = i == FINEST ? &m->smooth : &m->depth[i];
        RUN_ROWS(d, m->normal, c->width, c->height, ARG(depth->memory), ARG(*c), ARG(m->noise),
                 ARG(m->normals[i].memory));
    }
}

void depth_maps_pack(depth_maps *m, device *d, int level, device_buffer *packed) {
    kernel_camera *c = &m->camera[level];
    RUN(d, m->pack, (size_t)c->width, (size_t)c->height, 0, ARG(m->depth[level].memory),
        ARG(m->normals[level].memory), ARG(*c), ARG(packed->memory));
}
