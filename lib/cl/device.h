/* The OpenCL device: choice, context and queue, and its first error. cl/program.h builds its kernels, cl/buffer.h makes
 * its buffers, cl/launch.h runs the kernels. */
#ifndef FATHOM_DEVICE_H
#define FATHOM_DEVICE_H

#define CL_TARGET_OPENCL_VERSION 120
#include <CL/cl.h>
#include <stdbool.h>
#include <stddef.h>

#include "fathom.h"

typedef struct {
    const fathom_config *config; /* for the log, the choice and the cache */
    cl_platform_id platform;
    cl_device_id id;
    cl_context context;
    cl_command_queue queue;
    cl_program program;
    bool buffers_in_block; /* buffers lie in the caller's block */
    bool cpu;              /* kernels in their CPU shape: one work-item per strip */
    int lanes;             /* pixels that a work-item processes at once (LANES in opencl/common.cl) */
    int wide;              /* the same in kernels that gain from more (WIDE) */
    int group;             /* work-items that share a row in align_reduce: 1 on a CPU */
    size_t device_bytes;   /* of buffers that don't lie in the block */
    int error;             /* the first failure: a fathom_error, or FATHOM_OK */
    uint64_t built_for;    /* identifies sources, options, device and driver of the program */
    bool to_cache;         /* it was built from source and is to be cached */
    char name[128];
} device;

/* Chooses the device and where its buffers will lie; opens nothing. FATHOM_OK or FATHOM_ERROR_DEVICE. */
int device_choose(device *d, const fathom_config *config);

/* Opens context and queue on the chosen device and builds the kernels. FATHOM_OK, _DEVICE or _KERNEL (nothing stays
 * open). */
int device_open(device *d);
void device_close(device *d);

/* Notes that an OpenCL call failed; the first failure is logged. The device is dead from then on: nothing is launched,
 * mapped, cleared or waited for any more, so that results from before and after the failure aren't mixed. Callers check
 * d->error before they use results of the device. */
void device_failed(device *d, const char *what, cl_int code);

#endif
