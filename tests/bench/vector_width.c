/* Loaded before a program (LD_PRELOAD): devices then have native vectors of 8 floats, as an AVX2 CPU has, whatever this
 * one has. */
#define CL_TARGET_OPENCL_VERSION 120
#include <dlfcn.h>
#include <string.h>

#include <CL/cl.h>

cl_int clGetDeviceInfo(cl_device_id device, cl_device_info what, size_t size, void *value,
                       size_t *value_size) {
    static cl_int (*next)(cl_device_id, cl_device_info, size_t, void *, size_t *);
    if (!next) *(void **)&next = dlsym(RTLD_NEXT, "clGetDeviceInfo");
    const cl_int e = next(device, what, size, value, value_size);
    const cl_uint width = 8;
    if (e == CL_SUCCESS && what == CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT && value && size >= sizeof width)
        memcpy(value, &width, sizeof width);
    return e;
}
