/* Depth maps: metric depth at the alignment's size, edge-preserving smoothing, pyramid, normals and confidence. */

/* The position in the frame of the ideal pinhole's pixel (x, y), or -1 outside of it. */
inline int source_index(kernel_depth_source s, int x, int y) {
    if (s.lens) {
        float u = ((float)x - s.cx) / s.fx, v = ((float)y - s.cy) / s.fy;
        float r2 = u * u + v * v;
        float radial = 1.0f + r2 * (s.k1 + r2 * (s.k2 + r2 * s.k3));
        if (s.lens == 2) radial /= 1.0f + r2 * (s.k4 + r2 * (s.k5 + r2 * s.k6));
        float ud = u * radial + 2.0f * s.p1 * u * v + s.p2 * (r2 + 2.0f * u * u);
        float vd = v * radial + s.p1 * (r2 + 2.0f * v * v) + 2.0f * s.p2 * u * v;
        float px = ud * s.fx + s.cx, py = vd * s.fy + s.cy;
        if (!(px > -0.5f && py > -0.5f && px < (float)s.width - 0.5f && py < (float)s.height - 0.5f))
            return -1;
        x = convert_int_rtn(px + 0.5f);
        y = convert_int_rtn(py + 0.5f);
    }
    return x < s.width ? y * s.width + x : -1;
}

/* The depths of eight pixels of the map, each at (i, j) of its factor x factor pixels; 0: invalid. */
inline float8 source_depths(global const ushort *raw, kernel_depth_source s, int x, int y, int i, int j) {
    ushort8 units;
    global const ushort *row = raw + (y * s.factor + j) * s.width;
    if (!s.lens && s.factor == 1 && x + 8 <= s.width) {
        units = vload8(0, row + x);
    } else if (!s.lens && s.factor == 2 && 2 * x + 16 <= s.width) {
        ushort16 pairs = vload16(0, row + 2 * x);
        units = i == 0 ? pairs.even : pairs.odd;
    } else {
        ushort v[8];
        for (int k = 0; k < 8; k++) {
            int at = source_index(s, (x + k) * s.factor + i, y * s.factor + j);
            v[k] = at >= 0 ? raw[at] : 0;
        }
        units = vload8(0, v);
    }
    int8 u = convert_int8(units);
    float8 z = convert_float8(u) * s.metres_per_unit;
    return select((float8)(0.0f), z, (u != 0) & (u != 65535) & (z >= s.min_m) & (z <= s.max_m));
}

/* Metric depth, averaged over factor x factor pixels as far as they belong to the nearest surface among them.
 * Global size: work-items that share a row, height of the map; each works on eight pixels at a time. */
kernel void convert_depth(global const ushort *raw, kernel_depth_source s, kernel_camera c, kernel_noise noise,
                          global float *depth) {
    int y = get_global_id(1);
    float8 lane = (float8)(0, 1, 2, 3, 4, 5, 6, 7);
    for (int x = get_global_id(0) * 8; x < c.width; x += get_global_size(0) * 8) {
        int8 inside = lane < (float)(c.width - x); /* distortion can bring depth into the margin */
        if (s.factor == 1) {                       /* no valid pixel to average */
            vstore8(select((float8)(0.0f), source_depths(raw, s, x, y, 0, 0), inside), 0,
                    depth + AT(c, x, y));
            continue;
        }
        float8 nearest = INFINITY, sum = 0.0f, count = 0.0f, few[4]; /* of a factor of two all are kept */
        for (int j = 0; j < s.factor; j++)
            for (int i = 0; i < s.factor; i++) {
                float8 z = source_depths(raw, s, x, y, i, j);
                if (s.factor == 2) few[2 * j + i] = z;
                nearest = fmin(nearest, select((float8)(INFINITY), z, z > 0.0f));
            }
        float8 band = nearest + 4.0f * DEPTH_SIGMA(noise, nearest) + 0.005f * nearest;
        for (int j = 0; j < s.factor; j++)
            for (int i = 0; i < s.factor; i++) {
                float8 z = s.factor == 2 ? few[2 * j + i] : source_depths(raw, s, x, y, i, j);
                int8 keep = (z > 0.0f) & (z <= band);
                sum += select((float8)(0.0f), z, keep);
                count += select((float8)(0.0f), (float8)(1.0f), keep);
            }
        vstore8(select((float8)(0.0f), sum / count, count > 0.0f && inside), 0, depth + AT(c, x, y));
    }
}

