/* Ray-cast of the surface to model maps (Newcombe et al. 2011, "KinectFusion", Section 3.3), over the hashed blocks. */

typedef struct {
    float voxel, truncation;  /* metres */
    uint mask;                /* of the hash table */
    float min_weight;         /* voxels below count as never seen; in stored units; 0: all that were seen count */
} surface;

/* A voxel's stored distance in truncations, or NAN where it was never seen. *last, *place: the block looked up last. */
inline float voxel_at(global const short *voxels, global const int4 *table, surface f, int3 i, int3 *last, int *place) {
    int3 b = i >> 3;
    if (any(b != *last)) {
        *last = b;
        *place = find_block(table, f.mask, b);
    }
    if (*place < 0) return NAN;
    global const short *block = voxels + (size_t)*place * 2 * BLOCK_VOXELS;
    int at = ((i.z & 7) * 8 + (i.y & 7)) * 8 + (i.x & 7);
    short d = block[at];
    if (f.min_weight > 0.0f && (float)((global const ushort *)block)[BLOCK_VOXELS + at] <= f.min_weight) return NAN;
    return d == NEVER_SEEN ? NAN : (float)d * (1.0f / TSDF_ONE);
}

/* The eight distances about the cube whose lowest voxel is i: x fastest. False if one was never seen. Doesn't look at
 * min_weight: for ray-casts. */
inline bool cube_at(global const short *voxels, global const int4 *table, surface f, int3 i, float8 *cube, int3 *last,
                    int *place) {
    int3 in = i & 7;
    if (all(in < 7)) { /* within one block */
        int3 b = i >> 3;
        if (any(b != *last)) {
            *last = b;
            *place = find_block(table, f.mask, b);
        }
        if (*place < 0) return false;
        global const short *d = voxels + (size_t)*place * 2 * BLOCK_VOXELS + (in.z * 8 + in.y) * 8 + in.x;
        short8 stored = (short8)(vload2(0, d), vload2(0, d + 8), vload2(0, d + 64), vload2(0, d + 72));
        if (any(stored == (short8)(NEVER_SEEN))) return false;
        *cube = convert_float8(stored) * (1.0f / TSDF_ONE);
        return true;
    }
    float c[8];
    bool seen = true;
    for (int k = 0; k < 8; k++) {
        c[k] = voxel_at(voxels, table, f, i + (int3)(k & 1, (k >> 1) & 1, k >> 2), last, place);
        seen = seen && !isnan(c[k]);
    }
    *cube = vload8(0, c);
    return seen;
}

/* Trilinear interpolation at p, in voxels; NAN if one of the eight was never seen. */
inline float distance_at(global const short *voxels, global const int4 *table, surface f, float3 p, int3 *last,
                         int *place) {
    float8 c;
    int3 i = convert_int3_rtn(p);
    float3 t = p - convert_float3(i);
    if (!cube_at(voxels, table, f, i, &c, last, place)) return NAN;
    float4 x = mix(c.even, c.odd, t.x);
    float2 y = mix(x.even, x.odd, t.y);
    return mix(y.x, y.y, t.z);
}

/* The gradient of the trilinear interpolation at p. NAN where it can't be had. */
inline float3 gradient_at(global const short *voxels, global const int4 *table, surface f, float3 p, int3 *last,
                          int *place) {
    float8 c;
    int3 i = convert_int3_rtn(p);
    float3 t = p - convert_float3(i);
    if (!cube_at(voxels, table, f, i, &c, last, place)) return (float3)(NAN);
    float4 x = mix(c.even, c.odd, t.x), dx = c.odd - c.even;
    float2 y = mix(x.even, x.odd, t.y), dy = x.odd - x.even;
    float2 dxy = mix(dx.even, dx.odd, t.y);
    return (float3)(mix(dxy.x, dxy.y, t.z), mix(dy.x, dy.y, t.z), y.y - y.x);
}

/* Nearest and farthest depth of any block for each tile of TILE x TILE pixels, so that rays start close to the surface.
 * ranges: two ints a tile, the bits of positive floats, which sort as integers do. First clear_ranges (global size:
 * tiles), then range_blocks (global size: blocks in use). Minimum and maximum don't depend on the order of threads. */
