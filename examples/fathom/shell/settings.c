#include "fathom/shell/settings.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/option_values.h"
#include "fathom/shell/set_option.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void settings_start(struct settings *settings) {
    *settings = (struct settings){0};
    fathom_config_init(&settings->config);
}

/* ---- values that are more than a number or a word ---- */

/* PoCL reads these when its device starts; the first is the older name. */
static bool set_threads(void *into, const char *option, const char *text) {
    long threads;
    char number[24];
    (void)into;
    if (!cli_parse_long(option, text, 1, 1024, &threads)) return false;
    snprintf(number, sizeof number, "%ld", threads);
    setenv("POCL_MAX_PTHREAD_COUNT", number, 1);
    setenv("POCL_CPU_MAX_CU_COUNT", number, 1);
    return true;
}

/* ICP's usual start, the previous frame's pose (Section 3.1). The sigma grows as hand-held motion may. */
static int stay(void *user, int64_t from_ns, int64_t to_ns, fathom_motion *motion) {
    const double turn = 1.0, speed = 0.5; /* rad/s, m/s */
    const double dt = 1e-9 * ((double)to_ns - (double)from_ns);
    (void)user;
    motion->motion = (fathom_pose){.orientation = {0, 0, 0, 1}};
    for (int i = 0; i < 3; i++) {
        motion->covariance[7 * i] = turn * turn * dt * dt;
        motion->covariance[7 * (i + 3)] = speed * speed * dt * dt;
    }
    return FATHOM_OK;
}

static bool set_start(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    int choice;
    if (!parse_choice(option, text, "inertia|previous", &choice)) return false;
    settings->config.inertial_hook = choice == 1 ? stay : NULL;
    return true;
}

static bool set_iterations(void *into, const char *option, const char *text) {
    fathom_config *config = &((struct settings *)into)->config;
    double counts[FATHOM_LEVELS];
    if (!parse_numbers(option, text, FATHOM_LEVELS, 0, 100, counts)) return false;
    int sum = 0;
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        const int count = (int)counts[i];
        if (count != counts[i]) {
            cli_error(CLI_USAGE, "%s: '%s' are not whole numbers", option, text);
            return false;
        }
        config->max_iterations[i] = config->max_seeded_iterations[i] = count;
        sum += count;
    }
    if (!sum) cli_error(CLI_USAGE, "%s: '%s' leaves no iteration at all", option, text);
    return sum > 0;
}

/* Settings with their own option keep its value. */
static bool set_preset(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    int choice;
    if (!parse_choice(option, text, "tiny|small|large", &choice)) return false;
    fathom_config c;
    fathom_config_preset(&c, choice);
    settings->config.max_align_width = c.max_align_width;
    if (settings->memory == 0) settings->config.max_memory_bytes = c.max_memory_bytes;
    if (settings->voxel == 0) settings->config.voxel_m = c.voxel_m;
    settings->preset = true;
    return true;
}

static bool set_depth_scale(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    if (!cli_parse_double(option, text, 1, 1e6, &settings->depth_scale)) return false;
    settings->config.depth_units_per_metre = (float)settings->depth_scale;
    return true;
}

static bool set_intrinsics(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    const double *k = settings->intrinsics;
    if (!parse_numbers(option, text, 4, 1e-3, 1e5, settings->intrinsics)) return false;
    fathom_pinhole *camera = &settings->config.depth_camera;
    camera->fx = k[0];
    camera->fy = k[1];
    camera->cx = k[2];
    camera->cy = k[3];
    return true;
}

static bool set_voxel(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    if (!cli_parse_double(option, text, 0.001, 1, &settings->voxel)) return false;
    settings->config.voxel_m = (float)settings->voxel;
    return true;
}

static bool set_memory(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    if (!cli_parse_double(option, text, 1, 1 << 20, &settings->memory)) return false;
    settings->config.max_memory_bytes = (int64_t)(settings->memory * (1 << 20));
    return true;
}

static bool set_size(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    struct option_size size;
    if (!parse_size(option, text, 8, 4096, &size)) return false;
    settings->config.align_width = size.width;
    settings->config.align_height = size.height;
    return true;
}

