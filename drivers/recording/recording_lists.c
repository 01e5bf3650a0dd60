/* The files of a recording with one record per time: depth.txt, imu.txt, groundtruth.txt. */
#include "recording/recording_internal.h"
#include "recording/recording_text.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* A list that grows by doubling. */
struct list {
    void *items;
    size_t item_size;
    int count, capacity;
};

/* Room for one more item at the end; NULL without memory. */
static void *list_more(struct list *list) {
    if (list->count == list->capacity) {
        const int capacity = list->capacity ? 2 * list->capacity : 1024;
        void *items = realloc(list->items, (size_t)capacity * list->item_size);
        if (!items) return NULL;
        list->items = items;
        list->capacity = capacity;
    }
    return (char *)list->items + (size_t)list->count++ * list->item_size;
}

/* The treatment of a record whose stamp may not be later than its predecessor's. */
enum order { ORDER_KEEP, ORDER_SKIP, ORDER_REPLACE };

/* Normally the record that goes back is wrong. But when its predecessor had leapt ahead by more than a second and this
 * one fits before it, that leap was the error, and skipping would lose the whole rest of the file. */
static enum order judge_order(const struct list *list, int64_t stamp) {
    const int64_t leap_ns = 1000000000;
    const char *items = list->items;
    int64_t last, before;
    if (list->count == 0) return ORDER_KEEP;
    memcpy(&last, items + (size_t)(list->count - 1) * list->item_size, sizeof last);
    if (stamp > last) return ORDER_KEEP;
    if (list->count == 1) return ORDER_SKIP;
    memcpy(&before, items + (size_t)(list->count - 2) * list->item_size, sizeof before);
    return stamp > before && last - before > leap_ns ? ORDER_REPLACE : ORDER_SKIP;
}

/* ---- depth.txt ----------------------------------------------------------------------------------------- */

static int read_frame_line(struct recording *recording, const char *path, struct text_file *text,
                           struct list *list, int *skipped, int *first_skipped) {
    int64_t stamp;
    if (!text_stamp(text, &stamp))
        return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: expected `t file`, t in seconds", path,
                              text->number);
    const char *file = text_rest(text);
    if (!*file)
        return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: no file after the time stamp", path,
                              text->number);
    const enum order order = judge_order(list, stamp);
    if (order != ORDER_KEEP) {
        fathom_recording_frame *last = (fathom_recording_frame *)list->items + (list->count - 1);
        if (!(*skipped)++) *first_skipped = order == ORDER_SKIP ? text->number : last->line;
        if (order == ORDER_SKIP) return FATHOM_OK;
        free((char *)last->file);
        list->count--;
    }
    char *copy = strdup(file);
    fathom_recording_frame *frame = copy ? list_more(list) : NULL;
    if (!frame) {
        free(copy);
        return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", path);
    }
    *frame = (fathom_recording_frame){stamp, copy, text->number};
    return FATHOM_OK;
}

int recording_read_frames(struct recording *recording) {
    struct list list = {.item_size = sizeof(fathom_recording_frame)};
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

/* The faults of lines that were left out. */
struct faults {
    int unreadable, not_finite, out_of_order, first_line;
};

static void count_fault(struct faults *faults, int *kind, int line) {
    if (!faults->first_line) faults->first_line = line;
    (*kind)++;
}

/* Reads a stamp and exactly 'count' finite numbers; false (and counted) for a line that is to be left out. */
static bool read_numbers(struct text_file *text, int64_t *stamp, double *values, int count,
                         struct faults *faults) {
    bool whole = text_stamp(text, stamp), finite = true;
    for (int i = 0; i < count && whole; i++) {
        whole = text_number(text, &values[i]);
        finite = finite && isfinite((float)values[i]);
    }
    if (!whole || !text_at_end(text))
        count_fault(faults, &faults->unreadable, text->number);
    else if (!finite)
        count_fault(faults, &faults->not_finite, text->number);
    else
        return true;
    return false;
}

/* Makes room for the record if its stamp allows. Returns false without memory; *item is NULL for a line to be left
 * out. */
static bool place(struct list *list, int64_t stamp, struct faults *faults, int line, void **item) {
    *item = NULL;
    const enum order order = judge_order(list, stamp);
    if (order != ORDER_KEEP) count_fault(faults, &faults->out_of_order, line);
    if (order == ORDER_SKIP) return true;
    if (order == ORDER_REPLACE) list->count--;
    *item = list_more(list);
    return *item != NULL;
}

static bool take_imu(struct text_file *text, struct list *list, struct faults *faults) {
    int64_t stamp;
    double v[6];
    void *item;
    if (!read_numbers(text, &stamp, v, 6, faults)) return true;
    if (!place(list, stamp, faults, text->number, &item)) return false;
    if (item)
        *(fathom_imu_sample *)item = (fathom_imu_sample){
            stamp, {(float)v[0], (float)v[1], (float)v[2]}, {(float)v[3], (float)v[4], (float)v[5]}};
    return true;
}

static bool take_pose(struct text_file *text, struct list *list, struct faults *faults) {
    int64_t stamp;
    double v[7];
    void *item;
    if (!read_numbers(text, &stamp, v, 7, faults)) return true;
    const double norm = sqrt(v[3] * v[3] + v[4] * v[4] + v[5] * v[5] + v[6] * v[6]);
    if (!(norm > 0.5 && norm < 2)) { /* rounding leaves it near one */
        count_fault(faults, &faults->unreadable, text->number);
        return true;
    }
    if (!place(list, stamp, faults, text->number, &item)) return false;
    if (item)
        *(fathom_recording_pose *)item = (fathom_recording_pose){
            stamp, {{v[0], v[1], v[2]}, {v[3] / norm, v[4] / norm, v[5] / norm, v[6] / norm}}};
    return true;
}

/* Reads a whole file by 'take', which returns false without memory. */
static int read_list(struct recording *recording, const char *path, bool may_be_missing, struct list *list,
                     bool (*take)(struct text_file *, struct list *, struct faults *)) {
    struct text_file text;
    struct faults faults = {0};
    int result = FATHOM_OK;
    const int missing = text_open(&text, path);
    if (missing && !(may_be_missing && missing == ENOENT))
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(missing));
    while (!result && !missing && text_next(&text))
        if (!take(&text, list, &faults))
            result = recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", path);
    if (!result && text.error)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(text.error));
    text_close(&text);
    const int count = faults.unreadable + faults.not_finite + faults.out_of_order;
    if (!result && count)
        recording_say(
            recording, FATHOM_LOG_WARNING,
            "%s:%d: the first of %d line%s left out (%d unreadable, %d not finite, %d out of order)", path,
            faults.first_line, count, count == 1 ? "" : "s", faults.unreadable, faults.not_finite,
            faults.out_of_order);
    return result;
}

int recording_read_imu(struct recording *recording, const char *path) {
    struct list list = {.item_size = sizeof(fathom_imu_sample)};
    char *own = path ? strdup(path) : recording_path(recording, "imu.txt");
    if (!own) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int result = read_list(recording, own, !path, &list, take_imu);
    recording->imu = list.items;
    recording->shown.imu = list.items;
    recording->shown.imu_count = list.count;
    free(own);
    return result;
}

int recording_read_poses(struct recording *recording) {
    struct list list = {.item_size = sizeof(fathom_recording_pose)};
    char *path = recording_path(recording, "groundtruth.txt");
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int result = read_list(recording, path, true, &list, take_pose);
    recording->poses = list.items;
    recording->shown.poses = list.items;
    recording->shown.pose_count = list.count;
    free(path);
    return result;
}
