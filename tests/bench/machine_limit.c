#include "machine_limit.h"

#include <stdio.h>
#include <string.h>
#include <time.h>

#define REPEATS 7
#define FMA_ROUNDS 4096
#define FMA_CHAINS 10 /* independent of each other: as many as hide the latency */

/* A CPU's work-item streams through a stretch of its own, a GPU's through every n-th vector. */
static const char source[] =
    "#if CPU\n"
    "#define EACH(i, n) for (size_t i = get_global_id(0) * (n / get_global_size(0)), e = i + n / "
    "get_global_size(0); i < e; i++)\n"
    "#else\n"
    "#define EACH(i, n) for (size_t i = get_global_id(0); i < n; i += get_global_size(0))\n"
    "#endif\n"
    "kernel void stream_read(global const float16 *from, ulong n, global float *sums) {\n"
    "    float16 a = 0.0f, b = 0.0f;\n"
    "    EACH(i, n) { if (i & 1) a += from[i]; else b += from[i]; }\n"
    "    a += b;\n"
    "    float8 h = a.lo + a.hi;\n"
    "    sums[get_global_id(0)] = h.s0 + h.s1 + h.s2 + h.s3 + h.s4 + h.s5 + h.s6 + h.s7;\n"
    "}\n"
    "kernel void stream_write(global float16 *to, ulong n) { EACH(i, n) to[i] = 1.0f; }\n"
    "kernel void stream_copy(global float16 *to, ulong n) {\n"
    "    global const float16 *from = to + n;\n"
    "    EACH(i, n) to[i] = from[i];\n"
    "}\n"
    "#define CHAIN(V) kernel void fma_##V(float x, int rounds, global float *sums) { \\\n"
    "    V a = x, b = x + 1, c = x + 2, d = x + 3, e = x + 4, f = x + 5, g = x + 6, h = x + 7, i = x + 8, j "
    "= x + 9, m = 0.999f; \\\n"
    "    for (int k = 0; k < rounds; k++) { \\\n"
    "        a = fma(a, m, m); b = fma(b, m, m); c = fma(c, m, m); d = fma(d, m, m); e = fma(e, m, m); \\\n"
    "        f = fma(f, m, m); g = fma(g, m, m); h = fma(h, m, m); i = fma(i, m, m); j = fma(j, m, m); \\\n"
    "    } \\\n"
    "    a += b + c + d + e + f + g + h + i + j; \\\n"
    "    sums[get_global_id(0)] = a.s0 + a.s1 + a.s2 + a.s3 + a.s4 + a.s5 + a.s6 + a.s7; }\n"
    "CHAIN(float8)\n"
    "CHAIN(float16)\n"
    "kernel void empty(int nothing) {}\n";

static double now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static size_t size_info(device *d, cl_device_info what) {
    cl_ulong value = 0;
    clGetDeviceInfo(d->id, what, sizeof value, &value, NULL);
    return (size_t)value;
}

/* The least seconds of several launches, each waited for. */
static double best_of(device *d, cl_kernel kernel, size_t items, size_t group) {
    double best = 1e30;
    for (int i = 0; i < REPEATS; i++) {
        double start = now_s();
        if (clEnqueueNDRangeKernel(d->queue, kernel, 1, NULL, &items, &group, 0, NULL, NULL) != CL_SUCCESS ||
            clFinish(d->queue) != CL_SUCCESS) {
            d->error = FATHOM_ERROR_DEVICE;
            return 1;
        }
        double took = now_s() - start;
        if (i > 0 && took < best) best = took; /* the first compiles */
    }
    return best;
}

/* The kernel with its arguments set, timed. */
static double timed(machine_limit *m, device *d, const char *name, size_t items, size_t group, int count,
                    const device_argument *arguments) {
    cl_int e;
    cl_kernel kernel = clCreateKernel(m->program, name, &e);
    for (int i = 0; kernel && e == CL_SUCCESS && i < count; i++)
        e = clSetKernelArg(kernel, (cl_uint)i, arguments[i].size, arguments[i].value);
    if (e != CL_SUCCESS) d->error = FATHOM_ERROR_DEVICE;
    double s = e == CL_SUCCESS ? best_of(d, kernel, items, group) : 1;
    if (kernel) clReleaseKernel(kernel);
    return s;
}
#define TIMED(name, items, group, ...)                                                                       \
    timed(m, d, name, items, group,                                                                          \
          (int)(sizeof((device_argument[]){__VA_ARGS__}) / sizeof(device_argument)),                         \
          (device_argument[]){__VA_ARGS__})