/* Edge-preserving smoothing over 5x5 pixels, `step` apart: weights fall with the distance in the image (binomial) and
 * with the difference of depth in units of its noise (Tukey's biweight, which is zero beyond `reach` sigma and needs no
 * exp). Depth below from_m, which is above 0, stays. Global size: work-items that share a row, height. */
kernel void smooth_depth(global const float *depth, kernel_camera c, kernel_noise noise, float reach, int step,
                         float from_m, global float *smooth) {
    int y = get_global_id(1);
    wfloat zero = 0.0f;
    const float binomial[5] = {1.0f, 4.0f, 6.0f, 4.0f, 1.0f};
    for (int x = get_global_id(0) * WIDE; x < c.width; x += get_global_size(0) * WIDE) {
        int i = AT(c, x, y);
        wfloat z = WLOAD(depth + i);
        wfloat inverse = 1.0f / (reach * DEPTH_SIGMA(noise, z));
        wfloat sum = 0.0f, weights = 0.0f;
        for (int dy = -2; dy <= 2; dy++)
            for (int dx = -2; dx <= 2; dx++) {
                wfloat v = WLOAD(depth + i + step * (dy * c.pitch + dx));
                wfloat e = (v - z) * inverse;
                wfloat w = fmax(1.0f - e * e, 0.0f);
                w = w * w * (binomial[dy + 2] * binomial[dx + 2]);
                w = SELECT(w, zero, v == 0.0f);
                sum += w * v;
                weights += w;
            }
        wfloat result = SELECT(sum / weights, z, z < from_m);
        WSTORE(SELECT(result, zero, COLUMNS >= (float)(c.width - x)), smooth + i); /* the margin stays zero */
    }
}

/* The next coarser depth: 2x2 pixels averaged as far as they belong to the nearest surface among them.
 * Global size: work-items that share a row, height of the coarser map. */
kernel void halve_depth(global const float *fine, kernel_camera f, kernel_camera c, kernel_noise noise,
                        global float *coarse) {
    int y = get_global_id(1);
    wfloat zero = 0.0f, one = 1.0f, never = INFINITY;
    for (int x = get_global_id(0) * WIDE; x < c.width; x += get_global_size(0) * WIDE) {
        int i = AT(f, 2 * x, 2 * y);
        wfloat z[4], nearest = never, sum = 0.0f, count = 0.0f;
        load_pairs(fine + i, &z[0], &z[1]);
        load_pairs(fine + i + f.pitch, &z[2], &z[3]);
        for (int k = 0; k < 4; k++) nearest = fmin(nearest, SELECT(never, z[k], z[k] > 0.0f));
        wfloat band = nearest + 4.0f * DEPTH_SIGMA(noise, nearest) + 0.01f * nearest;
        for (int k = 0; k < 4; k++) {
            wint keep = (z[k] > 0.0f) & (z[k] <= band);
            sum += SELECT(zero, z[k], keep);
            count += SELECT(zero, one, keep);
        }
        WSTORE(SELECT(zero, sum / count, (count > 0.0f) & (COLUMNS < (float)(c.width - x))),
               coarse + AT(c, x, y));
    }
}

/* Normals from differences of the neighbours' vertices, in camera axes and towards the camera; and each pixel's
 * confidence, the weight of Section 2: the depth's inverse variance relative to that at 1 m ("distance"), lowered where
 * the surface bends from pixel to pixel ("normal variation"). Four planes: nx, ny, nz, confidence; all zero: no normal.
 * Global size: work-items that share a row, height. */
