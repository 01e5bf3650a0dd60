/* A reference of every kernel of opencl/, in plain scalar C and double precision. Buffers have the kernels' layout, so
 * that outputs can be compared directly.
 *
 * A kernel works in single precision and may contract multiplications and additions. Where a comparison lies within
 * rounding of its threshold either outcome is right: a reference marks such places in `doubt` (a byte per pixel, tile
 * or voxel; it may be NULL), and the checks leave them out and verify that they are few. */
#ifndef FATHOM_TESTS_REFERENCE_H
#define FATHOM_TESTS_REFERENCE_H

#include <stdbool.h>
#include <stdint.h>

#include "cl/kernel_types.h"

#define REF_NEVER_SEEN INT16_MIN /* a voxel's stored distance before the first frame reaches it */

/* a < b, in doubt when they differ by slack or less. */
bool ref_below(double a, double b, double slack, bool *doubt);
/* The greatest integer not above v, in doubt when v is within slack of an integer. */
int ref_floor(double v, double slack, bool *doubt);
/* Index of a pixel in a padded plane. */
int ref_at(const kernel_camera *c, int x, int y);
void ref_transform(const kernel_rigid *m, const double p[3], double out[3]);
void ref_rotate(const kernel_rigid *m, const double v[3], double out[3]);
/* Standard deviation of a depth (Khoshelham and Elberink 2012, eq. 8). */
double ref_sigma(kernel_noise noise, double z);

/* ---- opencl/maps.cl (reference_maps.c): writes the pixels, never the margin ---- */

/* A normal in 11, 11 and 10 bits from the top, signed, in units of 1/1023, 1/1023 and 1/511.5, and back. */
cl_uint ref_pack_normal(const double n[3]);
void ref_unpack_normal(cl_uint packed, double n[3]);
#define REF_NORMAL_STEP (1 / 1023.0) /* most that z is off, and twice what x and y are */
/* Model maps (four floats per pixel: normal, depth) to the kernels' form, and back. */
void ref_pack_model(const float *model, int count, cl_uint2 *packed);
void ref_unpack_model(const cl_uint2 *packed, int count, float *model);

void ref_convert_depth(const uint16_t *raw, const kernel_depth_source *s, const kernel_camera *c,
                       kernel_noise noise, float *depth, uint8_t *doubt);
void ref_smooth_depth(const float *depth, const kernel_camera *c, kernel_noise noise, double reach, int step,
                      float from_m, float *smooth);
void ref_halve_depth(const float *fine, const kernel_camera *f, const kernel_camera *c, kernel_noise noise,
                     float *coarse, uint8_t *doubt);
void ref_normal_map(const float *depth, const kernel_camera *c, kernel_noise noise, float *normals,
                    uint8_t *doubt);
void ref_pack_map(const float *depth, const float *normals, const kernel_camera *c, float *packed);
void ref_halve_map(const float *fine, const kernel_camera *f, const kernel_camera *c, float *coarse,
                   uint8_t *doubt);

/* ---- opencl/align.cl (reference_align.c) ---- */

/* SUMS sums per row of the scan, and for each the sum of the magnitudes of its terms' parts before cancellation, to
 * which the rounding of single precision is proportional. */
void ref_align_reduce(const float *depth, const float *normals, const kernel_camera *c, const float *model,
                      const kernel_camera *mc, const kernel_rigid *motion, const kernel_pair_limits *limits,
                      double *sums, double *magnitudes, uint8_t *doubt);

/* ---- opencl/integrate.cl (reference_volume.c) ---- */

/* A surface for lookups; blocks[i] lies in place i. */
typedef struct {
    const cl_int4 *blocks;
    int count;
    const int16_t *voxels;
    kernel_surface surface;
    int *order; /* of blocks, sorted by coordinates */
    int last;   /* the place found last, or -1 */
    int last_block[3];
    bool has_cube; /* the cube of the last ref_volume_distance: its lowest voxel and its corners' distances */
    int cube[3];
    double corner[8]; /* the first is NAN when any was never seen */
} ref_volume;

void ref_volume_open(ref_volume *v, const cl_int4 *blocks, int count, const int16_t *voxels,
                     const kernel_surface *surface);
