/* Any bytes as a line from a phone, in each format; and uris' settings, IIO's formats and mount matrices, which are text too. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "address.h"
#include "imu/iio_channels.h"
#include "imu/udp_lines.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static source_address address;
    udp_line line;
    char *text = malloc(size + 1);
    memcpy(text, data, size);
    for (int format = UDP_FORMAT_ANY; format <= UDP_FORMAT_JSON; format++)
        if (udp_line_parse((udp_format)format, text, size, &line) == UDP_LINE_READING) {
            if (!line.has_gyro && !line.has_accel) abort();
            for (int i = 0; i < 3; i++)
                if (!isfinite(line.gyro[i]) || !isfinite(line.accel[i]) || !isfinite(line.time)) abort();
        }
    text[size] = 0;
    if (address_parse(&address, text)) address_setting(&address, "format");
    iio_format format;
    double matrix[9];
    if (iio_format_parse(text, &format))
        iio_value(&format, (const uint8_t *)"\xFF\x01\x80\x7F\xFF\x01\x80\x7F");
    iio_mount_matrix_parse(text, matrix);
    for (int i = 0; i < 9; i++)
        if (!(fabs(matrix[i]) < 2)) abort();
    free(text);
    return 0;
}
