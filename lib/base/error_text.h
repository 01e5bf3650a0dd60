/* Error texts: every message of a context passes here on its way to the caller's log, and the text of the latest
 * failure is kept for fathom_last_error. */
#ifndef FATHOM_ERROR_TEXT_H
#define FATHOM_ERROR_TEXT_H

#include "fathom.h"

typedef struct {
    fathom_log log; /* the caller's, or NULL */
    void *log_user;
    bool kept; /* the text is of this call: later messages are about the same failure */
    char text[256];
} error_text;

/* A fathom_log: keeps an error's text and passes it on. user: an error_text. */
void error_text_log(void *user, fathom_log_level level, const char *text);

/* Keeps the text, logs it at that level, and returns the error. */
int error_text_fail(error_text *r, int error, fathom_log_level level, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* Copies the text into a caller's buffer, truncated to its size; does nothing without a buffer. */
void error_text_copy(const error_text *r, char *why, size_t size);

#endif
