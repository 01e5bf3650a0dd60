/* The surface as a truncated signed distance in hashed blocks of 8x8x8 voxels (Curless and Levoy 1996; Niessner et al.
 * 2013, "Real-time 3D reconstruction at scale using voxel hashing").
 */

#define BEHIND 1.0f /* maximum depth behind the surface along the ray that a pixel is fused into, truncations */

/* Finds the missing blocks near the scan's surface. Each tile of pixels follows its rays through the truncation band
 * and lists the missing blocks on them, each once, in its own slots: no atomics, so that nothing depends on the order
 * of threads. Requests of tiles overlap; the host takes them in order and drops doubles. A tile with more than
 * TILE_SLOTS requests the rest in the next frame. Of rows closer together than a third of a block every second, third
 * or fourth is enough. turn: only rows of tiles with an odd or even number (1, 0) request; -1: all. requests:
 * TILE_SLOTS int4 per tile; counts: one int per tile; farthest: the tile's largest depth. Global size: work-items that
 * share a row of tiles, rows of tiles. */
kernel void request_blocks(global const float *depth, kernel_camera c, kernel_rigid pose, float block_m,
                           float truncation, global const int4 *table, uint mask, int submap,
                           global int4 *requests, global int *counts, global float *farthest, int turn) {
    int tiles_x = (c.width + TILE - 1) / TILE;
    int y0 = get_global_id(1) * TILE, y1 = min(y0 + TILE, c.height);
    /* recent blocks, by the parity of their coordinates, so that neighbours don't replace each other */
    int4 met[8];
    for (int i = 0; i < 8; i++) met[i] = INT_MAX;
    vint nowhere = INT_MAX;
    float inverse = 1.0f / block_m, ifx = 1.0f / c.fx;
    float3 origin = (float3)(pose.x.w, pose.y.w, pose.z.w) * inverse;
    /* maximum half a block, apart from rounding */
    int steps = max(convert_int_rtp(4.0f * truncation * inverse - 0.01f), 1);
    for (int tile_x = get_global_id(0); tile_x < tiles_x; tile_x += get_global_size(0)) {
        int tile = get_global_id(1) * tiles_x + tile_x, x0 = tile_x * TILE, count = 0;
        global int4 *slots = requests + tile * TILE_SLOTS;
        float8 most = 0.0f;
        for (int y = y0; y < y1; y++) most = fmax(most, vload8(0, depth + AT(c, x0, y)));
        float4 half_most = fmax(most.lo, most.hi);
        float far = fmax(fmax(half_most.x, half_most.y), fmax(half_most.z, half_most.w));
        farthest[tile] = far;
        counts[tile] = 0;
        if (turn >= 0 && (get_global_id(1) & 1) != turn) continue;
        int apart = clamp(convert_int_rtz(c.fx * block_m / (3.0f * fmax(far, 0.01f))), 1, 4);
        for (int y = y0; y < y1; y += apart)
            for (int x = x0; x < x0 + TILE; x += LANES) {
                vfloat z = VLOAD(depth + AT(c, x, y)), u = (IOTA + (float)x - c.cx) * ifx;
                float v = ((float)y - c.cy) / c.fy;
                vfloat rx = (pose.x.x * u + (pose.x.y * v + pose.x.z)) * inverse;
                vfloat ry = (pose.y.x * u + (pose.y.y * v + pose.y.z)) * inverse;
                vfloat rz = (pose.z.x * u + (pose.z.y * v + pose.z.z)) * inverse;
                vfloat reach = truncation / sqrt(u * u + v * v + 1.0f);
                for (int k = 0; k <= steps; k++) {
                    vfloat at = z + reach * (2.0f * (float)k / (float)steps - 1.0f);
                    /* the voxels around a point reach half a voxel below it: a block owns [8i, 8i + 8) samples */
                    vint i = SELECT(nowhere, vfloor(origin.x + rx * at), z > 0.0f);
                    vint j = vfloor(origin.y + ry * at), m = vfloor(origin.z + rz * at);
                    vint differs = (z > 0.0f) & ((i != vleft(i)) | (j != vleft(j)) | (m != vleft(m)));
                    if (!ANY(differs)) continue;
                    int bx[LANES], by[LANES], bz[LANES], look[LANES];
                    VSTORE(i, bx);
                    VSTORE(j, by);
                    VSTORE(m, bz);
                    VSTORE(differs, look);
                    for (int l = 0; l < LANES; l++) {
                        if (!look[l]) continue;
                        int place = (bx[l] & 1) | (by[l] & 1) << 1 | (bz[l] & 1) << 2;
                        int4 b = (int4)(bx[l], by[l], bz[l], submap);
                        if (all(met[place] == b)) continue;
                        met[place] = b;
                        bool known = count == TILE_SLOTS || find_block(table, mask, submap, b.xyz) >= 0;
                        for (int n = 0; n < count && !known; n++) known = all(slots[n] == b);
                        if (!known) slots[count++] = b;
                    }
                }
            }
        counts[tile] = count;
    }
}

