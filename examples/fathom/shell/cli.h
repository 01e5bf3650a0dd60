/* Shared by the commands of `fathom`: exit statuses, one-line errors, Ctrl-C, progress. */
#ifndef FATHOM_CLI_H
#define FATHOM_CLI_H

#include <stdbool.h>
#include <stdint.h>

enum {
    CLI_DONE = 0,          /* it worked */
    CLI_FAILED = 1,        /* it failed, after one line on stderr with the reason */
    CLI_USAGE = 2,         /* wrong usage or settings */
    CLI_INTERRUPTED = 130, /* stopped by Ctrl-C, files whole */
    CLI_HELPED = 256       /* no exit status: the help was printed, and nothing else is to be done */
};

/* Prints "fathom: " and the text as one line on stderr. Returns status, so that `return cli_error(CLI_FAILED, ...)`
 * reads well. */
int cli_error(int status, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Prints "fathom: note: ..." / "fathom: warning: ..." on stderr. */
void cli_note(const char *format, ...) __attribute__((format(printf, 1, 2)));
void cli_warning(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* Parses a whole argument as a number within [low, high]; false after an error message about `option`. */
bool cli_parse_long(const char *option, const char *text, long low, long high, long *value);
bool cli_parse_double(const char *option, const char *text, double low, double high, double *value);

/* Checks before a scan whether a file can be written. False after an error message. */
bool cli_can_write(const char *file);

/* Installs the Ctrl-C (SIGINT) and SIGTERM handlers; the first sets the flag that cli_interrupted() reads, a second one
 * kills. */
void cli_catch_interrupt(void);
bool cli_interrupted(void);

/* A progress line on stderr: drawn only on a terminal, or when forced by --progress; maximum ten times per second. */
void cli_progress_start(const char *what, long total, bool forced);
void cli_progress(long done, const char *detail); /* detail may be NULL */
void cli_progress_end(void);

#endif
