#include "map/blocks.h"

#include <string.h>

/* The table has a minimum of two entries per block, so that searches are short. */
static size_t table_entries(int blocks) {
    size_t n = 1024;
    while (n < 2 * (size_t)blocks) n *= 2;
    return n;
}

size_t volume_block_cost(void) {
    /* voxels, key, seen, birth, entries */
    return BLOCK_BYTES + sizeof(cl_int4) + sizeof(cl_int) + sizeof(int64_t) + TABLE_BYTES(4);
}

void volume_init(volume *v, device *d, arena *a, const fathom_config *c, int blocks) {
    size_t entries = table_entries(blocks);
    memset(v, 0, sizeof *v);
    v->pool.capacity = blocks;
    v->table.mask = (cl_uint)(entries - 1);
    v->surface = (kernel_surface){.voxel = c->voxel_m,
                                  .truncation = c->truncation_m > 0 ? c->truncation_m : 4 * c->voxel_m,
                                  .mask = v->table.mask};
    device_buffer_make(d, a, (size_t)blocks * BLOCK_BYTES, &v->pool.voxels);
    device_buffer_make(d, a, TABLE_BYTES(entries), &v->table.entries);
    device_buffer_make(d, a, (size_t)blocks * sizeof(cl_int4), &v->pool.keys);
    device_buffer_make(d, a, (size_t)blocks * sizeof(cl_int), &v->pool.seen);
    v->pool.births = arena_take(a, (size_t)blocks * sizeof *v->pool.births);
    if (d->context && d->error == FATHOM_OK) volume_clear(v, d);
}

void volume_close(volume *v) {
    device_buffer *buffers[] = {&v->pool.voxels, &v->table.entries, &v->pool.keys, &v->pool.seen};
    for (size_t i = 0; i < sizeof buffers / sizeof *buffers; i++) device_buffer_free(buffers[i]);
}

void volume_clear(volume *v, device *d) {
    void *entries = device_map(d, &v->table.entries, CL_MAP_WRITE);
    if (entries) memset(entries, 0xff, v->table.entries.size); /* FREE_ENTRY */
    device_unmap(d, &v->table.entries, entries);
    v->pool.count = 0;
}

bool volume_map(volume *v, device *d, cl_map_flags flags, bool voxels, volume_view *view) {
    memset(view, 0, sizeof *view);
    view->mask = v->table.mask;
    if (voxels) view->voxels = device_map(d, &v->pool.voxels, flags);
    view->keys = device_map(d, &v->pool.keys, flags);
    view->seen = device_map(d, &v->pool.seen, flags);
    view->entries = device_map(d, &v->table.entries, flags);
    if ((voxels && !view->voxels) || !view->keys || !view->seen || !view->entries) return false;
    view->places = (cl_int *)(view->entries + view->mask + 1);
    return true;
}

void volume_unmap(volume *v, device *d, volume_view *view) {
    device_unmap(d, &v->table.entries, view->entries);
    device_unmap(d, &v->pool.seen, view->seen);
    device_unmap(d, &v->pool.keys, view->keys);
    device_unmap(d, &v->pool.voxels, view->voxels);
}

/* The same search as find_block in opencl/blocks.cl. */
cl_uint volume_entry(const volume_view *view, const cl_int4 *key) {
    cl_uint h = block_hash(key->x, key->y, key->z, key->w) & view->mask;
    while (view->entries[h].w != FREE_ENTRY && memcmp(&view->entries[h], key, sizeof *key) != 0)
        h = (h + 1) & view->mask;
    return h;
}

int volume_place(const volume_view *view, const cl_int4 *key) {
    return view->places[volume_entry(view, key)];
}

int volume_add(volume *v, volume_view *view, const cl_int4 *key, int seen) {
    int place = v->pool.count++;
    cl_uint h = volume_entry(view, key);
    view->entries[h] = *key;
    view->places[h] = place;
    view->keys[place] = *key;
    view->seen[place] = seen;
    v->pool.births[place] = v->pool.born++;
    return place;
}

int volume_born_since(const volume *v, int64_t birth) {
    int low = 0, high = v->pool.count;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (v->pool.births[middle] < birth)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

void volume_rehash(volume *v, volume_view *view) {
    memset(view->entries, 0xff, v->table.entries.size);
    for (int i = 0; i < v->pool.count; i++) {
        cl_uint h = volume_entry(view, &view->keys[i]);
        view->entries[h] = view->keys[i];
        view->places[h] = i;
    }
}

fathom_block volume_block(const volume *v, const cl_int4 *key, cl_short *voxels) {
    fathom_block block = FATHOM_STRUCT(fathom_block);
    block.key = (fathom_block_key){key->x, key->y, key->z, key->w};
    block.voxel_m = v->surface.voxel;
    block.truncation_m = v->surface.truncation;
    block.distances = voxels + DISTANCES_OF(0);
    block.weights = (uint16_t *)voxels + WEIGHTS_OF(0);
    return block;
}

void volume_make_new(const fathom_block *block) {
    for (int i = 0; i < BLOCK_VOXELS; i++) block->distances[i] = NEVER_SEEN;
    memset(block->weights, 0, BLOCK_VOXELS * sizeof *block->weights);
}
