/* Takes the messages of the library and its drivers: warnings go to stderr at once, an error is kept for the
 * one line that the command ends with. */
#ifndef FATHOM_CLI_LOG_H
#define FATHOM_CLI_LOG_H

#include <stdbool.h>

#include "fathom.h"

struct cli_log {
    bool verbose;     /* show informative messages, too */
    char error[1024]; /* the first error since log_clear, one line; empty without one */
};

/* A fathom_log; user is a struct cli_log. */
void log_message(void *user, fathom_log_level level, const char *text);

void log_clear(struct cli_log *log);

/* The reason of an error: the library's message, else the error's name. */
const char *log_reason(const struct cli_log *log, int error);

#endif
