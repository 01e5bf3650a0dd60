/* Launches of kernels. */
#ifndef FATHOM_LAUNCH_H
#define FATHOM_LAUNCH_H

#include "cl/device.h"

cl_kernel device_kernel(device *d, const char *name);

/* Waits until the queue is done. */
void device_wait(device *d);

/* Starts the queued work, without waiting. */
void device_flush(device *d);

typedef struct {
    size_t size;
    const void *value;
} device_argument;

#define ARG(v)                                                                                               \
    { sizeof(v), &(v) }

/* Queues a kernel over columns x rows work-items (rows 1: one dimension). group 0: the runtime chooses the
 * work-group. */
void device_run(device *d, cl_kernel kernel, size_t columns, size_t rows, size_t group, int count,
                const device_argument *arguments);
#define RUN(d, kernel, columns, rows, group, ...)                                                            \
    device_run(d, kernel, columns, rows, group,                                                              \
               (int)(sizeof((device_argument[]){__VA_ARGS__}) / sizeof(device_argument)),                    \
               (device_argument[]){__VA_ARGS__})

/* Queues a kernel that walks along rows: on a CPU one work-item per row, on a GPU several share a row. */
#define RUN_ROWS(d, kernel, columns, rows, ...)                                                              \
    RUN(d, kernel, (d)->cpu ? 1 : (size_t)(columns), (size_t)(rows), (d)->cpu ? 1 : 0, __VA_ARGS__)

#endif
