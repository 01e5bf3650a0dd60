/* fathom: the command line. Each command has its own file; this one has the list of them. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/help.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "fathom.h"

static const struct command *const commands[] = {
    &command_replay,    &command_scan, &command_log,     &command_devices,  &command_simulate,
    &command_calibrate, &command_info, &command_kernels, &command_selftest, NULL};

static int complete(int argc, char **argv) {
    if (argc != 3 || strcmp(argv[2], "bash"))
        return cli_error(CLI_USAGE, "--completion: give the shell; there is bash");
    completion_print_bash(commands);
    return CLI_DONE;
}

static int refuse(const char *name) {
    const char *names[sizeof commands / sizeof *commands];
    int count = 0;
    for (; commands[count]; count++) names[count] = commands[count]->name;
    const char *meant = options_nearest(name, names, count);
    return meant ? cli_error(CLI_USAGE, "unknown command '%s'; did you mean %s? fathom --help lists them",
                             name, meant)
                 : cli_error(CLI_USAGE, "unknown command '%s'; fathom --help lists them", name);
}

static int run(int argc, char **argv) {
    const char *name = argv[1];
    if (argc < 2) return cli_error(CLI_USAGE, "no command given; fathom --help lists them");
    for (const struct command *const *c = commands; *c; c++)
        if (!strcmp(name, (*c)->name)) return (*c)->run(*c, argc - 1, argv + 1);
    if (!strcmp(name, "--completion")) return complete(argc, argv);
    if (!strcmp(name, "--help") || !strcmp(name, "-h") || !strcmp(name, "help"))
        help_print_commands(commands);
    else if (!strcmp(name, "--version"))
        printf("fathom %s\n", fathom_version());
    else if (!strcmp(name, "--man"))
        manual_print(commands);
    else
        return refuse(name);
    return CLI_DONE;
}

int main(int argc, char **argv) {
    const int status = run(argc, argv);
    /* Output may still be in stdio's buffer; a full disk behind stdout is a failure like any other. */
    const bool lost = fflush(stdout) || ferror(stdout);
    if (status != CLI_DONE && status != CLI_HELPED) return status;
    return lost ? cli_error(CLI_FAILED, "standard output: %s", strerror(errno)) : CLI_DONE;
}
