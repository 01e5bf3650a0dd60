#include "map/store.h"

#include "base/sized.h"
#include "map/blocks.h"

bool store_init(caller_store *s, const fathom_config *config) {
    *s = (caller_store){.calls = FATHOM_STRUCT(fathom_block_store)};
    return !config->block_store || sized_in(&s->calls, sizeof s->calls, config->block_store);
}

void store_put(caller_store *s, const fathom_block *block) {
    s->put++;
    if (s->calls.put && s->calls.put(s->calls.user, block) < 0) s->lost++;
}

bool store_get(caller_store *s, const fathom_block *block) {
    const int got = s->calls.get ? s->calls.get(s->calls.user, block) : 0;
    if (got > 0) return true;
    if (got < 0) s->lost++;
    volume_make_new(block); /* whatever the store has left in them */
    return false;
}

bool store_key(const caller_store *s, int64_t position, cl_int4 *key) {
    fathom_block_key k;
    if (!s->calls.enumerate || s->calls.enumerate(s->calls.user, position, &k) <= 0) return false;
    *key = (cl_int4){{k.x, k.y, k.z, k.submap}};
    return true;
}
