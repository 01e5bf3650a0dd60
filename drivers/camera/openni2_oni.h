/*
 * The depth of an .oni recording, read without libOpenNI2: its own player crashes on damaged files, and now and then on
 * good ones when they are closed.
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
    int frame_total;        /* as the recorder wrote it at its end; 0: it never came to that */
} oni_description;

typedef struct oni_file oni_file;

/* Takes over the stream, which it closes. FATHOM_OK; FATHOM_ERROR_PROTOCOL, _UNSUPPORTED or _MEMORY with the reason in
 * `why`. */
int oni_open(oni_file **file, FILE *stream, oni_description *description, char *why, size_t size);
void oni_close(oni_file *file);

/* Goes back to the first frame. */
void oni_rewind(oni_file *file);

/* The next frame into width * height pixels, not mirrored. FATHOM_OK; FATHOM_ERROR_ENDED after the last one;
 * FATHOM_ERROR_SIZE: this frame makes no sense, the next may; FATHOM_ERROR_PROTOCOL: the file breaks off or is damaged
 * from here on. For the last two the reason is in `why`. Takes no memory. */
int oni_next(oni_file *file, uint16_t *depth, int64_t *stamp_ns, int *number, char *why, size_t size);

/* Decodes the codecs 16zP (table NULL) and 16zT: whether exactly `pixels` came out. */
bool oni_decode(const uint8_t *bytes, size_t size, bool with_table, uint16_t *depth, size_t pixels);

#endif
