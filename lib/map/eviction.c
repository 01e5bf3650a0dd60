#include "map/eviction.h"

#include <string.h>

#define IN_VIEW 3 /* frames: blocks seen this recently stay (calm frames fuse half of them) */
#define SHARE 16   /* fraction of the pool that is dropped at a time, so that it isn't done for every frame */

static int older_than(const cl_int *seen, int count, int frame) {
    int n = 0;
    for (int i = 0; i < count; i++) n += seen[i] < frame;
    return n;
}

/* The frame before which blocks must have been last seen to be dropped: as few as are enough. */
static int cutoff(const cl_int *seen, int count, int frames, int wanted) {
    int low = 0, high = frames - IN_VIEW;
    if (high <= low || older_than(seen, count, high) <= wanted) return high;
    while (high - low > 1) { /* older_than(high) is enough, older_than(low) isn't */
        int middle = low + (high - low) / 2;
        if (older_than(seen, count, middle) >= wanted)
            high = middle;
        else
            low = middle;
    }
    return high;
}

int eviction_make_room(volume *v, device *d, integrator *g, caller_store *s, int wanted) {
    volume_view view;
    int kept = 0, before = v->pool.count;
    if (wanted < v->pool.capacity / SHARE) wanted = v->pool.capacity / SHARE;
    if (volume_map(v, d, CL_MAP_READ | CL_MAP_WRITE, true, &view)) {
        int oldest = cutoff(view.seen, before, g->frames, wanted), left = wanted;
        for (int i = 0; i < before; i++) {
            cl_short *voxels = view.voxels + (size_t)i * BLOCK_SHORTS;
            if (view.seen[i] < oldest && left > 0) {
                left--;
                fathom_block b = volume_block(v, &view.keys[i], voxels);
                store_put(s, &b);
                continue;
            }
            if (kept < i) {
                memcpy(view.voxels + (size_t)kept * BLOCK_SHORTS, voxels, BLOCK_BYTES);
                view.keys[kept] = view.keys[i];
                view.seen[kept] = view.seen[i];
                v->pool.births[kept] = v->pool.births[i];
            }
            kept++;
        }
        v->pool.count = g->settling = kept;
        g->settled = 0;
        volume_rehash(v, &view);
    }
    volume_unmap(v, d, &view);
    return before - v->pool.count;
}

int eviction_restore(volume *v, device *d, caller_store *s, int first) {
    volume_view view;
    int restored = 0;
    if (!s->calls.get || first == v->pool.count) return 0;
    bool mapped = volume_map(v, d, CL_MAP_READ | CL_MAP_WRITE, true, &view);
    for (int i = first; mapped && i < v->pool.count; i++) {
        fathom_block b = volume_block(v, &view.keys[i], view.voxels + (size_t)i * BLOCK_SHORTS);
        restored += store_get(s, &b);
    }
    volume_unmap(v, d, &view);
    s->restored += restored;
    return restored;
}
