#include "imu/udp_lines.h"

#include <ctype.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { ACCELEROMETER = 3, GYROSCOPE = 4 };

static void skip_blanks(const char **at) {
    while (isspace((unsigned char)**at)) ++*at;
}

/* A finite decimal number; strtod would also take nan, inf and hexadecimal. */
static bool number(const char **at, double *value) {
    skip_blanks(at);
    const char *c = *at + (**at == '-' || **at == '+');
    if (!isdigit((unsigned char)*c) && *c != '.') return false;
    if (c[0] == '0' && (c[1] == 'x' || c[1] == 'X')) return false;
    char *end;
    *value = strtod(*at, &end);
    if (end == *at || !isfinite(*value)) return false;
    *at = end;
    skip_blanks(at);
    return true;
}

static bool take(const char **at, char c) {
    if (**at != c) return false;
    ++*at;
    skip_blanks(at);
    return true;
}

/* ---- comma-separated ---- */

static int values_of(int sensor) {
    switch (sensor) {
    case 7:
    case 8:
    case 85:
    case 86: return 1; /* pressure, proximity, ..., battery */
    default: return 3;
    }
}

static udp_line_result parse_csv(const char *at, udp_line *line) {
    if (!number(&at, &line->time)) return UDP_LINE_MALFORMED;
    while (*at) {
        double sensor, values[3];
        if (!take(&at, ',') || !number(&at, &sensor) || sensor != floor(sensor) || fabs(sensor) > 1000)
            return UDP_LINE_MALFORMED;
        const int count = values_of((int)sensor);
        for (int i = 0; i < count; i++)
            if (!take(&at, ',') || !number(&at, &values[i])) return UDP_LINE_MALFORMED;
        if ((int)sensor == ACCELEROMETER) {
            memcpy(line->accel, values, sizeof values);
            line->has_accel = true;
        } else if ((int)sensor == GYROSCOPE) {
            memcpy(line->gyro, values, sizeof values);
            line->has_gyro = true;
        }
    }
    return line->has_gyro || line->has_accel ? UDP_LINE_READING : UDP_LINE_OTHER;
}

/* ---- JSON: one object; what isn't ours is skipped, however deep ---- */

#define MOST_DEPTH 16

/* A string; key gets it, truncated, with escapes unchanged. */
static bool string(const char **at, char *key, size_t size) {
    if (**at != '"') return false;
    size_t n = 0;
    for (++*at; **at != '"'; ++*at) {
        if ((unsigned char)**at < ' ') return false; /* the end too */
        if (**at == '\\' && *++*at == 0) return false;
        if (n + 1 < size) key[n++] = **at;
    }
    if (size) key[n] = 0;
    ++*at;
    skip_blanks(at);
    return true;
}

static bool word(const char **at, const char *text) {
    const size_t length = strlen(text);
    if (strncmp(*at, text, length)) return false;
    *at += length;
    skip_blanks(at);
    return true;
}

static bool skip_value(const char **at, int depth) {
    double ignored;
    if (depth > MOST_DEPTH) return false;
    if (**at == '"') return string(at, NULL, 0);
    const bool object = **at == '{';
    if (!object && **at != '[')
        return word(at, "true") || word(at, "false") || word(at, "null") || number(at, &ignored);
    const char close = object ? '}' : ']';
    take(at, **at);
    if (take(at, close)) return true;
    do
        if ((object && (!string(at, NULL, 0) || !take(at, ':'))) || !skip_value(at, depth + 1)) return false;
    while (take(at, ','));
    return take(at, close);
}

static bool vector(const char **at, double values[3]) {
    return take(at, '[') && number(at, &values[0]) && take(at, ',') && number(at, &values[1]) &&
           take(at, ',') && number(at, &values[2]) && take(at, ']');
}

static udp_line_result parse_json(const char *at, udp_line *line) {
    bool timed = false;
    double count;
    if (!take(&at, '{')) return UDP_LINE_MALFORMED;
    if (!take(&at, '}')) {
        do {
            char key[16];
            bool good;
            if (!string(&at, key, sizeof key) || !take(&at, ':')) return UDP_LINE_MALFORMED;
            if (!strcmp(key, "t")) {
                good = timed = number(&at, &line->time);
            } else if (!strcmp(key, "gyro")) {
                good = line->has_gyro = vector(&at, line->gyro);
            } else if (!strcmp(key, "accel")) {
                good = line->has_accel = vector(&at, line->accel);
            } else if (!strcmp(key, "n")) {
                good = line->has_count = number(&at, &count) && count == floor(count) && fabs(count) < 9e15;
                if (good) line->count = (int64_t)count;
            } else {
                good = skip_value(&at, 0);
            }
            if (!good) return UDP_LINE_MALFORMED;
        } while (take(&at, ','));
        if (!take(&at, '}')) return UDP_LINE_MALFORMED;
    }
    if (*at) return UDP_LINE_MALFORMED;
    if (!line->has_gyro && !line->has_accel) return UDP_LINE_OTHER;
    return timed ? UDP_LINE_READING : UDP_LINE_MALFORMED;
}

udp_line_result udp_line_parse(udp_format format, const char *text, size_t length, udp_line *line) {
    char copy[UDP_LINE_MOST + 1];
    *line = (udp_line){0};
    if (length >= sizeof copy || memchr(text, 0, length)) return UDP_LINE_MALFORMED;
    memcpy(copy, text, length);
    copy[length] = 0;
    const char *at = copy;
    skip_blanks(&at);
    if (!*at) return UDP_LINE_OTHER;
    const bool json = format == UDP_FORMAT_JSON || (format == UDP_FORMAT_ANY && *at == '{');
    const udp_line_result result = json ? parse_json(at, line) : parse_csv(at, line);
    if (result != UDP_LINE_READING) *line = (udp_line){0};
    return result;
}
