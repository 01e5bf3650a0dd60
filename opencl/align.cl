/* Section 2: weighted projective correspondences and the sums of the linear system, in one pass.
 *
 * A pair of a scan point p (moved into the model's camera by `motion`) and a model point d with normal n gives the row
 *     a = [ (p - centre) x n, n ],  b = n . (d - p)
 * for the twist (rotation about centre, translation) that moves p towards the plane through d.
 *
 * A work-item owns a strip of pixels and keeps its sums in registers; strips depend on the device's kind only, never on
 * the number of threads, and the host adds them up in order in double precision: the result is the same to the last bit.
 * LANES pixels are worked on at once: 8 on a CPU, where a strip is a row; 1 on a GPU, where GROUP work-items share a row
 * and add up in local memory. */

#ifndef GROUP
#define GROUP 1
#endif

/* Upper triangle of A^T A row by row (21), A^T b (6), b^T b, sum of weights, sum of w p (3), sum of w |p|^2, pairs n,
 * pixels where both have a surface; p here counts from centre. */
#define SUMS 35

typedef struct {
    float distance2;    /* most squared distance of a pair, m^2 */
    float cos_angle;    /* least cosine between the normals */
    float huber;        /* residual where the weight begins to fall, m */
    float4 centre;      /* point that rotations are taken about, model camera */
} pair_limits;

inline void accumulate(vfloat *s, vfloat px, vfloat py, vfloat pz, vfloat nx, vfloat ny, vfloat nz, vfloat b, vfloat w) {
    vfloat a[6] = {py * nz - pz * ny, pz * nx - px * nz, px * ny - py * nx, nx, ny, nz};
    int k = 0;
    for (int i = 0; i < 6; i++) {
        vfloat wa = w * a[i];
        for (int j = i; j < 6; j++) s[k++] += wa * a[j];
        s[21 + i] += wa * b;
    }
    s[27] += w * b * b;
    s[28] += w;
    s[29] += w * px;
    s[30] += w * py;
    s[31] += w * pz;
    s[32] += w * (px * px + py * py + pz * pz);
}

/* Global size: GROUP, rows. Local size: GROUP, 1. sums: SUMS floats a row.
 * depth, normals: the scan's, padded. model: normal and depth, in the model camera mc. */
kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))
void align_reduce(global const float *depth, global const float *normals, camera c, global const float4 *model,
                  camera mc, rigid motion, pair_limits limits, global float *sums) {
    int y = get_global_id(1);
    vfloat s[SUMS];
    for (int k = 0; k < SUMS; k++) s[k] = 0.0f;
    float v = ((float)y - c.cy) / c.fy;
    for (int x = get_local_id(0) * LANES; x < c.width; x += LANES * GROUP) {
        int i = AT(c, x, y);
        vfloat z = VLOAD(depth + i);
        vfloat confidence = VLOAD(normals + 3 * c.plane + i);
        vint valid = confidence > 0.0f;
        if (!ANY(valid)) continue;
        vfloat sx = ((float)x + IOTA - c.cx) / c.fx * z, sy = v * z;
        vfloat px = motion.x.x * sx + motion.x.y * sy + motion.x.z * z + motion.x.w;
        vfloat py = motion.y.x * sx + motion.y.y * sy + motion.y.z * z + motion.y.w;
        vfloat pz = motion.z.x * sx + motion.z.y * sy + motion.z.z * z + motion.z.w;
        valid = valid && pz > 0.05f;
        vfloat iz = 1.0f / SELECT((vfloat)(1.0f), pz, valid);
        vfloat fu = px * iz * mc.fx + mc.cx + 0.5f, fv = py * iz * mc.fy + mc.cy + 0.5f;
        valid = valid && fu >= 0.0f && fv >= 0.0f && fu < (float)mc.width && fv < (float)mc.height;
        vfloat u = SELECT((vfloat)(0.0f), fu, valid), w_ = SELECT((vfloat)(0.0f), fv, valid);
        vint ui = VINT_FLOOR(u), vi = VINT_FLOOR(w_);
        vint at = vi * mc.width + ui;
#if LANES == 8
        float4 m0 = model[at.s0], m1 = model[at.s1], m2 = model[at.s2], m3 = model[at.s3];
        float4 m4 = model[at.s4], m5 = model[at.s5], m6 = model[at.s6], m7 = model[at.s7];
        vfloat nx = (float8)(m0.x, m1.x, m2.x, m3.x, m4.x, m5.x, m6.x, m7.x);
        vfloat ny = (float8)(m0.y, m1.y, m2.y, m3.y, m4.y, m5.y, m6.y, m7.y);
        vfloat nz = (float8)(m0.z, m1.z, m2.z, m3.z, m4.z, m5.z, m6.z, m7.z);
        vfloat mz = (float8)(m0.w, m1.w, m2.w, m3.w, m4.w, m5.w, m6.w, m7.w);
        vfloat uf = convert_float8(ui), vf = convert_float8(vi);
#else
        float4 m = model[at];
        vfloat nx = m.x, ny = m.y, nz = m.z, mz = m.w, uf = (float)ui, vf = (float)vi;
#endif
        valid = valid && mz > 0.0f && (nx != 0.0f || ny != 0.0f || nz != 0.0f);
        s[34] += SELECT((vfloat)(0.0f), (vfloat)(1.0f), valid);
        vfloat dx = (uf - mc.cx) / mc.fx * mz - px, dy = (vf - mc.cy) / mc.fy * mz - py, dz = mz - pz;
        valid = valid && dx * dx + dy * dy + dz * dz < limits.distance2;
        /* the scan's normal, turned into the model's camera */
        vfloat qx = VLOAD(normals + i), qy = VLOAD(normals + c.plane + i), qz = VLOAD(normals + 2 * c.plane + i);
        vfloat cosine = nx * (motion.x.x * qx + motion.x.y * qy + motion.x.z * qz) +
                        ny * (motion.y.x * qx + motion.y.y * qy + motion.y.z * qz) +
                        nz * (motion.z.x * qx + motion.z.y * qy + motion.z.z * qz);
        valid = valid && cosine > limits.cos_angle;
        vfloat b = nx * dx + ny * dy + nz * dz;
        vfloat w = confidence * limits.huber / fmax(fabs(b), limits.huber);
        /* an invalid lane may hold anything, NaN too: clear the factors, not only the weight */
        vfloat zero = 0.0f;
        w = SELECT(zero, w, valid);
        b = SELECT(zero, b, valid);
        accumulate(s, SELECT(zero, px - limits.centre.x, valid), SELECT(zero, py - limits.centre.y, valid),
                   SELECT(zero, pz - limits.centre.z, valid), SELECT(zero, nx, valid), SELECT(zero, ny, valid),
                   SELECT(zero, nz, valid), b, w);
        s[33] += SELECT(zero, (vfloat)(1.0f), valid);
    }
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
        float4 h = s[k].lo + s[k].hi;
        sums[y * SUMS + k] = (h.x + h.y) + (h.z + h.w);
    }
#endif
}
