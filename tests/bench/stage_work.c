#include "stage_work.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define LINE 64 /* bytes that memory is moved in */

bool work_start(work_state *w, const fathom *f) {
    memset(w, 0, sizeof *w);
    w->voxel_bytes = f->volume.pool.voxels.size;
    w->voxels = malloc(w->voxel_bytes);
    w->lines = malloc(w->voxel_bytes / LINE / 8 + 1);
    return w->voxels && w->lines;
}

void work_stop(work_state *w) {
    free(w->voxels);
    free(w->lines);
}

void work_before_fusion(work_state *w, fathom *f) {
    const void *voxels = device_map(&f->device, &f->volume.pool.voxels, CL_MAP_READ);
    if (voxels) memcpy(w->voxels, voxels, (size_t)f->volume.pool.count * BLOCK_BYTES);
    device_unmap(&f->device, &f->volume.pool.voxels, (void *)(uintptr_t)voxels);
}

static double valid_pixels(fathom *f, int level) {
    const kernel_camera *c = &f->maps.camera[level];
    const float *depth = device_map(&f->device, &f->maps.depth[level], CL_MAP_READ);
    int valid = 0;
    for (int y = 0; depth && y < c->height; y++)
        for (int x = 0; x < c->width; x++) valid += depth[(y + PAD_Y) * c->pitch + x + PAD_X] > 0;
    device_unmap(&f->device, &f->maps.depth[level], (void *)(uintptr_t)depth);
    return valid;
}

/* The pairs, and the pixels where scan and model both have a surface, of the reduction that has ended. */
static void pairs_of(fathom *f, int rows, double *pairs, double *overlap) {
    const float *sums = device_map(&f->device, &f->tracker.aligner.sums, CL_MAP_READ);
    *pairs = *overlap = 0;
    for (int y = 0; sums && y < rows; y++) {
        *pairs += sums[y * SUMS + SUMS_PAIRS];
        *overlap += sums[y * SUMS + SUMS_OVERLAP];
    }
    device_unmap(&f->device, &f->tracker.aligner.sums, (void *)(uintptr_t)sums);
}

static void fused(work_state *w, fathom *f, double *blocks, double *voxels) {
    const uint8_t *now = device_map(&f->device, &f->volume.pool.voxels, CL_MAP_READ);
    *blocks = *voxels = 0;
    for (int i = 0; now && i < f->volume.pool.count; i++) {
        const uint8_t *a = now + (size_t)i * BLOCK_BYTES, *b = w->voxels + (size_t)i * BLOCK_BYTES;
        if (memcmp(a, b, BLOCK_BYTES) == 0) continue;
        const uint16_t *p = (const uint16_t *)(const void *)a, *q = (const uint16_t *)(const void *)b;
        ++*blocks;
        for (int k = 0; k < BLOCK_VOXELS; k++)
            *voxels += p[k] != q[k] || p[BLOCK_VOXELS + k] != q[BLOCK_VOXELS + k];
    }
    device_unmap(&f->device, &f->volume.pool.voxels, (void *)(uintptr_t)now);
}

/* Bytes of the pool that a model map needs (lines of 64 bytes about the points met), and how many points these are. */
static double cast_voxels(work_state *w, fathom *f, device_buffer *map, const kernel_camera *c,
                          const pose *camera_to_world, double *met) {
    const kernel_surface *s = &f->volume.surface;
    const cl_uint2 *model = device_map(&f->device, map, CL_MAP_READ);
    volume_view view;
    bool mapped = volume_map(&f->volume, &f->device, CL_MAP_READ, false, &view);
    double count = 0;
    *met = 0;
    memset(w->lines, 0, w->voxel_bytes / LINE / 8 + 1);
    for (int i = 0; model && mapped && i < c->width * c->height; i++) {
        double z = kernel_point_of(model[i]).depth,
               p[3] = {(i % c->width - c->cx) / c->fx * z, (i / c->width - c->cy) / c->fy * z, z};
        int at[3];
        if (z <= 0) continue;
        ++*met;
        for (int k = 0; k < 3; k++) {
            const double *r = camera_to_world->r + 3 * k;
            at[k] = (int)floor((r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + camera_to_world->t[k]) / s->voxel);
        }
        for (int corner = 0; corner < 8; corner++) {
            int x = at[0] + (corner & 1), y = at[1] + (corner >> 1 & 1), v = at[2] + (corner >> 2);
            int place = volume_place(&view, &(cl_int4){{x >> 3, y >> 3, v >> 3, s->submap}});
            if (place < 0) continue;
            size_t byte = (size_t)place * BLOCK_BYTES + 2 * (size_t)(((v & 7) * 8 + (y & 7)) * 8 + (x & 7));
            size_t line = byte / LINE;
            count += !(w->lines[line / 8] >> (line % 8) & 1);
            w->lines[line / 8] |= (uint8_t)(1 << (line % 8));
        }
    }
    volume_unmap(&f->volume, &f->device, &view);
    device_unmap(&f->device, map, (void *)(uintptr_t)model);
    return LINE * count;
}

/* One step of a ray: the point 6, a cube 8, interpolation and gradient 21, the step 8; the normal turned 20. */
#define RAY_OPERATIONS 63

bool work_of_cast(work_state *w, fathom *f, const char *cast, const char *kernel, stage_work *work) {
    double met;
    if (!strcmp(cast, "raycast_near") && !strcmp(kernel, "align_reduce")) {
        work->read += cast_voxels(w, f, &f->tracker.models.level[FINEST], &f->maps.camera[FINEST],
                                  &f->tracker.models.seen_from, &met);
    } else if (!strcmp(cast, "raycast") && !strcmp(kernel, "request_blocks")) {
        /* the frame has passed, and is fused: its pose is the one that it was judged by */
        work->read += cast_voxels(w, f, &f->tracker.view.map, &f->tracker.view.same, &f->pose, &met);
        work->operations += RAY_OPERATIONS * met;
    } else {
        return false;
    }
    return true;
}

