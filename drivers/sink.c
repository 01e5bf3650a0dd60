/* The common parts of all sinks. */
#include "sink.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/sized.h"
#include "source_log.h"

int sink_fail(fathom_sink *sink, int code, const char *format, ...) {
    char text[sizeof sink->text];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    pthread_mutex_lock(&sink->lock);
    if (!sink->error) {
        memcpy(sink->text, text, sizeof text);
        sink->error = code;
    }
    pthread_mutex_unlock(&sink->lock);
    source_say(sink->options.log, sink->options.log_user, FATHOM_LOG_ERROR, "%s", text);
    return code;
}

int fathom_sink_open(fathom_sink **sink, const char *uri, const fathom_sink_options *options) {
    fathom_sink_options whole = FATHOM_STRUCT(fathom_sink_options);
    if (sink) *sink = NULL;
    if (options && !sized_in(&whole, sizeof whole, options)) return FATHOM_ERROR_ARGUMENT;
    if (!sink || !uri || !*uri) {
        source_say(whole.log, whole.log_user, FATHOM_LOG_ERROR,
                   "fathom_sink_open: NULL argument, or no name");
        return FATHOM_ERROR_ARGUMENT;
    }
    return folder_sink_open(sink, strncmp(uri, "folder:", 7) == 0 ? uri + 7 : uri, &whole);
}

int fathom_sink_write_rig(fathom_sink *sink, const fathom_sink_rig *rig) {
    fathom_sink_rig whole = FATHOM_STRUCT(fathom_sink_rig);
    if (!sink || !rig || !sized_in(&whole, sizeof whole, rig)) return FATHOM_ERROR_ARGUMENT;
    return sink->does->write_rig(sink, &whole);
}

int fathom_sink_write_depth(fathom_sink *sink, const fathom_depth_frame *frame) {
    fathom_depth_frame whole = FATHOM_STRUCT(fathom_depth_frame);
    if (!sink || !frame || !sized_in(&whole, sizeof whole, frame) || !whole.depth || whole.width < 1 ||
        whole.height < 1 || (whole.row_stride_bytes && whole.row_stride_bytes < 2 * whole.width) ||
        (whole.confidence && whole.confidence_stride_bytes && whole.confidence_stride_bytes < whole.width))
        return FATHOM_ERROR_ARGUMENT;
    return sink->does->write_depth(sink, &whole);
}

int fathom_sink_write_image(fathom_sink *sink, const fathom_image *image) {
    fathom_image whole = FATHOM_STRUCT(fathom_image);
    if (!sink || !image || !sized_in(&whole, sizeof whole, image) || !whole.data || whole.width < 1 ||
        whole.height < 1 || whole.stride_bytes < 0)
        return FATHOM_ERROR_ARGUMENT;
    return sink->does->write_image(sink, &whole);
}

int fathom_sink_write_imu(fathom_sink *sink, const fathom_imu_sample *samples, int count) {
    if (!sink || !samples || count < 0) return FATHOM_ERROR_ARGUMENT;
    return sink->does->write_imu(sink, samples, count);
}

int fathom_sink_copy_imu(fathom_sink *sink, const char *folder) {
    return sink && folder ? sink->does->copy_imu(sink, folder) : FATHOM_ERROR_ARGUMENT;
}

int fathom_sink_write_pose(fathom_sink *sink, int64_t timestamp_ns, const fathom_pose *pose) {
    if (!sink || !pose) return FATHOM_ERROR_ARGUMENT;
    for (int i = 0; i < 3; i++)
        if (!isfinite(pose->position[i])) return FATHOM_ERROR_ARGUMENT;
    for (int i = 0; i < 4; i++)
        if (!isfinite(pose->orientation[i])) return FATHOM_ERROR_ARGUMENT;
    return sink->does->write_pose(sink, timestamp_ns, pose);
}

int fathom_sink_flush(fathom_sink *sink) {
    return sink ? sink->does->flush(sink) : FATHOM_ERROR_ARGUMENT;
}

int fathom_sink_get_status(fathom_sink *sink, fathom_sink_status *status) {
    const size_t given = sized_of(status);
    if (!sink || !given) return FATHOM_ERROR_ARGUMENT;
    pthread_mutex_lock(&sink->lock);
    sized_out(status, given, &sink->status, sizeof sink->status);
    pthread_mutex_unlock(&sink->lock);
    return FATHOM_OK;
}

const char *fathom_sink_last_error(fathom_sink *sink) {
    if (!sink) return "";
    pthread_mutex_lock(&sink->lock); /* the text never changes once it is set */
    const char *text = sink->error ? sink->text : "";
    pthread_mutex_unlock(&sink->lock);
    return text;
}

int fathom_sink_close(fathom_sink *sink) {
    if (!sink) return FATHOM_OK;
    sink->does->close(sink);
    const int error = sink->error;
    pthread_mutex_destroy(&sink->lock);
    free(sink);
    return error;
}
