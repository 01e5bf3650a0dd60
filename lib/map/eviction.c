#include "map/eviction.h"

#include <string.h>

#define IN_VIEW 3 /* frames: a block that was seen so lately stays (calm frames fuse half of them) */
#define SHARE 16   /* of the pool that goes at a time, so that it isn't done for every frame */

static int older_than(const cl_int *seen, int count, int frame) {
    int n = 0;
    for (int i = 0; i < count; i++) n += seen[i] < frame;
    return n;
}

/* The frame before which blocks were last seen that must go: as few as are enough. */
static int cutoff(const volume *v, const cl_int *seen, int wanted) {
    int low = 0, high = v->frames - IN_VIEW;
    if (high <= low || older_than(seen, v->count, high) <= wanted) return high;
    while (high - low > 1) { /* older_than(high) is enough, older_than(low) isn't */
        int middle = low + (high - low) / 2;
        if (older_than(seen, v->count, middle) >= wanted)
            high = middle;
        else
            low = middle;
    }
    return high;
}

int eviction_make_room(volume *v, device *d, const fathom_config *config, int wanted) {
    if (wanted < v->capacity / SHARE) wanted = v->capacity / SHARE;
    cl_short *voxels = device_map(d, &v->voxels, CL_MAP_READ | CL_MAP_WRITE);
    cl_int4 *blocks = device_map(d, &v->blocks, CL_MAP_READ | CL_MAP_WRITE);
    cl_int *seen = device_map(d, &v->seen, CL_MAP_READ | CL_MAP_WRITE);
    cl_int4 *table = device_map(d, &v->table, CL_MAP_READ | CL_MAP_WRITE);
    int kept = 0, before = v->count;
    if (voxels && blocks && seen && table) {
        int oldest = cutoff(v, seen, wanted), left = wanted;
        for (int i = 0; i < before; i++) {
            if (seen[i] < oldest && left > 0) {
                left--;
                fathom_block b = volume_block(v, &blocks[i], voxels, i);
                if (config->block_out) config->block_out(config->block_user, &b);
                continue;
            }
            if (kept < i) {
                memcpy(voxels + (size_t)kept * 2 * BLOCK_VOXELS, voxels + (size_t)i * 2 * BLOCK_VOXELS,
                       BLOCK_BYTES);
                blocks[kept] = blocks[i];
                seen[kept] = seen[i];
            }
            blocks[kept].w = kept;
            kept++;
        }
        v->count = v->settling = kept;
        v->settled = 0;
        memset(table, 0xff, v->table.size);
        for (int i = 0; i < kept; i++) *volume_entry(table, v->surface.mask, &blocks[i]) = blocks[i];
        v->dropped += before - kept;
    }
    device_unmap(d, &v->table, table);
    device_unmap(d, &v->seen, seen);
    device_unmap(d, &v->blocks, blocks);
    device_unmap(d, &v->voxels, voxels);
    return before - v->count;
}

int eviction_restore(volume *v, device *d, const fathom_config *config, int first) {
    if (!config->block_in || first == v->count) return 0;
    cl_short *voxels = device_map(d, &v->voxels, CL_MAP_READ | CL_MAP_WRITE);
    cl_int4 *blocks = device_map(d, &v->blocks, CL_MAP_READ);
    int restored = 0;
    for (int i = first; voxels && blocks && i < v->count; i++) {
        fathom_block b = volume_block(v, &blocks[i], voxels, i);
        restored += config->block_in(config->block_user, &b) != 0;
    }
    v->restored += restored;
    device_unmap(d, &v->blocks, blocks);
    device_unmap(d, &v->voxels, voxels);
    return restored;
}
