#include "log.h"
#include "cli.h"

#include <stdio.h>
#include <string.h>

void log_message(void *user, fathom_log_level level, const char *text) {
    struct cli_log *log = user;
    switch (level) {
    case FATHOM_LOG_ERROR:
        /* A compiler's report has many lines, and all of them matter: it goes out as it is. */
        if (strchr(text, '\n')) fprintf(stderr, "%s\n", text);
        /* The first is the cause, what follows are its consequences. */
        if (!*log->error) snprintf(log->error, sizeof log->error, "%.*s", (int)strcspn(text, "\n"), text);
        break;
    case FATHOM_LOG_WARNING: cli_warning("%s", text); break;
    case FATHOM_LOG_INFO:
        if (log->verbose) cli_note("%s", text);
        break;
    }
}

void log_clear(struct cli_log *log) {
    *log->error = 0;
}

const char *log_reason(const struct cli_log *log, int error) {
    return *log->error ? log->error : fathom_error_name(error);
}
