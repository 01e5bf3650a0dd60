#include "selftest/kernel_checks_bench.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define GUARD 256 /* bytes behind each buffer's end that must stay unchanged */
#define GUARD_BYTE 0x5a

const kernel_noise bench_noise = {0.0001f, 0.0005f, 0.003f};

/* ---- a run -------------------------------------------------------------------------------------------------- */

void bench_start(bench *b, device *d, bool small, char *why, size_t size) {
    memset(b, 0, sizeof *b);
    b->d = d;
    b->why = why;
    b->why_size = size;
    b->small = small;
    b->shift = b->small ? BENCH_SHIFT : 0;
    b->random = 20140407;
    *why = 0;
    d->error = FATHOM_OK;
}

void bench_fail(bench *b, const char *format, ...) {
    if (b->failed) return;
    b->failed = true;
    va_list args;
    va_start(args, format);
    vsnprintf(b->why, b->why_size, format, args);
    va_end(args);
}

fathom_check bench_end(bench *b) {
    bench_free(b);
    /* Doubt is for rare comparisons within rounding of their threshold: if it were common, nothing would be checked. */
    if (b->doubtful > 5 + b->compared / 25)
        bench_fail(b, "%ld of %ld results in doubt", b->doubtful, b->doubtful + b->compared);
    return b->failed ? FATHOM_CHECK_FAILED : FATHOM_CHECK_PASSED;
}

void *bench_alloc(size_t size) {
    void *p = calloc(1, size + 64);
    if (!p) {
        perror("kernel checks");
        abort();
    }
    return p;
}

/* ---- buffers -------------------------------------------------------------------------------------------------- */

/* Made as by the library, and GUARD bytes longer; under Oclgrind of exact size, so that it detects any access
 * beyond. */
cl_mem bench_buffer(bench *b, size_t size, const void *content) {
    if (b->count == BENCH_BUFFERS) {
        bench_fail(b, "more than %d buffers", BENCH_BUFFERS);
        return NULL;
    }
    device_buffer *buffer = &b->buffers[b->count].buffer;
    size_t whole = (size + GUARD + ARENA_ALIGNMENT - 1) / ARENA_ALIGNMENT * ARENA_ALIGNMENT;
    void *block = NULL;
    if (b->small) {
        cl_int e;
        *buffer =
            (device_buffer){clCreateBuffer(b->d->context, CL_MEM_READ_WRITE, size, NULL, &e), NULL, size};
        whole = size;
    } else {
        arena a = {NULL, whole, 0};
        if (posix_memalign(&block, ARENA_ALIGNMENT, whole)) abort();
        a.base = block;
        device_buffer_make(b->d, &a, whole, buffer);
    }
    b->buffers[b->count].block = block;
    b->buffers[b->count++].size = size;
    unsigned char *p = buffer->memory ? device_map(b->d, buffer, CL_MAP_WRITE) : NULL;
    if (!p) {
        bench_fail(b, "no buffer of %zu bytes", size);
        return buffer->memory;
    }
    if (content)
        memcpy(p, content, size);
    else
        memset(p, 0, size);
    memset(p + size, GUARD_BYTE, whole - size);
    device_unmap(b->d, buffer, p);
    return buffer->memory;
}

void bench_read(bench *b, cl_mem memory, void *content, size_t size) {
    if (clEnqueueReadBuffer(b->d->queue, memory, CL_TRUE, 0, size, content, 0, NULL, NULL) != CL_SUCCESS)
        bench_fail(b, "a buffer can't be read");
}

cl_mem bench_model(bench *b, int count, float *model) {
    size_t bytes = (size_t)count * sizeof(cl_uint2);
    cl_uint2 *packed = bench_alloc(bytes);
    memset(packed, 0xff, bytes);
    if (model) {
        ref_pack_model(model, count, packed);
        ref_unpack_model(packed, count, model);
    }
    cl_mem memory = bench_buffer(b, bytes, packed);
    free(packed);
    return memory;
}

void bench_read_model(bench *b, cl_mem memory, int count, float *model) {
    size_t bytes = (size_t)count * sizeof(cl_uint2);
    cl_uint2 *packed = bench_alloc(bytes);
    bench_read(b, memory, packed, bytes);
    ref_unpack_model(packed, count, model);
    free(packed);
}

void bench_free(bench *b) {
    if (b->d->error != FATHOM_OK) bench_fail(b, "OpenCL failed: %s", fathom_error_name(b->d->error));
    for (int i = 0; i < b->count; i++) {
        device_buffer *buffer = &b->buffers[i].buffer;
        unsigned char *p = buffer->memory ? device_map(b->d, buffer, CL_MAP_READ) : NULL;
        for (size_t k = b->buffers[i].size; p && k < buffer->size; k++)
            if (p[k] != GUARD_BYTE) {
                bench_fail(b, "buffer %d of %zu bytes was written %zu bytes behind its end", i,
                           b->buffers[i].size, k - b->buffers[i].size + 1);
                break;
            }
        device_unmap(b->d, buffer, p);
        device_wait(b->d);
        device_buffer_free(buffer);
        free(b->buffers[i].block);
    }
    b->count = 0;
}

