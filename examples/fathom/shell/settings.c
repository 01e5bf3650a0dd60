#include "fathom/shell/settings.h"
#include "fathom/shell/cli.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char settings_help[] =
    "    --depth-scale N            depth units a metre (5000 TUM, 1000 millimetres); overrides rig.txt\n"
    "    --intrinsics FX,FY,CX,CY   pixels; overrides calibration.txt\n"
    "    --translation on|off       inertial translation (default on)\n"
    "    --refine-rig on|off        refine the IMU's mounting rotation and clock offset while scanning "
    "(default off)\n"
    "    --against model|previous   align with the ray-cast surface (default) or with the frame before\n"
    "    --prior seed|information   what inertia does for the alignment: where to start (the paper's way; "
    "an\n"
    "                               ill-conditioned one is rejected), or also its information (default)\n"
    "    --start inertia|previous   where alignment starts: at the inertial estimate (default), or at the "
    "frame\n"
    "                               before's pose, as it does where there is no inertial navigation\n"
    "    --iterations A,B,C         most iterations at the coarsest..finest level, each 0..100\n"
    "    --preset tiny|small|large  settings for a board: maps up to 160, 320 (default), 640 wide; voxels of "
    "20,\n"
    "                               10, 8 mm; at most 64, 128, 256 MB. Options for one of these win\n"
    "    --voxel M                  voxel size, metres (default 0.01; 0.003 where a fifth of the first\n"
    "                               frame lies within half a metre)\n"
    "    --memory MB                most memory, host and device together (default 128; MB is 2^20)\n"
    "    --when-full stop|drop      what happens when that memory holds no more surface: it stops growing\n"
    "                               (default), or what was seen longest ago makes room: replay and scan "
    "keep\n"
    "                               it in a file (2 KB a block; beside the mesh, else in $TMPDIR or "
    "/var/tmp;\n"
    "                               without a name, gone at the end), give it back when the camera returns\n"
    "                               and put it into the mesh\n"
    "    --fuse-behind on|off       the pose first, the surface while the next frame is on its way: the same\n"
    "                               result, sooner (scan: on by default, else off)\n"
    "    --size WxH                 alignment resolution: the depth size over a whole number\n"
    "    --threads N                threads of the OpenCL device, where it lets them be set (PoCL)\n"
    "    --device NAME              part of an OpenCL platform's or device's name, or cpu, or gpu\n"
    "    --kernels FILE             built kernels, as `fathom kernels` wrote them, instead of a compiler\n";

void settings_start(struct settings *settings) {
    *settings = (struct settings){.config = fathom_config_default()};
}

static int take_choice(const char *option, const char *text, const char *first, const char *second) {
    if (strcmp(text, first) == 0) return 0;
    if (strcmp(text, second) == 0) return 1;
    cli_error(CLI_USAGE, "%s: '%s' is neither %s nor %s", option, text, first, second);
    return -1;
}

/* PoCL reads these when its device starts; the first is the older name. */
static bool set_threads(const char *option, const char *text) {
    long threads;
    char number[24];
    if (!cli_parse_long(option, text, 1, 1024, &threads)) return false;
    snprintf(number, sizeof number, "%ld", threads);
    setenv("POCL_MAX_PTHREAD_COUNT", number, 1);
    setenv("POCL_CPU_MAX_CU_COUNT", number, 1);
    return true;
}

/* ICP's usual start, the frame before's pose (Section 3.1). The sigma grows as a hand may turn and move. */
static int stay(void *user, int64_t from_ns, int64_t to_ns, fathom_motion *motion) {
    const double turn = 1.0, speed = 0.5; /* rad/s, m/s */
    const double dt = 1e-9 * ((double)to_ns - (double)from_ns);
    (void)user;
    *motion = (fathom_motion){.motion = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
    for (int i = 0; i < 3; i++) {
        motion->covariance[7 * i] = (float)(turn * turn * dt * dt);
        motion->covariance[7 * (i + 3)] = (float)(speed * speed * dt * dt);
    }
    return FATHOM_OK;
}

static bool set_iterations(const char *option, const char *text, fathom_config *config) {
    double counts[FATHOM_LEVELS];
    if (!parse_numbers(option, text, FATHOM_LEVELS, 0, 100, counts)) return false;
    int sum = 0;
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        const int count = (int)counts[i];
        if (count != counts[i]) {
            cli_error(CLI_USAGE, "%s: '%s' are not whole numbers", option, text);
            return false;
        }
        config->iterations[i] = config->seeded_iterations[i] = count;
        sum += count;
    }
    if (!sum) cli_error(CLI_USAGE, "%s: '%s' leaves no iteration at all", option, text);
    return sum > 0;
}

