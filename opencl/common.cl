/* What all kernels share: cameras, poses, padded images, the block hash. OpenCL C 1.2.
 *
 * Depth images and their like are planes of floats with a margin of PAD_X columns and PAD_Y rows of zeros (invalid) on
 * every side, so that a neighbourhood never leaves the buffer; AT gives a pixel's index. Model maps have no margin. */

#define PAD_X 8
#define PAD_Y 2

typedef struct {
    float fx, fy, cx, cy; /* pinhole, pixels; a pixel's centre has integer coordinates */
    int width, height;
    int pitch;            /* floats from row to row of a padded plane */
    int plane;            /* floats in a padded plane */
} camera;

typedef struct {
    float4 x, y, z;       /* rows of the rotation, with the translation in w */
} rigid;

/* Pixels of a row that a work-item works on at once: 8 on a CPU, 1 on a GPU. */
#ifndef LANES
#define LANES 8
#endif
#if LANES == 8
typedef float8 vfloat;
typedef int8 vint;
#define VLOAD(p) vload8(0, p)
#define VSTORE(v, p) vstore8(v, 0, p)
#define VINT convert_int8
#define VINT_FLOOR convert_int8_rtn
#define VFLOAT convert_float8
#define IOTA ((float8)(0, 1, 2, 3, 4, 5, 6, 7))
#define ANY(v) any(v)
#define SELECT(a, b, c) select(a, b, c)
#else
typedef float vfloat;
typedef int vint;
#define VLOAD(p) (*(p))
#define VSTORE(v, p) (*(p) = (v))
#define VINT convert_int
#define VINT_FLOOR convert_int_rtn
#define VFLOAT convert_float
#define IOTA 0.0f
#define ANY(v) (v)
#define SELECT(a, b, c) ((c) ? (b) : (a))
#endif

#define TILE 8 /* side of the tiles that images are divided into, pixels */

#define AT(c, px, py) (((py) + PAD_Y) * (c).pitch + (px) + PAD_X)

inline float3 transform(rigid m, float3 p) {
    return (float3)(dot(m.x.xyz, p) + m.x.w, dot(m.y.xyz, p) + m.y.w, dot(m.z.xyz, p) + m.z.w);
}

inline float3 rotate_vector(rigid m, float3 v) {
    return (float3)(dot(m.x.xyz, v), dot(m.y.xyz, v), dot(m.z.xyz, v));
}

inline float3 rotate_back(rigid m, float3 v) {
    return m.x.xyz * v.x + m.y.xyz * v.y + m.z.xyz * v.z;
}

/* Standard deviation of a depth by triangulation (Khoshelham and Elberink 2012, eq. 8): noise.x + noise.y z^2 */
inline float depth_sigma(float2 noise, float z) {
    return noise.x + noise.y * z * z;
}

/* ---- the block hash: open addressing, linear probing; an entry holds a block's coordinates and its place (w), -1: free -- */

#define BLOCK_EDGE 8
#define BLOCK_VOXELS 512
#define TSDF_ONE 32767.0f  /* a stored distance of one truncation */
#define NEVER_SEEN SHRT_MIN /* the stored distance of a voxel that no frame has reached */

inline uint block_hash(int3 b) {
    return ((uint)b.x * 73856093u) ^ ((uint)b.y * 19349669u) ^ ((uint)b.z * 83492791u);
}

inline int find_block(global const int4 *table, uint mask, int3 b) {
    uint h = block_hash(b);
    h = (h ^ (h >> 15)) & mask;
    for (;;) {
        int4 e = table[h];
        if (e.w < 0 || (e.x == b.x && e.y == b.y && e.z == b.z)) return e.w;
        h = (h + 1u) & mask;
    }
}
