/* Shared by the host and the kernels: structures, constants, the voxel, the block hash. C includes this file; among the
 * kernels' sources it comes first. */
#ifndef FATHOM_LAYOUT_H
#define FATHOM_LAYOUT_H

#ifdef __OPENCL_VERSION__
typedef float cl_float;
typedef int cl_int;
typedef uint cl_uint;
typedef float4 cl_float4;
#define LAYOUT_INLINE inline
#else
#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#define LAYOUT_INLINE static inline
#endif

/* ---- images: a padded plane has margins of zeros (invalid), and rows filled up to a multiple of sixteen pixels --- */

#define PAD_X 8 /* columns on either side */
#define PAD_Y 4 /* rows above and below */
#define TILE 8  /* side of the tiles that images are divided into, pixels */

typedef struct {
    cl_float fx, fy, cx, cy; /* pinhole, pixels; a pixel's centre has integer coordinates */
    cl_int width, height;
    cl_int pitch; /* floats from row to row of a padded plane */
    cl_int plane; /* floats in a padded plane */
} kernel_camera;

typedef struct {
    cl_float4 x, y, z; /* rows of the rotation, with the translation in w */
} kernel_rigid;

/* The depth frame as received. */
typedef struct {
    cl_float fx, fy, cx, cy;
    cl_float k1, k2, p1, p2, k3, k4, k5, k6; /* distortion, OpenCV's order */
    cl_int lens; /* fathom_lens: none, five coefficients, or eight (rational) */
    cl_int width, height;
    cl_int factor; /* depth size / map size */
    cl_float metres_per_unit;
    cl_float min_m, max_m;
} kernel_depth_source;

/* Standard deviation of a depth z: base + slope z + growth z^2. Triangulation makes the last (Khoshelham and Elberink 2012,
 * eq. 8), time of flight and depth completed from sparse points the first two. */
typedef struct {
    cl_float base, slope, growth; /* m, 1, 1/m */
} kernel_noise;

/* A point of a model map, and the plane of a pixel that is fused, take eight bytes: a normal in 11, 11 and 10 bits from
 * the top, signed, and a float. The upper components in place count in units of NORMAL_UNIT. */
#define NORMAL_ONE 2145386496.0f /* 1023 * 2^21 and 511.5 * 2^22 */
#define NORMAL_UNIT (1.0f / NORMAL_ONE)
#define NORMAL_X(n) ((n) & (cl_int)0xffe00000)
#define NORMAL_Y(n) ((n) << 11 & (cl_int)0xffe00000)
#define NORMAL_Z(n) ((n) << 22)

/* ---- alignment ---- */

/* Sums of a row: upper triangle of A^T A row by row (21), A^T b (6), b^T b, sum of weights, sum of w p (3), sum of w
 * |p|^2, pairs n, pixels where both have a surface; in every ACROSS_EVERY-th row, else 0, upper triangle of the
 * symmetric part of A^T S (21), S being A with the scan's normals in place of the model's. */
#define SUMS 56
#define SUMS_PAIRS 33
#define SUMS_OVERLAP 34
#define SUMS_ACROSS 35
#define ACROSS_EVERY 8

typedef struct {
    cl_float distance2; /* maximum squared distance of a pair, m^2 */
    cl_float cos_angle; /* minimum cosine between the normals */
    cl_float huber;     /* residual where the weight begins to fall, m */
    cl_float4 centre;   /* point that rotations are taken about, model camera */
} kernel_pair_limits;

/* ---- voxels and blocks ---- */

#define BLOCK_EDGE 8
#define BLOCK_VOXELS 512

/* The content of voxels. A block is VOXEL_PLANES planes of BLOCK_VOXELS 16-bit numbers, x fastest: first the distances
 * (short, positive in front of the surface), then the weights (ushort). Voxel i lies at i * voxel metres. */
#define VOXEL_DISTANCE 0
#define VOXEL_WEIGHT 1
#define VOXEL_PLANES 2
#define BLOCK_SHORTS (VOXEL_PLANES * BLOCK_VOXELS)
#define BLOCK_BYTES (2 * BLOCK_SHORTS)
#define DISTANCES_OF(place) ((size_t)(place) * BLOCK_SHORTS + VOXEL_DISTANCE * BLOCK_VOXELS) /* shorts into the pool */
#define WEIGHTS_OF(place) ((size_t)(place) * BLOCK_SHORTS + VOXEL_WEIGHT * BLOCK_VOXELS)

#define TSDF_ONE 32767.0f    /* a stored distance of one truncation */
#define NEVER_SEEN (-32768)  /* the stored distance of a voxel that no frame has reached */
#define WEIGHT_ONE 64.0f     /* a stored weight of one observation at 1 m */
#define WEIGHT_BITS 511      /* of a pixel's plane: the last bits of its float hold the weight */

/* A surface for lookups. */
typedef struct {
    cl_float voxel, truncation; /* metres */
    cl_uint mask;               /* of the hash table: entries - 1 */
    cl_int submap;              /* whose blocks are meant */
    cl_float min_weight;        /* stored weights up to this count as never seen; 0: all that were seen count */
} kernel_surface;

/* A block's key is an int4: its coordinates and its submap's number. The hash is open, with linear probing. A table
 * holds `entries` keys (a power of two; submap FREE_ENTRY: none) and then as many ints, the places of those blocks in
 * the pool. */
#define FREE_ENTRY (-1)
#define TABLE_BYTES(entries) ((size_t)(entries) * 5 * sizeof(cl_int))

/* The entry where the search for a key begins (Teschner et al. 2003, the upper half folded in). */
LAYOUT_INLINE cl_uint block_hash(cl_int x, cl_int y, cl_int z, cl_int submap) {
    cl_uint h = ((cl_uint)x * 73856093u) ^ ((cl_uint)y * 19349669u) ^ ((cl_uint)z * 83492791u) ^
                ((cl_uint)submap * 2654435761u);
    return h ^ (h >> 15);
}

#define TILE_SLOTS 64 /* maximum blocks that a tile of the frame requests */

/* ---- marching cubes: cube corner k stands at (k & 1, k >> 1 & 1, k >> 2) ---- */

/* the corners that each edge joins */
#define EDGE_ENDS                                                                                            \
    { {0, 1}, {2, 3}, {4, 5}, {6, 7}, {0, 2}, {1, 3}, {4, 6}, {5, 7}, {0, 4}, {1, 5}, {2, 6}, {3, 7} }
#define CASE_SIZE 16 /* edges of up to five triangles, then CASE_END */
#define CASE_END 255
/* a triangle's corner keeps this part of its edge from either voxel, so that no corners fall together */
#define CORNER_MARGIN (1.0f / 256)
#define CASE_TRIANGLES 5

#endif
