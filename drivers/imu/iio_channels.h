/* Parsing of Linux IIO's buffers and attributes, independent of the kernel and libiio. */
#ifndef FATHOM_IIO_CHANNELS_H
#define FATHOM_IIO_CHANNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* How a channel's value is stored, from scan_elements/in_*_type: [be|le]:[s|u]bits/storagebits[>>shift]. */
typedef struct {
    bool big_endian, is_signed;
    unsigned bits, storage_bits, shift;
} iio_format;

/* "le:s16/16>>0". False: another format, repeated values, or invalid sizes. */
bool iio_format_parse(const char *text, iio_format *format);

/* The value in a scan. format must be one that iio_format_parse would accept. */
int64_t iio_value(const iio_format *format, const uint8_t *bytes);

/* "1, 0, 0; 0, 1, 0; 0, 0, 1", row by row: from the chip's axes to the board's. False: another format, or not a
 * rotation (then *matrix is the identity). */
bool iio_mount_matrix_parse(const char *text, double matrix[9]);

/* matrix times vector, in place. */
void iio_mount(const double matrix[9], double vector[3]);

#endif
