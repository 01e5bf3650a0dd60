/* Checks that run the kernels of opencl/ on a device and compare what they write with the reference (reference.h): on
 * random images of odd sizes, on all-invalid frames, at edges and limits, and on a real frame where there is one.
 * `fathom selftest` and tests/unit/cl/test_kernels.c run them. */
#ifndef FATHOM_TESTS_KERNEL_CHECKS_H
#define FATHOM_TESTS_KERNEL_CHECKS_H

#include "cl/buffer.h"
#include "cl/launch.h"

typedef enum { CHECK_PASSED, CHECK_FAILED, CHECK_SKIPPED } check_result;

typedef struct {
    const char *name; /* the kernel's, or what it is about */
    /* Runs on an open device. why: one line on what failed, or why it was skipped; else empty. */
    check_result (*run)(device *d, char *why, size_t size);
} kernel_check;

extern const kernel_check kernel_checks[];
extern const int kernel_check_count;

/* How the kernels are built: as the device has them, as for a CPU with vectors of eight where it has sixteen and the other
 * way round (WIDE), or as for a GPU (LANES=1, WIDE=1, GROUP=64). A CPU can do all of them. */
typedef enum { SHAPE_OWN, SHAPE_OTHER, SHAPE_GPU } kernel_shape;

/* Opens a device for the checks: config is set to the default settings with this part of a platform's or device's name,
 * buffer mode and log, and must outlive the device. FATHOM_OK or an error; nothing stays open after one. */
int kernel_checks_open(device *d, fathom_config *config, const char *name, fathom_buffers buffers,
                       kernel_shape shape, fathom_log log, void *log_user);

#endif
