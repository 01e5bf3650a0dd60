/* fathom selftest: checks every kernel against the C reference on the device. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

#include <stdio.h>

#include "fathom.h"

static int print_check(void *user, const char *kernel, fathom_check outcome, const char *why) {
    static const char *const words[] = {"ok", "FAILED", "skipped"};
    int *passed = user;
    *passed += outcome == FATHOM_CHECK_PASSED;
    printf("%-30s %s%s%s\n", kernel, words[outcome], *why ? ": " : "", why);
    fflush(stdout);
    return cli_interrupted();
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
    const int status = options_read(command, &selftest, argc, argv);
    if (status) return status;
    struct cli_log log = {.verbose = selftest.verbose};
    cli_catch_interrupt();
    fathom_config config;
    fathom_memory_plan plan = FATHOM_STRUCT(fathom_memory_plan);
    fathom_config_init(&config);
    config.device = selftest.device;
    config.log = log_message;
    config.log_user = &log;
    int passed = 0, failed = fathom_plan_memory(&config, &plan, NULL, 0);
    if (failed == FATHOM_OK) {
        printf("device: %s\n", plan.device);
        failed = fathom_selftest(&config, print_check, &passed);
    }
    if (failed == FATHOM_ERROR_STOPPED) return CLI_INTERRUPTED;
    if (failed < 0) return cli_error(CLI_FAILED, "%s", log_reason(&log, failed));
    printf("%d passed, %d failed\n", passed, failed);
    return failed > 0 ? CLI_FAILED : CLI_DONE;
}

const struct command command_selftest = {
    .name = "selftest",
    .summary = "check every kernel on this machine's device",
    .about = "Runs every OpenCL kernel on the device and compares what it writes with a plain C reference: "
             "on random images of odd sizes, on frames without any depth, at edges and limits. Prints a "
             "line per kernel and at the end 'N passed, N failed'; exits 1 when one failed.",
    .groups = groups,
    .later = "--cache",
    .run = run};
