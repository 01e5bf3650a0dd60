/* The commands of `fathom`. */
#ifndef FATHOM_CLI_COMMANDS_H
#define FATHOM_CLI_COMMANDS_H

#include "fathom/shell/options.h"

extern const struct command command_replay, command_scan, command_log, command_devices, command_simulate,
    command_calibrate, command_info, command_kernels, command_selftest;

#endif