/* ---- random input ---------------------------------------------------------------------------------------------- */

/* splitmix64 (Steele, Lea, Flood 2014) */
static uint64_t next_random(bench *b) {
    uint64_t z = b->random += 0x9e3779b97f4a7c15ull;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ z >> 27) * 0x94d049bb133111ebull;
    return z ^ z >> 31;
}

double bench_random(bench *b, double low, double high) {
    return low + (high - low) * (double)(next_random(b) >> 11) / 9007199254740992.0;
}

int bench_random_int(bench *b, int low, int high) {
    return low + (int)(next_random(b) % (uint64_t)(high - low + 1));
}

pose bench_motion(bench *b, double angle, double distance) {
    double twist[6], length = 0, turn = bench_random(b, 0.2, 1) * angle;
    for (int i = 0; i < 6; i++) twist[i] = bench_random(b, -1, 1);
    for (int i = 0; i < 3; i++) length += twist[i] * twist[i];
    for (int i = 0; i < 3; i++) twist[i] *= turn / sqrt(length);
    pose p = pose_exp(twist);
    for (int i = 0; i < 3; i++) p.t[i] = twist[3 + i] * distance;
    return p;
}

kernel_camera bench_camera(bench *b, int width, int height) {
    float f = (float)(bench_random(b, 0.85, 0.95) * (width > height ? width : height));
    return kernel_camera_of(width, height, f, f * 1.01f, (float)(0.5 * width + bench_random(b, -1, 1)),
                            (float)(0.5 * height + bench_random(b, -1, 1)));
}

float *bench_plane(const kernel_camera *c, int planes, float value) {
    float *p = bench_alloc((size_t)c->plane * (size_t)planes * sizeof *p);
    for (int k = 0; k < planes; k++)
        for (int y = 0; y < c->height; y++)
            for (int x = 0; x < c->width; x++) p[k * c->plane + ref_at(c, x, y)] = value;
    return p;
}

float *bench_depth(bench *b, const kernel_camera *c, kernel_noise noise, image_kind kind) {
    float *p = bench_plane(c, 1, 0);
    double base = bench_random(b, 0.6, 2.5), slant_x = bench_random(b, -1, 1),
           slant_y = bench_random(b, -1, 1);
    double edge_x = bench_random(b, 0.3, 0.7), edge_y = bench_random(b, 0.3, 0.7);
    for (int y = 0; y < c->height && kind != IMAGE_EMPTY; y++)
        for (int x = 0; x < c->width; x++) {
            double u = (double)x / c->width, v = (double)y / c->height;
            double z = base * (1 + 0.3 * slant_x * u + 0.3 * slant_y * v);
            if (kind == IMAGE_SMOOTH) {
                z += 0.1 * sin(5 * u + 1) * cos(4 * v);
            } else if (kind == IMAGE_RANDOM) {
                z = bench_random(b, 0, 1) < 0.2 ? 0 : bench_random(b, 0.3, 5);
            } else {
                if (u > edge_x && v > edge_y) z *= 0.7;  /* a box in front */
                if (u < 0.2 && v > 0.6) z = 1.2 + 3 * u; /* steep */
                z += ref_sigma(noise, z) * (bench_random(b, -1, 1) + bench_random(b, -1, 1));
                if (bench_random(b, 0, 1) < 0.03) z = 0;
            }
            p[ref_at(c, x, y)] = (float)z;
        }
    return p;
}

int bench_sizes(const bench *b, const image_size **sizes) {
    static const image_size few[] = {{19, 11}, {72, 9}},
                            many[] = {{37, 29}, {64, 48}, {131, 67}, {17, 3},  {1, 1},
                                      {88, 10}, {84, 9},  {20, 17},  {176, 5}, {40, 6}};
    *sizes = b->small ? few : many;
    return b->small ? 2 : 10;
}

/* ---- comparisons ------------------------------------------------------------------------------------------------- */

bool bench_near(bench *b, const char *what, int x, int y, double got, double want, double tolerance) {
    b->compared++;
    if (fabs(got - want) <= tolerance) return true;
    bench_fail(b, "%s at %d, %d: %.9g where the reference has %.9g (tolerance %.2g)", what, x, y, got, want,
               tolerance);
    return false;
}

