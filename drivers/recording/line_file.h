/* A text file that grows by whole lines: whenever the writing stops (a kill, a full disk), the file ends with a whole
 * line, and a maximum of half a second of lines is missing. */
#ifndef FATHOM_LINE_FILE_H
#define FATHOM_LINE_FILE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define LINE_FILE_ROOM 16384

struct line_file {
    bool is_open;
    int fd;
    int64_t bytes;      /* written so far */
    int64_t lines;      /* the same */
    int64_t waiting;    /* lines in the buffer */
    int64_t flushed_ns; /* CLOCK_MONOTONIC */
    int error;          /* the errno that ended it; 0: none */
    size_t used;        /* of the buffer: lines not yet written */
    char buffer[LINE_FILE_ROOM];
};

/* Replaces an existing file. This and all below: false on failure, then error is set. */
bool line_file_open(struct line_file *file, const char *path);

/* Adds one line, its end included, of a maximum of 1000 bytes. */
bool line_file_add(struct line_file *file, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Writes the waiting lines. */
bool line_file_flush(struct line_file *file);

/* A file that isn't open is allowed. */
bool line_file_close(struct line_file *file);

#endif
