/* PNG files by libpng (its manual: libpng-manual.txt, sections III "Reading" and IV "Writing").
 *
 * libpng reports errors by longjmp. Everything that has to survive the jump lives in a struct that the caller
 * of setjmp owns, so that no local variable is clobbered; and libpng's own message goes into the error line
 * instead of to stderr. */
#include "recording/image_file.h"

#include <errno.h>
#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <zlib.h>

/* Larger than any depth camera; prevents allocation of gigabytes for a corrupt header. */
#define LARGEST_SIDE 16384

struct png_job {
    const char *path;
    char *error;
    size_t error_size;
    FILE *file;
    png_structp png;
    png_infop info;
    png_bytep row; /* scratch, one row */
};

static int fail(const char *path, const char *what, char *error, size_t error_size) {
    if (error && error_size) snprintf(error, error_size, "%s: %s", path, what);
    return -1;
}

static void on_error(png_structp png, png_const_charp message) {
    struct png_job *job = png_get_error_ptr(png);
    /* libpng reports a failed write as "Write Error"; the system's reason (disk full) is more useful. */
    if (job->file && ferror(job->file) && errno)
        message = strerror(errno);
    else if (job->file && feof(job->file))
        message = "truncated PNG";
    fail(job->path, message, job->error, job->error_size);
    png_longjmp(png, 1);
}

static void on_warning(png_structp png, png_const_charp message) {
    (void)png;
    (void)message;
}

/* ---- Reading ---- */

static void read_end(struct png_job *job) {
    if (job->png) png_destroy_read_struct(&job->png, &job->info, NULL);
    free(job->row);
    if (job->file) fclose(job->file);
}

/* Opens the file and makes the reader; the caller then sets the jump and calls png_read_info. */
static int read_begin(struct png_job *job) {
    unsigned char signature[8];
    errno = 0;
    job->file = fopen(job->path, "rb");
    if (!job->file) return fail(job->path, strerror(errno), job->error, job->error_size);
    if (fread(signature, 1, sizeof signature, job->file) != sizeof signature ||
        png_sig_cmp(signature, 0, sizeof signature)) {
        const char *why = ferror(job->file) ? strerror(errno) : "not a PNG file";
        return fail(job->path, why, job->error, job->error_size);
    }
    job->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, job, on_error, on_warning);
    if (job->png) job->info = png_create_info_struct(job->png);
    if (!job->png || !job->info) return fail(job->path, "out of memory", job->error, job->error_size);
    png_init_io(job->png, job->file);
    png_set_sig_bytes(job->png, sizeof signature);
    png_set_user_limits(job->png, LARGEST_SIDE, LARGEST_SIDE);
    return 0;
}

static int read_rows(struct png_job *job, uint16_t *pixels, size_t capacity, int *width, int *height) {
    if (setjmp(png_jmpbuf(job->png))) return -1;
    png_read_info(job->png, job->info);
    const png_uint_32 w = png_get_image_width(job->png, job->info);
    const png_uint_32 h = png_get_image_height(job->png, job->info);
    const int bits = png_get_bit_depth(job->png, job->info);
    if (png_get_color_type(job->png, job->info) != PNG_COLOR_TYPE_GRAY || (bits != 16 && bits != 8))
        return fail(job->path, "not a greyscale PNG of 16 or 8 bits", job->error, job->error_size);
    if (png_get_interlace_type(job->png, job->info) != PNG_INTERLACE_NONE)
        return fail(job->path, "interlaced PNG, which depth cameras don't write", job->error,
                    job->error_size);
    if ((size_t)w * h > capacity)
        return fail(job->path, "larger than the frames expected", job->error, job->error_size);
    job->row = malloc(png_get_rowbytes(job->png, job->info));
    if (!job->row) return fail(job->path, "out of memory", job->error, job->error_size);
    for (png_uint_32 y = 0; y < h; y++) {
        uint16_t *out = pixels + (size_t)y * w;
        png_read_row(job->png, job->row, NULL);
        if (bits == 16)
            for (png_uint_32 x = 0; x < w; x++)
                out[x] = (uint16_t)(job->row[2 * x] << 8 | job->row[2 * x + 1]);
        else
            for (png_uint_32 x = 0; x < w; x++) out[x] = job->row[x];
    }
    png_read_end(job->png, NULL); /* detects a file truncated after its last row */
    *width = (int)w;
    *height = (int)h;
    return 0;
}

