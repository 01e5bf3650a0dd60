/* The files of a recording with one record per time: depth.txt, imu.txt, groundtruth.txt. */
#include "recording/record_list.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* ---- depth.txt ----------------------------------------------------------------------------------------- */

static int read_frame_line(struct recording *recording, const char *path, struct text_file *text,
                           struct record_list *list, int *skipped, int *first_skipped) {
    int64_t stamp;
    if (!text_stamp(text, &stamp))
        return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: expected `t file`, t in seconds", path,
                              text->number);
    const char *file = text_rest(text);
    if (!*file)
        return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: no file after the time stamp", path,
                              text->number);
    const enum record_order order = record_list_order(list, stamp);
    if (order != ORDER_KEEP) {
        fathom_recording_frame *last = (fathom_recording_frame *)list->items + (list->count - 1);
        if (!(*skipped)++) *first_skipped = order == ORDER_SKIP ? text->number : last->line;
        if (order == ORDER_SKIP) return FATHOM_OK;
        free((char *)last->file);
        list->count--;
    }
    char *copy = strdup(file);
    fathom_recording_frame *frame = copy ? record_list_more(list) : NULL;
    if (!frame) {
        free(copy);
        return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", path);
    }
    *frame = (fathom_recording_frame){stamp, copy, text->number};
    return FATHOM_OK;
}

int recording_read_frames(struct recording *recording) {
    struct record_list list = {.item_size = sizeof(fathom_recording_frame)};
    struct text_file text;
    int skipped = 0, first_skipped = 0, result = FATHOM_OK;
    char *path = recording_path(recording, "depth.txt");
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);

    const int missing = text_open(&text, path);
    if (missing) result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(missing));
    while (!result && text_next(&text))
        result = read_frame_line(recording, path, &text, &list, &skipped, &first_skipped);
    if (!result && text.error)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(text.error));
    text_close(&text);
    recording->frames = list.items;
    recording->shown.frames = list.items;
    recording->shown.frame_count = list.count;
    if (!result && list.count == 0)
        result = recording_fail(recording, FATHOM_ERROR_CONFIG, "%s: no depth frames in it", path);
    if (!result && skipped == 1)
        recording_say(recording, FATHOM_LOG_WARNING, "%s:%d: time stamp goes back: frame skipped", path,
                      first_skipped);
    if (!result && skipped > 1)
        recording_say(recording, FATHOM_LOG_WARNING,
                      "%s:%d: time stamp goes back: the first of %d frames skipped", path, first_skipped,
                      skipped);
    free(path);
    return result;
}

/* ---- imu.txt and groundtruth.txt ----------------------------------------------------------------------- */

static bool take_imu(struct text_file *text, struct record_list *list, struct record_faults *faults) {
    int64_t stamp;
    double v[6];
    void *item;
    if (!record_numbers(text, &stamp, v, 6, faults)) return true;
    if (!record_place(list, stamp, faults, text->number, &item)) return false;
    if (item)
        *(fathom_imu_sample *)item = (fathom_imu_sample){
            stamp, {(float)v[0], (float)v[1], (float)v[2]}, {(float)v[3], (float)v[4], (float)v[5]}};
    return true;
}

static bool take_pose(struct text_file *text, struct record_list *list, struct record_faults *faults) {
    int64_t stamp;
    double v[7];
    return !record_numbers(text, &stamp, v, 7, faults) || record_pose(list, stamp, v, v + 3, faults, text->number);
}

int recording_read_imu(struct recording *recording, const char *path) {
    struct record_list list = {.item_size = sizeof(fathom_imu_sample)};
    char *own = path ? strdup(path) : recording_path(recording, "imu.txt");
    if (!own) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int result = record_list_read(recording, own, !path, 0, &list, take_imu);
    recording->imu = list.items;
    recording->shown.imu = list.items;
    recording->shown.imu_count = list.count;
    free(own);
    return result;
}

int recording_read_poses(struct recording *recording) {
    struct record_list list = {.item_size = sizeof(fathom_recording_pose)};
    char *path = recording_path(recording, "groundtruth.txt");
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int result = record_list_read(recording, path, true, 0, &list, take_pose);
    recording->poses = list.items;
    recording->shown.poses = list.items;
    recording->shown.pose_count = list.count;
    free(path);
    return result;
}