kernel void clear_ranges(global int *ranges) {
    int i = get_global_id(0);
    ranges[2 * i] = as_int(INFINITY);
    ranges[2 * i + 1] = 0;
}

kernel void range_blocks(global const int4 *blocks, camera c, rigid world_to_camera, float voxel, float near_m,
                         float far_m, global int *ranges) {
    int4 b = blocks[get_global_id(0)];
    float edge = voxel * BLOCK_EDGE;
    float3 o = transform(world_to_camera, convert_float3(b.xyz) * edge);
    /* samples lie at 0..7 voxels, but the surface between the blocks belongs to both: half a voxel more on each side */
    float3 ex = edge * (float3)(world_to_camera.x.x, world_to_camera.y.x, world_to_camera.z.x);
    float3 ey = edge * (float3)(world_to_camera.x.y, world_to_camera.y.y, world_to_camera.z.y);
    float3 ez = edge * (float3)(world_to_camera.x.z, world_to_camera.y.z, world_to_camera.z.z);
    float nearest = INFINITY, farthest = 0.0f;
    float2 low = INFINITY, high = -INFINITY;
    for (int k = 0; k < 8; k++) {
        float3 p = o + ex * (float)(k & 1) + ey * (float)((k >> 1) & 1) + ez * (float)(k >> 2);
        nearest = fmin(nearest, p.z);
        farthest = fmax(farthest, p.z);
        float z = fmax(p.z, 0.05f);
        float2 pixel = (float2)(p.x / z * c.fx + c.cx, p.y / z * c.fy + c.cy);
        low = fmin(low, pixel);
        high = fmax(high, pixel);
    }
    if (farthest < near_m || nearest > far_m) return;
    if (!(high.x > -1.0f && high.y > -1.0f && low.x < (float)c.width && low.y < (float)c.height)) return;
    int tiles_x = (c.width + TILE - 1) / TILE;
    int x0 = convert_int_rtn(fmax(low.x - 1.0f, 0.0f)) / TILE, y0 = convert_int_rtn(fmax(low.y - 1.0f, 0.0f)) / TILE;
    int x1 = convert_int_rtn(fmin(high.x + 1.0f, (float)(c.width - 1))) / TILE;
    int y1 = convert_int_rtn(fmin(high.y + 1.0f, (float)(c.height - 1))) / TILE;
    int near_bits = as_int(fmax(nearest - 2.0f * voxel, near_m)), far_bits = as_int(fmin(farthest + 2.0f * voxel, far_m));
    for (int y = y0; y <= y1; y++)
        for (int x = x0; x <= x1; x++) {
            volatile global int *range = ranges + 2 * (y * tiles_x + x);
            if (near_bits < range[0]) atomic_min(range, near_bits);
            if (far_bits > range[1]) atomic_max(range + 1, far_bits);
        }
}

/* For alignment only what lies near the scan matters: narrows each tile's range to `reach` about the depths that the scan
 * has in it or in a tile beside it; empty where it has none. scan_ranges (global size: tiles) finds the nearest and
 * farthest depth of each tile, limit_ranges (the same) applies them. */
kernel void scan_ranges(global const float *depth, camera c, global float2 *scan) {
    int tile = get_global_id(0), tiles_x = (c.width + TILE - 1) / TILE;
    int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
    float2 range = (float2)(INFINITY, 0.0f);
    for (int y = y0; y < min(y0 + TILE, c.height); y++)
        for (int x = x0; x < min(x0 + TILE, c.width); x++) {
            float z = depth[AT(c, x, y)];
            range.x = z > 0.0f ? fmin(range.x, z) : range.x;
            range.y = fmax(range.y, z);
        }
    scan[tile] = range;
}

