/* Ray-cast of the surface to model maps (Newcombe et al. 2011, "KinectFusion", Section 3.3), over the hashed blocks. */

/* The eight stored distances about the cube whose lowest voxel is i: x fastest. False if one was never seen. Ignores
 * min_weight, as ray-casts do. */
inline bool stored_cube(global const short *voxels, global const int4 *table, kernel_surface f, int3 i,
                        short8 *cube, int3 *last, int *place) {
    int3 in = i & 7, b = i >> 3;
    if (any(b != *last)) {
        *last = b;
        *place = find_block(table, f.mask, f.submap, b);
    }
    if (*place < 0) return false;
    global const short *d = voxels + DISTANCES_OF(*place) + (in.z * 8 + in.y) * 8 + in.x;
    short8 stored;
    if (all(in < 7)) { /* within one block */
        stored = (short8)(vload2(0, d), vload2(0, d + 8), vload2(0, d + 64), vload2(0, d + 72));
    } else { /* some axes reach into the next block: bit 0 for x, 1 for y, 2 for z, as in a corner's number */
        int over = (in.x == 7) | (in.y == 7) << 1 | (in.z == 7) << 2;
        global const short *from[8]; /* index of the cube's lowest voxel in a corner's block */
        short c[8];
        from[0] = d;
        for (int k = 1; k < 8; k++) {
            if (k & ~over) {
                from[k] = from[k & over];
                continue;
            }
            int3 next = (int3)(k & 1, (k >> 1) & 1, k >> 2);
            int there = find_block(table, f.mask, f.submap, b + next);
            if (there < 0) return false;
            int3 at = in - 8 * next;
            from[k] = voxels + DISTANCES_OF(there) + (at.z * 8 + at.y) * 8 + at.x;
        }
        for (int k = 0; k < 8; k++) c[k] = from[k][(k & 1) + (k >> 1 & 1) * 8 + (k >> 2) * 64];
        stored = vload8(0, c);
    }
    *cube = stored;
    return !any(stored == (short8)(NEVER_SEEN));
}

