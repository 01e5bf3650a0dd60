#include "fathom/files/png_file.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* Writes into an open file; returns the reason of a failure, or NULL. */
static const char *write_to(FILE *out, png_image *image, const uint8_t *rgb) {
    errno = 0;
    if (!png_image_write_to_stdio(image, out, 0, rgb, 0, NULL))
        return errno ? strerror(errno) : image->message;
    return fflush(out) || ferror(out) ? strerror(errno) : NULL;
}

bool png_write_rgb(const char *file, const uint8_t *rgb, int width, int height) {
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)width,
                       .height = (png_uint_32)height,
                       .format = PNG_FORMAT_RGB};
    const size_t room = strlen(file) + sizeof ".part";
    char *part = malloc(room);
    FILE *out = NULL;
    errno = ENOMEM;
    if (part && snprintf(part, room, "%s.part", file) > 0) out = fopen(part, "wb");
    const char *wrong = out ? write_to(out, &image, rgb) : strerror(errno);
    if (out && fclose(out) && !wrong) wrong = strerror(errno);
    if (!wrong && rename(part, file)) wrong = strerror(errno);
    if (wrong) cli_error(CLI_FAILED, "%s: %s", file, wrong);
    if (wrong && out) unlink(part);
    free(part);
    return !wrong;
}
