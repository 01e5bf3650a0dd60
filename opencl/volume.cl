/* The surface as a truncated signed distance in hashed blocks of 8x8x8 voxels (Curless and Levoy 1996; Niessner et al.
 * 2013, "Real-time 3D reconstruction at scale using voxel hashing").
 *
 * A block is 512 distances (short, TSDF_ONE a truncation, positive in front of the surface, or NEVER_SEEN) and then 512 weights (ushort,
 * WEIGHT_ONE for one observation at 1 m), x fastest. Voxel i stands at i * voxel metres in the world. */

#define WEIGHT_ONE 64.0f
#define BEHIND 1.0f /* truncations behind the surface along the ray that a pixel still speaks for */

#define TILE_SLOTS 64 /* requests a tile may make */

/* Which blocks near the scan's surface are not there yet? Each tile of pixels walks its rays through the truncation band
 * and lists the missing blocks it meets, each once, in its own slots: no atomics, so nothing depends on the order of
 * threads. Tiles overlap in what they ask for; the host takes them in order and drops doubles. A tile with more than TILE_SLOTS asks
 * for the rest in the next frame. Of pixels closer together than a third of a block every second, third or fourth will do.
 * Global size: tiles. requests: TILE_SLOTS int4 a tile; counts: one int a tile; farthest: the tile's largest depth. */
kernel void request_blocks(global const float *depth, camera c, rigid pose, float block_m, float truncation,
                           global const int4 *table, uint mask, global int4 *requests, global int *counts,
                           global float *farthest) {
    int tile = get_global_id(0), tiles_x = (c.width + TILE - 1) / TILE;
    int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
    global int4 *slots = requests + tile * TILE_SLOTS;
    int count = 0;
    int3 last = (int3)(INT_MAX);
    float3 origin = (float3)(pose.x.w, pose.y.w, pose.z.w);
    float inverse = 1.0f / block_m;
    float8 most = 0.0f;
    for (int y = y0; y < min(y0 + TILE, c.height); y++) most = fmax(most, vload8(0, depth + AT(c, x0, y)));
    float4 half_most = fmax(most.lo, most.hi);
    float far = fmax(fmax(half_most.x, half_most.y), fmax(half_most.z, half_most.w));
    farthest[tile] = far;
    int apart = clamp(convert_int_rtz(c.fx * block_m / (3.0f * fmax(far, 0.01f))), 1, 4);
    for (int y = y0; y < min(y0 + TILE, c.height); y += apart)
        for (int x = x0; x < min(x0 + TILE, c.width); x += apart) {
            float z = depth[AT(c, x, y)];
            if (z == 0.0f) continue;
            float3 ray = rotate_vector(pose, (float3)(((float)x - c.cx) / c.fx, ((float)y - c.cy) / c.fy, 1.0f));
            float reach = truncation * rsqrt(dot(ray, ray));
            float3 from = (origin + ray * (z - reach)) * inverse, to = (origin + ray * (z + reach)) * inverse;
            float3 way = to - from;
            int steps = convert_int_rtp(fmax(fmax(fabs(way.x), fabs(way.y)), fabs(way.z)) * 2.0f);
            for (int k = 0; k <= steps; k++) {
                /* the voxels around a point reach half a voxel below it: a block owns [8i, 8i + 8) samples */
                int3 b = convert_int3_rtn(from + way * ((float)k / (float)max(steps, 1)));
                if (all(b == last)) continue;
                last = b;
                if (count == TILE_SLOTS) continue;
                bool known = false;
                for (int j = count - 1; j >= 0 && !known; j--)
                    known = slots[j].x == b.x && slots[j].y == b.y && slots[j].z == b.z;
                if (!known && find_block(table, mask, b) < 0) slots[count++] = (int4)(b, 0);
            }
        }
    counts[tile] = count;
}

