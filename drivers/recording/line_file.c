#include "recording/line_file.h"
#include "monotonic.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>
#include <sys/types.h>
#include <unistd.h>

#define FLUSH_NS 500000000

bool line_file_open(struct line_file *file, const char *path) {
    *file = (struct line_file){.flushed_ns = monotonic_now_ns()};
    file->fd = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
    file->is_open = file->fd >= 0;
    if (!file->is_open) file->error = errno;
    return !file->error;
}

bool line_file_flush(struct line_file *file) {
    size_t done = 0;
    while (!file->error && done < file->used) {
        const ssize_t wrote = write(file->fd, file->buffer + done, file->used - done);
        if (wrote > 0)
            done += (size_t)wrote;
        else if (wrote == 0 || errno != EINTR)
            file->error = wrote == 0 ? EIO : errno;
    }
    /* A full disk takes a part of a line; the lines before stay whole. A file that can't be truncated ends in an
     * incomplete line, which readers skip. */
    if (file->error && done > 0 && ftruncate(file->fd, (off_t)file->bytes)) {
    }
    if (!file->error) {
        file->bytes += (int64_t)file->used;
        file->lines += file->waiting;
    }
    file->used = 0;
    file->waiting = 0;
    file->flushed_ns = monotonic_now_ns();
    return !file->error;
}

bool line_file_add(struct line_file *file, const char *format, ...) {
    char line[1001];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    if (!file->error && (length < 0 || length >= (int)sizeof line)) file->error = EOVERFLOW;
    if (!file->error && file->used + (size_t)length > sizeof file->buffer) line_file_flush(file);
    if (file->error) return false;
    memcpy(file->buffer + file->used, line, (size_t)length);
    file->used += (size_t)length;
    file->waiting++;
    return monotonic_now_ns() - file->flushed_ns < FLUSH_NS || line_file_flush(file);
}

bool line_file_close(struct line_file *file) {
    if (!file->is_open) return true;
    line_file_flush(file);
    if (close(file->fd) && !file->error) file->error = errno;
    file->is_open = false;
    return !file->error;
}
