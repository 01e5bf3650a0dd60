#include "fathom/shell/log.h"
#include "fathom/shell/cli.h"

#include <pthread.h>
#include <stdio.h>
#include <string.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* sources have their own threads */

void log_message(void *user, fathom_log_level level, const char *text) {
    struct cli_log *log = user;
    pthread_mutex_lock(&lock);
    switch (level) {
    case FATHOM_LOG_ERROR:
        /* A compiler's report has many lines, and all of them matter: it is written unchanged. */
        if (strchr(text, '\n')) fprintf(stderr, "%s\n", text);
        /* The first is the cause, later ones are its consequences. */
        if (!*log->error) snprintf(log->error, sizeof log->error, "%.*s", (int)strcspn(text, "\n"), text);
        break;
    case FATHOM_LOG_WARNING: cli_warning("%s", text); break;
    case FATHOM_LOG_INFO:
        if (log->verbose) cli_note("%s", text);
        break;
    }
    pthread_mutex_unlock(&lock);
}

void log_clear(struct cli_log *log) {
    pthread_mutex_lock(&lock);
    *log->error = 0;
    pthread_mutex_unlock(&lock);
}

const char *log_reason(const struct cli_log *log, int error) {
    return *log->error ? log->error : fathom_error_name(error);
}
