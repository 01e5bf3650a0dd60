/* A scanning context with the block of memory that it lives in. */
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

/* Starts it; its messages go to log, which config then names. Returns a CLI_ status, after saying what went wrong. */
int library_start(struct library *library, fathom_config *config, struct cli_log *log);

/* Nothing need have been started. */
void library_stop(struct library *library);

/* Wrong settings are the user's to mend (CLI_USAGE); the rest has failed. */
int library_status(int error);

#endif
