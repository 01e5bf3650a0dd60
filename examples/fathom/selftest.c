/* fathom selftest: every kernel against the C reference on the present device. */
#include "fathom/shell/cli.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

#include <stdio.h>
#include <string.h>

#include "selftest/kernel_checks.h"

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

static int run_checks(device *d) {
    int passed = 0, failed = 0;
    printf("device: %s\n", d->name);
    for (int i = 0; i < kernel_check_count && !cli_interrupted(); i++) {
        char why[256] = "";
        const check_result result = kernel_checks[i].run(d, why, sizeof why);
        static const char *const words[] = {"ok", "FAILED", "skipped"};
        printf("%-30s %s%s%s\n", kernel_checks[i].name, words[result], *why ? ": " : "", why);
        fflush(stdout);
        passed += result == CHECK_PASSED;
        failed += result == CHECK_FAILED;
    }
    printf("%d passed, %d failed\n", passed, failed);
    return cli_interrupted() ? CLI_INTERRUPTED : failed ? CLI_FAILED : CLI_DONE;
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
    device d;
    fathom_config config;
    const int e = kernel_checks_open(&d, &config, name, FATHOM_BUFFERS_AUTO, false, log_message, &log);
    if (e != FATHOM_OK) return cli_error(CLI_FAILED, "%s", log_reason(&log, e));
    const int status = run_checks(&d);
    device_close(&d);
    return status;
}