void ref_volume_close(ref_volume *v);
/* The place of a block, or -1. */
int ref_volume_place(ref_volume *v, int x, int y, int z);
/* A voxel's distance in truncations; NAN where it was never seen. */
double ref_volume_voxel(ref_volume *v, int x, int y, int z);
/* Trilinear interpolation at p (in voxels), and its gradient where that isn't NULL; NAN where a corner is unseen. */
double ref_volume_distance(ref_volume *v, const double p[3], double gradient[3]);

/* The largest depth of each tile. */
void ref_tile_farthest(const float *depth, const kernel_camera *c, float *farthest);
/* The blocks within the truncation band that the rays of a tile's sampled pixels meet, each once, whether they are
 * there already or not; w: 1, or 0 where rounding decides. Returns how many, or -1 when there are more than most. */
int ref_met_blocks(const float *depth, const kernel_camera *c, const kernel_rigid *camera_to_world,
                   double block_m, double truncation, int tile, cl_int4 *met, int most);
void ref_clear_blocks(int first, int count, int16_t *voxels);

/* A pixel's plane in fusion: points p with n . p = w, in camera axes. w is infinite without depth. */
typedef struct {
    double n[3], w, weight;
} ref_plane;

/* The plane through the pixel's point, across its normal, or across its ray where it has none. weight: not rounded. */
ref_plane ref_plane_of(const float *depth, const float *normals, const kernel_camera *c, kernel_noise noise,
                       int x, int y);
#define REF_WEIGHT_BITS 511u
/* To eight bytes, and back. First: n (ref_pack_normal). Second: w, a float whose last nine bits are the weight. w holds
 * the same point with the n that is packed. */
cl_uint2 ref_pack_plane(const ref_plane *plane);
ref_plane ref_unpack_plane(cl_uint2 packed);
/* Of a whole image, row by row. */
void ref_pack_planes(const float *depth, const float *normals, const kernel_camera *c, kernel_noise noise,
                     cl_uint2 *planes);

/* Is something of each block in view: does a sphere about its middle, through its outermost voxels, reach into the
 * picture's frustum and no further than a truncation behind the farthest that any tile it may cover has? What reaches
 * to within 0.1 m of the camera may cover all of it. REF_DOUBTFUL where rounding decides. */
enum { REF_OUT, REF_IN_VIEW };
void ref_in_view(const float *farthest, const kernel_camera *c, const kernel_rigid *world_to_camera,
                 const kernel_surface *f, const cl_int4 *blocks, int count, uint8_t *outcomes);

/* The outcome of fuse_blocks for a voxel. */
enum { REF_LEFT, REF_FUSED, REF_DOUBTFUL };
/* Fuses into voxels; planes: packed; of the first `settled` blocks every other one; outcomes: one per voxel. */
void ref_fuse_blocks(const cl_uint2 *planes, const kernel_camera *c, const kernel_rigid *world_to_camera,
                     double voxel, double truncation, double max_weight, const cl_int4 *blocks, int count,
                     int settled, int turn, int16_t *voxels, uint8_t *outcomes);

/* ---- opencl/raycast.cl, opencl/mesh.cl (reference_surface.c) ---- */

void ref_clear_ranges(int tiles, float *ranges);
/* Near and far for each tile: twice, without and with the blocks whose tile is in doubt. */
void ref_range_blocks(const cl_int4 *blocks, int count, const kernel_camera *c,
                      const kernel_rigid *world_to_camera, double voxel, double near_m, double far_m,
                      float *sure, float *widest);
/* Every ray is followed from near_m to far_m in steps of a fifth of a voxel. model: normal and depth. */
void ref_raycast(ref_volume *v, const kernel_camera *c, const kernel_rigid *camera_to_world, double near_m,
                 double far_m, float *model);
/* The first crossing within reach of a scan's depth (padded), nothing where it has none. In doubt where it lies within
 * slack of the ends. */
void ref_raycast_near(ref_volume *v, const kernel_camera *c, const kernel_rigid *camera_to_world,
                      const float *scan, double reach, double slack, float *model, uint8_t *doubt);
/* Triangles of blocks first..first+count-1. cases: mesh_cases(). */
void ref_count_triangles(ref_volume *v, const uint8_t *cases, int first, int count, int *counts);
/* 18 floats per triangle, block after block. */
void ref_emit_triangles(ref_volume *v, const uint8_t *cases, int first, int count, float *vertices);

#endif
