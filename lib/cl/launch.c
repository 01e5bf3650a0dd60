#include "cl/launch.h"

void device_wait(device *d) {
    if (d->error != FATHOM_OK) return;
    cl_int e = clFinish(d->queue);
    if (e != CL_SUCCESS) device_failed(d, "waiting", e);
}

void device_flush(device *d) {
    if (d->error != FATHOM_OK) return;
    cl_int e = clFlush(d->queue);
    if (e != CL_SUCCESS) device_failed(d, "starting", e);
}

cl_kernel device_kernel(device *d, const char *name) {
    cl_int e;
    cl_kernel k = clCreateKernel(d->program, name, &e);
    if (!k) device_failed(d, name, e);
    return k;
}

void device_run(device *d, cl_kernel kernel, size_t columns, size_t rows, size_t group, int count,
                const device_argument *arguments) {
    if (d->error != FATHOM_OK || columns == 0 || rows == 0) return;
    for (int i = 0; i < count; i++) {
        cl_int e = clSetKernelArg(kernel, (cl_uint)i, arguments[i].size, arguments[i].value);
        if (e != CL_SUCCESS) {
            device_failed(d, "setting a kernel's argument", e);
            return;
        }
    }
    size_t global[2] = {columns, rows}, local[2] = {group, 1};
    cl_int e = clEnqueueNDRangeKernel(d->queue, kernel, rows > 1 ? 2 : 1, NULL, global, group ? local : NULL,
                                      0, NULL, NULL);
    if (e != CL_SUCCESS) device_failed(d, "starting a kernel", e);
}
