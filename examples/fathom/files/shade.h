/* Turns maps of a surface into a picture of it. */
#ifndef FATHOM_FILES_SHADE_H
#define FATHOM_FILES_SHADE_H

#include <stddef.h>
#include <stdint.h>

/* A matt surface under a sky to the upper left, 3 bytes (R, G, B) per pixel; white where there is none (depth 0).
 * Normals are three floats per pixel in camera axes, as fathom_cast_view gives them. */
void shade(const float *depth, const float *normals, size_t pixels, uint8_t *rgb);

#endif
