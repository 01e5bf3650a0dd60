#include "recording/record_list.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

void *record_list_more(struct record_list *list) {
    if (list->count == list->capacity) {
        const int capacity = list->capacity ? 2 * list->capacity : 1024;
        void *items = realloc(list->items, (size_t)capacity * list->item_size);
        if (!items) return NULL;
        list->items = items;
        list->capacity = capacity;
    }
    return (char *)list->items + (size_t)list->count++ * list->item_size;
}

/* Normally the record that goes back is wrong. But when its predecessor had leapt ahead by more than a second and this
 * one fits before it, that leap was the error, and skipping would lose the whole rest of the file. */
enum record_order record_list_order(const struct record_list *list, int64_t stamp) {
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

void record_fault(struct record_faults *faults, int *kind, int line) {
    if (!faults->first_line) faults->first_line = line;
    (*kind)++;
}

bool record_numbers(struct text_file *text, int64_t *stamp, double *values, int count,
                    struct record_faults *faults) {
    bool whole = text_stamp(text, stamp), finite = true;
    for (int i = 0; i < count && whole; i++) {
        whole = text_number(text, &values[i]);
        finite = finite && isfinite((float)values[i]);
    }
    if (!whole || !text_at_end(text))
        record_fault(faults, &faults->unreadable, text->number);
    else if (!finite)
        record_fault(faults, &faults->not_finite, text->number);
    else
        return true;
    return false;
}

bool record_place(struct record_list *list, int64_t stamp, struct record_faults *faults, int line,
                  void **item) {
    *item = NULL;
    const enum record_order order = record_list_order(list, stamp);
    if (order != ORDER_KEEP) record_fault(faults, &faults->out_of_order, line);
    if (order == ORDER_SKIP) return true;
    if (order == ORDER_REPLACE) list->count--;
    *item = record_list_more(list);
    return *item != NULL;
}

bool record_pose(struct record_list *list, int64_t stamp, const double position[3], const double q[4],
                 struct record_faults *faults, int line) {
    const double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    void *item;
    if (!(norm > 0.5 && norm < 2)) { /* rounding leaves it near one */
        record_fault(faults, &faults->unreadable, line);
        return true;
    }
    if (!record_place(list, stamp, faults, line, &item)) return false;
    if (item)
        *(fathom_recording_pose *)item = (fathom_recording_pose){
            stamp,
            {{position[0], position[1], position[2]}, {q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm}}};
    return true;
}

/* Values between separators, with their names in the first line. */
static bool next_line(struct text_file *text, char separator) {
    if (!text_next(text)) return false;
    if (!separator) return true;
    if (text->number == 1 && strpbrk(text->at, "abcdefghijklmnopqrstuvwxyz") && !text_next(text))
        return false;
    for (char *c = text->at; *c; c++)
        if (*c == separator) *c = ' ';
    return true;
}

int record_list_read(struct recording *recording, const char *path, bool may_be_missing, char separator,
                     struct record_list *list,
                     bool (*take)(struct text_file *, struct record_list *, struct record_faults *)) {
    struct text_file text;
    struct record_faults faults = {0};
    int result = FATHOM_OK;
    const int missing = text_open(&text, path);
    if (missing && !(may_be_missing && missing == ENOENT))
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(missing));
    while (!result && !missing && next_line(&text, separator))
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
