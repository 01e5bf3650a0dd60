/* What a device can do at most, through OpenCL. */
#ifndef FATHOM_BENCH_MACHINE_LIMIT_H
#define FATHOM_BENCH_MACHINE_LIMIT_H

#include "cl/launch.h"

typedef struct {
    double read, write, copy; /* bytes a second, buffers larger than the caches; copy: read and written */
    double fma8, fma16; /* fused multiply-adds a second, of float8 and float16; each counts once a lane */
    double launch_ms, queued_ms; /* an empty kernel and a wait; one of twenty that are waited for together */
    cl_program program;
    cl_kernel evict;
    cl_mem large; /* larger than the caches */
    cl_mem sums;  /* what is read adds up to, a float an item */
    size_t bytes; /* of the large one */
    size_t items; /* work-items that stream through it */
} machine_limit;

/* Measures; each figure is the best of several. FATHOM_OK or FATHOM_ERROR_DEVICE. */
int machine_limit_measure(machine_limit *m, device *d);

/* Reads so much memory that the caches hold nothing else; waits. */
void machine_limit_evict(machine_limit *m, device *d);

void machine_limit_close(machine_limit *m);

#endif