/* Blocks that the last two frames were fused into: of those in view each takes its turn in one of them. */
static double blocks_in_view(fathom *f) {
    const cl_int *seen = device_map(&f->device, &f->volume.pool.seen, CL_MAP_READ);
    int count = 0;
    for (int i = 0; seen && i < f->volume.pool.count; i++) count += seen[i] >= f->integrator.frames - 1;
    device_unmap(&f->device, &f->volume.pool.seen, (void *)(uintptr_t)seen);
    return count;
}

int work_level(const fathom *f, const char *kernel, size_t rows) {
    static const char *const of_levels[] = {"halve_depth", "normal_map",   "pack_map",
                                            "halve_map",   "align_reduce", "raycast"};
    for (size_t k = 0; k < sizeof of_levels / sizeof *of_levels; k++)
        for (int i = 0; i < FATHOM_LEVELS && !strcmp(kernel, of_levels[k]); i++)
            if ((size_t)f->maps.camera[i].height == rows) return i;
    return FINEST;
}

bool work_of(work_state *w, fathom *f, const char *kernel, size_t columns, size_t rows, stage_work *work) {
    const depth_maps *m = &f->maps;
    const int level = work_level(f, kernel, rows);
    const double raw = (double)m->source.width * m->source.height;
    const double finest = (double)m->camera[FINEST].width * m->camera[FINEST].height;
    const double pixels = (double)m->camera[level].width * m->camera[level].height;
    *work = (stage_work){0};
    if (!strcmp(kernel, "convert_depth")) { /* a raw pixel: convert, scale, nearest, compare, sum, count */
        *work = (stage_work){2 * raw, 4 * pixels, 6 * raw + 4 * pixels};
    } else if (!strcmp(kernel, "smooth_depth")) { /* 25 neighbours: the weight 5, two sums */
        *work = (stage_work){4 * pixels, 4 * pixels, 25 * 7 * valid_pixels(f, level)};
    } else if (!strcmp(kernel, "halve_depth")) {
        *work = (stage_work){16 * pixels, 4 * pixels, 20 * pixels};
    } else if (!strcmp(kernel, "normal_map")) {
        *work = (stage_work){4 * pixels, 16 * pixels, 60 * valid_pixels(f, level)};
    } else if (!strcmp(kernel, "pack_map")) {
        *work = (stage_work){16 * pixels, 8 * pixels, 0};
    } else if (!strcmp(kernel, "halve_map")) {
        *work = (stage_work){32 * pixels, 8 * pixels, 30 * pixels};
    } else if (!strcmp(kernel, "align_reduce")) {
        /* the sums alone: 21 + 6 of the row, the weighted row 6, the cross product 6, residual, weights and moments
         * 12 */
        double pairs, overlap;
        pairs_of(f, (int)rows, &pairs, &overlap);
        *work = (stage_work){4 * pixels + 16 * valid_pixels(f, level) + 8 * overlap,
                             4.0 * SUMS * (double)rows, 51 * pairs};
    } else if (!strcmp(kernel, "raycast_near")) {
        /* and work_of_cast */
        *work = (stage_work){4 * pixels, 8 * pixels, RAY_OPERATIONS * valid_pixels(f, FINEST)};
    } else if (!strcmp(kernel, "clear_ranges")) {
        w->ranges = (double)columns;
        *work = (stage_work){0, 8 * w->ranges, 0};
    } else if (!strcmp(kernel, "range_blocks")) {
        /* is it in view 20; if so eight corners: the point 3, projection 4, minima and maxima 6; its tiles 10 */
        *work = (stage_work){16.0 * f->volume.pool.count, 8 * w->ranges,
                             20.0 * f->volume.pool.count + 114 * blocks_in_view(f)};
    } else if (!strcmp(kernel, "raycast")) { /* of each pixel the ray 15; and work_of_cast */
        const double rays = (double)columns * (double)rows;
        *work = (stage_work){8 * w->ranges, 8 * rays, 15 * rays};
    } else if (!strcmp(kernel, "request_blocks")) {
        /* a block's table entry, once; a third of a block apart, rays of some 20 and 12 for each of two blocks */
        const kernel_camera *c = &m->camera[FINEST];
        double apart = c->fx * f->volume.surface.voxel * BLOCK_EDGE / (3 * 2.0);
        apart = fmin(fmax(apart, 1), 4);
        *work = (stage_work){4 * finest + 16 * w->fused_blocks, 8.0 * f->integrator.tiles,
                             44 * valid_pixels(f, FINEST) / (apart * apart)};
    } else if (!strcmp(kernel, "clear_blocks")) {
        *work = (stage_work){0, (double)BLOCK_BYTES * (double)columns, 0};
    } else if (!strcmp(kernel, "pack_planes")) {
        /* the ray and its length 9, weight 14, normal to bits 12, distance 7, the two words 6 */
        *work = (stage_work){16 * finest, 8 * finest, 48 * valid_pixels(f, FINEST)};
    } else if (!strcmp(kernel, "fuse_blocks")) {
        /* a voxel: projection 8, bounds and pixel 8, plane out of its bits 6, distance 4, along the ray 6, mean 6, to
         * and from 16 bits 8 */
        double voxels;
        fused(w, f, &w->fused_blocks, &voxels);
        *work = (stage_work){BLOCK_BYTES * w->fused_blocks + 8 * finest + 16.0 * f->volume.pool.count,
                             BLOCK_BYTES * w->fused_blocks, 46 * voxels + 20.0 * f->volume.pool.count};
    } else {
        return false;
    }
    return true;
}
