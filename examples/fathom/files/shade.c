#include "fathom/files/shade.h"

/* Lit from the sky above the camera's left shoulder, and a little from the camera itself. */
static void shade_pixel(const float normal[3], uint8_t rgb[3]) {
    static const float colour[3] = {232, 226, 214}, shadow[3] = {6, 6, 14};
    const float sky = 0.5f + 0.5f * (-0.45f * normal[0] - 0.70f * normal[1] - 0.55f * normal[2]),
                front = -normal[2];
    const float light = 0.10f + 0.62f * sky + 0.22f * (front > 0 ? front : 0);
    for (int i = 0; i < 3; i++) {
        const float c = colour[i] * light + shadow[i] * (1 - sky);
        rgb[i] = (uint8_t)(c < 0 ? 0 : c > 255 ? 255 : c);
    }
}

void shade(const float *depth, const float *normals, size_t pixels, uint8_t *rgb) {
    for (size_t i = 0; i < pixels; i++) {
        if (depth[i] > 0)
            shade_pixel(normals + 3 * i, rgb + 3 * i);
        else
            rgb[3 * i] = rgb[3 * i + 1] = rgb[3 * i + 2] = 255;
    }
}
