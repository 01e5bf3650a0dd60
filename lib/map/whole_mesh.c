#include "map/whole_mesh.h"

#include <string.h>

#define PATCH_BLOCKS 512
#define PATCH_ENTRIES 1024
#define REACHED 20 /* blocks that a block's triangles and their normals are made from, itself counted */

typedef struct {
    volume *patch, *pool;
    const fathom_config *config;
    cl_short *voxels, *pool_voxels; /* mapped */
    cl_int4 *table, *pool_table;
    cl_int4 *blocks, *pool_blocks;
    int used;       /* places of the patch */
    size_t dropped; /* blocks */
    const int32_t *indices;
} work;

void whole_mesh_init(volume *patch, device *d, arena *a, const fathom_config *config) {
    memset(patch, 0, sizeof *patch);
    if (config->when_full != FATHOM_FULL_DROP) return;
    device_buffer_make(d, a, (size_t)PATCH_BLOCKS * BLOCK_BYTES, &patch->voxels);
    device_buffer_make(d, a, PATCH_ENTRIES * sizeof(cl_int4), &patch->table);
    device_buffer_make(d, a, PATCH_BLOCKS * sizeof(cl_int4), &patch->blocks);
    patch->capacity = PATCH_BLOCKS;
}

void whole_mesh_close(volume *patch) {
    device_buffer *buffers[] = {&patch->voxels, &patch->table, &patch->blocks};
    for (int i = 0; i < 3; i++) device_buffer_free(buffers[i]);
}

static cl_int4 *pooled(const work *w, const cl_int4 *b) {
    return volume_entry(w->pool_table, w->pool->surface.mask, b);
}

/* Brings the block into the patch unless it is there. False: nobody has it. */
static bool bring(work *w, cl_int4 b) {
    cl_int4 *entry = volume_entry(w->table, w->patch->surface.mask, &b);
    if (entry->w >= 0) return true;
    fathom_block block = volume_block(w->patch, &b, w->voxels, w->used);
    int place = pooled(w, &b)->w;
    if (place >= 0) {
        memcpy(block.distances, w->pool_voxels + (size_t)place * 2 * BLOCK_VOXELS, BLOCK_BYTES);
    } else {
        for (int i = 0; i < BLOCK_VOXELS; i++) block.distances[i] = INT16_MIN;
        memset(block.weights, 0, BLOCK_VOXELS * sizeof *block.weights);
        if (!w->config->block_in(w->config->block_user, &block)) return false;
    }
    b.w = w->used++;
    *entry = b;
    return true;
}

/* The n-th block of all; false when it is a dropped one that isn't to be had, or is in the pool and so comes later. */
static bool bring_nth(work *w, size_t n, cl_int4 *b) {
    if (n >= w->dropped) {
        *b = w->pool_blocks[n - w->dropped];
        return bring(w, *b);
    }
    for (int k = 0; k < 3; k++) b->s[k] = w->indices[3 * n + (size_t)k];
    b->w = -1;
    return pooled(w, b)->w < 0 && bring(w, *b);
}

/* A cube reaches into the next block along each axis, a corner's gradient one voxel further along one axis. */
static void bring_neighbours(work *w, const cl_int4 *b) {
    for (int z = -1; z <= 1; z++)
        for (int y = -1; y <= 1; y++)
            for (int x = -1; x <= 1; x++) {
                cl_int4 neighbour = {{b->x + x, b->y + y, b->z + z, -1}};
                if ((x < 0) + (y < 0) + (z < 0) <= 1) bring(w, neighbour);
            }
}

/* Fills the patch from the next-th block on, as far as it goes. Returns the block to go on with. */
static size_t fill(work *w, device *d, size_t next, size_t all) {
    volume *patch = w->patch;
    w->voxels = device_map(d, &patch->voxels, CL_MAP_READ | CL_MAP_WRITE);
    w->table = device_map(d, &patch->table, CL_MAP_READ | CL_MAP_WRITE);
    w->blocks = device_map(d, &patch->blocks, CL_MAP_READ | CL_MAP_WRITE);
    w->used = patch->count = 0;
    if (w->voxels && w->table && w->blocks) {
        memset(w->table, 0xff, patch->table.size);
        for (; next < all && w->used + REACHED <= PATCH_BLOCKS && patch->count < PATCH_BLOCKS; next++) {
            cl_int4 b;
            if (!bring_nth(w, next, &b)) continue;
            bring_neighbours(w, &b);
            w->blocks[patch->count++] = b;
        }
    }
    device_unmap(d, &patch->blocks, w->blocks);
    device_unmap(d, &patch->table, w->table);
    device_unmap(d, &patch->voxels, w->voxels);
    return next;
}

int64_t whole_mesh_extract(volume *patch, volume *pool, surface_output *s, device *d, const int32_t *dropped,
                           size_t count, float min_weight, fathom_triangles triangles, void *user) {
    work w = {.patch = patch, .pool = pool, .config = d->config, .dropped = count, .indices = dropped};
    patch->surface = pool->surface;
    patch->surface.mask = PATCH_ENTRIES - 1;
    w.pool_voxels = device_map(d, &pool->voxels, CL_MAP_READ);
    w.pool_table = device_map(d, &pool->table, CL_MAP_READ);
    w.pool_blocks = device_map(d, &pool->blocks, CL_MAP_READ);
    int64_t total = 0;
    size_t all = count + (size_t)pool->count;
    for (size_t next = 0; next < all && total >= 0 && d->error == FATHOM_OK;) {
        next = fill(&w, d, next, all);
        int64_t more = surface_extract(s, d, patch, min_weight, triangles, user);
        total = more < 0 ? more : total + more;
    }
    device_unmap(d, &pool->blocks, w.pool_blocks);
    device_unmap(d, &pool->table, w.pool_table);
    device_unmap(d, &pool->voxels, w.pool_voxels);
    return d->error != FATHOM_OK ? d->error : total;
}