/* The largest depth of all tiles under a circle about a point in camera axes. */
inline float farthest_about(global const float *farthest, kernel_camera c, float3 m, float radius) {
    float z = m.z - radius;
    if (z < 0.1f) return INFINITY;
    int tiles_x = (c.width + TILE - 1) / TILE, tiles_y = (c.height + TILE - 1) / TILE;
    float2 at = (float2)(m.x * c.fx, m.y * c.fy) / m.z + (float2)(c.cx, c.cy) + 0.5f;
    float2 reach = (float2)(c.fx, c.fy) * radius / z * sqrt(1.0f + dot(m.xy, m.xy) / (m.z * m.z));
    int2 low = convert_int2_rtn((at - reach) / (float)TILE),
         high = convert_int2_rtn((at + reach) / (float)TILE);
    float far = 0.0f;
    for (int y = max(low.y, 0); y <= min(high.y, tiles_y - 1); y++)
        for (int x = max(low.x, 0); x <= min(high.x, tiles_x - 1); x++)
            far = fmax(far, farthest[y * tiles_x + x]);
    return far;
}

/* Whether part of a block is in view: tests a sphere about its middle m, in camera axes, against the frustum and the
 * frame's depth. */
inline bool in_view(global const float *farthest, kernel_camera c, kernel_surface f, float3 m) {
    float radius = 3.5f * 1.7320508f * f.voxel;
    if (m.z < -radius) return false;
    /* the frustum's sides: u = -1/2, u = width - 1/2 and so on, as planes through the camera */
    float z = fmax(m.z, 0.0f), left = c.cx + 0.5f, right = (float)c.width - 0.5f - c.cx;
    float up = c.cy + 0.5f, down = (float)c.height - 0.5f - c.cy;
    if (m.x * c.fx + left * z < -radius * sqrt(c.fx * c.fx + left * left)) return false;
    if (m.x * c.fx - right * z > radius * sqrt(c.fx * c.fx + right * right)) return false;
    if (m.y * c.fy + up * z < -radius * sqrt(c.fy * c.fy + up * up)) return false;
    if (m.y * c.fy - down * z > radius * sqrt(c.fy * c.fy + down * down)) return false;
    /* behind all surface in the frame there */
    return m.z - radius <= farthest_about(farthest, c, m, radius) + BEHIND * f.truncation;
}

/* Stamps the blocks in view of a frame, before other blocks make room for it. seen: set to the frame's number. Global
 * size: blocks in use. */
kernel void mark_seen(kernel_camera c, global const float *farthest, kernel_rigid world_to_camera,
                      kernel_surface f, global const int4 *blocks, int frame, global int *seen) {
    int index = get_global_id(0);
    int4 b = blocks[index];
    float3 middle = (convert_float3(b.xyz * BLOCK_EDGE) + 3.5f) * f.voxel;
    if (b.w == f.submap && in_view(farthest, c, f, transform(world_to_camera, middle))) seen[index] = frame;
}

