/* Reads text files of one record per line: numbers and words, # comments. For drivers/ only. */
#ifndef FATHOM_RECORDING_TEXT_H
#define FATHOM_RECORDING_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct text_file {
    FILE *file;
    char *line;      /* the current line, without comment and surrounding blanks */
    size_t capacity; /* of line */
    int number;      /* of the current line, from 1 */
    char *at;        /* the unread rest of the line */
    int error;       /* errno of a failed read, or 0 */
};

/* Returns 0 or an errno. text_close must follow in either case. */
int text_open(struct text_file *text, const char *path);
void text_close(struct text_file *text);

/* Goes to the next line that isn't empty; false at the end, or when reading failed (then error is set). */
bool text_next(struct text_file *text);

/* Each reads the next word of the line; false when there is none or it isn't of that kind. A number may be nan or inf:
 * the caller decides. */
bool text_number(struct text_file *text, double *value);
bool text_word(struct text_file *text, char **word);

/* Seconds, to the nanosecond: a double has a resolution of a quarter of a microsecond for present-day stamps. */
bool text_stamp(struct text_file *text, int64_t *timestamp_ns);

/* The rest of the line, without surrounding blanks; may be empty. */
char *text_rest(struct text_file *text);

/* Whether the whole line has been read. */
bool text_at_end(const struct text_file *text);

#endif
