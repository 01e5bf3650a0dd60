/* Settings as text: the same in every locale, and read back to the same bits. */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "api/settings.h"
#include "api/settings_table.h"
#include "base/sized.h"

#define NUMBER_SIZE 64  /* bytes of a number's text */
#define NO_TEXT "default" /* stands for NULL */

/* The locale's decimal point, which strtod and printf use. */
static void decimal_point(char point[8]) {
    char half[16];
    snprintf(half, sizeof half, "%.1f", 0.5);
    snprintf(point, 8, "%.*s", (int)strlen(half) - 2, half + 1);
}

static size_t digits(const char *text) {
    return strspn(text, "0123456789");
}

/* -12.5e-3 and the like; no space, no hexadecimal, no inf, no nan. */
static bool is_number(const char *text) {
    text += *text == '-' || *text == '+';
    const size_t whole = digits(text);
    text += whole;
    size_t part = 0;
    if (*text == '.') {
        part = digits(text + 1);
        text += 1 + part;
    }
    if (whole + part == 0) return false;
    if (*text == 'e' || *text == 'E') {
        text++;
        text += *text == '-' || *text == '+';
        if (digits(text) == 0) return false;
        text += digits(text);
    }
    return !*text;
}

static bool read_number(const char *text, double *value) {
    char point[8], local[NUMBER_SIZE + 8];
    if (strlen(text) >= NUMBER_SIZE || !is_number(text)) return false;
    decimal_point(point);
    const size_t before = strcspn(text, ".");
    snprintf(local, sizeof local, "%.*s%s%s", (int)before, text, text[before] ? point : "",
             text[before] ? text + before + 1 : "");
    *value = strtod(local, NULL);
    return true;
}

static bool read_whole(const char *text, int64_t *value) {
    const char *first = text + (*text == '-' || *text == '+');
    if (digits(first) == 0 || first[digits(first)]) return false;
    errno = 0;
    *value = strtoll(text, NULL, 10); /* beyond 64 bits: the limit, which no setting allows */
    return true;
}

/* The index of text among words separated by bars. */
static bool read_word(const char *words, const char *text, int32_t *value) {
    const size_t length = strlen(text);
    for (*value = 0;; ++*value) {
        const size_t end = strcspn(words, "|");
        if (length == end && strncmp(words, text, end) == 0) return true;
        if (!words[end]) return false;
        words += end + 1;
    }
}

static int set_number(const setting_row *row, fathom_config *config, double value) {
    const double held = row->type == FATHOM_SETTING_FLOAT ? (float)value : value;
    if (!setting_allows(row, held)) return FATHOM_ERROR_CONFIG;
    setting_store(row, config, value);
    return FATHOM_OK;
}

static int set_row(const setting_row *row, fathom_config *config, const char *text) {
    double number;
    int64_t whole;
    int32_t word;
    switch (row->type) {
    case FATHOM_SETTING_TEXT: {
        const char *kept = strcmp(text, NO_TEXT) == 0 ? NULL : text;
        memcpy((char *)config + row->at, &kept, sizeof kept);
        return FATHOM_OK;
    }
    case FATHOM_SETTING_BOOL:
        if (strcmp(text, "false") == 0 || strcmp(text, "true") == 0)
            return set_number(row, config, *text == 't');
        return read_word(row->words, text, &word) ? set_number(row, config, word) : FATHOM_ERROR_VALUE;
    case FATHOM_SETTING_WORD:
        return read_word(row->words, text, &word) ? set_number(row, config, word) : FATHOM_ERROR_VALUE;
    case FATHOM_SETTING_INT32:
        return read_whole(text, &whole) ? set_number(row, config, (double)whole) : FATHOM_ERROR_VALUE;
    case FATHOM_SETTING_INT64:
        if (!read_whole(text, &whole)) return FATHOM_ERROR_VALUE;
        if (!setting_allows(row, (double)whole)) return FATHOM_ERROR_CONFIG;
        memcpy((char *)config + row->at, &whole, sizeof whole);
        return FATHOM_OK;
    default: return read_number(text, &number) ? set_number(row, config, number) : FATHOM_ERROR_VALUE;
    }
}

