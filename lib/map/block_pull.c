#include "map/block_pull.h"

#include <string.h>

static void copy(const volume_view *view, int place, fathom_block_pull *p, size_t n) {
    const cl_int4 *key = &view->keys[place];
    p->keys[n] = (fathom_block_key){key->x, key->y, key->z, key->w};
    const size_t bytes = BLOCK_VOXELS * sizeof *view->voxels;
    if (p->distances) memcpy(p->distances + n * BLOCK_VOXELS, view->voxels + DISTANCES_OF(place), bytes);
    if (p->weights) memcpy(p->weights + n * BLOCK_VOXELS, view->voxels + WEIGHTS_OF(place), bytes);
}

int block_pull(volume *v, const integrator *g, device *d, fathom_block_pull *p) {
    volume_view view;
    int n = 0;
    if (p->next == 0) p->generation = integrator_generation(g);
    if (volume_map(v, d, CL_MAP_READ, p->distances || p->weights, &view)) {
        for (int place = volume_born_since(v, p->next); place < v->pool.count && n < p->capacity; place++) {
            p->next = v->pool.births[place] + 1;
            if (g->before + view.seen[place] > p->since) copy(&view, place, p, (size_t)n++);
        }
    }
    volume_unmap(v, d, &view);
    if (n == 0) {
        p->since = p->generation;
        p->next = 0;
    }
    return n;
}
