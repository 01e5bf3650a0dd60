/* Lookup of a block and of a voxel (see opencl/layout.h). */

/* The place of a block in the pool, or -1. */
inline int find_block(global const int4 *table, uint mask, int submap, int3 b) {
    uint h = block_hash(b.x, b.y, b.z, submap) & mask;
    for (;;) {
        int4 e = table[h];
        if (e.x == b.x && e.y == b.y && e.z == b.z && e.w == submap)
            return ((global const int *)(table + mask + 1))[h];
        if (e.w == FREE_ENTRY) return -1;
        h = (h + 1u) & mask;
    }
}

/* A voxel's stored distance in truncations, or NAN where it was never seen. *last, *place: the last block that was
 * looked up. */
inline float voxel_at(global const short *voxels, global const int4 *table, kernel_surface f, int3 i,
                      int3 *last, int *place) {
    int3 b = i >> 3;
    if (any(b != *last)) {
        *last = b;
        *place = find_block(table, f.mask, f.submap, b);
    }
    if (*place < 0) return NAN;
    int at = ((i.z & 7) * 8 + (i.y & 7)) * 8 + (i.x & 7);
    short d = voxels[DISTANCES_OF(*place) + at];
    if (f.min_weight > 0.0f &&
        (float)((global const ushort *)voxels)[WEIGHTS_OF(*place) + at] <= f.min_weight)
        return NAN;
    return d == NEVER_SEEN ? NAN : (float)d * (1.0f / TSDF_ONE);
}