static void measure_launches(machine_limit *m, device *d) {
    cl_int nothing = 0;
    size_t one = 1;
    m->launch_ms = 1e3 * TIMED("empty", 1, 1, ARG(nothing));
    cl_int e;
    cl_kernel kernel = clCreateKernel(m->program, "empty", &e);
    clSetKernelArg(kernel, 0, sizeof nothing, &nothing);
    double best = 1e30;
    for (int i = 0; i < 20; i++) {
        double start = now_s();
        for (int k = 0; k < 20; k++)
            clEnqueueNDRangeKernel(d->queue, kernel, 1, NULL, &one, &one, 0, NULL, NULL);
        clFinish(d->queue);
        if (now_s() - start < best) best = now_s() - start;
    }
    m->queued_ms = 1e3 * best / 20;
    clReleaseKernel(kernel);
}

int machine_limit_measure(machine_limit *m, device *d) {
    cl_int e;
    memset(m, 0, sizeof *m);
    char options[64];
    const char *text = source;
    snprintf(options, sizeof options, "-cl-std=CL1.2 -DCPU=%d", d->cpu);
    m->program = clCreateProgramWithSource(d->context, 1, &text, NULL, &e);
    if (!m->program || clBuildProgram(m->program, 1, &d->id, options, NULL, NULL) != CL_SUCCESS)
        return FATHOM_ERROR_DEVICE;
    size_t units = size_info(d, CL_DEVICE_MAX_COMPUTE_UNITS) & 0xffff, group = (size_t)d->group;
    size_t most = size_info(d, CL_DEVICE_MAX_MEM_ALLOC_SIZE);
    m->bytes = 4 * size_info(d, CL_DEVICE_GLOBAL_MEM_CACHE_SIZE);
    if (m->bytes < (size_t)64 << 20) m->bytes = (size_t)64 << 20;
    if (m->bytes > most / 2) m->bytes = most / 2;
    m->items = units * (d->cpu ? 128 : 16 * group);
    m->bytes = m->bytes / (m->items * 128) * (m->items * 128);
    m->large = clCreateBuffer(d->context, CL_MEM_READ_WRITE, m->bytes, NULL, &e);
    m->sums = clCreateBuffer(d->context, CL_MEM_READ_WRITE, m->items * 4, NULL, &e);
    if (!m->large || !m->sums) return FATHOM_ERROR_DEVICE;

    cl_ulong all = m->bytes / 64, half = all / 2;
    cl_int rounds = FMA_ROUNDS;
    cl_float x = 0.5f;
    m->write = (double)m->bytes / TIMED("stream_write", m->items, group, ARG(m->large), ARG(all));
    m->read = (double)m->bytes / TIMED("stream_read", m->items, group, ARG(m->large), ARG(all), ARG(m->sums));
    m->copy = (double)m->bytes / TIMED("stream_copy", m->items, group, ARG(m->large), ARG(half));
    double sets = (double)m->items * FMA_ROUNDS * FMA_CHAINS;
    m->fma8 = 8 * sets / TIMED("fma_float8", m->items, group, ARG(x), ARG(rounds), ARG(m->sums));
    m->fma16 = 16 * sets / TIMED("fma_float16", m->items, group, ARG(x), ARG(rounds), ARG(m->sums));
    measure_launches(m, d);
    m->evict = clCreateKernel(m->program, "stream_read", &e);
    if (!m->evict) return FATHOM_ERROR_DEVICE;
    clSetKernelArg(m->evict, 0, sizeof m->large, &m->large);
    clSetKernelArg(m->evict, 1, sizeof all, &all);
    clSetKernelArg(m->evict, 2, sizeof m->sums, &m->sums);
    return d->error;
}

void machine_limit_evict(machine_limit *m, device *d) {
    size_t group = (size_t)d->group;
    clEnqueueNDRangeKernel(d->queue, m->evict, 1, NULL, &m->items, &group, 0, NULL, NULL);
    clFinish(d->queue);
}

void machine_limit_close(machine_limit *m) {
    if (m->evict) clReleaseKernel(m->evict);
    if (m->sums) clReleaseMemObject(m->sums);
    if (m->large) clReleaseMemObject(m->large);
    if (m->program) clReleaseProgram(m->program);
}
