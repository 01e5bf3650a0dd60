#include "map/mesh.h"

#include <string.h>

void mesher_init(mesher *m, device *d, arena *a) {
    memset(m, 0, sizeof *m);
    device_buffer_make(d, a, 256 * CASE_SIZE, &m->cases);
    device_buffer_make(d, a, MESH_BATCH * sizeof(cl_int), &m->counts);
    device_buffer_make(d, a, MESH_BATCH * sizeof(cl_int), &m->offsets);
    device_buffer_make(d, a, MESH_TRIANGLES * 18 * sizeof(float), &m->vertices);
    if (!d->context) return;
    m->count = device_kernel(d, "count_triangles");
    m->emit = device_kernel(d, "emit_triangles");
    if (d->error != FATHOM_OK) return;
    uint8_t *table = device_map(d, &m->cases, CL_MAP_WRITE);
    if (table) mesh_cases(table);
    device_unmap(d, &m->cases, table);
}

void mesher_close(mesher *m) {
    if (m->count) clReleaseKernel(m->count);
    if (m->emit) clReleaseKernel(m->emit);
    device_buffer *buffers[] = {&m->cases, &m->counts, &m->offsets, &m->vertices};
    for (int i = 0; i < 4; i++) device_buffer_free(buffers[i]);
}

/* ---- triangles --------------------------------------------------------------------------------------------------- */

static bool count(mesh_walk *w, mesher *m, device *d) {
    volume *v = w->volume;
    const int blocks = w->end - w->next < MESH_BATCH ? w->end - w->next : MESH_BATCH;
    cl_int from = w->next;
    RUN(d, m->count, (size_t)blocks, 1, 1, ARG(v->pool.voxels.memory), ARG(v->table.entries.memory),
        ARG(w->surface), ARG(v->pool.keys.memory), ARG(m->cases.memory), ARG(from), ARG(m->counts.memory));
    cl_int *mapped = device_map(d, &m->counts, CL_MAP_READ);
    if (mapped) memcpy(w->counts, mapped, (size_t)blocks * sizeof *mapped);
    device_unmap(d, &m->counts, mapped);
    w->from = w->next;
    w->counted = blocks;
    return mapped;
}

/* Emits the triangles of blocks first..first+blocks-1, `triangles` in all, and passes them to the callback. */
static int emit(mesher *m, device *d, volume *v, const kernel_surface *f, int first, int blocks,
                const cl_int *counts, int triangles, fathom_triangles callback, void *user) {
    cl_int *offsets = device_map(d, &m->offsets, CL_MAP_WRITE);
    int sum = 0;
    for (int i = 0; offsets && i < blocks; i++) {
        offsets[i] = sum;
        sum += counts[i];
    }
    device_unmap(d, &m->offsets, offsets);
    cl_int from = first;
    /* groups of one: Intel's compiler for CPUs (2026.2.0), with more, computes wrong normals for several blocks at
     * once */
    RUN(d, m->emit, (size_t)blocks, 1, 1, ARG(v->pool.voxels.memory), ARG(v->table.entries.memory), ARG(*f),
        ARG(v->pool.keys.memory), ARG(m->cases.memory), ARG(from), ARG(m->offsets.memory),
        ARG(m->vertices.memory));
    fathom_vertex *vertices = device_map(d, &m->vertices, CL_MAP_READ);
    int stop = vertices && d->error == FATHOM_OK ? callback(user, vertices, (size_t)triangles) : 0;
    device_unmap(d, &m->vertices, vertices);
    return d->error != FATHOM_OK ? d->error : stop ? FATHOM_ERROR_STOPPED : triangles;
}

void mesh_walk_start(mesh_walk *w, volume *v, float min_weight, int next) {
    w->volume = v;
    w->surface = v->surface;
    w->surface.min_weight = min_weight > 0 ? min_weight * WEIGHT_ONE - 0.5f : 0;
    w->next = w->from = next;
    w->end = v->pool.count;
    w->counted = 0;
}

int mesh_walk_next(mesh_walk *w, mesher *m, device *d, int64_t capacity, fathom_triangles triangles,
                   void *user) {
    if (capacity > MESH_TRIANGLES) capacity = MESH_TRIANGLES;
    while (w->next < w->end) {
        if (w->next == w->from + w->counted && !count(w, m, d)) return d->error;
        const int first = w->next - w->from;
        int i = first, sum = 0;
        while (i < w->counted && sum + w->counts[i] <= capacity) sum += w->counts[i++];
        w->next = w->from + i;
        if (sum > 0)
            return emit(m, d, w->volume, &w->surface, w->from + first, i - first, w->counts + first, sum,
                        triangles, user);
        if (i < w->counted) break;
    }
    return d->error;
}

static int ignore(void *user, const fathom_vertex *vertices, size_t triangle_count) {
    (void)user, (void)vertices, (void)triangle_count;
    return 0;
}

void mesh_warm_up(mesher *m, device *d, volume *v) {
    const cl_int none = 0;
    mesh_walk w;
    mesh_walk_start(&w, v, 0, 0);
    mesh_walk_next(&w, m, d, MESH_TRIANGLES, ignore, NULL);
    emit(m, d, v, &v->surface, 0, 1, &none, 0, ignore, NULL);
}
