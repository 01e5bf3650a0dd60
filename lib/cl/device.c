#include "cl/device.h"

#include <ctype.h>
#include <stdio.h>
#include <string.h>

#include "base/log.h"
#include "cl/program.h"

/* ---- choice ------------------------------------------------------------------------------------------------------ */

#define MAX_PLATFORMS 16
#define MAX_DEVICES 16 /* of a platform */

static bool contains(const char *text, const char *part) {
    for (; *text; text++) {
        size_t i = 0;
        while (part[i] && tolower((unsigned char)text[i]) == tolower((unsigned char)part[i])) i++;
        if (!part[i]) return true;
    }
    return !*part;
}

/* Takes a device if it matches the name and beats the best one so far; returns the best score. */
static int consider(device *d, cl_platform_id platform, const char *platform_name, cl_device_id id,
                    const char *wanted, int best) {
    char name[128] = "";
    cl_device_type type = 0;
    cl_bool unified = CL_FALSE, usable = CL_FALSE;
    clGetDeviceInfo(id, CL_DEVICE_NAME, sizeof name - 1, name, NULL);
    clGetDeviceInfo(id, CL_DEVICE_TYPE, sizeof type, &type, NULL);
    clGetDeviceInfo(id, CL_DEVICE_HOST_UNIFIED_MEMORY, sizeof unified, &unified, NULL);
    clGetDeviceInfo(id, CL_DEVICE_AVAILABLE, sizeof usable, &usable, NULL);
    bool cpu = (type & CL_DEVICE_TYPE_CPU) != 0, gpu = (type & CL_DEVICE_TYPE_GPU) != 0;
    bool match = contains(platform_name, wanted) || contains(name, wanted) ||
                 (cpu && strcmp(wanted, "cpu") == 0) || (gpu && strcmp(wanted, "gpu") == 0);
    int score = gpu && unified ? 1 : 0;
    if (!match || !usable || score <= best) return best;
    d->platform = platform;
    d->id = id;
    d->cpu = cpu;
    snprintf(d->name, sizeof d->name, "%s", name);
    return score;
}

/* Sets the build parameters of the kernels for the chosen device. */
static void choose_shape(device *d) {
    cl_uint vector = 1;
    clGetDeviceInfo(d->id, CL_DEVICE_NATIVE_VECTOR_WIDTH_FLOAT, sizeof vector, &vector, NULL);
    d->lanes = d->cpu ? 8 : 1;
    d->wide = !d->cpu ? 1 : vector >= 16 ? 16 : 8;
    d->group = 1;
    if (d->cpu) return;
    size_t group = 1;
    cl_ulong local = 0;
    clGetDeviceInfo(d->id, CL_DEVICE_MAX_WORK_GROUP_SIZE, sizeof group, &group, NULL);
    clGetDeviceInfo(d->id, CL_DEVICE_LOCAL_MEM_SIZE, sizeof local, &local, NULL);
    d->group = group >= 64 && local >= 1024 ? 64 : 1; /* the tree takes 256 bytes */
}

int device_choose(device *d, const fathom_config *config) {
    memset(d, 0, sizeof *d);
    d->config = config;
    const char *wanted = config->device ? config->device : "";
    cl_platform_id platforms[MAX_PLATFORMS];
    cl_uint platform_count = 0;
    cl_int e = clGetPlatformIDs(MAX_PLATFORMS, platforms, &platform_count);
    if (e != CL_SUCCESS || platform_count == 0) {
        log_write(
            config, FATHOM_LOG_ERROR,
            "no OpenCL platform found (code %d): install one, e.g. pocl-opencl-icd, or check OCL_ICD_VENDORS",
            e);
        return FATHOM_ERROR_DEVICE;
    }
    int best = -1;
    for (cl_uint p = 0; p < platform_count && p < MAX_PLATFORMS; p++) {
        cl_device_id ids[MAX_DEVICES];
        cl_uint count = 0;
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, MAX_DEVICES, ids, &count) != CL_SUCCESS)
            continue;
        char name[128] = "";
        clGetPlatformInfo(platforms[p], CL_PLATFORM_NAME, sizeof name - 1, name, NULL);
        for (cl_uint i = 0; i < count && i < MAX_DEVICES; i++)
            best = consider(d, platforms[p], name, ids[i], wanted, best);
    }
    if (best < 0) {
        log_write(config, FATHOM_LOG_ERROR, "no OpenCL device matches \"%s\" among %u platforms", wanted,
                  platform_count);
        return FATHOM_ERROR_DEVICE;
    }
    d->buffers_in_block =
        config->buffers == FATHOM_BUFFERS_HOST || (config->buffers == FATHOM_BUFFERS_AUTO && d->cpu);
    choose_shape(d);
    return FATHOM_OK;
}

/* ---- life -------------------------------------------------------------------------------------------------------- */

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

void device_failed(device *d, const char *what, cl_int code) {
    if (d->error == FATHOM_OK)
        log_write(d->config, FATHOM_LOG_ERROR, "OpenCL on %s: %s failed (code %d)", d->name, what, code);
    d->error = FATHOM_ERROR_DEVICE;
}