/* Packs a pixel for fusion into eight bytes: the plane by its depth and normal, in camera axes, and its weight. A point
 * p is n . p - w metres in front of the plane. The weight is the depth's inverse variance times the cosine of
 * incidence; pixels without a normal count a quarter, with a plane across the ray. First word: n, packed. Second word:
 * w, computed with the packed n so that the plane contains the pixel's point; its last bits are the weight. Pixels
 * without depth have an infinite w. Depth below from_m is taken raw, else smooth. Global size: work-items that share a
 * row, height. */
kernel void pack_planes(global const float *depth, global const float *smooth, float from_m,
                        global const float *normals, kernel_camera c, kernel_noise noise, global uint2 *planes) {
    int y = get_global_id(1);
    vfloat quarter = 0.25f, never = INFINITY, ry = ((float)y - c.cy) / c.fy;
    float sigma_1m = DEPTH_SIGMA(noise, 1.0f), ifx = 1.0f / c.fx;
    for (int x = get_global_id(0) * LANES; x < c.width; x += get_global_size(0) * LANES) {
        int i = AT(c, x, y);
        vfloat raw = VLOAD(depth + i), d = SELECT(VLOAD(smooth + i), raw, raw < from_m);
        vfloat nx = VLOAD(normals + i), ny = VLOAD(normals + c.plane + i),
               nz = VLOAD(normals + 2 * c.plane + i);
        vfloat rx = (IOTA + (float)x - c.cx) * ifx, across = -1.0f / sqrt(1.0f + rx * rx + ry * ry);
        vint flat = nz != 0.0f;
        vfloat squarely = SELECT(quarter, (nx * rx + ny * ry + nz) * across, flat);
        vfloat sigma = DEPTH_SIGMA(noise, d);
        vfloat weight = WEIGHT_ONE * sigma_1m * sigma_1m * squarely / (sigma * sigma);
        vint normal = pack_normals(SELECT(rx * across, nx, flat), SELECT(ry * across, ny, flat),
                                   SELECT(across, nz, flat));
        vfloat w = VFLOAT(NORMAL_X(normal)) * rx + VFLOAT(NORMAL_Y(normal)) * ry + VFLOAT(NORMAL_Z(normal));
        w *= NORMAL_UNIT * d;
        vint rounded = (AS_VINT(SELECT(never, w, d > 0.0f)) + WEIGHT_BITS / 2 + 1) & ~WEIGHT_BITS;
        store_points(normal, rounded | vnear(fmin(fmax(weight, 1.0f), 4.0f * WEIGHT_ONE)),
                     min(c.width - x, LANES), planes + y * c.width + x);
    }
}

/* Fuses a frame into the blocks in view (Curless and Levoy 1996, eq. 1 and 2): a running average of the distance to the
 * plane of a voxel's pixel. The plane (not the depth along the ray) keeps slanted surfaces true and compensates the
 * pixels' coarseness. WIDE voxels at once. Of the first `settled` blocks only those at odd or even places are fused
 * into (turn 1, 0). seen: set to the frame's number for each block in view. planes: of each pixel (pack_planes).
 * farthest: each tile's largest depth. Global size: work-items that share a block, blocks in use. */
