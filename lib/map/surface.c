#include "map/surface.h"

#include <math.h>
#include <string.h>

/* ---- marching cubes' table ---------------------------------------------------------------------------------------------- */

static int edge_between(int a, int b) {
    static const uint8_t ends[12][2] = {{0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3},
                                        {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7}};
    for (int e = 0; e < 12; e++)
        if ((ends[e][0] == a && ends[e][1] == b) || (ends[e][0] == b && ends[e][1] == a)) return e;
    return -1;
}

/* On each face the surface's trace joins the edge where a walk around the face enters the inside with the edge where it
 * leaves again. Two cubes that share a face so agree on it, even where its corners alternate, and the mesh has no holes.
 * Each crossed edge is entered on one of its faces and left on the other, so the joins form loops; each loop is a fan. */
void surface_cases(uint8_t table[256 * 16]) {
    static const uint8_t faces[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
    memset(table, 255, 256 * 16);
    for (int kind = 0; kind < 256; kind++) {
        int next[12];
        for (int e = 0; e < 12; e++) next[e] = -1;
        for (int f = 0; f < 6; f++)
            for (int k = 0; k < 4; k++) {
                int outside = faces[f][k], inside = faces[f][(k + 1) % 4];
                if (kind >> outside & 1 || !(kind >> inside & 1)) continue;
                int m = k + 1;
                while (kind >> faces[f][(m + 1) % 4] & 1) m++;
                next[edge_between(outside, inside)] = edge_between(faces[f][m % 4], faces[f][(m + 1) % 4]);
            }
        uint8_t *out = table + 16 * kind;
        for (int start = 0; start < 12; start++) {
            if (next[start] < 0) continue;
            int a = next[start], b = next[a];
            while (b != start) {
                *out++ = (uint8_t)start;
                *out++ = (uint8_t)a;
                *out++ = (uint8_t)b;
                next[a] = -1;
                a = b;
                b = next[b];
            }
            next[a] = next[start] = -1;
        }
    }
}

/* ---- buffers ------------------------------------------------------------------------------------------------------------ */

void surface_init(surface_output *s, device *d, arena *a, const depth_maps *maps) {
    memset(s, 0, sizeof *s);
    s->view_width = maps->camera[FINEST].width;
    s->view_height = maps->camera[FINEST].height;
    device_buffer_make(d, a, 256 * 16, &s->cases);
    device_buffer_make(d, a, SURFACE_BATCH * sizeof(cl_int), &s->counts);
    device_buffer_make(d, a, SURFACE_BATCH * sizeof(cl_int), &s->offsets);
    device_buffer_make(d, a, SURFACE_TRIANGLES * 18 * sizeof(float), &s->vertices);
    device_buffer_make(d, a, (size_t)s->view_width * (size_t)s->view_height * sizeof(cl_uint2), &s->view);
    if (!d->context) return;
    s->count = device_kernel(d, "count_triangles");
    s->emit = device_kernel(d, "emit_triangles");
    if (d->error != FATHOM_OK) return;
    uint8_t *table = device_map(d, &s->cases, CL_MAP_WRITE);
    if (table) surface_cases(table);
    device_unmap(d, &s->cases, table);
}

void surface_close(surface_output *s) {
    if (s->count) clReleaseKernel(s->count);
    if (s->emit) clReleaseKernel(s->emit);
    device_buffer *buffers[] = {&s->cases, &s->counts, &s->offsets, &s->vertices, &s->view};
    for (int i = 0; i < 5; i++) device_buffer_free(buffers[i]);
}

/* ---- triangles ---------------------------------------------------------------------------------------------------------- */

/* Emits blocks first..first+blocks-1, which make `triangles` in all, and hands them over. */
static int emit(surface_output *s, device *d, volume *v, const kernel_surface *f, int first, int blocks,
                const cl_int *counts, int triangles, fathom_triangles callback, void *user) {
    cl_int *offsets = device_map(d, &s->offsets, CL_MAP_WRITE);
    int sum = 0;
    for (int i = 0; offsets && i < blocks; i++) {
        offsets[i] = sum;
        sum += counts[i];
    }
    device_unmap(d, &s->offsets, offsets);
    cl_int from = first;
    /* groups of one: Intel's compiler for CPUs (2026.2.0), given more, makes wrong normals of several blocks at once */
    RUN(d, s->emit, (size_t)blocks, 1, 1, ARG(v->voxels.memory), ARG(v->table.memory), ARG(*f),
        ARG(v->blocks.memory), ARG(s->cases.memory), ARG(from), ARG(s->offsets.memory),
        ARG(s->vertices.memory));
    fathom_vertex *vertices = device_map(d, &s->vertices, CL_MAP_READ);
    int stop = vertices && d->error == FATHOM_OK ? callback(user, vertices, (size_t)triangles) : 0;
    device_unmap(d, &s->vertices, vertices);
    return d->error != FATHOM_OK ? d->error : stop ? FATHOM_ERROR_STOPPED : FATHOM_OK;
}

int64_t surface_extract(surface_output *s, device *d, volume *v, float min_weight, fathom_triangles callback,
                        void *user) {
    kernel_surface f = v->surface;
    f.min_weight = min_weight > 0 ? min_weight * WEIGHT_ONE - 0.5f : 0;
    int64_t total = 0;
    for (int start = 0; start < v->count; start += SURFACE_BATCH) {
        int blocks = v->count - start < SURFACE_BATCH ? v->count - start : SURFACE_BATCH;
        cl_int from = start, counts[SURFACE_BATCH];
        RUN(d, s->count, (size_t)blocks, 1, 1, ARG(v->voxels.memory), ARG(v->table.memory), ARG(f),
            ARG(v->blocks.memory), ARG(s->cases.memory), ARG(from), ARG(s->counts.memory));
        cl_int *mapped = device_map(d, &s->counts, CL_MAP_READ);
        if (!mapped) return d->error;
        memcpy(counts, mapped, (size_t)blocks * sizeof *counts);
        device_unmap(d, &s->counts, mapped);
        int first = 0, sum = 0;
        for (int i = 0; i <= blocks; i++) {
            if (i == blocks || sum + counts[i] > SURFACE_TRIANGLES) {
                int e = sum > 0
                            ? emit(s, d, v, &f, start + first, i - first, counts + first, sum, callback, user)
                            : 0;
                if (e != FATHOM_OK) return e;
                total += sum;
                first = i;
                sum = 0;
            }
            if (i < blocks) sum += counts[i];
        }
    }
    return d->error != FATHOM_OK ? d->error : total;
}

static int ignore(void *user, const fathom_vertex *vertices, size_t triangle_count) {
    (void)user, (void)vertices, (void)triangle_count;
    return 0;
}

void surface_warm_up(surface_output *s, device *d, volume *v) {
    const cl_int none = 0;
    surface_extract(s, d, v, 0, ignore, NULL);
    emit(s, d, v, &v->surface, 0, 1, &none, 0, ignore, NULL);
}

/* ---- views -------------------------------------------------------------------------------------------------------------- */

int surface_view(surface_output *s, device *d, volume *v, const fathom_view *view,
                 const pose *camera_to_world, float *depth, float *normals) {
    float near_m = view->near_m > 0 ? view->near_m : 0.1f, far_m = view->far_m > 0 ? view->far_m : 20.0f;
    const fathom_pinhole *c = &view->camera;
    for (int y0 = 0; y0 < c->height; y0 += s->view_height)
        for (int x0 = 0; x0 < c->width; x0 += s->view_width) {
            int w = c->width - x0 < s->view_width ? c->width - x0 : s->view_width;
            int h = c->height - y0 < s->view_height ? c->height - y0 : s->view_height;
            kernel_camera part = kernel_camera_of(w, h, (float)c->fx, (float)c->fy, (float)c->cx - (float)x0,
                                                  (float)c->cy - (float)y0);
            volume_raycast(v, d, &part, camera_to_world, near_m, far_m, &s->view);
            cl_uint2 *map = device_map(d, &s->view, CL_MAP_READ);
            for (int i = 0; map && i < w * h; i++) {
                size_t at = (size_t)(y0 + i / w) * (size_t)c->width + (size_t)(x0 + i % w);
                kernel_point m = kernel_point_of(map[i]);
                float *n = m.normal, length = sqrtf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
                for (int k = 0; k < 3 && length > 0; k++) n[k] /= length; /* rounded, in the map */
                if (depth) depth[at] = m.depth;
                if (normals) memcpy(normals + 3 * at, m.normal, sizeof m.normal);
            }
            device_unmap(d, &s->view, map);
        }
    return d->error;
}
