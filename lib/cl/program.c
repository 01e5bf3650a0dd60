#include "cl/program.h"

#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.h"
#include "cl/kernels.h"

/* FNV-1a, 64 bits (Fowler, Noll, Vo). */
#define FNV_START 14695981039346656037ull
static uint64_t fnv_bytes(uint64_t h, const unsigned char *bytes, size_t size) {
    for (size_t i = 0; i < size; i++) h = (h ^ bytes[i]) * 1099511628211ull;
    return h;
}

static uint64_t fnv(uint64_t h, const char *text) {
    return fnv_bytes(h, (const unsigned char *)text, strlen(text));
}

/* The header of a file of built kernels: an OpenCL runtime may crash on a binary that is truncated or for another
 * device. */
typedef struct {
    uint64_t built_for;  /* identity */
    uint64_t size, hash; /* of the program after the header */
} cache_header;

/* Hash of everything that a built program depends on: sources, options, device and driver. */
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

static bool too_long(device *d, const char *path) {
    log_write(d->config, FATHOM_LOG_WARNING,
              "kernels are built anew each time: the cache's path is too long: %s", path);
    return false;
}

/* The cache file for that; false: no cache is wanted or can be had. */
static bool cache_path(device *d, uint64_t built_for, char *path, size_t size) {
    const char *folder = d->config->cache_folder;
    char home[PATH_MAX];
    if (folder && !*folder) return false;
    if (!folder) {
        const char *base = getenv("XDG_CACHE_HOME"), *user = getenv("HOME");
        int n;
        if (base && *base == '/')
            n = snprintf(home, sizeof home, "%s", base);
        else if (user && *user == '/')
            n = snprintf(home, sizeof home, "%s/.cache", user);
        else
            return false;
        if (n + sizeof "/fathom" > sizeof home) return too_long(d, home);
        mkdir(home, 0777);
        memcpy(home + n, "/fathom", sizeof "/fathom");
        folder = home;
    }
    mkdir(folder, 0777);
    const int n = snprintf(path, size, "%s/%016llx.bin", folder, (unsigned long long)built_for);
    return n < (int)size || too_long(d, folder);
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
    char part[PATH_MAX]; /* beside the file, which appears whole or not at all */
    bool fits = snprintf(part, sizeof part, "%s.%d", path, (int)getpid()) < (int)sizeof part;
    if (!fits)
        log_write(d->config, FATHOM_LOG_WARNING, "built kernels can't be written: the path is too long: %s",
                  path);
    else if (clGetProgramInfo(d->program, CL_PROGRAM_BINARIES, sizeof binary, &binary, NULL) == CL_SUCCESS) {
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

bool program_save(device *d, const char *path) {
    return program_to_file(d, path, d->built_for);
}

void program_to_cache(device *d) {
    char path[PATH_MAX];
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

int program_build(device *d) {
    char options[128], path[PATH_MAX];
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
    if (!d->program) {
        log_write(d->config, FATHOM_LOG_ERROR, "the OpenCL kernels can't be given to %s (code %d)", d->name,
                  e);
        return FATHOM_ERROR_KERNEL;
    }
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