kernel void normal_map(global const float *depth, kernel_camera c, kernel_noise noise, global float *normals) {
    int y = get_global_id(1);
    wfloat zero = 0.0f, one = 1.0f, quarter = 0.25f;
    float sigma_1m = DEPTH_SIGMA(noise, 1.0f);
    for (int x = get_global_id(0) * WIDE; x < c.width; x += get_global_size(0) * WIDE) {
        int i = AT(c, x, y);
        wfloat z = WLOAD(depth + i);
        wfloat left = WLOAD(depth + i - 1), right = WLOAD(depth + i + 1);
        wfloat up = WLOAD(depth + i - c.pitch), down = WLOAD(depth + i + c.pitch);
        wfloat sigma = DEPTH_SIGMA(noise, z);
        /* a step to a neighbour across an edge is not a slope: the maximum is the slope of a surface at 75 degrees,
         * plus noise */
        wfloat limit = 4.0f * sigma + 4.0f * z / c.fx;
        wint l = (left > 0.0f) & (fabs(left - z) < limit), r = (right > 0.0f) & (fabs(right - z) < limit);
        wint u = (up > 0.0f) & (fabs(up - z) < limit), b = (down > 0.0f) & (fabs(down - z) < limit);
        wfloat za = SELECT(z, left, l), zb = SELECT(z, right, r), zc = SELECT(z, up, u),
               zd = SELECT(z, down, b);
        wfloat wide = SELECT(zero, one, r) + SELECT(zero, one, l);
        wfloat tall = SELECT(zero, one, b) + SELECT(zero, one, u);
        wint valid = (z > 0.0f) & (wide > 0.0f) & (tall > 0.0f) & (COLUMNS < (float)(c.width - x));
        wfloat gx = (zb - za) / wide, gy = (zd - zc) / tall; /* slope of the depth, metres per pixel */
        /* (dP/du) x (dP/dv) for P = ((u - cx) z / fx, (v - cy) z / fy, z), up to a positive factor, pointing to the
         * camera */
        wfloat px = (float)x + COLUMNS - c.cx;
        float py = (float)y - c.cy;
        wfloat nx = c.fx * gx, ny = c.fy * gy, nz = -(z + px * gx + py * gy);
        wfloat inverse = 1.0f / sqrt(nx * nx + ny * ny + nz * nz);
        wfloat bend_x = SELECT(zero, left + right - 2.0f * z, l & r);
        wfloat bend_y = SELECT(zero, up + down - 2.0f * z, u & b);
        wfloat bend = (bend_x * bend_x + bend_y * bend_y) / (9.0f * sigma * sigma); /* in units of three sigma */
        wfloat edge = SELECT(quarter, one, l & r & u & b);
        wfloat confidence = edge * sigma_1m * sigma_1m / (sigma * sigma * (1.0f + bend));
        WSTORE(SELECT(zero, nx * inverse, valid), normals + i);
        WSTORE(SELECT(zero, ny * inverse, valid), normals + c.plane + i);
        WSTORE(SELECT(zero, nz * inverse, valid), normals + 2 * c.plane + i);
        WSTORE(SELECT(zero, confidence, valid), normals + 3 * c.plane + i);
    }
}

/* A frame's maps in the model's form, normal and depth, so that the next one can be aligned with it. Global size:
 * width, height. */
kernel void pack_map(global const float *depth, global const float *normals, kernel_camera c,
                     global uint2 *packed) {
    int x = get_global_id(0), y = get_global_id(1);
    int i = AT(c, x, y);
    packed[y * c.width + x] =
        pack_point((float3)(normals[i], normals[c.plane + i], normals[2 * c.plane + i]), depth[i]);
}

/* The next coarser model map: of 2x2 pixels those near the nearest one are averaged.
 * Global size: width, height of the coarser map. */
kernel void halve_map(global const uint2 *fine, kernel_camera f, kernel_camera c, global uint2 *coarse) {
    int x = get_global_id(0), y = get_global_id(1);
    float nearest = INFINITY;
    for (int k = 0; k < 4; k++) {
        float z = as_float(fine[(2 * y + (k >> 1)) * f.width + 2 * x + (k & 1)].y);
        if (z > 0.0f) nearest = fmin(nearest, z);
    }
    float4 sum = 0.0f;
    float count = 0.0f;
    for (int k = 0; k < 4; k++) {
        float4 m = unpack_point(fine[(2 * y + (k >> 1)) * f.width + 2 * x + (k & 1)]);
        if (m.w > 0.0f && m.w <= nearest * 1.02f + 0.01f) {
            sum += m;
            count += 1.0f;
        }
    }
    float length2 = dot(sum.xyz, sum.xyz);
    coarse[y * c.width + x] =
        count > 0.0f && length2 > 0.01f ? pack_point(sum.xyz * rsqrt(length2), sum.w / count) : (uint2)(0);
}
