#include "inertial/timeline.h"

void timeline_init(timeline *t, arena *a) {
    t->moments = arena_take(a, TIMELINE_MOMENTS * sizeof *t->moments);
    t->first = t->count = 0;
}

void timeline_restart(timeline *t, const navigation *now) {
    t->first = 0;
    t->count = 1;
    t->moments[0].by = measurement_of_nothing(now->state.timestamp_ns);
    t->moments[0].after = *now;
}

int timeline_find(const timeline *t, int64_t timestamp_ns) {
    int i = t->count - 1;
    if (i >= 0 && timeline_at(t, i)->by.timestamp_ns - TIMELINE_NS > timestamp_ns) return -1;
    while (i >= 0 && timeline_at(t, i)->by.timestamp_ns > timestamp_ns) i--;
    return i;
}

int timeline_insert(timeline *t, int i) {
    if (t->count == TIMELINE_MOMENTS) {
        t->first = (t->first + 1) % TIMELINE_MOMENTS;
        t->count--;
        i--;
    }
    t->count++;
    for (int k = t->count - 1; k > i; k--) *timeline_at(t, k) = *timeline_at(t, k - 1);
    return i;
}
