/* Colour images as PNG files. */
#ifndef FATHOM_FILES_PNG_FILE_H
#define FATHOM_FILES_PNG_FILE_H

#include <stdbool.h>
#include <stdint.h>

/* Writes 3 bytes (R, G, B) per pixel; the file appears whole or not at all. False after an error message. */
bool png_write_rgb(const char *file, const uint8_t *rgb, int width, int height);

#endif
