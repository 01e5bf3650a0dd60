/* A scanning context with its block of memory. */
#ifndef FATHOM_SHELL_LIBRARY_H
#define FATHOM_SHELL_LIBRARY_H

#include "fathom.h"
#include "fathom/shell/log.h"

/* All zero: not started. */
struct library {
    fathom_memory_plan plan;
    void *memory;
    fathom *scan;
};

/* Starts it; its messages go to log, which is set in config. Returns a CLI_ status, after a message on errors. */
int library_start(struct library *library, fathom_config *config, struct cli_log *log);

/* Allowed when it wasn't started. */
void library_stop(struct library *library);

/* The CLI_ status for an error: CLI_USAGE for wrong settings, else CLI_FAILED. */
int library_status(int error);

#endif
