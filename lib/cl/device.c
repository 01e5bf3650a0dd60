#include "cl/device.h"

#include <ctype.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"
#include "cl/kernels.h"

/* ---- choice ---------------------------------------------------------------------------------------------------------- */

static bool contains(const char *text, const char *part) {
    for (; *text; text++) {
        size_t i = 0;
        while (part[i] && tolower((unsigned char)text[i]) == tolower((unsigned char)part[i])) i++;
        if (!part[i]) return true;
    }
    return !*part;
}

int device_choose(device *d, const fathom_config *config) {
    memset(d, 0, sizeof *d);
    d->config = config;
    const char *wanted = config->device ? config->device : "";
    cl_platform_id platforms[16];
    cl_uint platform_count = 0;
    cl_int e = clGetPlatformIDs(16, platforms, &platform_count);
    if (e != CL_SUCCESS || platform_count == 0) {
        log_write(
            config, FATHOM_LOG_ERROR,
            "no OpenCL platform found (code %d): install one, e.g. pocl-opencl-icd, or check OCL_ICD_VENDORS",
            e);
        return FATHOM_ERROR_DEVICE;
    }
    int best = -1;
    for (cl_uint p = 0; p < platform_count && p < 16; p++) {
        cl_device_id ids[16];
        cl_uint count = 0;
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, 16, ids, &count) != CL_SUCCESS) continue;
        char platform_name[128] = "";
        clGetPlatformInfo(platforms[p], CL_PLATFORM_NAME, sizeof platform_name - 1, platform_name, NULL);
        for (cl_uint i = 0; i < count && i < 16; i++) {
            char name[128] = "";
            cl_device_type type = 0;
            cl_bool unified = CL_FALSE, usable = CL_FALSE;
            clGetDeviceInfo(ids[i], CL_DEVICE_NAME, sizeof name - 1, name, NULL);
            clGetDeviceInfo(ids[i], CL_DEVICE_TYPE, sizeof type, &type, NULL);
            clGetDeviceInfo(ids[i], CL_DEVICE_HOST_UNIFIED_MEMORY, sizeof unified, &unified, NULL);
            clGetDeviceInfo(ids[i], CL_DEVICE_AVAILABLE, sizeof usable, &usable, NULL);
            bool cpu = (type & CL_DEVICE_TYPE_CPU) != 0;
            bool match = contains(platform_name, wanted) || contains(name, wanted) ||
                         (cpu && strcmp(wanted, "cpu") == 0) ||
                         ((type & CL_DEVICE_TYPE_GPU) && strcmp(wanted, "gpu") == 0);
            if (!match || !usable) continue;
            int score = (type & CL_DEVICE_TYPE_GPU) && unified ? 1 : 0;
            if (score <= best) continue;
            best = score;
            d->platform = platforms[p];
            d->id = ids[i];
            d->cpu = cpu;
            snprintf(d->name, sizeof d->name, "%s", name);
        }
    }
    if (best < 0) {
        log_write(config, FATHOM_LOG_ERROR, "no OpenCL device matches \"%s\" among %u platforms", wanted,
                  platform_count);
        return FATHOM_ERROR_DEVICE;
    }
    d->buffers_in_block =
        config->buffers == FATHOM_BUFFERS_HOST || (config->buffers == FATHOM_BUFFERS_AUTO && d->cpu);
    cl_uint vector = 1;
    clGetDeviceInfo(d->id, CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT, sizeof vector, &vector, NULL);
    d->lanes = d->cpu ? 8 : 1;
    d->wide = !d->cpu ? 1 : vector >= 16 ? 16 : 8;
    d->group = 1;
    if (!d->cpu) {
        size_t most = 1;
        cl_ulong local = 0;
        clGetDeviceInfo(d->id, CL_DEVICE_MAX_WORK_GROUP_SIZE, sizeof most, &most, NULL);
        clGetDeviceInfo(d->id, CL_DEVICE_LOCAL_MEM_SIZE, sizeof local, &local, NULL);
        d->group = most >= 64 && local >= 1024 ? 64 : 1; /* the tree takes 256 bytes */
    }
    return FATHOM_OK;
}

/* ---- programs and their cache ------------------------------------------------------------------------------------------ */

/* FNV-1a, 64 bits (Fowler, Noll, Vo). */
#define FNV_START 14695981039346656037ull
static uint64_t fnv_bytes(uint64_t h, const unsigned char *bytes, size_t size) {
    for (size_t i = 0; i < size; i++) h = (h ^ bytes[i]) * 1099511628211ull;
    return h;
}

