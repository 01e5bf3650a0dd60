#include "map/store.h"

void store_init(caller_store *s, const fathom_config *config) {
    *s = (caller_store){.config = config};
}

void store_put(caller_store *s, const fathom_block *block) {
    if (s->config->block_out) s->config->block_out(s->config->block_user, block);
    s->dropped++;
}

bool store_get(caller_store *s, const fathom_block *block) {
    return s->config->block_in && s->config->block_in(s->config->block_user, block) != 0;
}