int image_read_gray16(const char *path, uint16_t *pixels, size_t capacity, int *width, int *height,
                      char *error, size_t error_size) {
    struct png_job job = {.path = path, .error = error, .error_size = error_size};
    int result = read_begin(&job);
    if (!result) result = read_rows(&job, pixels, capacity, width, height);
    read_end(&job);
    return result;
}

static int read_header(struct png_job *job, int *width, int *height) {
    if (setjmp(png_jmpbuf(job->png))) return -1;
    png_read_info(job->png, job->info);
    *width = (int)png_get_image_width(job->png, job->info);
    *height = (int)png_get_image_height(job->png, job->info);
    return 0;
}

int image_read_size(const char *path, int *width, int *height, char *error, size_t error_size) {
    struct png_job job = {.path = path, .error = error, .error_size = error_size};
    int result = read_begin(&job);
    if (!result) result = read_header(&job, width, height);
    read_end(&job);
    return result;
}

/* ---- Writing ---- */

/* PNG's rows hold 16 bits high byte first. */
static void put_row(const image_pixels *picture, int y, png_bytep out) {
    static const size_t bytes[] = {[IMAGE_GRAY16] = 2, [IMAGE_GRAY8] = 1, [IMAGE_RGB8] = 3};
    const size_t w = (size_t)picture->width, tight = w * bytes[picture->kind];
    const uint8_t *row = (const uint8_t *)picture->pixels +
                         (size_t)y * (picture->stride_bytes ? picture->stride_bytes : tight);
    if (picture->kind != IMAGE_GRAY16) {
        memcpy(out, row, tight);
        return;
    }
    const uint16_t *in = (const uint16_t *)(const void *)row;
    for (size_t x = 0; x < w; x++) {
        out[2 * x] = (png_byte)(in[x] >> 8);
        out[2 * x + 1] = (png_byte)(in[x] & 255);
    }
}

static int write_rows(struct png_job *job, const image_pixels *picture) {
    if (setjmp(png_jmpbuf(job->png))) return -1;
    png_init_io(job->png, job->file);
    png_set_IHDR(job->png, job->info, (png_uint_32)picture->width, (png_uint_32)picture->height,
                 picture->kind == IMAGE_GRAY16 ? 16 : 8,
                 picture->kind == IMAGE_RGB8 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    /* Level 1 with the one filter that suits smooth depth: libpng's own choice of filters costs five times as
     * long for files that are a few per cent smaller. */
    png_set_compression_level(job->png, 1);
    png_set_filter(job->png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
    png_write_info(job->png, job->info);
    for (int y = 0; y < picture->height; y++) {
        put_row(picture, y, job->row);
        png_write_row(job->png, job->row);
    }
    png_write_end(job->png, NULL);
    return 0;
}

int image_write(const char *path, const image_pixels *picture, char *error, size_t error_size) {
    struct png_job job = {.path = path, .error = error, .error_size = error_size};
    if (picture->width < 1 || picture->height < 1 || picture->width > LARGEST_SIDE ||
        picture->height > LARGEST_SIDE)
        return fail(path, "picture of impossible size", error, error_size);
    const size_t length = strlen(path);
    char *part = malloc(length + sizeof ".part");
    if (!part) return fail(path, "out of memory", error, error_size);
    memcpy(part, path, length);
    memcpy(part + length, ".part", sizeof ".part");

    int result = -1;
    errno = 0;
    job.file = fopen(part, "wb");
    if (!job.file) {
        fail(path, strerror(errno), error, error_size);
        free(part);
        return -1;
    }
    job.row = malloc((size_t)picture->width * 3);
    job.png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &job, on_error, on_warning);
    if (job.png) job.info = png_create_info_struct(job.png);
    if (job.row && job.info)
        result = write_rows(&job, picture);
    else
        fail(path, "out of memory", error, error_size);
    if (job.png) png_destroy_write_struct(&job.png, &job.info);
    free(job.row);
    /* Writes stdio's buffer to the disk: a full disk shows here at the latest. */
    errno = 0;
    const int bad_flush = fflush(job.file) || ferror(job.file);
    const int flush_errno = errno;
    const int bad_close = fclose(job.file);
    if (!result && (bad_flush || bad_close)) {
        const int why = bad_flush ? flush_errno : errno;
        result = fail(path, why ? strerror(why) : "write error", error, error_size);
    }
    if (!result && rename(part, path)) result = fail(path, strerror(errno), error, error_size);
    if (result) unlink(part);
    free(part);
    return result;
}

int image_write_gray16(const char *path, const uint16_t *pixels, int width, int height, char *error,
                       size_t error_size) {
    const image_pixels picture = {.pixels = pixels, .width = width, .height = height};
    return image_write(path, &picture, error, error_size);
}
