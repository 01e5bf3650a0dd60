/* fathom kernels: builds kernels into a file, for boards without a compiler. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/option_values.h"
#include "fathom/shell/library.h"
#include "fathom/shell/settings.h"

#include <stdio.h>

static int save(fathom_config *config, const char *file, struct cli_log *log) {
    struct library library = {0};
    const fathom_memory_plan *plan = &library.plan;
    int status = library_start(&library, config, log);
    if (!status) {
        const int saved = fathom_save_kernels(library.scan, file);
        if (saved < 0) status = cli_error(CLI_FAILED, "%s: %s", file, log_reason(log, saved));
    }
    if (!status)
        printf("%s: kernels for %s, depth %dx%d, maps %dx%d\n", file, plan->device,
               config->depth_camera.width, config->depth_camera.height, plan->align_width,
               plan->align_height);
    library_stop(&library);
    return status;
}

struct kernels {
    const char *file;
    struct option_size depth;
    bool verbose;
    struct settings settings;
};

#define AT(field) offsetof(struct kernels, field)

static const struct option_row own[] = {
    {"--depth", "WxH", OPTION_SIZE, AT(depth), 16, 4096,
     .help = "size of the depth frames (default 640x480)"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};

static const struct option_group groups[] = {
    {"What they are for", own, 0}, SETTINGS_GROUPS(AT(settings)), {0}};

static int run(const struct command *command, int argc, char **argv) {
    struct kernels kernels = {0};
    settings_start(&kernels.settings);
    const int status = options_read(command, &kernels, argc, argv);
    if (status) return status;
    struct cli_log log = {.verbose = kernels.verbose};
    fathom_config *config = &kernels.settings.config;
    if (kernels.depth.width) {
        config->depth_camera.width = kernels.depth.width;
        config->depth_camera.height = kernels.depth.height;
    }
    settings_apply_set(&kernels.settings, config);
    return save(config, kernels.file, &log);
}

const struct command command_kernels = {
    .name = "kernels",
    .summary = "build the kernels into a file, for boards without a compiler",
    .about = "Builds the kernels in every shape that the given settings use, and writes them to FILE. With "
             "--kernels FILE the other commands take them from there and never run a compiler, on machines "
             "of the same kind, with the same OpenCL runtime, fathom and settings.",
    .words = {{"file", AT(file)}},
    .groups = groups,
    .run = run};