/* The shortest text that is read back as the same value. */
static void print_number(double value, bool single, char text[NUMBER_SIZE]) {
    char point[8];
    decimal_point(point);
    for (int precision = 1; precision <= 17; precision++) {
        snprintf(text, NUMBER_SIZE, "%.*g", precision, value);
        const double back = strtod(text, NULL);
        if (single ? (float)back == (float)value : back == value) break;
    }
    if (strchr(text, 'e') && fabs(value) >= 1 && fabs(value) < 1e7) /* 300, not 3e+02 */
        snprintf(text, NUMBER_SIZE, "%.0f", value);
    char *at = strstr(text, point);
    if (!at) return;
    memmove(at + 1, at + strlen(point), strlen(at + strlen(point)) + 1);
    *at = '.';
}

static int print_word(const char *words, int value, char *text, size_t size) {
    const char *at = words;
    for (int i = 0; at && i < value; i++) {
        at = strchr(at, '|');
        if (at) at++;
    }
    if (value < 0 || !at) return snprintf(text, size, "%d", value);
    return snprintf(text, size, "%.*s", (int)strcspn(at, "|"), at);
}

int setting_print(const setting_row *row, const fathom_config *config, char *text, size_t size) {
    char number[NUMBER_SIZE];
    const char *kept;
    int64_t whole;
    switch (row->type) {
    case FATHOM_SETTING_TEXT:
        memcpy(&kept, (const char *)config + row->at, sizeof kept);
        return snprintf(text, size, "%s", kept ? kept : NO_TEXT);
    case FATHOM_SETTING_BOOL:
    case FATHOM_SETTING_WORD: return print_word(row->words, (int)setting_value(row, config), text, size);
    case FATHOM_SETTING_INT64:
        memcpy(&whole, (const char *)config + row->at, sizeof whole);
        return snprintf(text, size, "%lld", (long long)whole);
    case FATHOM_SETTING_INT32: return snprintf(text, size, "%d", (int)setting_value(row, config));
    default:
        print_number(setting_value(row, config), row->type == FATHOM_SETTING_FLOAT, number);
        return snprintf(text, size, "%s", number);
    }
}

int setting_print_range(const setting_row *row, char *text, size_t size) {
    char low[NUMBER_SIZE], high[NUMBER_SIZE];
    if (row->type == FATHOM_SETTING_TEXT) return snprintf(text, size, "text");
    if (*row->words) return snprintf(text, size, "%s", row->words);
    print_number(row->low, false, low);
    print_number(row->high, false, high);
    return snprintf(text, size, "%s%s..%s", row->zero ? "0," : "", low, high);
}

/* ---- public ------------------------------------------------------------------------------------------------------ */

/* The row, if the caller's struct is long enough for its field. */
static const setting_row *row_in(const fathom_config *config, const char *name) {
    const setting_row *row = settings_find(name);
    return row && row->at + row->size <= sized_of(config) ? row : NULL;
}

int fathom_config_set(fathom_config *config, const char *name, const char *value) {
    if (!config || !name || !value || sized_of(config) == 0) return FATHOM_ERROR_ARGUMENT;
    const setting_row *row = row_in(config, name);
    return row ? set_row(row, config, value) : FATHOM_ERROR_NAME;
}

int fathom_config_get(const fathom_config *config, const char *name, char *text, size_t size) {
    if (!config || !name || (!text && size > 0) || sized_of(config) == 0) return FATHOM_ERROR_ARGUMENT;
    const setting_row *row = row_in(config, name);
    return row ? setting_print(row, config, text, size) : FATHOM_ERROR_NAME;
}

int fathom_get_setting(int32_t index, fathom_setting *setting) {
    const size_t size = sized_of(setting);
    if (!setting || size == 0 || index < 0) return FATHOM_ERROR_ARGUMENT;
    if (index >= settings_count) return FATHOM_ERROR_NO_DATA;
    const setting_row *row = &settings_table[index];
    fathom_setting whole = {.type = row->type,
                            .name = row->name,
                            .group = row->group,
                            .unit = row->unit,
                            .words = row->words,
                            .meaning = row->meaning,
                            .min = row->low,
                            .max = row->high,
                            .zero = row->zero};
    const fathom_config defaults = config_default();
    setting_print(row, &defaults, whole.default_text, sizeof whole.default_text);
    setting_print_range(row, whole.range_text, sizeof whole.range_text);
    sized_out(setting, size, &whole, sizeof whole);
    return FATHOM_OK;
}
