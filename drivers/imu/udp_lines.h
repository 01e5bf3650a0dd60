/* Lines of text with inertial samples, as phones send them.
 *
 * Comma-separated, as sensor-streaming apps for Android send them: the time, then groups of a sensor's number and its
 * values:
 *
 *     890.715, 3, -0.07, 9.19, 2.47, 4, 0.01, -0.03, 0.00, 5, 12.1, -3.0, 40.2
 *
 * 3 is the accelerometer (m/s^2), 4 the gyroscope (rad/s); others have three values (7, 8, 85 and 86: one) and are
 * skipped.
 *
 * JSON, an object per line:
 *
 *     {"t": 890.715, "gyro": [0.01, -0.03, 0.00], "accel": [-0.07, 9.19, 2.47], "n": 17}
 *
 * t: the phone's time of the values. gyro or accel may be missing: then the other comes in a line and with a t of its
 * own. n, if there is one, counts lines. Other keys are skipped. */
#ifndef FATHOM_UDP_LINES_H
#define FATHOM_UDP_LINES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define UDP_LINE_MOST 1024 /* characters */

typedef enum {
    UDP_FORMAT_ANY = 0,
    UDP_FORMAT_CSV,
    UDP_FORMAT_JSON
} udp_format; /* ANY: JSON where a line begins with { */

typedef struct {
    double time; /* as sent */
    bool has_gyro, has_accel, has_count;
    double gyro[3], accel[3]; /* as sent */
    int64_t count;
} udp_line;

typedef enum { UDP_LINE_READING, UDP_LINE_OTHER, UDP_LINE_MALFORMED } udp_line_result;

/* Parses a line (which needn't be zero-terminated). OTHER: no inertial data: an empty line, other sensors. */
udp_line_result udp_line_parse(udp_format format, const char *text, size_t length, udp_line *line);

#endif
