/* fathom kernels: built kernels in a file, for boards where no compiler shall run. */
#include "fathom/shell/cli.h"
#include "fathom/shell/log.h"
#include "fathom/shell/settings.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void help(void) {
    printf("usage: fathom kernels FILE [settings]\n\n"
           "Builds the kernels in every shape that the given settings use, and writes them to FILE. With "
           "--kernels\n"
           "FILE the other commands take them from there and never run a compiler, on machines of the same "
           "kind,\n"
           "with the same OpenCL runtime, fathom and settings.\n\n"
           "    --depth WxH                size of the depth frames (default 640x480)\n"
           "%s"
           "    --verbose                  say more on stderr\n",
           settings_help);
}

static int save(const struct settings *settings, const char *file, struct cli_log *log) {
    fathom_memory_plan plan;
    int result = fathom_memory_plan_for(&settings->config, &plan);
    if (result < 0) return cli_error(CLI_USAGE, "%s", log_reason(log, result));
    void *memory = malloc((size_t)plan.host_bytes);
    fathom *scan = NULL;
    if (!memory)
        return cli_error(CLI_FAILED, "out of memory: %lld bytes for the library", (long long)plan.host_bytes);
    result = fathom_init(&scan, &settings->config, memory, (size_t)plan.host_bytes);
    if (result == FATHOM_OK) result = fathom_save_kernels(scan, file);
    fathom_close(scan);
    free(memory);
    if (result < 0) return cli_error(CLI_FAILED, "%s: %s", file, log_reason(log, result));
    printf("%s: kernels for %s, depth %dx%d, maps %dx%d\n", file, plan.device, settings->config.depth_width,
           settings->config.depth_height, plan.align_width, plan.align_height);
    return CLI_DONE;
}

int command_kernels(int argc, char **argv) {
    struct options options = {.count = argc, .arguments = argv, .at = 1};
    struct settings settings;
    struct cli_log log = {0};
    const char *file = NULL;
    settings_start(&settings);
    while (options_next(&options)) {
        if (strcmp(options.name, "--help") == 0 || strcmp(options.name, "-h") == 0) {
            help();
            return CLI_DONE;
        }
        if (!options.name[0]) {
            if (file)
                return cli_error(CLI_USAGE, "kernels: more than one file: %s and %s", file, options.value);
            file = options.value;
            continue;
        }
        const int taken = settings_take(&settings, &options);
        if (taken < 0) return CLI_USAGE;
        if (taken) continue;
        if (strcmp(options.name, "--depth") == 0) {
            const char *value = options_value(&options);
            if (!value || !parse_size(options.name, value, 16, 4096, &settings.config.depth_width,
                                      &settings.config.depth_height))
                return CLI_USAGE;
        } else if (strcmp(options.name, "--verbose") == 0) {
            if (!(log.verbose = options_flag(&options))) return CLI_USAGE;
        } else {
            return cli_error(CLI_USAGE, "kernels: unknown option %s; fathom kernels --help lists them",
                             options.name);
        }
    }
    if (!file) return cli_error(CLI_USAGE, "kernels: no file given; fathom kernels --help says how");
    settings.config.log = log_message;
    settings.config.log_user = &log;
    return save(&settings, file, &log);
}
