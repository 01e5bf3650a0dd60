/* Shades maps of a surface into an image. */
#ifndef FATHOM_FILES_SHADE_H
#define FATHOM_FILES_SHADE_H

#include <stddef.h>
#include <stdint.h>

/* A matt surface under a sky to the upper left, 3 bytes (R, G, B) per pixel; white where there is no surface (depth 0).
 * Normals are three floats per pixel in camera axes, as from fathom_cast_view. */
void shade(const float *depth, const float *normals, size_t pixels, uint8_t *rgb);

#endif
