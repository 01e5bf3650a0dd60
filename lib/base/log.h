/* The library's log: formats a message for the caller's callback. */
#ifndef FATHOM_LOG_H
#define FATHOM_LOG_H

#include "fathom.h"

/* Does nothing when config->log is NULL. A message is cut at 511 bytes. */
void log_write(const fathom_config *config, fathom_log_level level, const char *format, ...)
    __attribute__((format(printf, 3, 4)));

#endif
