/* The help of the commands, from their tables: --help, shell completion, the manual page. */
#ifndef FATHOM_SHELL_HELP_H
#define FATHOM_SHELL_HELP_H

#include <stdio.h>

#include "fathom/shell/options.h"

/* fathom COMMAND --help. */
void help_print(const struct command *command);

/* fathom --help. A NULL ends the commands, here and below. */
void help_print_commands(const struct command *const *commands);

/* fathom --completion bash: a script for bash to source. */
void completion_print_bash(const struct command *const *commands);

/* fathom --man: the page fathom(1), for man or groff. */
void manual_print(const struct command *const *commands);

/* "--name VALUE". */
const char *help_option(const struct option_row *row, char *text, size_t room);

/* The command and its words, "fathom replay FOLDER [options]". */
void help_print_usage(const struct command *command, FILE *out);

#endif