/* The largest depth that any tile under the circle about a point in camera axes has. */
inline float farthest_about(global const float *farthest, camera c, float3 m, float radius) {
    float z = m.z - radius;
    if (z < 0.1f) return INFINITY;
    int tiles_x = (c.width + TILE - 1) / TILE, tiles_y = (c.height + TILE - 1) / TILE;
    float2 at = (float2)(m.x * c.fx, m.y * c.fy) / m.z + (float2)(c.cx, c.cy) + 0.5f;
    float2 reach = (float2)(c.fx, c.fy) * radius / z * sqrt(1.0f + dot(m.xy, m.xy) / (m.z * m.z));
    int2 low = convert_int2_rtn((at - reach) / (float)TILE), high = convert_int2_rtn((at + reach) / (float)TILE);
    float far = 0.0f;
    for (int y = max(low.y, 0); y <= min(high.y, tiles_y - 1); y++)
        for (int x = max(low.x, 0); x <= min(high.x, tiles_x - 1); x++) far = fmax(far, farthest[y * tiles_x + x]);
    return far;
}

/* Fuses a frame into the blocks in view (Curless and Levoy 1996, eq. 1 and 2): a running average of the distance to the
 * plane through the pixel's surface point, weighted by the depth's inverse variance and by how squarely it was seen. The
 * plane (not the depth along the ray) keeps slanted surfaces true and makes up for the pixels' coarseness. Pixels without
 * a normal count a quarter, by the distance along the ray. Two rows of eight voxels at once.
 * Of the first `settled` blocks only those with an odd or even place take their turn (turn 1, 0).
 * seen: gets the frame's number for each block in view.
 * scan: normal and depth of each pixel (pack_map). farthest: each tile's largest depth. Global size: blocks in use. */
