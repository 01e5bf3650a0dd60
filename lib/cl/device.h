/* The OpenCL device: choice, kernels (built once, kept in a cache), buffers, launches. The only file that knows where a
 * buffer lies. Every call of the step goes through here; the first error sticks and is asked for once, at the step's end. */
#ifndef FATHOM_DEVICE_H
#define FATHOM_DEVICE_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <stdbool.h>
#include <stddef.h>

#include "base/arena.h"
#include "fathom.h"

typedef struct {
    const fathom_config *config; /* for the log, the choice and the cache */
    cl_platform_id platform;
    cl_device_id id;
    cl_context context;
    cl_command_queue queue;
    cl_program program;
    bool buffers_in_block; /* buffers lie in the caller's block */
    bool cpu;              /* kernels in their CPU shape: one work-item works on a strip by itself */
    int lanes;             /* pixels that a work-item works on at once (LANES in opencl/common.cl) */
    int wide;              /* the same where more pay (WIDE) */
    int group;             /* work-items that share a row in align_reduce: 1 on a CPU */
    size_t device_bytes;   /* of buffers that don't lie in the block */
    int error;             /* the first failure: a fathom_error, or FATHOM_OK */
    uint64_t built_for;    /* identifies sources, options, device and driver of the program */
    bool to_cache;         /* it was built from source and is wanted in the cache */
    char name[128];
} device;

/* A buffer of the device; bytes of it may be looked at between device_map and device_unmap. */
typedef struct {
    cl_mem memory;
    void *host; /* where it lies in the block, or NULL */
    size_t size;
} device_buffer;

/* Chooses the device and says where its buffers will lie; opens nothing. FATHOM_OK or FATHOM_ERROR_DEVICE. */
int device_choose(device *d, const fathom_config *config);

/* Opens context and queue on the chosen device and builds the kernels. FATHOM_OK, _DEVICE or _KERNEL (nothing stays open). */
int device_open(device *d);
void device_close(device *d);

/* Writes the built program, with every kernel that was launched, to a file for config->kernel_file. */
bool device_save_program(device *d, const char *path);

/* Keeps a program that was built from source in the cache. To be called when each kernel has been launched: PoCL builds them
 * for their work-groups only then, and asked earlier would give a program without these. */
void device_cache_program(device *d);

/* Plans a buffer, and makes it when the device is open: in the arena or on the device. Not cleared. */
void device_buffer_make(device *d, arena *a, size_t size, device_buffer *buffer);
void device_buffer_free(device_buffer *buffer);

/* Waits for what was queued, and gives the host's view of the buffer; NULL after an error. */
void *device_map(device *d, device_buffer *buffer, cl_map_flags flags);
void device_unmap(device *d, device_buffer *buffer, void *mapped);

/* Queues filling with zeros. */
void device_clear(device *d, device_buffer *buffer);
void device_wait(device *d);

/* Starts what was queued, without waiting. */
void device_flush(device *d);

cl_kernel device_kernel(device *d, const char *name);

typedef struct {
    size_t size;
    const void *value;
} device_argument;

#define ARG(v)                                                                                               \
    { sizeof(v), &(v) }

/* Queues a kernel over columns x rows work-items (rows 1: one dimension). group 0: the runtime chooses the work-group. */
void device_run(device *d, cl_kernel kernel, size_t columns, size_t rows, size_t group, int count,
                const device_argument *arguments);
#define RUN(d, kernel, columns, rows, group, ...)                                                            \
    device_run(d, kernel, columns, rows, group,                                                              \
               (int)(sizeof((device_argument[]){__VA_ARGS__}) / sizeof(device_argument)),                    \
               (device_argument[]){__VA_ARGS__})

/* Queues a kernel that walks along rows: on a CPU a work-item takes a row, on a GPU each its part of one. */
#define RUN_ROWS(d, kernel, columns, rows, ...)                                                              \
    RUN(d, kernel, (d)->cpu ? 1 : (size_t)(columns), (size_t)(rows), (d)->cpu ? 1 : 0, __VA_ARGS__)

#endif
