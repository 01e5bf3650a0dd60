/* Reads text files of one record a line: numbers and words, # comments. For drivers/ only. */
#ifndef FATHOM_RECORDING_TEXT_H
#define FATHOM_RECORDING_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

struct text_file {
    FILE *file;
    char *line;      /* the present line, comment and blanks at its ends taken off */
    size_t capacity; /* of line */
    int number;      /* of the present line, from 1 */
    char *at;        /* what of the line hasn't been read yet */
    int error;       /* errno of a failed read, or 0 */
};

/* Returns 0 or an errno. text_close must follow in either case. */
int text_open(struct text_file *text, const char *path);
void text_close(struct text_file *text);

/* Goes to the next line that holds anything; false at the end, or when reading failed (then error is set). */
bool text_next(struct text_file *text);

/* Each takes the next word of the line; false when there is none or it isn't wholly of the kind. A number may
 * be nan or inf: the caller decides. */
bool text_number(struct text_file *text, double *value);
bool text_word(struct text_file *text, char **word);

/* Seconds, to the nanosecond: a double would leave a quarter of a microsecond of a stamp of our days. */
bool text_stamp(struct text_file *text, int64_t *timestamp_ns);

/* The rest of the line, blanks at its ends taken off; empty when nothing is left. */
char *text_rest(struct text_file *text);

/* Nothing is left of the line. */
bool text_at_end(const struct text_file *text);

#endif