void bench_compare_plane(bench *b, const char *what, const kernel_camera *c, const float *got,
                         const float *want, const uint8_t *doubt, double relative, double absolute) {
    for (int row = -PAD_Y; row < c->height + PAD_Y; row++)
        for (int column = -PAD_X; column < c->pitch - PAD_X; column++) {
            int at = ref_at(c, column, row);
            if (row < 0 || row >= c->height || column < 0 || column >= c->width) {
                if (got[at] != 0) bench_fail(b, "%s: the margin at %d, %d is %g", what, column, row, got[at]);
            } else if (doubt && doubt[row * c->width + column]) {
                b->doubtful++;
            } else if (!bench_near(b, what, column, row, got[at], want[at],
                                   absolute + relative * fabsf(want[at]))) {
                return;
            }
        }
}

void bench_compare_bytes(bench *b, const char *what, const void *got, const void *want, size_t size) {
    b->compared++;
    for (size_t i = 0; i < size; i++)
        if (((const unsigned char *)got)[i] != ((const unsigned char *)want)[i]) {
            bench_fail(b, "%s: byte %zu of %zu differs", what, i, size);
            return;
        }
}

/* ---- a surface of blocks ----------------------------------------------------------------------------------------- */

void bench_volume_make(bench_volume *v, int capacity, float voxel, float truncation) {
    memset(v, 0, sizeof *v);
    v->capacity = capacity;
    v->entries = 16;
    while (v->entries < capacity + capacity / 2) v->entries *= 2; /* full enough for collisions */
    v->surface = (kernel_surface){.voxel = voxel, .truncation = truncation, .mask = (cl_uint)v->entries - 1};
    v->blocks = bench_alloc((size_t)capacity * sizeof *v->blocks);
    v->table = bench_alloc(TABLE_BYTES(v->entries));
    v->voxels = bench_alloc((size_t)capacity * BLOCK_BYTES);
    for (int i = 0; i < capacity; i++) ref_clear_blocks(i, 1, v->voxels);
    memset(v->table, 0xff, TABLE_BYTES(v->entries));
}

void bench_volume_free(bench_volume *v) {
    free(v->blocks);
    free(v->table);
    free(v->voxels);
}

int bench_volume_add(bench_volume *v, int x, int y, int z) {
    const cl_int4 key = {{x, y, z, v->surface.submap}};
    cl_int *places = (cl_int *)(v->table + v->entries);
    for (cl_uint h = block_hash(x, y, z, v->surface.submap);; h++) {
        cl_uint at = h & v->surface.mask;
        if (v->table[at].s[3] == FREE_ENTRY) {
            if (v->count == v->capacity) abort();
            v->table[at] = v->blocks[v->count] = key;
            places[at] = v->count;
            return v->count++;
        }
        if (memcmp(&v->table[at], &key, sizeof key) == 0) return places[at];
    }
}

void bench_volume_upload(bench *b, bench_volume *v) {
    size_t blocks = (size_t)(v->count ? v->count : 1);
    v->blocks_memory = bench_buffer(b, blocks * sizeof *v->blocks, v->blocks);
    v->table_memory = bench_buffer(b, TABLE_BYTES(v->entries), v->table);
    v->voxels_memory = bench_buffer(b, blocks * BLOCK_BYTES, v->voxels);
}

double bench_ball(const double p[3]) {
    double x = p[0] - 0.02, y = p[1] + 0.03, z = p[2] - 0.9;
    return fmin(sqrt(x * x + y * y + z * z) - 0.23, 1.4 - p[2]);
}

double bench_ball_shifted(const double p[3]) {
    double q[3] = {p[0] - BENCH_SHIFT, p[1] - BENCH_SHIFT, p[2] - BENCH_SHIFT};
    return bench_ball(q);
}

void bench_volume_fill(bench_volume *v, bench_shape shape, const double low[3], const double high[3]) {
    double voxel = v->surface.voxel, edge = voxel * BLOCK_EDGE, truncation = v->surface.truncation;
    int from[3], to[3];
    for (int i = 0; i < 3; i++) {
        from[i] = (int)floor(low[i] / edge);
        to[i] = (int)floor(high[i] / edge);
    }
    for (int z = from[2]; z <= to[2]; z++)
        for (int y = from[1]; y <= to[1]; y++)
            for (int x = from[0]; x <= to[0]; x++) {
                double middle[3] = {(x + 0.5) * edge, (y + 0.5) * edge, (z + 0.5) * edge};
                if (fabs(shape(middle)) > truncation + 0.87 * edge) continue;
                int16_t *data = v->voxels + (size_t)bench_volume_add(v, x, y, z) * 2 * BLOCK_VOXELS;
                for (int k = 0; k < BLOCK_VOXELS; k++) {
                    double p[3] = {(x * BLOCK_EDGE + k % 8) * voxel, (y * BLOCK_EDGE + k / 8 % 8) * voxel,
                                   (z * BLOCK_EDGE + k / 64) * voxel};
                    data[k] = (int16_t)rint(32767 * fmax(fmin(shape(p) / truncation, 1), -1));
                    data[BLOCK_VOXELS + k] = 64;
                }
            }
}