static bool set_any(void *into, const char *option, const char *text) {
    struct settings *settings = into;
    if (settings->set_count == MAX_SET) {
        cli_error(CLI_USAGE, "%s: given more than %d times", option, MAX_SET);
        return false;
    }
    if (!set_option_apply(option, text, &settings->config)) return false;
    if (set_option_names(text, "voxel_m")) settings->voxel = (double)settings->config.voxel_m;
    settings->set[settings->set_count++] = text;
    return true;
}

void settings_apply_set(const struct settings *settings, fathom_config *config) {
    for (int i = 0; i < settings->set_count; i++) set_option_apply("--set", settings->set[i], config);
}

/* ---- the tables ---- */

#define AT(field) offsetof(struct settings, field)

const struct option_row settings_camera[] = {
    {"--depth-scale", "N", OPTION_PARSED, .parse = set_depth_scale,
     .help = "depth units per metre (5000 TUM, 1000 millimetres); overrides rig.txt"},
    {"--intrinsics", "FX,FY,CX,CY", OPTION_PARSED, .parse = set_intrinsics,
     .help = "pixels; overrides calibration.txt"},
    {0}};

const struct option_row settings_alignment[] = {
    {"--translation", "on|off", OPTION_SWITCH, AT(config.imu_translation),
     .help = "inertial translation (default on)"},
    {"--refine-rig", "on|off", OPTION_SWITCH, AT(config.refine_rig),
     .help = "refine the IMU's mounting rotation and clock offset while scanning (default off)"},
    {"--against", "model|previous", OPTION_CHOICE, AT(config.against),
     .help = "align with the ray-cast surface (default) or with the frame before"},
    {"--prior", "seed|information", OPTION_CHOICE, AT(config.prior),
     .help = "what inertia does for the alignment: where to start (the paper's way; an ill-conditioned one "
             "is rejected), or also its information (default)"},
    {"--start", "inertia|previous", OPTION_PARSED, .parse = set_start,
     .help = "where alignment starts: at the inertial estimate (default), or at the frame before's pose, as "
             "it does where there is no inertial navigation"},
    {"--iterations", "A,B,C", OPTION_PARSED, .parse = set_iterations,
     .help = "maximum iterations at the coarsest..finest level, each 0..100"},
    {"--size", "WxH", OPTION_PARSED, .parse = set_size,
     .help = "alignment resolution: the depth size over a whole number"},
    {0}};

const struct option_row settings_surface[] = {
    {"--preset", "tiny|small|large", OPTION_PARSED, .parse = set_preset,
     .help = "settings for a board: maps up to 160, 320 (default), 640 wide; voxels of 20, 10, 8 mm; at "
             "most 64, 128, 256 MB. --size, --voxel and --memory win over it"},
    {"--voxel", "M", OPTION_PARSED, .parse = set_voxel,
     .help = "voxel size, metres (default 0.01; 0.003 where a fifth of the first frame lies within half a "
             "metre)"},
    {"--memory", "MB", OPTION_PARSED, .parse = set_memory,
     .help = "maximum memory, host and device together (default 128; MB is 2^20)"},
    {"--when-full", "stop|drop", OPTION_CHOICE, AT(config.when_full),
     .help =
         "when that memory holds no more surface: it stops growing (default), or what was seen longest ago "
         "makes room: replay and scan keep it in a file (2 KB per block; beside the mesh, else in $TMPDIR "
         "or /var/tmp; without a name, gone at the end), give it back when the camera returns and put it "
         "into the mesh"},
    {"--fuse-behind", "on|off", OPTION_SWITCH, AT(config.fuse_behind),
     .help = "the pose first, the surface while the next frame is on its way: the same result, sooner "
             "(scan: on by default, else off)"},
    {0}};

const struct option_row settings_device[] = {
    {"--threads", "N", OPTION_PARSED, .parse = set_threads,
     .help = "threads of the OpenCL device, where it lets them be set (PoCL)"},
    {"--device", "NAME", OPTION_TEXT, AT(config.device),
     .help = "part of an OpenCL platform's or device's name, or cpu, or gpu"},
    {"--kernels", "FILE", OPTION_TEXT, AT(config.kernel_file),
     .help = "built kernels, as fathom kernels wrote them, instead of a compiler"},
    {0}};

const struct option_row settings_any[] = {
    {"--set", "NAME=VALUE", OPTION_PARSED, .parse = set_any,
     .help = "any setting of the library, several times if need be; fathom info --settings lists them. It "
             "wins over options, rig.txt and calibration.txt"},
    {0}};
