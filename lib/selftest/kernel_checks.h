/* Checks that run the kernels of opencl/ on a device and compare their output with the reference (reference.h): on
 * random images of odd sizes, on all-invalid frames, at edges and limits. fathom_selftest and
 * tests/unit/cl/test_kernels.c run them. They allocate from the heap. */
#ifndef FATHOM_KERNEL_CHECKS_H
#define FATHOM_KERNEL_CHECKS_H

#include "cl/buffer.h"
#include "cl/launch.h"

typedef struct {
    const char *name; /* the kernel's, or the subject */
    /* Runs on an open device. small: few pixels, and buffers of exact size, for Oclgrind. why: one line on the failure
     * or the reason for skipping; else empty. */
    fathom_check (*run)(device *d, bool small, char *why, size_t size);
    bool wide; /* its kernel depends on WIDE (opencl/common.cl) */
} kernel_check;

extern const kernel_check kernel_checks[];
extern const int kernel_check_count;

/* How the kernels are built: for the device; for a CPU with vectors of eight where it has sixteen, and vice versa
 * (WIDE); or for a GPU (LANES=1, WIDE=1, GROUP=64). A CPU can run all of them. */
typedef enum { SHAPE_OWN, SHAPE_OTHER, SHAPE_GPU } kernel_shape;

/* Opens the device that the settings choose, for the checks. The settings must outlive it. FATHOM_OK or an error;
 * nothing stays open after one. */
int kernel_checks_open(device *d, const fathom_config *config, kernel_shape shape);

#endif
