/* The values of options, from their text. Each returns false after an error message for an invalid text. */
#ifndef FATHOM_SHELL_OPTION_VALUES_H
#define FATHOM_SHELL_OPTION_VALUES_H

#include <stdbool.h>

/* "on" or "off". */
bool parse_switch(const char *option, const char *text, bool *on);

/* One of the words, such as "model|previous|none", by its index among them. */
bool parse_choice(const char *option, const char *text, const char *words, int *choice);

/* "A,B,C": exactly count numbers within [low, high]. */
bool parse_numbers(const char *option, const char *text, int count, double low, double high, double *values);

struct option_size {
    int width, height;
};

/* "WxH". */
bool parse_size(const char *option, const char *text, int low, int high, struct option_size *size);

/* Frames from..to-1. */
struct frame_range {
    int from, to;
};

#define MOST_RANGES 64
struct frame_ranges {
    int count;
    struct frame_range range[MOST_RANGES];
};

/* "A:B[,A:B]", added to the present ones. */
bool parse_ranges(const char *option, const char *text, struct frame_ranges *ranges);

#endif
