#include "recording/recording_text.h"

#include <ctype.h>
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static bool is_blank(char c) {
    return isspace((unsigned char)c) != 0;
}

int text_open(struct text_file *text, const char *path) {
    *text = (struct text_file){.file = fopen(path, "r")};
    return text->file ? 0 : errno;
}

void text_close(struct text_file *text) {
    if (text->file) fclose(text->file);
    free(text->line);
    *text = (struct text_file){0};
}

/* Removes the comment and surrounding blanks (including a carriage return) from the current line. */
static void trim(struct text_file *text, size_t length) {
    char *start = text->line;
    if (text->number == 1 && length >= 3 && memcmp(start, "\xEF\xBB\xBF", 3) == 0)
        start += 3; /* byte order mark */
    while (is_blank(*start)) start++;
    for (char *c = start; *c; c++)
        if (*c == '#' && (c == start || is_blank(c[-1]))) *c = 0;
    char *end = start + strlen(start);
    while (end > start && is_blank(end[-1])) end--;
    *end = 0;
    text->at = start;
}

bool text_next(struct text_file *text) {
    for (;;) {
        errno = 0;
        const ssize_t length = getline(&text->line, &text->capacity, text->file);
        if (length < 0) {
            /* getline returns -1 for the end, for a failed read (such as of a folder) and without memory. */
            if (ferror(text->file) || errno == ENOMEM) text->error = errno ? errno : EIO;
            return false;
        }
        text->number++;
        trim(text, (size_t)length);
        if (*text->at) return true;
    }
}

bool text_word(struct text_file *text, char **word) {
    while (is_blank(*text->at)) text->at++;
    if (!*text->at) return false;
    *word = text->at;
    while (*text->at && !is_blank(*text->at)) text->at++;
    if (*text->at) *text->at++ = 0;
    return true;
}

static bool word_to_number(const char *word, double *value) {
    if (strpbrk(word, "xXpP(")) return false; /* strtod would accept 0x1p3 and nan(...) */
    char *end;
    *value = strtod(word, &end);
    return end != word && !*end;
}

bool text_number(struct text_file *text, double *value) {
    char *word;
    return text_word(text, &word) && word_to_number(word, value);
}

bool text_stamp(struct text_file *text, int64_t *timestamp_ns) {
    char *word;
    double seconds;
    if (!text_word(text, &word) || !word_to_number(word, &seconds)) return false;
    if (!(fabs(seconds) < 9e9)) return false; /* nan too; int64 nanoseconds reach to 9.2e9 s */
    if (strpbrk(word, "eE")) {
        *timestamp_ns = llround(seconds * 1e9);
        return true;
    }
    const bool negative = *word == '-';
    if (negative || *word == '+') word++;
    int64_t ns = 0;
    int decimals = -1; /* -1: still before the point */
    for (; *word && decimals < 9; word++) {
        if (*word == '.') {
            decimals = 0;
        } else {
            ns = ns * 10 + (*word - '0');
            if (decimals >= 0) decimals++;
        }
    }
    if (*word >= '5' && *word <= '9') ns++; /* the tenth decimal rounds */
    for (; decimals < 9; decimals++) ns *= decimals < 0 ? 1 : 10;
    *timestamp_ns = negative ? -ns : ns;
    return true;
}

char *text_rest(struct text_file *text) {
    while (is_blank(*text->at)) text->at++;
    char *rest = text->at;
    text->at += strlen(text->at);
    return rest;
}

bool text_at_end(const struct text_file *text) {
    const char *c = text->at;
    while (is_blank(*c)) c++;
    return !*c;
}
