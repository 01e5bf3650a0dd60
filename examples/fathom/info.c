/* fathom info: versions, OpenCL devices, drivers built in, bytes for the given settings. */
#define CL_TARGET_OPENCL_VERSION 120
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom_drivers.h"
#include "fathom/settings_page.h"
#include "fathom/shell/library.h"
#include "fathom/shell/settings.h"

#include <CL/cl.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#define MOST 32

static void print_device(cl_device_id device) {
    char name[256] = "?", version[256] = "?", driver[256] = "?";
    cl_device_type type = 0;
    cl_ulong memory = 0;
    cl_uint units = 0;
    cl_bool shared = CL_FALSE;
    clGetDeviceInfo(device, CL_DEVICE_NAME, sizeof name, name, NULL);
    clGetDeviceInfo(device, CL_DEVICE_VERSION, sizeof version, version, NULL);
    clGetDeviceInfo(device, CL_DRIVER_VERSION, sizeof driver, driver, NULL);
    clGetDeviceInfo(device, CL_DEVICE_TYPE, sizeof type, &type, NULL);
    clGetDeviceInfo(device, CL_DEVICE_GLOBAL_MEM_SIZE, sizeof memory, &memory, NULL);
    clGetDeviceInfo(device, CL_DEVICE_MAX_COMPUTE_UNITS, sizeof units, &units, NULL);
    clGetDeviceInfo(device, CL_DEVICE_HOST_UNIFIED_MEMORY, sizeof shared, &shared, NULL);
    const char *kind = type & CL_DEVICE_TYPE_GPU           ? "gpu"
                       : type & CL_DEVICE_TYPE_CPU         ? "cpu"
                       : type & CL_DEVICE_TYPE_ACCELERATOR ? "accelerator"
                                                           : "other";
    printf("    device: %s\n        %s, %u units, %" PRIu64 " MB, %s; %s, driver %s\n", name, kind, units,
           (uint64_t)memory >> 20, shared ? "shared with the host" : "its own memory", version, driver);
}

static void print_platforms(void) {
    cl_platform_id platforms[MOST];
    cl_uint platform_count = 0;
    const cl_int result = clGetPlatformIDs(MOST, platforms, &platform_count);
    if (result != CL_SUCCESS || platform_count == 0) {
        printf("OpenCL: no platform (error %d); install one, such as pocl-opencl-icd\n", result);
        return;
    }
    for (cl_uint p = 0; p < platform_count && p < MOST; p++) {
        char name[256] = "?", version[256] = "?";
        cl_device_id devices[MOST];
        cl_uint device_count = 0;
        clGetPlatformInfo(platforms[p], CL_PLATFORM_NAME, sizeof name, name, NULL);
        clGetPlatformInfo(platforms[p], CL_PLATFORM_VERSION, sizeof version, version, NULL);
        printf("OpenCL platform: %s, %s\n", name, version);
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, MOST, devices, &device_count) != CL_SUCCESS ||
            !device_count)
            printf("    no devices\n");
        for (cl_uint d = 0; d < device_count && d < MOST; d++) print_device(devices[d]);
    }
}

static int print_plan(const struct settings *settings, struct cli_log *log) {
    fathom_memory_plan plan = FATHOM_STRUCT(fathom_memory_plan);
    const int result = fathom_plan_memory(&settings->config, &plan, NULL, 0);
    if (result < 0)
        return cli_error(library_status(result), "%s", log_reason(log, result));
    printf("plan: %s\n", plan.device);
    printf("    depth %dx%d, maps %dx%d, voxel %g m\n", settings->config.depth_camera.width,
           settings->config.depth_camera.height, plan.align_width, plan.align_height,
           (double)settings->config.voxel_m);
    printf("    host_bytes=%" PRId64 " device_bytes=%" PRId64 " total_bytes=%" PRId64
           " blocks=%d arena_mb=%.1f\n",
           plan.host_bytes, plan.device_bytes, plan.host_bytes + plan.device_bytes, plan.blocks,
           (double)(plan.host_bytes + plan.device_bytes) / (1 << 20));
    return CLI_DONE;
}

struct info {
    bool plan, list, markdown, verbose;
    struct settings settings;
};

#define AT(field) offsetof(struct info, field)

static const struct option_row own[] = {
    {"--plan", NULL, OPTION_FLAG, AT(plan), .help = "also the bytes needed for the given settings"},
    {"--settings", NULL, OPTION_FLAG, AT(list),
     .help = "the library's settings instead, for --set: name, unit, range, default, meaning"},
    {"--markdown", NULL, OPTION_FLAG, AT(markdown), .help = "with --settings: as the page docs/SETTINGS.md"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};

static const struct option_group groups[] = {{"What is said", own, 0}, SETTINGS_GROUPS(AT(settings)), {0}};

static int run(const struct command *command, int argc, char **argv) {
    struct info info = {0};
    settings_start(&info.settings);
    const int status = options_read(command, &info, argc, argv);
    if (status) return status;
    if (info.list) {
        if (info.markdown)
            settings_page_markdown();
        else
            settings_page_text();
        return CLI_DONE;
    }
    settings_apply_set(&info.settings, &info.settings.config);
    struct cli_log log = {.verbose = info.verbose};
    info.settings.config.log = log_message;
    info.settings.config.log_user = &log;
    printf("fathom %s\n", fathom_version());
    print_platforms();
    fathom_source_driver_info driver = FATHOM_STRUCT(fathom_source_driver_info);
    for (int i = 0; fathom_source_driver(i, &driver); i++)
        printf("driver: %s (%s): %s\n", driver.name, driver.what, driver.built ? "built in" : "not built");
    return info.plan ? print_plan(&info.settings, &log) : CLI_DONE;
}

const struct command command_info = {
    .name = "info",
    .summary = "versions, OpenCL devices, bytes needed",
    .about = "Prints versions, OpenCL platforms and devices, and the drivers built in.",
    .groups = groups,
    .later = "--cache",
    .run = run};
