/* Any bytes as a stream from an MTi, in pieces of any size; and as the data of a message. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "imu/mtdata2.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void use(mtdata2_state *state, const uint8_t *data, size_t length, int64_t now_ns) {
    imu_reading r;
    uint8_t *exact = malloc(length + 1);
    memcpy(exact, data, length);
    if (mtdata2_read(state, exact, length, now_ns, &r) == MTDATA2_READING)
        for (int i = 0; i < 3; i++)
            if (!isfinite(r.gyro[0][i]) || !isfinite(r.accel[0][i])) abort();
    free(exact);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    static xbus_parser parser;
    mtdata2_state state = {0}, direct = {0};
    if (size < 1) return 0;
    memset(&parser, 0, sizeof parser);
    const size_t piece = data[0] + 1u;
    int64_t now_ns = 1;
    for (size_t at = 1; at < size; at += piece) {
        const size_t length = piece < size - at ? piece : size - at;
        for (size_t taken = 0;;) {
            xbus_message message;
            bool whole;
            taken += xbus_take(&parser, data + at + taken, length - taken, &message, &whole);
            if (!whole) break;
            use(&state, message.data, message.length, now_ns += 2500000);
        }
    }
    use(&direct, data, size, 1);
    use(&direct, data, size, 2);
    return 0;
}
