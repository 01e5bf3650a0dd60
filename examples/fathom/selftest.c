/* fathom selftest: every kernel against the C reference on the present device. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

#include <stdio.h>
#include <string.h>

#include "selftest/kernel_checks.h"

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

struct selftest {
    const char *device;
    bool verbose;
};

#define AT(field) offsetof(struct selftest, field)

static const struct option_row own[] = {
    {"--device", "NAME", OPTION_TEXT, AT(device),
     .help = "part of a platform's or device's name, or cpu, or gpu (default: as replay chooses)"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};

static const struct option_group groups[] = {{"Options", own, 0}, {0}};

static int run(const struct command *command, int argc, char **argv) {
    struct selftest selftest = {0};
    int status = options_read(command, &selftest, argc, argv);
    if (status) return status;
    struct cli_log log = {.verbose = selftest.verbose};
    cli_catch_interrupt();
    device d;
    fathom_config config;
    const int e = kernel_checks_open(&d, &config, selftest.device, FATHOM_BUFFERS_AUTO, false, log_message, &log);
    if (e != FATHOM_OK) return cli_error(CLI_FAILED, "%s", log_reason(&log, e));
    status = run_checks(&d);
    device_close(&d);
    return status;
}

const struct command command_selftest = {
    .name = "selftest",
    .summary = "check every kernel on this machine's device",
    .about = "Runs every OpenCL kernel on the device and compares what it writes with a plain C reference: on random images "
             "of odd sizes, on frames without any depth, at edges and limits. Prints a line per kernel and at the end "
             "'N passed, N failed'; exits 1 when one failed.",
    .groups = groups,
    .later = "--cache",
    .run = run};
