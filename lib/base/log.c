#include "base/log.h"

#include <stdarg.h>
#include <stdio.h>

void log_write(const fathom_config *config, fathom_log_level level, const char *format, ...) {
    if (!config->log) return;
    char text[512];
    va_list args;
    va_start(args, format);
    vsnprintf(text, sizeof text, format, args);
    va_end(args);
    config->log(config->log_user, level, text);
}
