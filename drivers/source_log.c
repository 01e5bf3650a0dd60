#include "source_log.h"

#include <stdarg.h>
#include <stdio.h>

static void say(fathom_log log, void *log_user, fathom_log_level level, const char *format,
                va_list arguments) {
    char text[1024];
    if (!log) return;
    vsnprintf(text, sizeof text, format, arguments);
    log(log_user, level, text);
}

void source_say(fathom_log log, void *log_user, fathom_log_level level, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    say(log, log_user, level, format, arguments);
    va_end(arguments);
}

int source_fail(const fathom_source_options *options, int code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    say(options->log, options->log_user, FATHOM_LOG_ERROR, format, arguments);
    va_end(arguments);
    return code;
}

void source_warn(const fathom_source_options *options, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    say(options->log, options->log_user, FATHOM_LOG_WARNING, format, arguments);
    va_end(arguments);
}
