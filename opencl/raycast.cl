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

/* Trilinear interpolation between a cube's corners at t within it. */
inline float interpolate(float8 c, float3 t) {
    float4 x = mix(c.even, c.odd, t.x);
    float2 y = mix(x.even, x.odd, t.y);
    return mix(y.x, y.y, t.z);
}

/* Its gradient, a voxel. */
inline float3 interpolate_gradient(float8 c, float3 t) {
    float4 x = mix(c.even, c.odd, t.x), dx = c.odd - c.even;
    float2 y = mix(x.even, x.odd, t.y), dy = x.odd - x.even;
    float2 dxy = mix(dx.even, dx.odd, t.y);
    return (float3)(mix(dxy.x, dxy.y, t.z), mix(dy.x, dy.y, t.z), y.y - y.x);
}

/* Distance at p, in voxels; NAN if one of the eight voxels about it was never seen. */
inline float distance_at(global const short *voxels, global const int4 *table, surface f, float3 p, int3 *last,
                         int *place) {
    float8 c;
    int3 i = convert_int3_rtn(p);
    return cube_at(voxels, table, f, i, &c, last, place) ? interpolate(c, p - convert_float3(i)) : NAN;
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

/* A ray in voxels: origin + step * depth. */
typedef struct {
    float3 origin, step;
    float3 ray; /* of the pixel, in camera axes, with z = 1 */
} voxel_ray;

inline voxel_ray pixel_ray(surface f, camera c, rigid pose, int x, int y) {
    voxel_ray r;
    r.ray = (float3)(((float)x - c.cx) / c.fx, ((float)y - c.cy) / c.fy, 1.0f);
    r.step = rotate_vector(pose, r.ray) / f.voxel;
    r.origin = (float3)(pose.x.w, pose.y.w, pose.z.w) / f.voxel;
    return r;
}

/* A hit as the model map has it: normal in camera axes and depth; zero when the surface is seen from behind. */
inline float4 model_point(rigid pose, voxel_ray r, float3 gradient, float depth) {
    float length2 = dot(gradient, gradient);
    if (!(length2 > 1e-8f)) return (float4)(0.0f);
    float3 n = rotate_back(pose, gradient * rsqrt(length2));
    return dot(n, r.ray) < 0.0f ? (float4)(n, depth) : (float4)(0.0f);
}

/* From block to block where there are none, by the stored distance where there are, to the first change from outside to
 * inside; there the distance is interpolated between voxels and the crossing found by regula falsi. */
inline float4 march(global const short *voxels, global const int4 *table, surface f, rigid pose, voxel_ray r, float t,
                    float end) {
    float speed = length(r.step); /* voxels a metre of depth */
    float3 inverse = 1.0f / r.step;
    float one_voxel = 1.0f / speed;
    int3 last = (int3)(INT_MAX);
    int place = -1;
    float previous = -1.0f, previous_t = t; /* a ray starts "inside": a back side is passed through */
    while (t < end) {
        float3 p = r.origin + r.step * t;
        float d = voxel_at(voxels, table, f, convert_int3_rtn(p + 0.5f), &last, &place);
        if (place < 0) { /* to the block's far side */
            float3 low = convert_float3(last << 3) - 0.5f;
            float3 ways = (select(low, low + 8.0f, r.step > 0.0f) - p) * inverse;
            ways = select((float3)(INFINITY), ways, fabs(r.step) > 1e-6f);
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
                float fm = distance_at(voxels, table, f, r.origin + r.step * hit, &last, &place);
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
            float8 cube;
            p = r.origin + r.step * hit;
            int3 i = convert_int3_rtn(p);
            if (!cube_at(voxels, table, f, i, &cube, &last, &place)) return (float4)(0.0f);
            return model_point(pose, r, interpolate_gradient(cube, p - convert_float3(i)), hit);
        }
        previous = d;
        previous_t = t;
        /* the stored distance is to the surface's plane as some camera saw it: nearly, but not always, the least */
        t += fmax(0.8f * fabs(d) * f.truncation / f.voxel, 0.7f) * one_voxel;
    }
    return (float4)(0.0f);
}

/* The surface as the camera sees it: normal in camera axes, towards the camera, and depth; zero where nothing was met.
 * Global size: width, height. */
kernel void raycast(global const short *voxels, global const int4 *table, surface f, camera c, rigid pose,
                    global const int *ranges, global float4 *model) {
    int x = get_global_id(0), y = get_global_id(1);
    int tile = y / TILE * ((c.width + TILE - 1) / TILE) + x / TILE;
    model[y * c.width + x] = march(voxels, table, f, pose, pixel_ray(f, c, pose, x, y), as_float(ranges[2 * tile]),
                                   as_float(ranges[2 * tile + 1]));
}

#define NEWTON_STEPS 4
#define NEWTON_CLOSE 0.05f /* voxels */

/* The same for alignment, which needs the surface only where the scan has one, and near it. Where the camera's pose is
 * nearly right, the scan's own depth is the best start: Newton's method along the ray from there, two or three cubes of
 * voxels instead of a march. Where that fails, the ray is marched from `reach` before the scan's depth to as far behind.
 * Global size: width, height. */
kernel void raycast_near(global const short *voxels, global const int4 *table, surface f, camera c, rigid pose,
                         global const float *scan, float reach, global float4 *model) {
    int x = get_global_id(0), y = get_global_id(1);
    float z = scan[AT(c, x, y)];
    float4 result = 0.0f;
    if (z > 0.0f) {
        voxel_ray r = pixel_ray(f, c, pose, x, y);
        int3 last = (int3)(INT_MAX);
        int place = -1;
        float t = z;
        bool met = false;
        for (int k = 0; k < NEWTON_STEPS; k++) {
            float8 cube;
            float3 p = r.origin + r.step * t;
            int3 i = convert_int3_rtn(p);
            if (!cube_at(voxels, table, f, i, &cube, &last, &place)) break;
            float d = interpolate(cube, p - convert_float3(i));
            float3 gradient = interpolate_gradient(cube, p - convert_float3(i));
            float slope = dot(gradient, r.step);
            if (!(slope < 0.0f) || fabs(d) > 0.99f) break; /* flat, or the back of something */
            float change = -d / slope;
            t += change;
            if (fabs(t - z) > reach) break;
            if (fabs(change) * length(r.step) < NEWTON_CLOSE) {
                result = model_point(pose, r, gradient, t);
                met = true;
                break;
            }
        }
        if (!met) result = march(voxels, table, f, pose, r, fmax(z - reach, 0.05f), z + reach);
    }
    model[y * c.width + x] = result;
}
