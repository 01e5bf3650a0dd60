/* Walks over a command's arguments: `--name value`, `--name=value`, `--flag`, and plain words. */
#ifndef FATHOM_CLI_OPTIONS_H
#define FATHOM_CLI_OPTIONS_H

#include <stdbool.h>

struct options {
    int count;         /* of arguments */
    char **arguments;  /* the first is the command's name */
    int at;            /* the next one to read; starts at 1 */
    bool only_words;   /* after -- */
    char name[64];     /* of the present option, with its dashes; empty for a word */
    const char *value; /* the present word, or what followed = */
};

/* Goes to the next argument; false at the end. */
bool options_next(struct options *options);

/* The present option's value, taken from the next argument unless = gave it; NULL, and said so, when there is
 * none. */
const char *options_value(struct options *options);

/* False, and said so, when = gave a value to an option that takes none. */
bool options_flag(const struct options *options);

/* "A,B,C" into exactly count numbers within [low, high]; false, and said so, when it isn't. */
bool parse_numbers(const char *option, const char *text, int count, double low, double high, double *values);

/* "WxH". */
bool parse_size(const char *option, const char *text, int low, int high, int *width, int *height);

/* Frames from..to-1. */
struct frame_range {
    int from, to;
};

#define MOST_RANGES 64
struct frame_ranges {
    int count;
    struct frame_range range[MOST_RANGES];
};

/* "A:B[,A:B]", added to those already there. */
bool parse_ranges(const char *option, const char *text, struct frame_ranges *ranges);

#endif
