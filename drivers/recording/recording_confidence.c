/* Which file holds the confidences of each depth frame: confidence.txt, or a Stray Scanner folder's. */
#include "recording/image_file.h"
#include "recording/record_list.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int make_room(struct recording *recording) {
    if (!recording->confidence)
        recording->confidence = calloc((size_t)recording->shown.frame_count, sizeof(char *));
    recording->shown.confidence = (const char *const *)recording->confidence;
    return recording->confidence
               ? FATHOM_OK
               : recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
}

/* The frame of exactly that stamp, or -1. */
static int frame_at(const struct recording *recording, int64_t stamp) {
    int low = 0, high = recording->shown.frame_count;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        if (recording->frames[middle].timestamp_ns < stamp)
            low = middle + 1;
        else
            high = middle;
    }
    return low < recording->shown.frame_count && recording->frames[low].timestamp_ns == stamp ? low : -1;
}

static int take_line(struct recording *recording, struct text_file *text, const char *path, int *strays) {
    int64_t stamp;
    if (!text_stamp(text, &stamp))
        return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: expected `t file`, t in seconds", path,
                              text->number);
    const char *file = text_rest(text);
    const int frame = frame_at(recording, stamp);
    if (frame < 0 || !*file || recording->confidence[frame]) {
        ++*strays;
        return FATHOM_OK;
    }
    recording->confidence[frame] = strdup(file);
    return recording->confidence[frame]
               ? FATHOM_OK
               : recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", path);
}

int recording_read_confidence_list(struct recording *recording) {
    struct text_file text;
    int strays = 0;
    char *path = recording_path(recording, "confidence.txt");
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int missing = text_open(&text, path);
    int result = missing == ENOENT ? FATHOM_OK
                 : missing
                     ? recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(missing))
                     : make_room(recording);
    while (!missing && !result && text_next(&text)) result = take_line(recording, &text, path, &strays);
    if (!result && text.error)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(text.error));
    if (!result && strays > 0)
        recording_say(recording, FATHOM_LOG_WARNING,
                      "%s: %d line%s without a depth frame of that stamp left out", path, strays,
                      strays == 1 ? "" : "s");
    text_close(&text);
    free(path);
    return result;
}

int recording_pair_confidence(struct recording *recording, const char *folder) {
    char *path = recording_path(recording, folder);
    const bool there = path && access(path, F_OK) == 0;
    free(path);
    int result = there ? make_room(recording) : FATHOM_OK;
    for (int i = 0; there && !result && i < recording->shown.frame_count; i++) {
        const char *name = strrchr(recording->frames[i].file, '/');
        const size_t size = strlen(folder) + strlen(recording->frames[i].file) + 2;
        recording->confidence[i] = malloc(size);
        if (!recording->confidence[i])
            result = recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
        else
            snprintf(recording->confidence[i], size, "%s/%s", folder,
                     name ? name + 1 : recording->frames[i].file);
    }
    return result;
}

int fathom_recording_read_confidence(const fathom_recording *shown, int index, uint8_t *pixels) {
    const struct recording *recording = (const struct recording *)shown;
    char error[512];
    int width = 0, height = 0, result = FATHOM_OK;
    if (!shown || !pixels || index < 0 || index >= shown->frame_count) return FATHOM_ERROR_ARGUMENT;
    if (!recording->confidence || !recording->confidence[index]) return FATHOM_ERROR_NO_DATA;
    const size_t count = (size_t)shown->camera.width * (size_t)shown->camera.height;
    char *path = recording_path(recording, recording->confidence[index]);
    uint16_t *wide = malloc(count * sizeof *wide);
    if (!path || !wide)
        result = recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", shown->folder);
    else if (image_read_gray16(path, wide, count, &width, &height, error, sizeof error))
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s", error);
    else if (width != shown->camera.width || height != shown->camera.height)
        result = recording_fail(recording, FATHOM_ERROR_SIZE, "%s: %dx%d, where the depth is %dx%d", path,
                                width, height, shown->camera.width, shown->camera.height);
    for (size_t i = 0; !result && i < count; i++) pixels[i] = (uint8_t)(wide[i] < 255 ? wide[i] : 255);
    free(wide);
    free(path);
    return result;
}
