#include "opencl_shim.h"

#define CL_TARGET_OPENCL_VERSION 120
#define CL_USE_DEPRECATED_OPENCL_1_2_APIS
#include <CL/cl.h>
#include <stddef.h>

const char *const shim_names[SHIM_KINDS] = {
    "clCreateContext",         "clCreateCommandQueue",   "clCreateProgramWithSource", "clBuildProgram",
    "clCreateKernel",          "clCreateBuffer",         "clSetKernelArg",            "clEnqueueNDRangeKernel",
    "clEnqueueMapBuffer",      "clEnqueueUnmapMemObject", "clEnqueueFillBuffer",      "clFinish",
    "clFlush",
};

static int counts[SHIM_KINDS], failing = SHIM_KINDS, nth, later;
static bool has_failed;

void shim_start(void) {
    shim_fail(SHIM_KINDS, 0);
}

void shim_fail(shim_kind kind, int number) {
    for (int i = 0; i < SHIM_KINDS; i++) counts[i] = 0;
    failing = kind;
    nth = number;
    later = 0;
    has_failed = false;
}

int shim_count(shim_kind kind) {
    return counts[kind];
}

bool shim_failed(void) {
    return has_failed;
}

int shim_later(void) {
    return later;
}

static bool fails(shim_kind kind) {
    bool now = kind == (shim_kind)failing && counts[kind] == nth;
    counts[kind]++;
    later += has_failed && (kind == SHIM_LAUNCH || kind == SHIM_MAP || kind == SHIM_FILL || kind == SHIM_FLUSH);
    has_failed |= now;
    return now;
}

/* A function that returns what it makes, and its code through the last argument. */
#define MAKER(kind, type, name, parameters, arguments)                                                             \
    type __real_##name parameters;                                                                                 \
    type __wrap_##name parameters;                                                                                 \
    type __wrap_##name parameters {                                                                                \
        if (!fails(kind)) return __real_##name arguments;                                                          \
        if (e) *e = CL_OUT_OF_RESOURCES;                                                                           \
        return NULL;                                                                                               \
    }
/* A function that returns its code. */
#define DOER(kind, name, parameters, arguments)                                                                    \
    cl_int __real_##name parameters;                                                                               \
    cl_int __wrap_##name parameters;                                                                               \
    cl_int __wrap_##name parameters {                                                                              \
        return fails(kind) ? CL_OUT_OF_RESOURCES : __real_##name arguments;                                        \
    }
/* The same, and the call is made all the same. */
#define LATE_DOER(kind, name, parameters, arguments)                                                               \
    cl_int __real_##name parameters;                                                                               \
    cl_int __wrap_##name parameters;                                                                               \
    cl_int __wrap_##name parameters {                                                                              \
        const cl_int e = __real_##name arguments;                                                                  \
        return fails(kind) ? CL_OUT_OF_RESOURCES : e;                                                              \
    }

typedef void(CL_CALLBACK *context_notify)(const char *, const void *, size_t, void *);
typedef void(CL_CALLBACK *program_notify)(cl_program, void *);

MAKER(SHIM_CONTEXT, cl_context, clCreateContext,
      (const cl_context_properties *p, cl_uint n, const cl_device_id *d, context_notify f, void *u, cl_int *e),
      (p, n, d, f, u, e))
MAKER(SHIM_QUEUE, cl_command_queue, clCreateCommandQueue,
      (cl_context c, cl_device_id d, cl_command_queue_properties p, cl_int *e), (c, d, p, e))
MAKER(SHIM_SOURCE, cl_program, clCreateProgramWithSource,
      (cl_context c, cl_uint n, const char **s, const size_t *l, cl_int *e), (c, n, s, l, e))
DOER(SHIM_BUILD, clBuildProgram,
     (cl_program p, cl_uint n, const cl_device_id *d, const char *o, program_notify f, void *u), (p, n, d, o, f, u))
MAKER(SHIM_KERNEL, cl_kernel, clCreateKernel, (cl_program p, const char *n, cl_int *e), (p, n, e))
MAKER(SHIM_BUFFER, cl_mem, clCreateBuffer, (cl_context c, cl_mem_flags f, size_t n, void *h, cl_int *e),
      (c, f, n, h, e))
DOER(SHIM_ARGUMENT, clSetKernelArg, (cl_kernel k, cl_uint i, size_t n, const void *v), (k, i, n, v))
DOER(SHIM_LAUNCH, clEnqueueNDRangeKernel,
     (cl_command_queue q, cl_kernel k, cl_uint d, const size_t *o, const size_t *g, const size_t *l, cl_uint n,
      const cl_event *w, cl_event *v),
     (q, k, d, o, g, l, n, w, v))
MAKER(SHIM_MAP, void *, clEnqueueMapBuffer,
      (cl_command_queue q, cl_mem m, cl_bool b, cl_map_flags f, size_t o, size_t s, cl_uint n, const cl_event *w,
       cl_event *v, cl_int *e),
      (q, m, b, f, o, s, n, w, v, e))
LATE_DOER(SHIM_UNMAP, clEnqueueUnmapMemObject,
          (cl_command_queue q, cl_mem m, void *p, cl_uint n, const cl_event *w, cl_event *v), (q, m, p, n, w, v))
DOER(SHIM_FILL, clEnqueueFillBuffer,
     (cl_command_queue q, cl_mem m, const void *p, size_t ps, size_t o, size_t s, cl_uint n, const cl_event *w,
      cl_event *v),
     (q, m, p, ps, o, s, n, w, v))
LATE_DOER(SHIM_FINISH, clFinish, (cl_command_queue q), (q))
LATE_DOER(SHIM_FLUSH, clFlush, (cl_command_queue q), (q))
