#include "api/frame_check.h"

#include "api/call.h"
#include "base/stamps.h"

#define SECOND_NS 1000000000
#define IMAGE_SIZE_MAX 16384

static int check_size_and_stamp(fathom *f, const fathom_depth_frame *frame) {
    const fathom_pinhole *c = &f->config.depth_camera;
    error_text *r = &f->error;
    if (frame->width != c->width || frame->height != c->height)
        return error_text_fail(r, FATHOM_ERROR_SIZE, FATHOM_LOG_WARNING,
                               "a frame of %dx%d was ignored: the settings say %dx%d", frame->width,
                               frame->height, c->width, c->height);
    if (!stamp_valid(frame->timestamp_ns))
        return error_text_fail(r, FATHOM_ERROR_TIME, FATHOM_LOG_WARNING,
                           "a frame stamped %lld ns was ignored: more than 126 years from zero",
                           (long long)frame->timestamp_ns);
    if (f->timestamp_ns != INT64_MIN && frame->timestamp_ns <= f->timestamp_ns)
        return error_text_fail(r, FATHOM_ERROR_TIME, FATHOM_LOG_WARNING,
                           "a frame stamped %.6f s was ignored: the one before has %.6f s",
                           1e-9 * (double)frame->timestamp_ns, 1e-9 * (double)f->timestamp_ns);
    return FATHOM_OK;
}

/* The smallest stride of a row; 0 for a compressed image, -1 for an unknown format. */
static int64_t tight_stride(const fathom_image *image) {
    switch (image->format) {
    case FATHOM_IMAGE_GREY8: return image->width;
    case FATHOM_IMAGE_RGB8:
    case FATHOM_IMAGE_BGR8: return 3 * (int64_t)image->width;
    case FATHOM_IMAGE_YUYV: return image->width % 2 ? -1 : 2 * (int64_t)image->width;
    case FATHOM_IMAGE_JPEG: return 0;
    }
    return -1;
}

static int check_image(fathom *f, const fathom_image *given) {
    fathom_image image = {0};
    const int e = call_take(f, &image, sizeof image, given, "fathom_image");
    if (e != FATHOM_OK) return e;
    if (!image.data) return call_refuse(f, "the image's data is NULL");
    if (image.width < 1 || image.height < 1 || image.width > IMAGE_SIZE_MAX || image.height > IMAGE_SIZE_MAX)
        return call_refuse(f, "an image of %dx%d; each must lie within 1 and %d", image.width, image.height,
                           IMAGE_SIZE_MAX);
    if (!stamp_valid(image.timestamp_ns))
        return call_refuse(f, "an image stamped %lld ns: more than 126 years from zero",
                           (long long)image.timestamp_ns);
    const int64_t tight = tight_stride(&image);
    if (tight < 0)
        return call_refuse(f, "an image of format %d, %d wide: no such format", image.format, image.width);
    if (tight == 0)
        return image.size_bytes > 0 && image.stride_bytes == 0
                   ? FATHOM_OK
                   : call_refuse(f, "a compressed image needs its size_bytes, and has no stride");
    const int64_t stride = image.stride_bytes == 0 ? tight : image.stride_bytes;
    if (stride < tight || stride > INT32_MAX)
        return call_refuse(f, "the image's rows are %lld bytes apart; a row has %lld", (long long)stride,
                           (long long)tight);
    if (image.size_bytes != 0 && image.size_bytes < stride * (image.height - 1) + tight)
        return call_refuse(f, "an image of %lld bytes is too short for %d rows %lld bytes apart",
                           (long long)image.size_bytes, image.height, (long long)stride);
    return FATHOM_OK;
}

int frame_take(fathom *f, const fathom_depth_frame *given, fathom_depth_frame *frame) {
    *frame = FATHOM_STRUCT(fathom_depth_frame);
    int e = call_take(f, frame, sizeof *frame, given, "fathom_depth_frame");
    if (e != FATHOM_OK) return e;
    if (!frame->depth) return call_refuse(f, "the frame's depth is NULL");
    e = check_size_and_stamp(f, frame);
    if (e != FATHOM_OK) return e;
    if (frame->row_stride_bytes == 0) frame->row_stride_bytes = 2 * frame->width;
    if (frame->confidence_stride_bytes == 0) frame->confidence_stride_bytes = frame->width;
    if (frame->row_stride_bytes < 2 * frame->width || frame->row_stride_bytes % 2 != 0)
        return call_refuse(f, "row_stride_bytes is %d; it must be even, and at least %d",
                           frame->row_stride_bytes, 2 * frame->width);
    if (frame->exposure_ns < 0 || frame->exposure_ns > SECOND_NS)
        return call_refuse(f, "exposure_ns is %lld; it must lie within 0 and a second",
                           (long long)frame->exposure_ns);
    const int64_t row_max = SECOND_NS / frame->height;
    if (frame->row_time_ns < -row_max || frame->row_time_ns > row_max)
        return call_refuse(f, "row_time_ns is %lld; all %d rows must be read within a second",
                           (long long)frame->row_time_ns, frame->height);
    if (frame->confidence &&
        (frame->confidence_stride_bytes < frame->width || frame->confidence_stride_bytes > INT32_MAX))
        return call_refuse(f, "confidence_stride_bytes is %lld; a row has %d",
                           (long long)frame->confidence_stride_bytes, frame->width);
    return frame->image ? check_image(f, frame->image) : FATHOM_OK;
}