kernel void fuse_blocks(global const uint2 *planes, kernel_camera c, global const float *farthest,
                        kernel_rigid world_to_camera, kernel_surface f, float max_weight,
                        global const int4 *blocks, int settled, int turn, int frame, global int *seen,
                        global short *voxels) {
    int index = get_global_id(1);
    if (index < settled && (index & 1) != turn) return;
    int4 b = blocks[index];
    if (b.w != f.submap) return;
    float voxel = f.voxel, truncation = f.truncation;
    float3 corner = convert_float3(b.xyz * BLOCK_EDGE) * voxel;
    float3 o = transform(world_to_camera, corner);
    float3 ex = voxel * (float3)(world_to_camera.x.x, world_to_camera.y.x, world_to_camera.z.x);
    float3 ey = voxel * (float3)(world_to_camera.x.y, world_to_camera.y.y, world_to_camera.z.y);
    float3 ez = voxel * (float3)(world_to_camera.x.z, world_to_camera.y.z, world_to_camera.z.z);
    if (!in_view(farthest, c, f, o + 3.5f * (ex + ey + ez))) return;

    seen[index] = frame;
    global wshort *distances = (global wshort *)(voxels + DISTANCES_OF(index));
    global wushort *weights = (global wushort *)(voxels + WEIGHTS_OF(index));
    wfloat lx = COLUMNS - 8.0f * floor(COLUMNS / 8.0f), ly = floor(COLUMNS / 8.0f);
    wfloat dx = ex.x * lx + ey.x * ly, dy = ex.y * lx + ey.y * ly, dz = ex.z * lx + ey.z * ly;
    wint nowhere = 0;
    float units = TSDF_ONE / truncation, behind = BEHIND * truncation;
    for (int k = get_global_id(0); k < BLOCK_VOXELS / WIDE; k += get_global_size(0)) {
        int i = k * WIDE;
        float3 p0 = o + ex * (float)(i & 7) + ey * (float)(i >> 3 & 7) + ez * (float)(i >> 6);
        wfloat px = p0.x + dx, py = p0.y + dy, pz = p0.z + dz;
        wfloat iz = 1.0f / pz;
        wfloat u = px * iz * c.fx + (c.cx + 0.5f), v = py * iz * c.fy + (c.cy + 0.5f);
        wint valid = (pz > 0.1f) & (u >= 0.0f) & (v >= 0.0f) & (u < (float)c.width) & (v < (float)c.height);
        if (!WANY(valid)) continue;
        wint normal, second;
        gather_points(planes, SELECT(nowhere, WINT(v) * c.width + WINT(u), valid), &normal, &second);
        wfloat nx = WFLOAT(NORMAL_X(normal)), ny = WFLOAT(NORMAL_Y(normal)), nz = WFLOAT(NORMAL_Z(normal));
        /* a voxel's distance s is `along` the ray by s |p| / -n.p, with the maximum `behind` */
        wfloat up = NORMAL_UNIT * (nx * px + ny * py + nz * pz), s = up - AS_WFLOAT(second & ~WEIGHT_BITS);
        wfloat limit = behind * up;
        valid &= (s > -truncation) & (s * fabs(s) * (px * px + py * py + pz * pz) > -limit * limit);
        if (!WANY(valid)) continue;
        wfloat weight = WFLOAT(second & WEIGHT_BITS);
        wfloat old_d = WFLOAT(distances[k]), old_w = WFLOAT(weights[k]);
        wfloat sum = old_w + weight;
        wfloat mean = old_d + (fmin(s * units, TSDF_ONE) - old_d) * weight / sum;
        distances[k] = WSHORT(WINT(SELECT(old_d, mean, valid) + 32768.5f) - 32768); /* to the nearest */
        weights[k] = WUSHORT(WINT(SELECT(old_w, fmin(sum, max_weight * WEIGHT_ONE), valid)));
    }
}

/* Sets blocks to never seen. Global size: blocks, rows of eight numbers (BLOCK_SHORTS / 8). */
kernel void clear_blocks(int first, global short *voxels) {
    size_t block = (size_t)(first + get_global_id(0)), row = get_global_id(1);
    vstore8((short8)(row / (BLOCK_VOXELS / 8) == VOXEL_DISTANCE ? NEVER_SEEN : 0), 0,
            voxels + block * BLOCK_SHORTS + 8 * row);
}
