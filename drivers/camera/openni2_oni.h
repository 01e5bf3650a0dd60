/*
 * The depth of an .oni recording, read without libOpenNI2: its own player crashes on damaged files, and sometimes on
 * closing good ones.
 */
#ifndef FATHOM_OPENNI2_ONI_H
#define FATHOM_OPENNI2_ONI_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

typedef struct {
    int width, height;
    double fov[2];          /* radians, horizontal and vertical */
    double units_per_metre; /* of depth: 1000 or 10000 */
    int frame_total;        /* written by the recorder at its end; 0: it didn't finish */
} oni_description;

typedef struct oni_file oni_file;

/* Takes over the stream, which it closes. FATHOM_OK; FATHOM_ERROR_PROTOCOL, _UNSUPPORTED or _MEMORY with the reason in
 * `why`. */
int oni_open(oni_file **file, FILE *stream, oni_description *description, char *why, size_t size);
void oni_close(oni_file *file);

/* Goes back to the first frame. */
void oni_rewind(oni_file *file);

/* The next frame into width * height pixels, not mirrored. FATHOM_OK; FATHOM_ERROR_ENDED after the last one;
 * FATHOM_ERROR_SIZE: this frame is invalid, the next may not be; FATHOM_ERROR_PROTOCOL: the file is truncated or
 * damaged from here on. For the last two the reason is in `why`. Allocates no memory. */
int oni_next(oni_file *file, uint16_t *depth, int64_t *stamp_ns, int *number, char *why, size_t size);

/* Decodes the codecs 16zP (with_table false) and 16zT (true); false unless the result has exactly `pixels`. */
bool oni_decode(const uint8_t *bytes, size_t size, bool with_table, uint16_t *depth, size_t pixels);

#endif
