#include "map/whole_mesh.h"

#include <string.h>

#define PATCH_BLOCKS 512
#define REACHED 20 /* blocks that a block's triangles and their normals are made from, itself counted */

typedef struct {
    volume *patch, *pool;
    caller_store *store;
    volume_view in_patch, in_pool; /* mapped */
    size_t dropped;                /* blocks */
    const int32_t *indices;
} work;

void whole_mesh_init(volume *patch, device *d, arena *a, const fathom_config *config) {
    memset(patch, 0, sizeof *patch);
    if (config->when_full == FATHOM_FULL_DROP) volume_init(patch, d, a, config, PATCH_BLOCKS);
}

void whole_mesh_close(volume *patch) {
    volume_close(patch);
}

/* Brings the block into the patch unless it is there. False: nobody has it. */
static bool bring(work *w, const cl_int4 *key) {
    if (volume_place(&w->in_patch, key) >= 0) return true;
    cl_short *voxels = w->in_patch.voxels + (size_t)w->patch->pool.count * BLOCK_SHORTS;
    int place = volume_place(&w->in_pool, key);
    if (place >= 0) {
        memcpy(voxels, w->in_pool.voxels + (size_t)place * BLOCK_SHORTS, BLOCK_BYTES);
    } else {
        fathom_block block = volume_block(w->patch, key, voxels);
        volume_make_new(voxels);
        if (!store_get(w->store, &block)) return false;
    }
    volume_add(w->patch, &w->in_patch, key, 0);
    return true;
}

/* The n-th block of all; false when it is a dropped one that isn't to be had, or is in the pool and so comes later. */
static bool bring_nth(work *w, size_t n, cl_int4 *key) {
    if (n >= w->dropped) {
        *key = w->in_pool.keys[n - w->dropped];
        return bring(w, key);
    }
    for (int k = 0; k < 3; k++) key->s[k] = w->indices[3 * n + (size_t)k];
    key->w = w->pool->surface.submap;
    return volume_place(&w->in_pool, key) < 0 && bring(w, key);
}

/* A cube reaches into the next block along each axis, a corner's gradient one voxel further along one axis. */
static void bring_neighbours(work *w, const cl_int4 *b) {
    for (int z = -1; z <= 1; z++)
        for (int y = -1; y <= 1; y++)
            for (int x = -1; x <= 1; x++) {
                cl_int4 neighbour = {{b->x + x, b->y + y, b->z + z, b->w}};
                if ((x < 0) + (y < 0) + (z < 0) <= 1) bring(w, &neighbour);
            }
}

/* Fills the patch from the next-th block on, as far as it goes: the blocks whose triangles are wanted get their keys in
 * `wanted`. Returns the block to go on with. */
static size_t fill(work *w, device *d, size_t next, size_t all) {
    volume *patch = w->patch;
    int wanted = 0;
    patch->pool.count = 0;
    if (volume_map(patch, d, CL_MAP_READ | CL_MAP_WRITE, true, &w->in_patch)) {
        cl_int4 keys[PATCH_BLOCKS];
        volume_rehash(patch, &w->in_patch);
        for (; next < all && patch->pool.count + REACHED <= PATCH_BLOCKS; next++) {
            cl_int4 key;
            if (!bring_nth(w, next, &key)) continue;
            bring_neighbours(w, &key);
            keys[wanted++] = key;
        }
        memcpy(w->in_patch.keys, keys, (size_t)wanted * sizeof *keys);
    }
    volume_unmap(patch, d, &w->in_patch);
    patch->pool.count = wanted;
    return next;
}

int64_t whole_mesh_extract(volume *patch, volume *pool, mesher *m, device *d, caller_store *s, const int32_t *dropped,
                           size_t count, float min_weight, fathom_triangles triangles, void *user) {
    work w = {.patch = patch, .pool = pool, .store = s, .dropped = count, .indices = dropped};
    int64_t total = 0;
    size_t all = count + (size_t)pool->pool.count;
    bool mapped = volume_map(pool, d, CL_MAP_READ, true, &w.in_pool);
    for (size_t next = 0; mapped && next < all && total >= 0 && d->error == FATHOM_OK;) {
        next = fill(&w, d, next, all);
        int64_t more = mesh_extract(m, d, patch, min_weight, triangles, user);
        total = more < 0 ? more : total + more;
    }
    volume_unmap(pool, d, &w.in_pool);
    return d->error != FATHOM_OK ? d->error : total;
}