/* The same in truncations. */
inline bool cube_at(global const short *voxels, global const int4 *table, kernel_surface f, int3 i,
                    float8 *cube, int3 *last, int *place) {
    short8 stored;
    bool seen = stored_cube(voxels, table, f, i, &stored, last, place);
    if (seen) *cube = convert_float8(stored) * (1.0f / TSDF_ONE);
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
inline float distance_at(global const short *voxels, global const int4 *table, kernel_surface f, float3 p,
                         int3 *last, int *place) {
    float8 c;
    int3 i = convert_int3_rtn(p);
    return cube_at(voxels, table, f, i, &c, last, place) ? interpolate(c, p - convert_float3(i)) : NAN;
}

/* Nearest and farthest depth of any block for each tile of TILE x TILE pixels, so that rays start close to the surface.
 * ranges: two ints per tile, the bits of positive floats, which sort as integers do. First clear_ranges (global size:
 * tiles), then range_blocks (global size: blocks in use). Minimum and maximum don't depend on the order of threads. */
kernel void clear_ranges(global int *ranges) {
    int i = get_global_id(0);
    ranges[2 * i] = as_int(INFINITY);
    ranges[2 * i + 1] = 0;
}

kernel void range_blocks(global const int4 *blocks, kernel_surface f, kernel_camera c,
                         kernel_rigid world_to_camera, float near_m, float far_m, global int *ranges) {
    int4 b = blocks[get_global_id(0)];
    if (b.w != f.submap) return;
    float voxel = f.voxel, edge = voxel * BLOCK_EDGE;
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
    int x0 = convert_int_rtn(fmax(low.x - 1.0f, 0.0f)) / TILE,
        y0 = convert_int_rtn(fmax(low.y - 1.0f, 0.0f)) / TILE;
    int x1 = convert_int_rtn(fmin(high.x + 1.0f, (float)(c.width - 1))) / TILE;
    int y1 = convert_int_rtn(fmin(high.y + 1.0f, (float)(c.height - 1))) / TILE;
    int near_bits = as_int(fmax(nearest - 2.0f * voxel, near_m)),
        far_bits = as_int(fmin(farthest + 2.0f * voxel, far_m));
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

/* Returned through a pointer: by value, Clang emits noalias scopes, which Oclgrind 21.10 doesn't know. */
inline void pixel_ray(kernel_surface f, kernel_camera c, kernel_rigid pose, int x, int y, voxel_ray *r) {
    r->ray = (float3)(((float)x - c.cx) / c.fx, ((float)y - c.cy) / c.fy, 1.0f);
    r->step = rotate_vector(pose, r->ray) / f.voxel;
    r->origin = (float3)(pose.x.w, pose.y.w, pose.z.w) / f.voxel;
}

/* A hit: normal in camera axes and depth; zero when the surface is seen from behind. */
inline float4 model_point(kernel_rigid pose, voxel_ray r, float3 gradient, float depth) {
    float length2 = dot(gradient, gradient);
    if (!(length2 > 1e-8f)) return (float4)(0.0f);
    float3 n = rotate_back(pose, gradient * rsqrt(length2));
    return dot(n, r.ray) < 0.0f ? (float4)(n, depth) : (float4)(0.0f);
}

/* Steps from block to block in empty space, by the stored distance within blocks, to the first change from outside to
 * inside; there interpolates between voxels and finds the crossing by regula falsi. */
inline float4 march(global const short *voxels, global const int4 *table, kernel_surface f, kernel_rigid pose,
                    voxel_ray r, float t, float end) {
    float speed = length(r.step); /* voxels a metre of depth */
    float3 inverse = 1.0f / r.step;
    float one_voxel = 1.0f / speed;
    int3 last = (int3)(INT_MAX);
    int place = -1;
    float previous = -1.0f, previous_t = t; /* a ray that starts "inside" passes through the back of a surface */
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
        if (d < 0.3f) { /* near the surface: interpolate between voxels */
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
        /* the stored distance is to the plane that a camera saw: nearly, but not always, the distance to the surface */
        t += fmax(0.8f * fabs(d) * f.truncation / f.voxel, 0.7f) * one_voxel;
    }
    return (float4)(0.0f);
}

/* The surface as the camera sees it: normal in camera axes, towards the camera, and depth; zero without a hit. Global
 * size: width, height. */
kernel void raycast(global const short *voxels, global const int4 *table, kernel_surface f, kernel_camera c,
                    kernel_rigid pose, global const int *ranges, global uint2 *model) {
    int x = get_global_id(0), y = get_global_id(1);
    int tile = y / TILE * ((c.width + TILE - 1) / TILE) + x / TILE;
    voxel_ray ray;
    pixel_ray(f, c, pose, x, y, &ray);
    float4 point = march(voxels, table, f, pose, ray, as_float(ranges[2 * tile]),
                         as_float(ranges[2 * tile + 1]));
    model[y * c.width + x] = pack_point(point.xyz, point.w);
}

#define NEWTON_STEPS 4
#define NEWTON_STEEP 0.2f /* minimum cosine between ray and normal; surfaces seen at a flatter angle may be missed */
#define NEWTON_CLOSE 0.05f /* voxels: a step below this ends it */
#define NEWTON_WITHIN 0.3f /* the same within one cube, where the distance is trilinear */

/* The distances at a corner, for all lanes. */
#if LANES == 8
#define CORNER(q, k)                                                                                         \
    convert_float8(                                                                                          \
        (short8)(q[0].s##k, q[1].s##k, q[2].s##k, q[3].s##k, q[4].s##k, q[5].s##k, q[6].s##k, q[7].s##k))
#else
#define CORNER(q, k) convert_float(q[0].s##k)
#endif

/* The same for alignment, which needs the surface only where the scan has one, and near it. Where the camera's pose is
 * nearly right, the scan's own depth is the best start: Newton's method along the ray from there, one or two cubes of
 * voxels instead of a march. Where that fails, and `marched` isn't 0, the ray is marched from `reach` before the scan's
 * depth to as far behind. Global size: strips of LANES pixels per row, height. */
kernel void raycast_near(global const short *voxels, global const int4 *table, kernel_surface f,
                         kernel_camera c, kernel_rigid pose, global const float *scan, float reach,
                         int marched, global uint2 *model) {
    int x0 = get_global_id(0) * LANES, y = get_global_id(1);
    vfloat z = VLOAD(scan + AT(c, x0, y)), t = z;
    vfloat u = ((float)x0 + IOTA - c.cx) / c.fx; /* of the rays, in camera axes, with z = 1 */
    float v = ((float)y - c.cy) / c.fy, inverse = 1.0f / f.voxel;
    vfloat sx = (pose.x.x * u + (pose.x.y * v + pose.x.z)) * inverse; /* in the world, voxels per metre of depth */
    vfloat sy = (pose.y.x * u + (pose.y.y * v + pose.y.z)) * inverse;
    vfloat sz = (pose.z.x * u + (pose.z.y * v + pose.z.z)) * inverse;
    vfloat speed = sqrt(sx * sx + sy * sy + sz * sz);
    float ox = pose.x.w * inverse, oy = pose.y.w * inverse, oz = pose.z.w * inverse;
    vfloat nx = 0.0f, ny = 0.0f, nz = 0.0f; /* the gradient at the hit, in the world */
    vint open = z > 0.0f, met = 0;
    int3 last = (int3)(INT_MAX);
    int place = -1;
    for (int k = 0; k < NEWTON_STEPS && ANY(open); k++) {
        vfloat px = ox + sx * t, py = oy + sy * t, pz = oz + sz * t;
        vfloat lx = VFLOAT(vfloor(px)), ly = VFLOAT(vfloor(py)), lz = VFLOAT(vfloor(pz));
        int go[LANES], ix[LANES], iy[LANES], iz[LANES];
        short8 cube[LANES];
        VSTORE(open, go);
        VSTORE(VINT(lx), ix);
        VSTORE(VINT(ly), iy);
        VSTORE(VINT(lz), iz);
        for (int l = 0; l < LANES; l++) {
            cube[l] = 0;
            if (go[l] && !stored_cube(voxels, table, f, (int3)(ix[l], iy[l], iz[l]), &cube[l], &last, &place))
                go[l] = 0;
        }
        open = VLOAD(go);
        /* trilinear, x first, with the derivatives along */
        vfloat fx = px - lx, fy = py - ly, fz = pz - lz;
        vfloat c0 = CORNER(cube, 0), c2 = CORNER(cube, 2), c4 = CORNER(cube, 4), c6 = CORNER(cube, 6);
        vfloat dx0 = CORNER(cube, 1) - c0, dx1 = CORNER(cube, 3) - c2, dx2 = CORNER(cube, 5) - c4,
               dx3 = CORNER(cube, 7) - c6;
        vfloat x00 = c0 + dx0 * fx, x10 = c2 + dx1 * fx, x01 = c4 + dx2 * fx, x11 = c6 + dx3 * fx;
        vfloat dy0 = x10 - x00, dy1 = x11 - x01, xy0 = x00 + dy0 * fy, xy1 = x01 + dy1 * fy;
        vfloat dxy0 = dx0 + (dx1 - dx0) * fy, dxy1 = dx2 + (dx3 - dx2) * fy;
        vfloat gx = dxy0 + (dxy1 - dxy0) * fz, gy = dy0 + (dy1 - dy0) * fz, gz = xy1 - xy0;
        vfloat value = xy0 + gz * fz, slope = gx * sx + gy * sy + gz * sz;
        /* neither degenerate, nor a back side, nor seen at a flat angle */
        open = open & (slope < 0.0f) & (fabs(value) <= 0.99f * TSDF_ONE) &
               (slope * slope > NEWTON_STEEP * NEWTON_STEEP * (gx * gx + gy * gy + gz * gz) * speed * speed);
        vfloat change = value / SELECT((vfloat)(1.0f), -slope, open);
        t = SELECT(t, t + change, open);
        open = open & (fabs(t - z) <= reach);
        /* the same cube */
        vint same = (VFLOAT(vfloor(ox + sx * t)) == lx) & (VFLOAT(vfloor(oy + sy * t)) == ly) &
                    (VFLOAT(vfloor(oz + sz * t)) == lz);
        vint close =
            open & (fabs(change) * speed < SELECT((vfloat)(NEWTON_CLOSE), (vfloat)(NEWTON_WITHIN), same));
        nx = SELECT(nx, gx, close);
        ny = SELECT(ny, gy, close);
        nz = SELECT(nz, gz, close);
        met = met | close;
        open = open & !close;
    }
    vfloat inverse_length = 1.0f / sqrt(fmax(nx * nx + ny * ny + nz * nz, 1.0f));
    vfloat mx = (pose.x.x * nx + pose.y.x * ny + pose.z.x * nz) * inverse_length; /* turned back into camera axes */
    vfloat my = (pose.x.y * nx + pose.y.y * ny + pose.z.y * nz) * inverse_length;
    vfloat mz = (pose.x.z * nx + pose.y.z * ny + pose.z.z * nz) * inverse_length;
    vfloat zero = 0.0f;
    vint front = met & (mx * u + my * v + mz < 0.0f), ends = met | (z == 0.0f) | (marched == 0 ? -1 : 0);
    vint nothing = 0, normal = pack_normals(mx, my, mz);
    global uint2 *points = model + y * c.width + x0;
    int count = min(c.width - x0, LANES);
    store_points(SELECT(nothing, normal, front), SELECT(nothing, AS_VINT(t), front), count, points);
    if (!ANY(!ends)) return;
    float start[LANES];
    int done[LANES];
    VSTORE(z, start);
    VSTORE(ends, done);
    for (int l = 0; l < count; l++) {
        if (done[l]) continue;
        voxel_ray ray;
        pixel_ray(f, c, pose, x0 + l, y, &ray);
        float4 point = march(voxels, table, f, pose, ray, fmax(start[l] - reach, 0.05f),
                             start[l] + reach);
        points[l] = pack_point(point.xyz, point.w);
    }
}
