/* Checks of libOpenNI2's frames. A driver plug-in may return any values; nothing outside of its buffers is read. */
#include <stdio.h>
#include <string.h>

#include "camera/openni2_internal.h"

#define LAST_STAMP_US (UINT64_MAX >> 12) /* 142 years: larger stamps are invalid */

bool openni2_frame_is_good(const OniFrame *frame, const OniVideoMode *mode, char *why, size_t size) {
    const int64_t row = (int64_t)mode->resolutionX * oniFormatBytesPerPixel(mode->pixelFormat);
    if (!frame->data)
        snprintf(why, size, "it has no data");
    else if (frame->width != mode->resolutionX || frame->height != mode->resolutionY)
        snprintf(why, size, "it is %dx%d, not %dx%d", frame->width, frame->height, mode->resolutionX,
                 mode->resolutionY);
    else if (frame->videoMode.pixelFormat != mode->pixelFormat)
        snprintf(why, size, "its pixel format is %d, not %d", frame->videoMode.pixelFormat,
                 mode->pixelFormat);
    else if (frame->croppingEnabled)
        snprintf(why, size, "it is cropped");
    else if (frame->stride < row || frame->dataSize < (int64_t)frame->stride * (frame->height - 1) + row)
        snprintf(why, size, "it is short: %d bytes in rows of %d", frame->dataSize, frame->stride);
    else if (frame->timestamp > LAST_STAMP_US)
        snprintf(why, size, "its stamp is no time");
    else
        return true;
    return false;
}

void openni2_copy_depth(const OniFrame *frame, bool mirrored, uint16_t *depth) {
    const size_t width = (size_t)frame->width;
    for (int y = 0; y < frame->height; y++, depth += width) {
        memcpy(depth, (const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride, 2 * width);
        for (size_t x = 0; mirrored && x < width / 2; x++) {
            const uint16_t left = depth[x];
            depth[x] = depth[width - 1 - x];
            depth[width - 1 - x] = left;
        }
    }
}

void openni2_copy_color(const OniFrame *frame, bool mirrored, uint8_t *color) {
    const size_t width = (size_t)frame->width;
    for (int y = 0; y < frame->height; y++) {
        const uint8_t *row = (const uint8_t *)frame->data + (size_t)y * (size_t)frame->stride;
        for (size_t x = 0; x < width; x++, color += 3)
            memcpy(color, row + 3 * (mirrored ? width - 1 - x : x), 3);
    }
}
