#include "map/whole_mesh.h"

#include <string.h>

#define PATCH_BLOCKS 512
#define REACHED 20          /* blocks that a block's triangles and their normals depend on, itself included */
#define INDEX_MAX (1 << 27) /* of a block: voxels are counted in 32 bits */

typedef struct {
    const whole_mesh *mesh;
    volume_view in_patch, in_pool; /* mapped */
    bool nonsense;                 /* a key from the store */
} work;

void whole_mesh_init(volume *patch, device *d, arena *a, const fathom_config *config) {
    memset(patch, 0, sizeof *patch);
    if (config->when_full == FATHOM_FULL_DROP) volume_init(patch, d, a, config, PATCH_BLOCKS);
}

void whole_mesh_close(volume *patch) {
    volume_close(patch);
}

/* ---- the patch --------------------------------------------------------------------------------------------------- */

/* Brings the block into the patch unless it is there. False: neither pool nor store has it. */
static bool bring(work *w, const cl_int4 *key) {
    volume *patch = w->mesh->patch;
    if (volume_place(&w->in_patch, key) >= 0) return true;
    cl_short *voxels = w->in_patch.voxels + (size_t)patch->pool.count * BLOCK_SHORTS;
    int place = volume_place(&w->in_pool, key);
    if (place >= 0) {
        memcpy(voxels, w->in_pool.voxels + (size_t)place * BLOCK_SHORTS, BLOCK_BYTES);
    } else {
        fathom_block block = volume_block(patch, key, voxels);
        volume_make_new(&block);
        if (!store_get(w->mesh->store, &block)) return false;
    }
    volume_add(patch, &w->in_patch, key, 0);
    return true;
}

static bool countable(const cl_int4 *key) {
    for (int k = 0; k < 3; k++)
        if (key->s[k] < -INDEX_MAX || key->s[k] > INDEX_MAX) return false;
    return true;
}

/* Brings the next block and moves on. A stored one that is in the pool comes with the pool's later; one that the store
 * doesn't return is left out. False at the end. */
static bool bring_next(work *w, mesh_place *at, cl_int4 *key) {
    const volume *pool = w->mesh->pool;
    while (store_key(w->mesh->store, at->stored, key)) {
        if (!countable(key)) {
            w->nonsense = true;
            return false;
        }
        at->stored++;
        if (key->w == pool->surface.submap && volume_place(&w->in_pool, key) < 0 && bring(w, key))
            return true;
    }
    const int place = volume_born_since(pool, at->born);
    if (place == pool->pool.count) return false;
    *key = w->in_pool.keys[place];
    at->born = pool->pool.births[place] + 1;
    return bring(w, key);
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

/* Fills the patch from a place on, up to its capacity, and advances the place. The blocks to be meshed come first in
 * its keys; places[i] is where the i-th began. Returns their number. */
static int fill(work *w, mesh_place *at, mesh_place places[PATCH_BLOCKS]) {
    volume *patch = w->mesh->patch;
    device *d = w->mesh->device;
    int wanted = 0;
    patch->pool.count = 0;
    if (volume_map(patch, d, CL_MAP_READ | CL_MAP_WRITE, true, &w->in_patch)) {
        cl_int4 keys[PATCH_BLOCKS], key;
        volume_rehash(patch, &w->in_patch);
        while (patch->pool.count + REACHED <= PATCH_BLOCKS) {
            const mesh_place here = *at;
            if (!bring_next(w, at, &key)) break;
            bring_neighbours(w, &key);
            places[wanted] = here;
            keys[wanted++] = key;
        }
        memcpy(w->in_patch.keys, keys, (size_t)wanted * sizeof *keys);
    }
    volume_unmap(patch, d, &w->in_patch);
    patch->pool.count = wanted;
    return wanted;
}

/* ---- triangles --------------------------------------------------------------------------------------------------- */

/* Passes on the triangles of a walk within the capacity, of which a part may stay unused. */
static int64_t walk_on(const whole_mesh *w, mesh_walk *walk, int64_t capacity, fathom_triangles triangles,
                       void *user) {
    int64_t total = 0;
    for (;;) {
        const int more = mesh_walk_next(walk, w->mesher, w->device, capacity - total, triangles, user);
        if (more <= 0) return more < 0 ? more : total;
        total += more;
    }
}

static int64_t pull_pool(const whole_mesh *w, mesh_place *at, int64_t capacity, fathom_triangles triangles,
                         void *user) {
    const block_pool *pool = &w->pool->pool;
    mesh_walk walk;
    mesh_walk_start(&walk, w->pool, w->min_weight, volume_born_since(w->pool, at->born));
    const int64_t total = walk_on(w, &walk, capacity, triangles, user);
    at->born = walk.next < pool->count ? pool->births[walk.next] : pool->born;
    return total;
}

/* Meshes the pool's blocks in the patch, too: their neighbours may be in the store. */
static int64_t pull_all(const whole_mesh *w, mesh_place *at, int64_t capacity, fathom_triangles triangles,
                        void *user) {
    work k = {.mesh = w};
    mesh_place places[PATCH_BLOCKS];
    int64_t total = 0;
    bool mapped = volume_map(w->pool, w->device, CL_MAP_READ, true, &k.in_pool);
    for (int wanted; mapped && total >= 0 && (wanted = fill(&k, at, places)) > 0;) {
        mesh_walk walk;
        mesh_walk_start(&walk, w->patch, w->min_weight, 0);
        const int64_t more = walk_on(w, &walk, capacity - total, triangles, user);
        total = more < 0 ? more : total + more;
        if (walk.next == wanted) continue;
        *at = places[walk.next];
        break;
    }
    volume_unmap(w->pool, w->device, &k.in_pool);
    if (w->device->error != FATHOM_OK) return w->device->error;
    return k.nonsense && total >= 0 ? FATHOM_ERROR_ARGUMENT : total;
}

int64_t whole_mesh_pull(const whole_mesh *w, mesh_place *at, int64_t capacity, fathom_triangles triangles,
                        void *user) {
    cl_int4 key;
    const bool stored = w->store && w->patch->pool.capacity > 0 && store_key(w->store, 0, &key);
    return stored ? pull_all(w, at, capacity, triangles, user) : pull_pool(w, at, capacity, triangles, user);
}