static uint64_t fnv(uint64_t h, const char *text) {
    return fnv_bytes(h, (const unsigned char *)text, strlen(text));
}

/* A file of built kernels begins with this: an OpenCL runtime may end the program over a binary that was cut off, or is
 * another's. */
typedef struct {
    uint64_t built_for;  /* identity */
    uint64_t size, hash; /* of what follows */
} cache_header;

/* What a built program depends on: the sources, options, device and driver at hand. */
static uint64_t identity(device *d, const char *options) {
    char text[256];
    uint64_t h = fnv(FNV_START, options);
    for (int i = 0; i < kernel_count; i++) h = fnv(h, kernel_sources[i]);
    static const cl_device_info asked[] = {CL_DEVICE_NAME, CL_DEVICE_VENDOR, CL_DEVICE_VERSION,
                                           CL_DRIVER_VERSION};
    for (int i = 0; i < 4; i++) {
        memset(text, 0, sizeof text);
        clGetDeviceInfo(d->id, asked[i], sizeof text - 1, text, NULL);
        h = fnv(h, text);
    }
    return h;
}

/* The cache file for that; false: no cache is wanted or can be had. */
static bool cache_path(device *d, uint64_t built_for, char *path, size_t size) {
    const char *folder = d->config->cache_folder;
    char home[512];
    if (folder && !*folder) return false;
    if (!folder) {
        const char *base = getenv("XDG_CACHE_HOME"), *user = getenv("HOME");
        if (base && *base == '/')
            snprintf(home, sizeof home, "%s", base);
        else if (user && *user == '/')
            snprintf(home, sizeof home, "%s/.cache", user);
        else
            return false;
        mkdir(home, 0777);
        size_t n = strlen(home);
        if (n + 8 > sizeof home) return false;
        memcpy(home + n, "/fathom", 8);
        folder = home;
    }
    mkdir(folder, 0777);
    return snprintf(path, size, "%s/%016llx.bin", folder, (unsigned long long)built_for) < (int)size;
}

static bool program_from_file(device *d, const char *path, uint64_t built_for, const char *options) {
    int file = open(path, O_RDONLY | O_CLOEXEC);
    if (file < 0) return false;
    struct stat st;
    bool good = false;
    if (fstat(file, &st) == 0 && (size_t)st.st_size > sizeof(cache_header)) {
        void *data = mmap(NULL, (size_t)st.st_size, PROT_READ, MAP_PRIVATE, file, 0);
        if (data != MAP_FAILED) {
            const cache_header *header = data;
            const unsigned char *binary = (const unsigned char *)(header + 1);
            size_t size = (size_t)st.st_size - sizeof *header;
            cl_int e = CL_SUCCESS, status = CL_SUCCESS;
            if (header->built_for == built_for && header->size == size &&
                header->hash == fnv_bytes(FNV_START, binary, size))
                d->program = clCreateProgramWithBinary(d->context, 1, &d->id, &size, &binary, &status, &e);
            if (d->program && e == CL_SUCCESS && status == CL_SUCCESS)
                good = clBuildProgram(d->program, 1, &d->id, options, NULL, NULL) == CL_SUCCESS;
            if (!good && d->program) {
                clReleaseProgram(d->program);
                d->program = NULL;
            }
            munmap(data, (size_t)st.st_size);
        }
    }
    close(file);
    return good;
}

