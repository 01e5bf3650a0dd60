/* Messages and paths of the recording reader. */
#include "recording/recording_internal.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static void say(const struct recording *recording, fathom_log_level level, const char *format,
                va_list arguments) {
    char text[1024];
    if (!recording->log) return;
    vsnprintf(text, sizeof text, format, arguments);
    recording->log(recording->log_user, level, text);
}

void recording_say(const struct recording *recording, fathom_log_level level, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    say(recording, level, format, arguments);
    va_end(arguments);
}

int recording_fail(const struct recording *recording, int code, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    say(recording, FATHOM_LOG_ERROR, format, arguments);
    va_end(arguments);
    return code;
}

char *recording_path(const struct recording *recording, const char *file) {
    if (*file == '/') return strdup(file);
    const size_t size = strlen(recording->folder) + strlen(file) + 2;
    char *path = malloc(size);
    if (path) snprintf(path, size, "%s/%s", recording->folder, file);
    return path;
}