/* What was given by an option of its own stays. */
static bool set_preset(const char *option, const char *text, struct settings *settings) {
    static const char *const names[] = {"tiny", "small", "large"};
    for (int i = 0; i < 3; i++) {
        if (strcmp(text, names[i]) != 0) continue;
        const fathom_config c = fathom_config_preset((fathom_preset)i);
        settings->config.align_most = c.align_most;
        if (settings->memory == 0) settings->config.memory_cap_bytes = c.memory_cap_bytes;
        if (settings->voxel == 0) settings->config.voxel_m = c.voxel_m;
        settings->preset = true;
        return true;
    }
    cli_error(CLI_USAGE, "%s: '%s' is none of tiny, small, large", option, text);
    return false;
}

int settings_take(struct settings *settings, struct options *options) {
    enum key {
        DEPTH_SCALE,
        INTRINSICS,
        TRANSLATION,
        REFINE_RIG,
        AGAINST,
        PRIOR,
        START,
        ITERATIONS,
        VOXEL,
        MEMORY,
        PRESET,
        WHEN_FULL,
        FUSE_BEHIND,
        SIZE,
        THREADS,
        DEVICE,
        KERNELS,
        KEYS
    };
    static const char *const names[KEYS] = {
        "--depth-scale", "--intrinsics", "--translation", "--refine-rig", "--against", "--prior",
        "--start",       "--iterations", "--voxel",       "--memory",     "--preset",  "--when-full",
        "--fuse-behind", "--size",       "--threads",     "--device",     "--kernels"};
    fathom_config *config = &settings->config;
    int key = 0;
    while (key < KEYS && strcmp(names[key], options->name) != 0) key++;
    if (key == KEYS) return 0;
    const char *name = names[key], *value = options_value(options);
    double number = 0;
    int choice = 0;
    bool good = value != NULL;
    if (!good) return -1;
    switch ((enum key)key) {
    case DEPTH_SCALE:
        good = cli_parse_double(name, value, 1, 1e6, &settings->depth_scale);
        config->depth_units_per_metre = (float)settings->depth_scale;
        break;
    case INTRINSICS:
        good = parse_numbers(name, value, 4, 1e-3, 1e5, settings->intrinsics);
        config->fx = (float)settings->intrinsics[0];
        config->fy = (float)settings->intrinsics[1];
        config->cx = (float)settings->intrinsics[2];
        config->cy = (float)settings->intrinsics[3];
        break;
    case TRANSLATION:
        choice = take_choice(name, value, "on", "off");
        good = choice >= 0;
        config->imu_translation = choice == 0;
        break;
    case REFINE_RIG:
        choice = take_choice(name, value, "on", "off");
        good = choice >= 0;
        config->refine_rig = choice == 0;
        break;
    case AGAINST:
        choice = take_choice(name, value, "model", "previous");
        good = choice >= 0;
        config->against = choice ? FATHOM_AGAINST_PREVIOUS : FATHOM_AGAINST_MODEL;
        break;
    case PRIOR:
        choice = take_choice(name, value, "seed", "information");
        good = choice >= 0;
        config->prior = choice ? FATHOM_PRIOR_INFORMATION : FATHOM_PRIOR_SEED;
        break;
    case START:
        choice = take_choice(name, value, "inertia", "previous");
        good = choice >= 0;
        config->inertial_hook = choice == 1 ? stay : NULL;
        break;
    case ITERATIONS: good = set_iterations(name, value, config); break;
    case VOXEL:
        good = cli_parse_double(name, value, 0.001, 1, &number);
        config->voxel_m = (float)number;
        settings->voxel = number;
        break;
    case MEMORY:
        good = cli_parse_double(name, value, 1, 1 << 20, &number);
        config->memory_cap_bytes = (int64_t)(number * (1 << 20));
        settings->memory = number;
        break;
    case PRESET: good = set_preset(name, value, settings); break;
    case FUSE_BEHIND:
        choice = take_choice(name, value, "on", "off");
        good = choice >= 0;
        config->fuse_behind = choice == 0;
        break;
    case WHEN_FULL:
        choice = take_choice(name, value, "stop", "drop");
        good = choice >= 0;
        config->when_full = choice == 1 ? FATHOM_FULL_DROP : FATHOM_FULL_STOP;
        break;
    case SIZE: good = parse_size(name, value, 8, 4096, &config->align_width, &config->align_height); break;
    case THREADS: good = set_threads(name, value); break;
    case DEVICE: config->device = value; break;
    case KERNELS: config->kernel_file = value; break;
    case KEYS: break;
    }
    return good ? 1 : -1;
}
