/* fathom selftest: every kernel against the C reference on the present device. */
#include "fathom/shell/cli.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

#include <stdio.h>
#include <string.h>

#include "fathom.h"

static const char help[] =
    "usage: fathom selftest [--device NAME]\n"
    "\n"
    "Runs every OpenCL kernel on the device and compares what it writes with a plain C reference: on random\n"
    "images of odd sizes, on frames without any depth, at edges and limits. Prints a line a kernel and at "
    "the\n"
    "end 'N passed, N failed'; exits 1 when one failed.\n"
    "\n"
    "    --device NAME     part of a platform's or device's name, or cpu, or gpu (default: as replay "
    "chooses)\n"
    "    --verbose         say more on stderr\n";

static int print_check(void *user, const char *kernel, fathom_check outcome, const char *why) {
    static const char *const words[] = {"ok", "FAILED", "skipped"};
    int *passed = user;
    *passed += outcome == FATHOM_CHECK_PASSED;
    printf("%-30s %s%s%s\n", kernel, words[outcome], *why ? ": " : "", why);
    fflush(stdout);
    return cli_interrupted();
}

int command_selftest(int argc, char **argv) {
    struct options options = {.count = argc, .arguments = argv, .at = 1};
    struct cli_log log = {0};
    const char *name = NULL;
    while (options_next(&options)) {
        if (strcmp(options.name, "--help") == 0 || strcmp(options.name, "-h") == 0) {
            fputs(help, stdout);
            return CLI_DONE;
        }
        if (!options.name[0]) return cli_error(CLI_USAGE, "selftest: takes no %s", options.value);
        if (strcmp(options.name, "--device") == 0) {
            if (!(name = options_value(&options))) return CLI_USAGE;
        } else if (strcmp(options.name, "--verbose") == 0) {
            if (!(log.verbose = options_flag(&options))) return CLI_USAGE;
        } else {
            return cli_error(CLI_USAGE, "selftest: unknown option %s; fathom selftest --help lists them",
                             options.name);
        }
    }
    cli_catch_interrupt();
    fathom_config config = fathom_config_default();
    fathom_memory_plan plan;
    config.device = name;
    config.log = log_message;
    config.log_user = &log;
    int passed = 0, failed = fathom_memory_plan_for(&config, &plan);
    if (failed == FATHOM_OK) {
        printf("device: %s\n", plan.device);
        failed = fathom_selftest(&config, print_check, &passed);
    }
    if (failed == FATHOM_ERROR_STOPPED) return CLI_INTERRUPTED;
    if (failed < 0) return cli_error(CLI_FAILED, "%s", log_reason(&log, failed));
    printf("%d passed, %d failed\n", passed, failed);
    return failed > 0 ? CLI_FAILED : CLI_DONE;
}
