#include "imu/iio_channels.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

bool iio_format_parse(const char *text, iio_format *format) {
    char order[3], sign;
    unsigned bits, storage, shift = 0;
    int end = 0;
    *format = (iio_format){0};
    if (sscanf(text, "%2[bel]:%c%4u/%4u%n", order, &sign, &bits, &storage, &end) != 4) return false;
    text += end;
    if (*text == '>' && (sscanf(text, ">>%4u%n", &shift, &end) != 1 || (text += end, false))) return false;
    if (*text && *text != '\n') return false; /* X: repeated */
    if (strcmp(order, "be") && strcmp(order, "le")) return false;
    if (sign != 's' && sign != 'u') return false;
    if (storage != 8 && storage != 16 && storage != 32 && storage != 64) return false;
    if (bits == 0 || bits > storage || shift > storage - bits) return false;
    *format = (iio_format){order[0] == 'b', sign == 's', bits, storage, shift};
    return true;
}

int64_t iio_value(const iio_format *format, const uint8_t *bytes) {
    const unsigned size = format->storage_bits / 8;
    uint64_t raw = 0;
    for (unsigned i = 0; i < size; i++) raw = raw << 8 | bytes[format->big_endian ? i : size - 1 - i];
    raw >>= format->shift;
    if (format->bits == 64) return (int64_t)raw;
    raw &= (UINT64_C(1) << format->bits) - 1;
    if (format->is_signed && raw >> (format->bits - 1)) raw |= UINT64_MAX << format->bits;
    return (int64_t)raw;
}

static double determinant(const double m[9]) {
    return m[0] * (m[4] * m[8] - m[5] * m[7]) - m[1] * (m[3] * m[8] - m[5] * m[6]) +
           m[2] * (m[3] * m[7] - m[4] * m[6]);
}

bool iio_mount_matrix_parse(const char *text, double matrix[9]) {
    static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    double m[9];
    memcpy(matrix, identity, sizeof identity);
    if (sscanf(text, "%lf , %lf , %lf ; %lf , %lf , %lf ; %lf , %lf , %lf", &m[0], &m[1], &m[2], &m[3], &m[4],
               &m[5], &m[6], &m[7], &m[8]) != 9)
        return false;
    for (int row = 0; row < 3; row++)
        for (int other = 0; other <= row; other++) {
            double product = 0;
            for (int i = 0; i < 3; i++) product += m[3 * row + i] * m[3 * other + i];
            if (!(fabs(product - (row == other)) < 0.02)) return false;
        }
    /* Mirrors occur, where drivers change signs with them, and are applied. */
    if (!(fabs(fabs(determinant(m)) - 1) < 0.05)) return false;
    memcpy(matrix, m, sizeof m);
    return true;
}

void iio_mount(const double matrix[9], double vector[3]) {
    const double v[3] = {vector[0], vector[1], vector[2]};
    for (int i = 0; i < 3; i++)
        vector[i] = matrix[3 * i] * v[0] + matrix[3 * i + 1] * v[1] + matrix[3 * i + 2] * v[2];
}