static bool program_to_file(device *d, const char *path, uint64_t built_for) {
    bool good = false;
    size_t size = 0;
    clGetProgramInfo(d->program, CL_PROGRAM_BINARY_SIZES, sizeof size, &size, NULL);
    if (size == 0) return false;
    size += sizeof(cache_header);
    void *data = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (data == MAP_FAILED) return false;
    cache_header *header = data;
    unsigned char *bytes = data, *binary = bytes + sizeof *header;
    char part[600];
    snprintf(part, sizeof part, "%s.%d", path, (int)getpid());
    if (clGetProgramInfo(d->program, CL_PROGRAM_BINARIES, sizeof binary, &binary, NULL) == CL_SUCCESS) {
        header->built_for = built_for;
        header->size = size - sizeof *header;
        header->hash = fnv_bytes(FNV_START, binary, size - sizeof *header);
        int file = open(part, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
        good = file >= 0;
        for (size_t done = 0; good && done < size;) {
            ssize_t n = write(file, bytes + done, size - done);
            good = n > 0;
            done += good ? (size_t)n : 0;
        }
        if (file >= 0) good = close(file) == 0 && good;
        good = good && rename(part, path) == 0;
        if (!good) {
            if (file >= 0) unlink(part);
            log_write(d->config, FATHOM_LOG_WARNING, "built kernels can't be written to %s: %s", path,
                      strerror(errno));
        }
    }
    munmap(data, size);
    return good;
}

bool device_save_program(device *d, const char *path) {
    return program_to_file(d, path, d->built_for);
}

void device_cache_program(device *d) {
    char path[580];
    if (d->to_cache && cache_path(d, d->built_for, path, sizeof path)) program_to_file(d, path, d->built_for);
    d->to_cache = false;
}

static void log_build(device *d, cl_int code) {
    log_write(d->config, FATHOM_LOG_ERROR, "the OpenCL kernels didn't build on %s (code %d)", d->name, code);
    size_t size = 0;
    clGetProgramBuildInfo(d->program, d->id, CL_PROGRAM_BUILD_LOG, 0, NULL, &size);
    if (size == 0 || !d->config->log) return;
    char *text = mmap(NULL, size + 1, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    if (text == MAP_FAILED) return;
    clGetProgramBuildInfo(d->program, d->id, CL_PROGRAM_BUILD_LOG, size, text, NULL);
    d->config->log(d->config->log_user, FATHOM_LOG_ERROR, text);
    munmap(text, size + 1);
}

static int program_build(device *d) {
    char options[128], path[580];
    snprintf(options, sizeof options, "-cl-std=CL1.2 -DLANES=%d -DWIDE=%d -DGROUP=%d", d->lanes, d->wide,
             d->group);
    d->built_for = identity(d, options);
    d->to_cache = false;
    const char *given = d->config->kernel_file;
    if (given && program_from_file(d, given, d->built_for, options)) return FATHOM_OK;
    if (given) {
        log_write(d->config, FATHOM_LOG_ERROR,
                  "the built kernels in %s can't be used: missing, damaged, or for another device, driver "
                  "or version",
                  given);
        return FATHOM_ERROR_KERNEL;
    }
    bool cached = cache_path(d, d->built_for, path, sizeof path);
    if (cached && program_from_file(d, path, d->built_for, options)) return FATHOM_OK;
    if (cached && access(path, F_OK) == 0)
        log_write(d->config, FATHOM_LOG_INFO, "kernel cache %s can't be used: building anew", path);
    cl_bool compiler = CL_TRUE;
    clGetDeviceInfo(d->id, CL_DEVICE_COMPILER_AVAILABLE, sizeof compiler, &compiler, NULL);
    if (!compiler) {
        log_write(
            d->config, FATHOM_LOG_ERROR,
            "%s has no compiler: it needs kernels built elsewhere (kernel_file; fathom kernels makes them)",
            d->name);
        return FATHOM_ERROR_KERNEL;
    }
    cl_int e;
    const char *sources[32];
    char lines[16][64];
    cl_uint n = 0;
    for (int i = 0; i < kernel_count && i < 16; i++) { /* so that the compiler's messages name the file */
        snprintf(lines[i], sizeof lines[i], "#line 1 \"%s\"\n", kernel_names[i]);
        sources[n++] = lines[i];
        sources[n++] = kernel_sources[i];
    }
    d->program = clCreateProgramWithSource(d->context, n, sources, NULL, &e);
    if (!d->program) return FATHOM_ERROR_KERNEL;
    const char *extra = getenv("FATHOM_KERNEL_OPTIONS"); /* for tests: a build that fails */
    if (extra) snprintf(options + strlen(options), sizeof options - strlen(options), " %s", extra);
    e = clBuildProgram(d->program, 1, &d->id, options, NULL, NULL);
    if (e != CL_SUCCESS) {
        log_build(d, e);
        return FATHOM_ERROR_KERNEL;
    }
    d->to_cache = cached && !extra;
    return FATHOM_OK;
}

int device_open(device *d) {
    cl_int e;
    cl_context_properties properties[] = {CL_CONTEXT_PLATFORM, (cl_context_properties)d->platform, 0};
    d->error = FATHOM_OK;
    d->device_bytes = 0;
    d->context = clCreateContext(properties, 1, &d->id, NULL, NULL, &e);
    if (d->context) d->queue = clCreateCommandQueue(d->context, d->id, 0, &e);
    if (!d->context || !d->queue) {
        log_write(d->config, FATHOM_LOG_ERROR, "OpenCL device %s can't be opened (code %d)", d->name, e);
        device_close(d);
        return FATHOM_ERROR_DEVICE;
    }
    int result = program_build(d);
    if (result != FATHOM_OK) device_close(d);
    return result;
}

void device_close(device *d) {
    if (d->queue) clFinish(d->queue);
    if (d->program) clReleaseProgram(d->program);
    if (d->queue) clReleaseCommandQueue(d->queue);
    if (d->context) clReleaseContext(d->context);
    d->program = NULL;
    d->queue = NULL;
    d->context = NULL;
}

/* ---- buffers and launches ---------------------------------------------------------------------------------------------- */

static void failed(device *d, const char *what, cl_int code) {
    if (d->error == FATHOM_OK)
        log_write(d->config, FATHOM_LOG_ERROR, "OpenCL on %s: %s failed (code %d)", d->name, what, code);
    d->error = FATHOM_ERROR_DEVICE;
}

void device_buffer_make(device *d, arena *a, size_t size, device_buffer *buffer) {
    size = (size + ARENA_ALIGNMENT - 1) / ARENA_ALIGNMENT * ARENA_ALIGNMENT;
    buffer->memory = NULL;
    buffer->size = size;
    buffer->host = NULL;
    if (d->buffers_in_block)
        buffer->host = arena_take(a, size);
    else
        d->device_bytes += size;
    if (!d->context || (d->buffers_in_block && !buffer->host)) return;
    cl_int e;
    cl_mem_flags flags =
        CL_MEM_READ_WRITE | (d->buffers_in_block ? CL_MEM_USE_HOST_PTR : CL_MEM_ALLOC_HOST_PTR);
    buffer->memory = clCreateBuffer(d->context, flags, size, buffer->host, &e);
    if (!buffer->memory) failed(d, "making a buffer", e);
}

void device_buffer_free(device_buffer *buffer) {
    if (buffer->memory) clReleaseMemObject(buffer->memory);
    buffer->memory = NULL;
}

void *device_map(device *d, device_buffer *buffer, cl_map_flags flags) {
    cl_int e;
    void *p =
        clEnqueueMapBuffer(d->queue, buffer->memory, CL_TRUE, flags, 0, buffer->size, 0, NULL, NULL, &e);
    if (!p) failed(d, "mapping a buffer", e);
    return p;
}

void device_unmap(device *d, device_buffer *buffer, void *mapped) {
    if (!mapped) return;
    cl_int e = clEnqueueUnmapMemObject(d->queue, buffer->memory, mapped, 0, NULL, NULL);
    if (e != CL_SUCCESS) failed(d, "unmapping a buffer", e);
}

void device_clear(device *d, device_buffer *buffer) {
    if (!buffer->memory) return;
    cl_int zero = 0;
    cl_int e =
        clEnqueueFillBuffer(d->queue, buffer->memory, &zero, sizeof zero, 0, buffer->size, 0, NULL, NULL);
    if (e != CL_SUCCESS) failed(d, "clearing a buffer", e);
}

void device_wait(device *d) {
    cl_int e = clFinish(d->queue);
    if (e != CL_SUCCESS) failed(d, "waiting", e);
}

void device_flush(device *d) {
    cl_int e = clFlush(d->queue);
    if (e != CL_SUCCESS) failed(d, "starting", e);
}

cl_kernel device_kernel(device *d, const char *name) {
    cl_int e;
    cl_kernel k = clCreateKernel(d->program, name, &e);
    if (!k) failed(d, name, e);
    return k;
}

void device_run(device *d, cl_kernel kernel, size_t columns, size_t rows, size_t group, int count,
                const device_argument *arguments) {
    if (d->error != FATHOM_OK || columns == 0 || rows == 0) return;
    for (int i = 0; i < count; i++) {
        cl_int e = clSetKernelArg(kernel, (cl_uint)i, arguments[i].size, arguments[i].value);
        if (e != CL_SUCCESS) {
            failed(d, "setting a kernel's argument", e);
            return;
        }
    }
    size_t global[2] = {columns, rows}, local[2] = {group, 1};
    cl_int e = clEnqueueNDRangeKernel(d->queue, kernel, rows > 1 ? 2 : 1, NULL, global, group ? local : NULL,
                                      0, NULL, NULL);
    if (e != CL_SUCCESS) failed(d, "starting a kernel", e);
}
