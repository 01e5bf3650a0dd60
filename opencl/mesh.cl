/* Triangles of the surface by marching cubes (Lorensen and Cline 1987). The host builds the table
 * (lib/map/mesh_cases.c). */

constant uchar edge_ends[12][2] = EDGE_ENDS;

inline int3 corner_offset(int k) {
    return (int3)(k & 1, (k >> 1) & 1, k >> 2);
}

/* The eight distances of the cube at voxel i; its case, or 0 when one was never seen. */
inline int cube_case(global const short *voxels, global const int4 *table, kernel_surface f, int3 i, float *d,
                     int3 *last, int *place) {
    int kind = 0;
    for (int k = 0; k < 8; k++) {
        d[k] = voxel_at(voxels, table, f, i + corner_offset(k), last, place);
        if (isnan(d[k])) return 0;
        if (d[k] <= 0.0f) kind |= 1 << k;
    }
    return kind;
}

/* Counts the triangles of each block. Global size: blocks. */
kernel void count_triangles(global const short *voxels, global const int4 *table, kernel_surface f,
                            global const int4 *blocks, constant uchar *cases, int first, global int *counts) {
    int index = first + get_global_id(0);
    int3 base = blocks[index].xyz * BLOCK_EDGE, last = (int3)(INT_MAX);
    int place = -1, count = 0;
    float d[8];
    for (int k = 0; k < BLOCK_VOXELS; k++) {
        int kind = cube_case(voxels, table, f, base + (int3)(k & 7, (k >> 3) & 7, k >> 6), d, &last, &place);
        for (int j = 0; j < CASE_SIZE && cases[kind * CASE_SIZE + j] != CASE_END; j += 3) count++;
    }
    counts[get_global_id(0)] = count;
}

inline float3 voxel_gradient(global const short *voxels, global const int4 *table, kernel_surface f, int3 i,
                             int3 *last, int *place) {
    float here = voxel_at(voxels, table, f, i, last, place);
    float g[3];
    for (int axis = 0; axis < 3; axis++) {
        int3 e = (int3)(axis == 0, axis == 1, axis == 2);
        float up = voxel_at(voxels, table, f, i + e, last, place),
              down = voxel_at(voxels, table, f, i - e, last, place);
        /* one-sided beside unseen voxels */
        if (isnan(up))
            g[axis] = isnan(down) ? 0.0f : 2.0f * (here - down);
        else
            g[axis] = isnan(down) ? 2.0f * (up - here) : up - down;
    }
    return (float3)(g[0], g[1], g[2]);
}

/* Writes each block's triangles from its offset on: position and normal (6 floats) per corner, three corners per
 * triangle. A corner is computed from its edge alone, always from the lower voxel up, so that all triangles that share
 * it agree to the bit. Global size: blocks. */
kernel void emit_triangles(global const short *voxels, global const int4 *table, kernel_surface f,
                           global const int4 *blocks, constant uchar *cases, int first,
                           global const int *offsets, global float *vertices) {
    int index = first + get_global_id(0);
    int3 base = blocks[index].xyz * BLOCK_EDGE, last = (int3)(INT_MAX);
    int place = -1;
    global float *out = vertices + (size_t)offsets[get_global_id(0)] * 18;
    float d[8];
    for (int k = 0; k < BLOCK_VOXELS; k++) {
        int3 i = base + (int3)(k & 7, (k >> 3) & 7, k >> 6);
        int kind = cube_case(voxels, table, f, i, d, &last, &place);
        for (int j = 0; j < CASE_SIZE && cases[kind * CASE_SIZE + j] != CASE_END; j++) {
            int edge = cases[kind * CASE_SIZE + j];
            int a = edge_ends[edge][0], b = edge_ends[edge][1];
            int3 ia = i + corner_offset(a), ib = i + corner_offset(b);
            float t = clamp(d[a] / (d[a] - d[b]), CORNER_MARGIN, 1.0f - CORNER_MARGIN);
            float3 p = (convert_float3(ia) + t * convert_float3(ib - ia)) * f.voxel;
            float3 n = mix(voxel_gradient(voxels, table, f, ia, &last, &place),
                           voxel_gradient(voxels, table, f, ib, &last, &place), t);
            float length2 = dot(n, n);
            n = length2 > 1e-12f ? n * rsqrt(length2) : (float3)(0.0f, 0.0f, 1.0f);
            vstore3(p, 0, out);
            vstore3(n, 1, out);
            out += 6;
        }
    }
}
