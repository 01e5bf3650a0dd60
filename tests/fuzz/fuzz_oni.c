/* Any bytes as an .oni recording; and the rest of them as a compressed frame. */
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include "fathom_drivers.h"
#include "camera/openni2_oni.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void play(oni_file *file, const oni_description *about) {
    char why[160];
    int64_t stamp_ns;
    int number, result;
    const size_t pixels = (size_t)about->width * (size_t)about->height;
    if (pixels > 1 << 16) return;
    uint16_t *depth = malloc(pixels * sizeof *depth);
    do result = oni_next(file, depth, &stamp_ns, &number, why, sizeof why);
    while (result == FATHOM_OK || result == FATHOM_ERROR_SIZE);
    if (result != FATHOM_ERROR_ENDED && result != FATHOM_ERROR_PROTOCOL) abort();
    free(depth);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
    char why[160];
    uint16_t depth[64];
    oni_file *file;
    oni_description about;
    if (size < 1) return 0;
    oni_decode(data, size, data[0] & 1, depth, 64);
    FILE *stream = fmemopen((void *)(uintptr_t)data, size, "rb");
    if (!stream || oni_open(&file, stream, &about, why, sizeof why)) return 0;
    play(file, &about);
    oni_rewind(file);
    play(file, &about);
    oni_close(file);
    return 0;
}
