/* What the kernel checks share: buffers with guarded ends, random images, comparisons. */
#ifndef FATHOM_KERNEL_CHECKS_BENCH_H
#define FATHOM_KERNEL_CHECKS_BENCH_H

#include "cl/kernel_types.h"
#include "selftest/kernel_checks.h"
#include "selftest/reference.h"

#define BENCH_BUFFERS 16

/* One check's run. Failures stick; the first one is reported. */
typedef struct {
    device *d;
    char *why;
    size_t why_size;
    bool failed;
    bool small; /* few pixels, and buffers without a byte too many: for Oclgrind, which sees a byte too far */
    double shift;    /* metres to move the world by when small: Oclgrind 21.10 rounds negative numbers up */
    uint64_t random; /* state of bench_random */
    long compared, doubtful;
    int count;
    struct {
        device_buffer buffer;
        void *block;
        size_t size;
    } buffers[BENCH_BUFFERS];
} bench;

void bench_start(bench *b, device *d, bool small, char *why, size_t size);
/* Checks the fraction left out for doubt, and ends. */
fathom_check bench_end(bench *b);
void bench_fail(bench *b, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* ---- buffers: all are freed by bench_free, which also looks at what lies behind their ends ---- */

cl_mem bench_buffer(bench *b, size_t size, const void *content);
void bench_read(bench *b, cl_mem memory, void *content, size_t size);
/* A buffer with a model map (four floats per pixel); model is set to its value after packing. NULL: not initialised. */
cl_mem bench_model(bench *b, int count, float *model);
void bench_read_model(bench *b, cl_mem memory, int count, float *model);
void bench_free(bench *b);

/* Runs a kernel and waits. */
#define LAUNCH(b, name, columns, rows, group, ...)                                                           \
    do {                                                                                                     \
        cl_kernel launched = device_kernel((b)->d, name);                                                    \
        if (launched) {                                                                                      \
            RUN((b)->d, launched, columns, rows, group, __VA_ARGS__);                                        \
            device_wait((b)->d);                                                                             \
            clReleaseKernel(launched);                                                                       \
        }                                                                                                    \
    } while (0)

/* The same as the library's RUN_ROWS: on a CPU a work-item takes a row. */
#define LAUNCH_ROWS(b, name, columns, rows, ...)                                                             \
    LAUNCH(b, name, (b)->d->cpu ? 1 : (size_t)(columns), (size_t)(rows), (b)->d->cpu ? 1 : 0, __VA_ARGS__)

void *bench_alloc(size_t size); /* zeros; ends the program when there are none */

/* ---- random input ---- */

double bench_random(bench *b, double low, double high);
int bench_random_int(bench *b, int low, int high); /* low..high */
/* A rigid motion with a rotation of up to angle about a random axis, and a translation of up to distance an axis. */
pose bench_motion(bench *b, double angle, double distance);
/* A camera for a picture of the size, with the optical axis near its middle and about 60 degrees across. */
kernel_camera bench_camera(bench *b, int width, int height);

typedef enum {
    IMAGE_SURFACES, /* slanted planes with steps between them, the sensor's noise, and holes */
    IMAGE_RANDOM,   /* each pixel for itself, a fifth of them invalid */
    IMAGE_SMOOTH,   /* one bent surface without holes */
    IMAGE_EMPTY,
    IMAGE_KINDS
} image_kind;

/* A padded plane of depths. */
float *bench_depth(bench *b, const kernel_camera *c, kernel_noise noise, image_kind kind);
/* A padded plane whose pixels are all set to value and whose margin is zero. */
float *bench_plane(const kernel_camera *c, int planes, float value);
/* Sizes that are no multiples of eight or of tiles, and some that are; widths whose last sixteen are filled to various
 * parts. */
typedef struct {
    int width, height;
} image_size;
int bench_sizes(const bench *b, const image_size **sizes);

extern const kernel_noise bench_noise; /* like the default settings', all three parts */

/* ---- comparisons ---- */

/* |got - want| <= tolerance, which also fails for NaN. On a failure, reports the position. */
bool bench_near(bench *b, const char *what, int x, int y, double got, double want, double tolerance);
/* Compares the pixels of a padded plane where doubt isn't set, and verifies that the margin is still zero. */
void bench_compare_plane(bench *b, const char *what, const kernel_camera *c, const float *got,
                         const float *want, const uint8_t *doubt, double relative, double absolute);
void bench_compare_bytes(bench *b, const char *what, const void *got, const void *want, size_t size);

/* ---- a surface of blocks ---- */

typedef struct {
    kernel_surface surface;
    int capacity, count;
    cl_int4 *blocks, *table;
    int entries; /* of the table */
    int16_t *voxels;
    cl_mem blocks_memory, table_memory, voxels_memory; /* after bench_volume_upload */
} bench_volume;

void bench_volume_make(bench_volume *v, int capacity, float voxel, float truncation);
void bench_volume_free(bench_volume *v);
/* The place of a block, made when it isn't there. */
int bench_volume_add(bench_volume *v, int x, int y, int z);
void bench_volume_upload(bench *b, bench_volume *v);

/* A signed distance, positive outside, in metres. */
typedef double (*bench_shape)(const double p[3]);
/* radius 0.23 about (0.02, -0.03, 0.9), in front of a wall at z = 1.4 */
double bench_ball(const double p[3]);
#define BENCH_SHIFT 8
double bench_ball_shifted(const double p[3]); /* the same, moved by BENCH_SHIFT along each axis */
/* Adds the blocks within low..high (metres) that come within a truncation of the shape, all voxels seen. */
void bench_volume_fill(bench_volume *v, bench_shape shape, const double low[3], const double high[3]);

/* ---- each kernel against its reference (kernel_checks_maps.c, _align.c, _volume.c, _seen.c, _surface.c) ---- */

void compare_convert_depth(bench *b, const uint16_t *raw, const kernel_depth_source *s,
                           const kernel_camera *c, kernel_noise noise);
void compare_smooth_depth(bench *b, const float *depth, const kernel_camera *c, kernel_noise noise, int step,
                          float from_m);
void compare_halve_depth(bench *b, const float *fine, const kernel_camera *f, kernel_noise noise);
void compare_normal_map(bench *b, const float *depth, const kernel_camera *c, kernel_noise noise);
void compare_pack_map(bench *b, const float *depth, const float *normals, const kernel_camera *c);
void compare_halve_map(bench *b, const float *fine, const kernel_camera *f);
/* Pixels in doubt lose their confidence (in normals) before the comparison. */
void compare_align_reduce(bench *b, const float *depth, float *normals, const kernel_camera *c,
                          const float *model, const kernel_camera *mc, const kernel_rigid *motion,
                          const kernel_pair_limits *limits);
void compare_request_blocks(bench *b, const float *depth, const kernel_camera *c,
                            const kernel_rigid *camera_to_world, bench_volume *v, float block_m, cl_int turn);
void compare_pack_planes(bench *b, const float *raw, const float *smooth, float from_m, const float *normals,
                         const kernel_camera *c, kernel_noise noise);
void compare_fuse_blocks(bench *b, const float *depth, const float *normals, const kernel_camera *c,
                         kernel_noise noise, const kernel_rigid *world_to_camera, bench_volume *v,
                         float max_weight);
void compare_ranges(bench *b, bench_volume *v, const kernel_camera *c, const kernel_rigid *world_to_camera,
                    float near_m, float far_m);
/* A view to ray-cast, and the criteria for it. */
typedef struct {
    kernel_camera c;
    pose camera_to_world;
    float near_m, far_m;
    const float *scan; /* raycast_near, within reach of these depths; NULL: raycast */
    float reach;
    bench_shape truth; /* the shape that the volume holds, or NULL */
    double allowed;    /* the share of unambiguous pixels that may differ */
} bench_view;
void compare_raycast(bench *b, bench_volume *v, const bench_view *view);
/* Compares the counts, and with emit also the triangles. */
void compare_triangles(bench *b, bench_volume *v, float min_weight, bool emit);

fathom_check check_convert_depth(device *d, bool small, char *why, size_t size);
fathom_check check_smooth_depth(device *d, bool small, char *why, size_t size);
fathom_check check_halve_depth(device *d, bool small, char *why, size_t size);
fathom_check check_normal_map(device *d, bool small, char *why, size_t size);
fathom_check check_pack_map(device *d, bool small, char *why, size_t size);
fathom_check check_halve_map(device *d, bool small, char *why, size_t size);
fathom_check check_align_reduce(device *d, bool small, char *why, size_t size);
fathom_check check_align_not_finite(device *d, bool small, char *why, size_t size);
fathom_check check_request_blocks(device *d, bool small, char *why, size_t size);
fathom_check check_clear_blocks(device *d, bool small, char *why, size_t size);
fathom_check check_mark_seen(device *d, bool small, char *why, size_t size);
fathom_check check_pack_planes(device *d, bool small, char *why, size_t size);
fathom_check check_fuse_blocks(device *d, bool small, char *why, size_t size);
fathom_check check_clear_ranges(device *d, bool small, char *why, size_t size);
fathom_check check_range_blocks(device *d, bool small, char *why, size_t size);
fathom_check check_raycast(device *d, bool small, char *why, size_t size);
fathom_check check_raycast_near(device *d, bool small, char *why, size_t size);
fathom_check check_count_triangles(device *d, bool small, char *why, size_t size);
fathom_check check_emit_triangles(device *d, bool small, char *why, size_t size);

#endif
