/* fathom kernels: built kernels in a file, for boards where no compiler shall run. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/option_values.h"
#include "fathom/shell/log.h"
#include "fathom/shell/settings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int save(const struct settings *settings, const char *file, struct cli_log *log) {
    fathom_memory_plan plan = FATHOM_STRUCT(fathom_memory_plan);
    int result = fathom_plan_memory(&settings->config, &plan, NULL, 0);
    if (result < 0) return cli_error(CLI_USAGE, "%s", log_reason(log, result));
    void *memory = malloc((size_t)plan.host_bytes);
    fathom *scan = NULL;
    if (!memory)
        return cli_error(CLI_FAILED, "out of memory: %lld bytes for the library", (long long)plan.host_bytes);
    result = fathom_init(&scan, &settings->config, memory, (size_t)plan.host_bytes, NULL, 0);
    if (result == FATHOM_OK) result = fathom_save_kernels(scan, file);
    fathom_close(scan);
    free(memory);
    if (result < 0) return cli_error(CLI_FAILED, "%s: %s", file, log_reason(log, result));
    printf("%s: kernels for %s, depth %dx%d, maps %dx%d\n", file, plan.device, settings->config.depth_camera.width,
           settings->config.depth_camera.height, plan.align_width, plan.align_height);
    return CLI_DONE;
}

struct kernels {
    const char *file;
    struct option_size depth;
    bool verbose;
    struct settings settings;
};

#define AT(field) offsetof(struct kernels, field)

static const struct option_row own[] = {
    {"--depth", "WxH", OPTION_SIZE, AT(depth), 16, 4096, .help = "size of the depth frames (default 640x480)"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};

static const struct option_group groups[] = {{"What they are for", own, 0}, SETTINGS_GROUPS(AT(settings)), {0}};

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
    config->log = log_message;
    config->log_user = &log;
    return save(&kernels.settings, kernels.file, &log);
}

const struct command command_kernels = {
    .name = "kernels",
    .summary = "build the kernels into a file, for boards without a compiler",
    .about = "Builds the kernels in every shape that the given settings use, and writes them to FILE. With --kernels FILE "
             "the other commands take them from there and never run a compiler, on machines of the same kind, with the "
             "same OpenCL runtime, fathom and settings.",
    .words = {{"file", AT(file)}},
    .groups = groups,
    .run = run};
