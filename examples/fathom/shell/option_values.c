#include "fathom/shell/option_values.h"
#include "fathom/shell/cli.h"

#include <limits.h>
#include <string.h>

/* Copies the text before the next separator; NULL when it doesn't fit. Moves *text behind the separator, or to NULL at
 * the end. */
static const char *next_part(const char **text, char separator, char part[64]) {
    const char *end = strchr(*text, separator);
    const size_t length = end ? (size_t)(end - *text) : strlen(*text);
    if (length >= 64) return NULL;
    memcpy(part, *text, length);
    part[length] = 0;
    *text = end ? end + 1 : NULL;
    return part;
}

bool parse_choice(const char *option, const char *text, const char *words, int *choice) {
    const size_t length = strlen(text);
    int place = 0;
    for (const char *word = words; word; place++) {
        const size_t ends = strcspn(word, "|");
        if (ends == length && !strncmp(word, text, length)) {
            *choice = place;
            return true;
        }
        word = word[ends] ? word + ends + 1 : NULL;
    }
    cli_error(CLI_USAGE, "%s: '%s' is none of %s", option, text, words);
    return false;
}

bool parse_switch(const char *option, const char *text, bool *on) {
    int choice;
    if (!parse_choice(option, text, "on|off", &choice)) return false;
    *on = choice == 0;
    return true;
}

bool parse_numbers(const char *option, const char *text, int count, double low, double high, double *values) {
    char part[64];
    const char *rest = text;
    for (int i = 0; i < count; i++) {
        if (!rest || !next_part(&rest, ',', part)) {
            cli_error(CLI_USAGE, "%s: '%s' isn't %d numbers with commas between them", option, text, count);
            return false;
        }
        if (!cli_parse_double(option, part, low, high, &values[i])) return false;
    }
    if (rest) cli_error(CLI_USAGE, "%s: '%s' has more than %d numbers", option, text, count);
    return !rest;
}

bool parse_size(const char *option, const char *text, int low, int high, struct option_size *size) {
    char part[64];
    const char *rest = text;
    long w, h;
    if (!next_part(&rest, 'x', part) || !rest || strchr(rest, 'x')) {
        cli_error(CLI_USAGE, "%s: '%s' isn't WIDTHxHEIGHT", option, text);
        return false;
    }
    if (!cli_parse_long(option, part, low, high, &w) || !cli_parse_long(option, rest, low, high, &h))
        return false;
    *size = (struct option_size){(int)w, (int)h};
    return true;
}

bool parse_ranges(const char *option, const char *text, struct frame_ranges *ranges) {
    const char *rest = text;
    while (rest) {
        char part[64];
        long from, to;
        char *colon = NULL;
        if (next_part(&rest, ',', part)) colon = strchr(part, ':');
        if (!colon) {
            cli_error(CLI_USAGE, "%s: '%s' isn't A:B[,A:B], frames A to B-1", option, text);
            return false;
        }
        *colon = 0;
        if (!cli_parse_long(option, part, 0, INT_MAX, &from) ||
            !cli_parse_long(option, colon + 1, 0, INT_MAX, &to))
            return false;
        if (from >= to) {
            cli_error(CLI_USAGE, "%s: %ld:%ld has no frames: the second number comes after the last frame",
                      option, from, to);
            return false;
        }
        if (ranges->count == MOST_RANGES) {
            cli_error(CLI_USAGE, "%s: more than %d ranges", option, MOST_RANGES);
            return false;
        }
        ranges->range[ranges->count++] = (struct frame_range){(int)from, (int)to};
    }
    return true;
}
