/* Log messages of drivers. */
#ifndef FATHOM_SOURCE_LOG_H
#define FATHOM_SOURCE_LOG_H

#include "fathom_drivers.h"

/* Writes one line to the log; log may be NULL. */
void source_say(fathom_log log, void *log_user, fathom_log_level level, const char *format, ...)
    __attribute__((format(printf, 4, 5)));

/* The same as an error, by a source's options; returns code. */
int source_fail(const fathom_source_options *options, int code, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

/* The same as a warning. */
void source_warn(const fathom_source_options *options, const char *format, ...)
    __attribute__((format(printf, 2, 3)));

#endif
