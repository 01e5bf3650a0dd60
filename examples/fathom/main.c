/* fathom: the command line. Each command is a file of its own; here is only the table of them. */
#include "fathom/shell/cli.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "fathom.h"

static const struct command {
    const char *name;
    int (*run)(int argc, char **argv);
    const char *says;
} commands[] = {
    {"replay", command_replay, "track and reconstruct a recording"},
    {"scan", command_scan, "track and reconstruct what a live rig sees"},
    {"log", command_log, "record what a live rig gives, for a replay"},
    {"devices", command_devices, "depth cameras and inertial sensors, and what they lack"},
    {"simulate", command_simulate, "render a scene into a recording, with its ground truth"},
    {"calibrate", command_calibrate, "how the IMU sits on the camera, from a recording"},
    {"info", command_info, "versions, OpenCL devices, bytes needed"},
    {"kernels", command_kernels, "build the kernels into a file, for boards without a compiler"},
    {"selftest", command_selftest, "check every kernel on this machine's device"},
};

#define COMMANDS (sizeof commands / sizeof commands[0])

static int help(void) {
    puts("usage: fathom COMMAND [options]\n");
    for (size_t i = 0; i < COMMANDS; i++) printf("    %-10s %s\n", commands[i].name, commands[i].says);
    puts("\n    fathom COMMAND --help   the command's options\n    fathom --version        the version");
    return CLI_DONE;
}

/* What was printed may still be in stdio's buffer; a full disk behind stdout is a failure like any other. */
static int finish(int status) {
    if (fflush(stdout) || ferror(stdout)) {
        if (status == CLI_DONE) return cli_error(CLI_FAILED, "standard output: %s", strerror(errno));
    }
    return status;
}

int main(int argc, char **argv) {
    if (argc < 2) return cli_error(CLI_USAGE, "no command given; fathom --help lists them");
    if (!strcmp(argv[1], "--help") || !strcmp(argv[1], "-h") || !strcmp(argv[1], "help"))
        return finish(help());
    if (!strcmp(argv[1], "--version")) {
        printf("fathom %s\n", fathom_version());
        return finish(CLI_DONE);
    }
    for (size_t i = 0; i < COMMANDS; i++)
        if (!strcmp(argv[1], commands[i].name)) return finish(commands[i].run(argc - 1, argv + 1));
    return cli_error(CLI_USAGE, "unknown command '%s'; fathom --help lists them", argv[1]);
}
