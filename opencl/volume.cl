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
 * for the rest in the next frame. Global size: tiles. requests: TILE_SLOTS int4 a tile; counts: one int a tile. */
kernel void request_blocks(global const float *depth, camera c, rigid pose, float block_m, float truncation,
                           global const int4 *table, uint mask, global int4 *requests, global int *counts) {
    int tile = get_global_id(0), tiles_x = (c.width + TILE - 1) / TILE;
    int x0 = tile % tiles_x * TILE, y0 = tile / tiles_x * TILE;
    global int4 *slots = requests + tile * TILE_SLOTS;
    int count = 0;
    int3 last = (int3)(INT_MAX);
    float3 origin = (float3)(pose.x.w, pose.y.w, pose.z.w);
    float inverse = 1.0f / block_m;
    for (int y = y0; y < min(y0 + TILE, c.height); y++)
        for (int x = x0; x < min(x0 + TILE, c.width); x++) {
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

/* Fuses a frame into the blocks in view (Curless and Levoy 1996, eq. 1 and 2): a running average of the distance to the
 * plane through the pixel's surface point, weighted by the depth's inverse variance and by how squarely it was seen. The
 * plane (not the depth along the ray) keeps slanted surfaces true and makes up for the pixels' coarseness. Pixels without
 * a normal count a quarter, by the distance along the ray. Rows of eight voxels at once.
 * scan: normal and depth of each pixel (pack_map). Global size: blocks in use. */
kernel void fuse_blocks(global const float4 *scan, camera c, float2 noise, rigid world_to_camera, float voxel,
                        float truncation, float max_weight, global const int4 *blocks, global short *voxels) {
    int index = get_global_id(0);
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

    global short *distances = voxels + (size_t)index * 2 * BLOCK_VOXELS;
    global ushort *weights = (global ushort *)(distances + BLOCK_VOXELS);
    float8 lane = (float8)(0, 1, 2, 3, 4, 5, 6, 7);
    float sigma_1m = depth_sigma(noise, 1.0f);
    for (int k = 0; k < BLOCK_EDGE * BLOCK_EDGE; k++) {
        float3 p0 = o + ey * (float)(k & 7) + ez * (float)(k >> 3);
        float8 pz = p0.z + ex.z * lane;
        int8 valid = pz > 0.1f;
        if (!any(valid)) continue;
        float8 iz = 1.0f / select((float8)(1.0f), pz, valid);
        float8 px = p0.x + ex.x * lane, py = p0.y + ex.y * lane;
        float8 rx = px * iz, ry = py * iz;
        float8 u = rx * c.fx + c.cx + 0.5f, v = ry * c.fy + c.cy + 0.5f;
        valid = valid && u >= 0.0f && v >= 0.0f && u < (float)c.width && v < (float)c.height;
        if (!any(valid)) continue;
        int8 ui = convert_int8_rtn(select((float8)(0.0f), u, valid));
        int8 vi = convert_int8_rtn(select((float8)(0.0f), v, valid));
        int8 at = vi * c.width + ui;
        float4 m0 = scan[at.s0], m1 = scan[at.s1], m2 = scan[at.s2], m3 = scan[at.s3];
        float4 m4 = scan[at.s4], m5 = scan[at.s5], m6 = scan[at.s6], m7 = scan[at.s7];
        float8 d = (float8)(m0.w, m1.w, m2.w, m3.w, m4.w, m5.w, m6.w, m7.w);
        float8 ray = sqrt(1.0f + rx * rx + ry * ry);
        float8 along = (d - pz) * ray;
        valid = valid && d > 0.0f && along > -BEHIND * truncation;
        if (!any(valid)) continue;
        float8 nx = (float8)(m0.x, m1.x, m2.x, m3.x, m4.x, m5.x, m6.x, m7.x);
        float8 ny = (float8)(m0.y, m1.y, m2.y, m3.y, m4.y, m5.y, m6.y, m7.y);
        float8 nz = (float8)(m0.z, m1.z, m2.z, m3.z, m4.z, m5.z, m6.z, m7.z);
        float8 gx = (convert_float8(ui) - c.cx) / c.fx * d - px, gy = (convert_float8(vi) - c.cy) / c.fy * d - py;
        float8 to_plane = -(nx * gx + ny * gy + nz * (d - pz));
        float8 cosine = -(nx * rx + ny * ry + nz) / ray;
        int8 flat = nz != 0.0f;
        float8 s = select(along, to_plane, flat);
        valid = valid && s > -truncation;
        float8 sigma = noise.x + noise.y * d * d;
        float8 w = WEIGHT_ONE * sigma_1m * sigma_1m / (sigma * sigma) * select((float8)(0.25f), cosine, flat);
        w = clamp(rint(w), 1.0f, 4.0f * WEIGHT_ONE);
        float8 old_d = convert_float8(vload8(k, distances)), old_w = convert_float8(vload8(k, weights));
        float8 sum = old_w + w;
        float8 mean = (old_d * old_w + fmin(s / truncation, 1.0f) * TSDF_ONE * w) / sum;
        float8 new_w = fmin(sum, max_weight * WEIGHT_ONE);
        vstore8(convert_short8_sat_rte(select(old_d, mean, valid)), k, distances);
        vstore8(convert_ushort8_sat_rte(select(old_w, new_w, valid)), k, weights);
    }
}

/* Makes blocks new: nothing seen. Global size: blocks, rows of eight numbers (128: distances, then weights). */
kernel void clear_blocks(int first, global short *voxels) {
    size_t block = (size_t)(first + get_global_id(0)), row = get_global_id(1);
    vstore8((short8)(row < BLOCK_VOXELS / 8 ? NEVER_SEEN : 0), block * 128 + row, voxels);
}