kernel void fuse_blocks(global const float4 *scan, camera c, float2 noise, global const float *farthest,
                        rigid world_to_camera, float voxel, float truncation, float max_weight, global const int4 *blocks,
                        int settled, int turn, int frame, global int *seen, global short *voxels) {
    int index = get_global_id(0);
    if (index < settled && (index & 1) != turn) return;
    int4 b = blocks[index];
    float3 corner = convert_float3(b.xyz * BLOCK_EDGE) * voxel;
    float3 o = transform(world_to_camera, corner);
    float3 ex = voxel * (float3)(world_to_camera.x.x, world_to_camera.y.x, world_to_camera.z.x);
    float3 ey = voxel * (float3)(world_to_camera.x.y, world_to_camera.y.y, world_to_camera.z.y);
    float3 ez = voxel * (float3)(world_to_camera.x.z, world_to_camera.y.z, world_to_camera.z.z);
    /* out of view? a sphere about the block against the frustum */
    float radius = 3.5f * 1.7320508f * voxel;
    float3 m = o + 3.5f * (ex + ey + ez);
    if (m.z < -radius) return;
    float z = fmax(m.z, 0.0f); /* the frustum's sides: u = -1/2, u = width - 1/2 and so on, as planes through the camera */
    float left = c.cx + 0.5f, right = (float)c.width - 0.5f - c.cx, up = c.cy + 0.5f, down = (float)c.height - 0.5f - c.cy;
    if (m.x * c.fx + left * z < -radius * sqrt(c.fx * c.fx + left * left)) return;
    if (m.x * c.fx - right * z > radius * sqrt(c.fx * c.fx + right * right)) return;
    if (m.y * c.fy + up * z < -radius * sqrt(c.fy * c.fy + up * up)) return;
    if (m.y * c.fy - down * z > radius * sqrt(c.fy * c.fy + down * down)) return;
    /* behind everything the frame sees there? */
    if (m.z - radius > farthest_about(farthest, c, m, radius) + BEHIND * truncation) return;

    seen[index] = frame;
    global short *distances = voxels + (size_t)index * 2 * BLOCK_VOXELS;
    global ushort *weights = (global ushort *)(distances + BLOCK_VOXELS);
    float16 lx = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 0, 1, 2, 3, 4, 5, 6, 7), ly = (float16)(0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1);
    float16 rowx = ex.x * lx + ey.x * ly, rowy = ex.y * lx + ey.y * ly, rowz = ex.z * lx + ey.z * ly;
    float sigma_1m = depth_sigma(noise, 1.0f);
    float weight_1m = WEIGHT_ONE * sigma_1m * sigma_1m, ifx = 1.0f / c.fx, ify = 1.0f / c.fy;
    float units = TSDF_ONE / truncation;
    for (int k = 0; k < BLOCK_EDGE * BLOCK_EDGE / 2; k++) {
        float3 p0 = o + ey * (float)(2 * k & 7) + ez * (float)(k >> 2);
        float16 pz = p0.z + rowz;
        int16 valid = pz > 0.1f;
        float16 iz = 1.0f / fmax(pz, 0.1f);
        float16 px = p0.x + rowx, py = p0.y + rowy;
        float16 rx = px * iz, ry = py * iz;
        float16 u = rx * c.fx + (c.cx + 0.5f), v = ry * c.fy + (c.cy + 0.5f);
        valid &= (u >= 0.0f) & (v >= 0.0f) & (u < (float)c.width) & (v < (float)c.height);
        if (!any(valid)) continue;
        int16 ui = convert_int16_rtz(select((float16)(0.0f), u, valid));
        int16 vi = convert_int16_rtz(select((float16)(0.0f), v, valid));
        int16 at = vi * c.width + ui;
        float4 m0 = scan[at.s0], m1 = scan[at.s1], m2 = scan[at.s2], m3 = scan[at.s3];
        float4 m4 = scan[at.s4], m5 = scan[at.s5], m6 = scan[at.s6], m7 = scan[at.s7];
        float4 m8 = scan[at.s8], m9 = scan[at.s9], ma = scan[at.sa], mb = scan[at.sb];
        float4 mc = scan[at.sc], md = scan[at.sd], me = scan[at.se], mf = scan[at.sf];
        float16 d = (float16)(m0.w, m1.w, m2.w, m3.w, m4.w, m5.w, m6.w, m7.w, m8.w, m9.w, ma.w, mb.w, mc.w, md.w, me.w, mf.w);
        float16 ray = sqrt(1.0f + rx * rx + ry * ry);
        float16 along = (d - pz) * ray;
        valid &= (d > 0.0f) & (along > -BEHIND * truncation);
        if (!any(valid)) continue;
        float16 nx = (float16)(m0.x, m1.x, m2.x, m3.x, m4.x, m5.x, m6.x, m7.x, m8.x, m9.x, ma.x, mb.x, mc.x, md.x, me.x, mf.x);
        float16 ny = (float16)(m0.y, m1.y, m2.y, m3.y, m4.y, m5.y, m6.y, m7.y, m8.y, m9.y, ma.y, mb.y, mc.y, md.y, me.y, mf.y);
        float16 nz = (float16)(m0.z, m1.z, m2.z, m3.z, m4.z, m5.z, m6.z, m7.z, m8.z, m9.z, ma.z, mb.z, mc.z, md.z, me.z, mf.z);
        float16 gx = (convert_float16(ui) - c.cx) * ifx * d - px, gy = (convert_float16(vi) - c.cy) * ify * d - py;
        float16 to_plane = -(nx * gx + ny * gy + nz * (d - pz));
        int16 flat = nz != 0.0f;
        float16 s = select(along, to_plane, flat);
        valid &= s > -truncation;
        float16 sigma = noise.x + noise.y * d * d;
        float16 squarely = select(0.25f * ray, -(nx * rx + ny * ry + nz), flat); /* the cosine, times the ray's length */
        float16 w = weight_1m * squarely / (sigma * sigma * ray);
        w = clamp(rint(w), 1.0f, 4.0f * WEIGHT_ONE);
        float16 old_d = convert_float16(vload16(k, distances)), old_w = convert_float16(vload16(k, weights));
        float16 sum = old_w + w;
        float16 mean = (old_d * old_w + fmin(s * units, TSDF_ONE) * w) / sum;
        float16 new_w = fmin(sum, max_weight * WEIGHT_ONE);
        vstore16(convert_short16_sat_rte(select(old_d, mean, valid)), k, distances);
        vstore16(convert_ushort16_sat_rte(select(old_w, new_w, valid)), k, weights);
    }
}

/* Makes blocks new: nothing seen. Global size: blocks, rows of eight numbers (128: distances, then weights). */
kernel void clear_blocks(int first, global short *voxels) {
    size_t block = (size_t)(first + get_global_id(0)), row = get_global_id(1);
    vstore8((short8)(row < BLOCK_VOXELS / 8 ? NEVER_SEEN : 0), block * 128 + row, voxels);
}
