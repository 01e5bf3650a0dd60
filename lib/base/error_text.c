#include "base/error_text.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static void keep(error_text *r, const char *text) {
    if (r->kept) return;
    r->kept = true;
    snprintf(r->text, sizeof r->text, "%.*s", (int)strcspn(text, "\n"), text);
}

void error_text_log(void *user, fathom_log_level level, const char *text) {
    error_text *r = user;
    if (level == FATHOM_LOG_ERROR) keep(r, text);
    if (r->log) r->log(r->log_user, level, text);
}

int error_text_fail(error_text *r, int error, fathom_log_level level, const char *format, ...) {
    char text[sizeof r->text];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    keep(r, text);
    if (r->log) r->log(r->log_user, level, text);
    return error;
}

void error_text_copy(const error_text *r, char *why, size_t size) {
    if (why && size > 0) snprintf(why, size, "%s", r->text);
}
