#include "api/call.h"

#include "base/sized.h"

int call_begin(fathom *f) {
    if (!f) return FATHOM_ERROR_ARGUMENT;
    if (f->device.error != FATHOM_OK) return FATHOM_ERROR_DEVICE; /* the text of the fatal failure stays */
    f->error.kept = false;
    return FATHOM_OK;
}

/* The result of every step from now on. */
static void say_lost(fathom_result *r) {
    r->state = FATHOM_LOST;
    r->verdict = FATHOM_VERDICT_DEVICE;
    r->fused = r->seeded = r->searched = r->pool_full = false;
    r->iterations = r->pairs = r->overlap_pixels = r->blocks_dropped = r->blocks_restored = 0;
}

int call_end(fathom *f) {
    if (f->device.error == FATHOM_OK) return FATHOM_OK;
    if (!atomic_exchange(&f->dead, true)) say_lost(&f->result);
    return FATHOM_ERROR_DEVICE;
}

size_t call_struct(fathom *f, const void *callers, const char *name) {
    const size_t size = sized_of(callers);
    if (size == 0 && !callers)
        call_refuse(f, "%s is NULL", name);
    else if (size == 0)
        call_refuse(f, "%s's struct_size isn't set: FATHOM_STRUCT(%s)", name, name);
    return size;
}

int call_take(fathom *f, void *whole, size_t size, const void *callers, const char *name) {
    if (call_struct(f, callers, name) == 0) return FATHOM_ERROR_ARGUMENT;
    if (sized_in(whole, size, callers)) return FATHOM_OK;
    return call_refuse(
        f, "%s is longer than this library's, and the rest isn't zero: fields of a later version", name);
}

const char *fathom_last_error(const fathom *f) {
    return f ? f->error.text : "";
}
