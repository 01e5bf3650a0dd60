/* Section 2: weighted projective correspondences and the sums of the linear system, in one pass.
 *
 * A pair of a scan point p (moved into the model's camera by `motion`) and a model point d with normal n gives the row
 *     a = [ (p - centre) x n, n ],  b = n . (d - p)
 * for the twist (rotation about centre, translation) that moves p towards the plane through d.
 *
 * A work-item owns a strip of pixels and keeps its sums in registers; strips depend on the kind of device only, never
 * on the number of threads, and the host adds them up in order in double precision: the result is the same to the last
 * bit. WIDE pixels are processed at once: 8 or 16 on a CPU, where a strip is a row; 1 on a GPU, where GROUP work-items
 * share a row and add up in local memory. */

#ifndef GROUP
#define GROUP 1
#endif

/* WIDE pairs: the point from centre, the model's normal, residual and weight; all zero in lanes without a pair. */
typedef struct {
    wfloat px, py, pz, nx, ny, nz, b, w;
} wide_pairs;

/* The scan's normals of these, in the model's camera. */
typedef struct {
    wfloat x, y, z;
} wide_normals;

#define KEPT (WIDE == 1 ? 1 : 16) /* of them, until they are summed */

/* The row of A of each pair, with a normal. */
inline void row_of(wide_pairs p, wfloat nx, wfloat ny, wfloat nz, wfloat *a) {
    a[0] = p.py * nz - p.pz * ny;
    a[1] = p.pz * nx - p.px * nz;
    a[2] = p.px * ny - p.py * nx;
    a[3] = nx;
    a[4] = ny;
    a[5] = nz;
}

/* Adds the pairs to the sums, in two passes: the sums of either stay in registers. */
inline void accumulate(wfloat *s, const wide_pairs *pairs, int count) {
    wfloat r[18];
#pragma unroll
    for (int k = 0; k < 18; k++) r[k] = 0.0f;
    for (int g = 0; g < count; g++) {
        wide_pairs p = pairs[g];
        wfloat a[6];
        int k = 0;
        row_of(p, p.nx, p.ny, p.nz, a);
#pragma unroll
        for (int i = 0; i < 3; i++) {
            wfloat wa = p.w * a[i];
#pragma unroll
            for (int j = i; j < 6; j++) r[k++] += wa * a[j];
            r[15 + i] += wa * p.b;
        }
    }
#pragma unroll
    for (int k = 0; k < 15; k++) s[k] += r[k];
#pragma unroll
    for (int k = 0; k < 3; k++) s[21 + k] += r[15 + k];

#pragma unroll
    for (int k = 0; k < 15; k++) r[k] = 0.0f;
    for (int g = 0; g < count; g++) {
        wide_pairs p = pairs[g];
        wfloat wx = p.w * p.nx, wy = p.w * p.ny, wz = p.w * p.nz;
        r[0] += wx * p.nx;
        r[1] += wx * p.ny;
        r[2] += wx * p.nz;
        r[3] += wy * p.ny;
        r[4] += wy * p.nz;
        r[5] += wz * p.nz;
        r[6] += wx * p.b;
        r[7] += wy * p.b;
        r[8] += wz * p.b;
        r[9] += p.w * p.b * p.b;
        r[10] += p.w;
        r[11] += p.w * p.px;
        r[12] += p.w * p.py;
        r[13] += p.w * p.pz;
        r[14] += p.w * (p.px * p.px + p.py * p.py + p.pz * p.pz);
    }
#pragma unroll
    for (int k = 0; k < 6; k++) s[15 + k] += r[k];
#pragma unroll
    for (int k = 0; k < 9; k++) s[24 + k] += r[6 + k];
}