kernel void limit_ranges(global const float2 *scan, camera c, float reach, global int *ranges) {
    int tile = get_global_id(0), tiles_x = (c.width + TILE - 1) / TILE, tiles_y = (c.height + TILE - 1) / TILE;
    int tx = tile % tiles_x, ty = tile / tiles_x;
    float2 range = (float2)(INFINITY, 0.0f);
    for (int y = max(ty - 1, 0); y <= min(ty + 1, tiles_y - 1); y++)
        for (int x = max(tx - 1, 0); x <= min(tx + 1, tiles_x - 1); x++) {
            float2 s = scan[y * tiles_x + x];
            range = (float2)(fmin(range.x, s.x), fmax(range.y, s.y));
        }
    ranges[2 * tile] = as_int(fmax(as_float(ranges[2 * tile]), range.x - reach));
    ranges[2 * tile + 1] = as_int(fmin(as_float(ranges[2 * tile + 1]), range.y + reach));
}

/* One ray a pixel: from block to block where there are none, by the stored distance where there are, to the first change
 * from outside to inside; there the distance is interpolated between voxels and the crossing found by regula falsi.
 * model: normal in camera axes, towards the camera, and depth; zero where nothing was met. Global size: width or more,
 * height. */
kernel void raycast(global const short *voxels, global const int4 *table, surface f, camera c, rigid pose,
                    global const int *ranges, global float4 *model) {
    int x = get_global_id(0), y = get_global_id(1);
    if (x >= c.width) return;
    int tile = y / TILE * ((c.width + TILE - 1) / TILE) + x / TILE;
    float t = as_float(ranges[2 * tile]), end = as_float(ranges[2 * tile + 1]);
    float3 ray = rotate_vector(pose, (float3)(((float)x - c.cx) / c.fx, ((float)y - c.cy) / c.fy, 1.0f));
    float3 origin = (float3)(pose.x.w, pose.y.w, pose.z.w) / f.voxel;
    float3 step = ray / f.voxel; /* voxels a metre of depth */
    float speed = length(step);
    float3 inverse = 1.0f / step;
    float one_voxel = 1.0f / speed;
    int3 last = (int3)(INT_MAX);
    int place = -1;
    float previous = -1.0f, previous_t = t; /* a ray starts "inside": a back side is passed through */
    float4 result = 0.0f;
    while (t < end) {
        float3 p = origin + step * t;
        int3 i = convert_int3_rtn(p + 0.5f);
        float d = voxel_at(voxels, table, f, i, &last, &place);
        if (place < 0) { /* to the block's far side */
            float3 low = convert_float3(last << 3) - 0.5f;
            float3 out = select(low, low + 8.0f, step > 0.0f);
            float3 ways = (out - p) * inverse;
            ways = select((float3)(INFINITY), ways, fabs(step) > 1e-6f);
            t += fmax(fmin(fmin(ways.x, ways.y), ways.z), 0.0f) + 0.05f * one_voxel;
            previous = -1.0f;
            continue;
        }
        if (isnan(d)) {
            previous = -1.0f;
            t += one_voxel;
            continue;
        }
        if (d < 0.3f) { /* near the surface: between the voxels */
            float fine = distance_at(voxels, table, f, p, &last, &place);
            if (!isnan(fine)) d = fine;
        }
        if (d <= 0.0f && previous > 0.0f) {
            float a = previous_t, b = t, fa = previous, fb = d;
            float hit = a + (b - a) * fa / (fa - fb);
            for (int k = 0; k < 2; k++) {
                float fm = distance_at(voxels, table, f, origin + step * hit, &last, &place);
                if (isnan(fm)) break;
                if (fm > 0.0f) {
                    a = hit;
                    fa = fm;
                } else {
                    b = hit;
                    fb = fm;
                }
                hit = a + (b - a) * fa / (fa - fb);
            }
            float3 n = gradient_at(voxels, table, f, origin + step * hit, &last, &place);
            float length2 = dot(n, n);
            if (length2 > 1e-8f) { /* false for NAN */
                n = rotate_back(pose, n * rsqrt(length2));
                if (n.x * ((float)x - c.cx) / c.fx + n.y * ((float)y - c.cy) / c.fy + n.z < 0.0f)
                    result = (float4)(n, hit);
            }
            break;
        }
        previous = d;
        previous_t = t;
        /* the stored distance is to the surface's plane as some camera saw it: nearly, but not always, the least */
        t += fmax(0.8f * fabs(d) * f.truncation / f.voxel, 0.7f) * one_voxel;
    }
    model[y * c.width + x] = result;
}
