/* Shared by the commands: see cli.h. */
#include "fathom/shell/cli.h"

#include <errno.h>
#include <math.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

/* ---- Messages ---- */

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER; /* of stderr and the progress line */

static struct {
    const char *what;
    long total;
    bool shown;   /* progress is wanted at all */
    bool on_line; /* the progress line isn't empty */
    struct timespec last;
} progress;

/* One line, written with one call, so that the lines of two threads don't mix; a progress line is erased first. */
static void print_line(const char *kind, const char *format, va_list arguments) {
    char text[1024];
    vsnprintf(text, sizeof text, format, arguments);
    for (char *c = text; *c; c++)
        if (*c == '\n' || *c == '\r')
            *c = ' '; /* a file name may contain anything; the message stays one line */
    pthread_mutex_lock(&lock);
    fprintf(stderr, "%sfathom: %s%s\n", progress.on_line ? "\r\033[K" : "", kind, text);
    progress.on_line = false;
    pthread_mutex_unlock(&lock);
}

int cli_error(int status, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    print_line("", format, arguments);
    va_end(arguments);
    return status;
}

void cli_note(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    print_line("note: ", format, arguments);
    va_end(arguments);
}

void cli_warning(const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    print_line("warning: ", format, arguments);
    va_end(arguments);
}

/* ---- Arguments ---- */

bool cli_parse_long(const char *option, const char *text, long low, long high, long *value) {
    char *end = NULL;
    errno = 0;
    const long v = strtol(text, &end, 10);
    if (end == text || *end || errno) {
        cli_error(CLI_USAGE, "%s: '%s' is not a whole number", option, text);
        return false;
    }
    if (v < low || v > high) {
        cli_error(CLI_USAGE, "%s: %s is outside %ld..%ld", option, text, low, high);
        return false;
    }
    *value = v;
    return true;
}

bool cli_parse_double(const char *option, const char *text, double low, double high, double *value) {
    char *end = NULL;
    const double v = strtod(text, &end);
    if (end == text || *end || isnan(v)) {
        cli_error(CLI_USAGE, "%s: '%s' is not a number", option, text);
        return false;
    }
    if (v < low || v > high) {
        cli_error(CLI_USAGE, "%s: %s is outside %g..%g", option, text, low, high);
        return false;
    }
    *value = v;
    return true;
}

/* ---- Files ---- */

bool cli_can_write(const char *file) {
    char probe[4096];
    snprintf(probe, sizeof probe, "%s.part", file);
    FILE *opened = fopen(probe, "wb");
    if (!opened) {
        cli_error(CLI_FAILED, "%s: can't be written there (%s.part: %m)", file, file);
        return false;
    }
    fclose(opened);
    unlink(probe);
    return true;
}

/* ---- Ctrl-C ---- */

static volatile sig_atomic_t interrupted;

static void on_interrupt(int signal_number) {
    (void)signal_number;
    interrupted = 1;
}

void cli_catch_interrupt(void) {
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = on_interrupt;
    /* SA_RESETHAND: the second Ctrl-C finds the default action, which kills. SA_RESTART: a write isn't cut
     * short. */
    action.sa_flags = (int)SA_RESETHAND | SA_RESTART;
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
}

bool cli_interrupted(void) {
    return interrupted != 0;
}

/* ---- Progress ---- */

void cli_progress_start(const char *what, long total, bool forced) {
    memset(&progress, 0, sizeof progress);
    progress.what = what;
    progress.total = total;
    progress.shown = forced || isatty(STDERR_FILENO);
}

void cli_progress(long done, const char *detail) {
    if (!progress.shown) return;
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    const double since =
        (double)(now.tv_sec - progress.last.tv_sec) + 1e-9 * (double)(now.tv_nsec - progress.last.tv_nsec);
    if (since < 0.1 && (progress.total <= 0 || done < progress.total)) return;
    progress.last = now;
    pthread_mutex_lock(&lock);
    const bool terminal = isatty(STDERR_FILENO);
    fprintf(stderr, "%s%s %ld", terminal ? "\r\033[K" : "", progress.what, done);
    if (progress.total > 0) fprintf(stderr, "/%ld", progress.total);
    if (detail && *detail) fprintf(stderr, " %s", detail);
    if (!terminal) fputc('\n', stderr); /* forced into a file or a pipe: one line per update, no escapes */
    progress.on_line = terminal;
    fflush(stderr);
    pthread_mutex_unlock(&lock);
}

void cli_progress_end(void) {
    if (progress.on_line) fputc('\n', stderr);
    progress.on_line = false;
    progress.shown = false;
}