/* Adds the pairs to A^T S. */
inline void accumulate_across(wfloat *s, const wide_pairs *pairs, const wide_normals *scan, int count) {
    wfloat r[21];
#pragma unroll
    for (int k = 0; k < 21; k++) r[k] = 0.0f;
    for (int g = 0; g < count; g++) {
        wide_pairs p = pairs[g];
        wfloat a[6], b[6];
        row_of(p, p.nx, p.ny, p.nz, a);
        row_of(p, scan[g].x, scan[g].y, scan[g].z, b);
        int k = 0;
#pragma unroll
        for (int i = 0; i < 6; i++) {
            wfloat wa = 0.5f * p.w * a[i], wb = 0.5f * p.w * b[i];
#pragma unroll
            for (int j = i; j < 6; j++) r[k++] += wa * b[j] + wb * a[j];
        }
    }
#pragma unroll
    for (int k = 0; k < 21; k++) s[SUMS_ACROSS + k] += r[k];
}

/* Global size: GROUP, rows. Local size: GROUP, 1. sums: SUMS floats per row. depth, normals: the scan's, padded. model:
 * normal and depth, in the model kernel_camera mc. */
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void
align_reduce(global const float *depth, global const float *normals, kernel_camera c,
             global const uint2 *model, kernel_camera mc, kernel_rigid motion, kernel_pair_limits limits,
             global float *sums) {
    int y = get_global_id(1), across = y % ACROSS_EVERY == 0;
    wfloat s[SUMS];
    wide_pairs pairs[KEPT];
    wide_normals scan[KEPT];
    int at[WIDE * KEPT];
    uint2 fetched[WIDE * KEPT];
    for (int k = 0; k < SUMS; k++) s[k] = 0.0f;
    wfloat zero = 0.0f, one = 1.0f, pair_count = 0.0f, overlap = 0.0f;
    float ifx = 1.0f / c.fx, imfx = 1.0f / mc.fx, imfy = 1.0f / mc.fy, v = ((float)y - c.cy) / c.fy;
    /* of a ray, in the model's camera: the parts that are constant in a row */
    float rx = motion.x.y * v + motion.x.z, ry = motion.y.y * v + motion.y.z,
          rz = motion.z.y * v + motion.z.z;
    for (int x0 = get_local_id(0) * WIDE * KEPT; x0 < c.width; x0 += WIDE * KEPT * GROUP) {
        /* part of a row goes through each of four stages, so that no stage waits for loads of another */
        int kept = min(KEPT, (c.width - x0 + WIDE - 1) / WIDE);
        for (int g = 0; g < kept; g++) { /* 1: the points' positions, and their pixels in the model */
            int x = x0 + g * WIDE, i = AT(c, x, y);
            wfloat z = WLOAD(depth + i), confidence = WLOAD(normals + 3 * c.plane + i);
            wfloat u = ((float)x - c.cx + COLUMNS) * ifx;
            wfloat px = (motion.x.x * u + rx) * z + motion.x.w;
            wfloat py = (motion.y.x * u + ry) * z + motion.y.w;
            wfloat pz = (motion.z.x * u + rz) * z + motion.z.w;
            wint valid = (confidence > zero) & (pz > 0.05f);
            wfloat iz = 1.0f / SELECT(one, pz, valid);
            wfloat fu = px * iz * mc.fx + (mc.cx + 0.5f), fv = py * iz * mc.fy + (mc.cy + 0.5f);
            valid &= (fu >= 0.0f) & (fv >= 0.0f) & (fu < (float)mc.width) & (fv < (float)mc.height);
            wint ui = WINT(SELECT(zero, fu, valid)), vi = WINT(SELECT(zero, fv, valid));
            WSTORE(vi * mc.width + ui, at + g * WIDE);
            FETCH_AHEAD(depth + i + c.pitch);
#pragma unroll
            for (int k = 0; k < 4; k++) FETCH_AHEAD(normals + k * c.plane + i + c.pitch);
            FETCH_AHEAD(model + at[g * WIDE] + mc.width);
            FETCH_AHEAD(model + at[g * WIDE] + mc.width + WIDE / 2);
            wide_pairs *p = &pairs[g];
            p->px = px;
            p->py = py;
            p->pz = pz;
            p->nx = (WFLOAT(ui) - mc.cx) * imfx; /* for now the pixel's ray */
            p->ny = (WFLOAT(vi) - mc.cy) * imfy;
            p->w = SELECT(zero, confidence, valid);
        }
        for (int g = 0; g < kept; g++) /* 2: fetch those */
#pragma unroll
            for (int k = 0; k < WIDE; k++) fetched[g * WIDE + k] = model[at[g * WIDE + k]];
        for (int g = 0; g < kept; g++) { /* 3: which are pairs */
            wide_pairs *p = &pairs[g];
            int i = AT(c, x0 + g * WIDE, y);
            wint normal, second;
            load_points(fetched + g * WIDE, &normal, &second);
            wfloat nx = NORMAL_UNIT * WFLOAT(NORMAL_X(normal)), ny = NORMAL_UNIT * WFLOAT(NORMAL_Y(normal));
            wfloat nz = NORMAL_UNIT * WFLOAT(NORMAL_Z(normal)), mz = AS_WFLOAT(second);
            wint valid = (p->w > zero) & (mz > 0.0f) & (normal != 0);
            overlap += SELECT(zero, one, valid);
            wfloat dx = p->nx * mz - p->px, dy = p->ny * mz - p->py, dz = mz - p->pz;
            valid &= dx * dx + dy * dy + dz * dz < limits.distance2;
            /* the scan's normal, turned into the model's camera */
            wfloat qx = WLOAD(normals + i), qy = WLOAD(normals + c.plane + i),
                   qz = WLOAD(normals + 2 * c.plane + i);
            wfloat sx = motion.x.x * qx + motion.x.y * qy + motion.x.z * qz;
            wfloat sy = motion.y.x * qx + motion.y.y * qy + motion.y.z * qz;
            wfloat sz = motion.z.x * qx + motion.z.y * qy + motion.z.z * qz;
            valid &= nx * sx + ny * sy + nz * sz > limits.cos_angle;
            wfloat b = nx * dx + ny * dy + nz * dz;
            wfloat w = p->w * limits.huber / fmax(fabs(b), limits.huber);
            /* an invalid lane may hold anything, NaN too: clear the factors, not only the weight */
            p->px = SELECT(zero, p->px - limits.centre.x, valid);
            p->py = SELECT(zero, p->py - limits.centre.y, valid);
            p->pz = SELECT(zero, p->pz - limits.centre.z, valid);
            p->nx = SELECT(zero, nx, valid);
            p->ny = SELECT(zero, ny, valid);
            p->nz = SELECT(zero, nz, valid);
            p->b = SELECT(zero, b, valid);
            p->w = SELECT(zero, w, valid);
            pair_count += SELECT(zero, one, valid);
            if (across) {
                scan[g].x = SELECT(zero, sx, valid);
                scan[g].y = SELECT(zero, sy, valid);
                scan[g].z = SELECT(zero, sz, valid);
            }
        }
        accumulate(s, pairs, kept); /* 4 */
        if (across) accumulate_across(s, pairs, scan, kept);
    }
    s[SUMS_PAIRS] = pair_count;
    s[SUMS_OVERLAP] = overlap;
#if GROUP > 1
    local float tree[GROUP];
    int lane = get_local_id(0);
    for (int k = 0; k < SUMS; k++) {
        tree[lane] = s[k];
        barrier(CLK_LOCAL_MEM_FENCE);
        for (int half_size = GROUP / 2; half_size > 0; half_size /= 2) {
            if (lane < half_size) tree[lane] += tree[lane + half_size];
            barrier(CLK_LOCAL_MEM_FENCE);
        }
        if (lane == 0) sums[y * SUMS + k] = tree[0];
        barrier(CLK_LOCAL_MEM_FENCE);
    }
#elif LANES == 1
    for (int k = 0; k < SUMS; k++) sums[y * SUMS + k] = s[k];
#else
    for (int k = 0; k < SUMS; k++) {
#if WIDE == 16
        float8 h = s[k].lo + s[k].hi;
#else
        float8 h = s[k];
#endif
        float4 q = h.lo + h.hi;
        sums[y * SUMS + k] = (q.x + q.y) + (q.z + q.w);
    }
#endif
}
