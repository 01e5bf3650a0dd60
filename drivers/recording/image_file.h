/* 16-bit depth, 8-bit grey and 8-bit colour images in PNG files, by libpng. Internal to drivers/ and examples/. */
#ifndef FATHOM_IMAGE_FILE_H
#define FATHOM_IMAGE_FILE_H

#include <stddef.h>
#include <stdint.h>

/* Each returns 0, or -1 with one line in error: the file and the reason. */

/* Reads a greyscale PNG of 16 (or 8) bits into pixels, row by row, maximum capacity pixels; its size into *width,
 * *height. */
int image_read_gray16(const char *path, uint16_t *pixels, size_t capacity, int *width, int *height,
                      char *error, size_t error_size);

/* Reads only the size. */
int image_read_size(const char *path, int *width, int *height, char *error, size_t error_size);

/* An image to write. */
typedef struct {
    const void *pixels; /* as the kind says */
    int width, height;
    size_t stride_bytes; /* from row to row; 0: tight */
    enum { IMAGE_GRAY16, IMAGE_GRAY8, IMAGE_RGB8 } kind; /* uint16_t, a byte, or three bytes (R, G, B) per pixel */
} image_pixels;

/* Writes an image; the file appears whole or not at all (written under another name, then renamed). */
int image_write(const char *path, const image_pixels *picture, char *error, size_t error_size);

/* The same for tight rows of depth. */
int image_write_gray16(const char *path, const uint16_t *pixels, int width, int height, char *error,
                       size_t error_size);

#endif
