#include "fathom/files/block_store.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#include <unistd.h>

#define PART (FATHOM_BLOCK_VOXELS * sizeof(int16_t)) /* distances, and the same size of weights */
#define BLOCK (2 * PART)

/* The scan goes on: part of the surface is lost, and only the first loss is reported. */
static void lose(struct block_store *store, const char *what, const char *why) {
    if (store->lost++ == 0)
        cli_error(CLI_FAILED,
                  "%s: a dropped block can't be %s: %s; such parts of the surface are lost, the scan goes on",
                  store->path, what, why);
}

/* ---- places -------------------------------------------------------------------------------------------- */

/* The entry of the block, or the free one where it belongs. */
static uint32_t *entry_of(const struct block_store *store, const fathom_block_key *key) {
    const size_t mask = 2 * store->capacity - 1;
    const int32_t words[4] = {key->x, key->y, key->z, key->submap};
    uint32_t hash = 2166136261u;
    for (int k = 0; k < 4; k++) {
        hash = (hash ^ (uint32_t)words[k]) * 0x9E3779B1u;
        hash ^= hash >> 15;
    }
    size_t at = hash & mask;
    while (store->table[at] && memcmp(&store->keys[store->table[at] - 1], key, sizeof *key) != 0)
        at = (at + 1) & mask;
    return &store->table[at];
}

static bool grow(struct block_store *store) {
    const size_t capacity = store->capacity ? 2 * store->capacity : 1024;
    fathom_block_key *keys = realloc(store->keys, capacity * sizeof *keys);
    if (!keys) return false;
    store->keys = keys;
    uint32_t *table = calloc(2 * capacity, sizeof *table);
    if (!table) return false;
    free(store->table);
    store->table = table;
    store->capacity = capacity;
    for (size_t i = 0; i < store->count; i++) *entry_of(store, &keys[i]) = (uint32_t)i + 1;
    return true;
}

/* ---- the library's calls -------------------------------------------------------------------------------- */

static int put(void *user, const fathom_block *block) {
    struct block_store *store = user;
    if (store->count == store->capacity && !grow(store)) {
        lose(store, "kept", strerror(ENOMEM));
        return -1;
    }
    uint32_t *entry = entry_of(store, &block->key);
    const size_t place = *entry ? *entry - 1 : store->count;
    const struct iovec parts[2] = {{block->distances, PART}, {block->weights, PART}};
    const ssize_t written = pwritev(store->fd, parts, 2, (off_t)(place * BLOCK));
    if (written != (ssize_t)BLOCK) {
        lose(store, "kept", written < 0 ? strerror(errno) : "no room for more");
        return -1;
    }
    if (*entry) return 0;
    store->keys[place] = block->key;
    *entry = (uint32_t)++store->count;
    return 0;
}

static int get(void *user, const fathom_block *block) {
    struct block_store *store = user;
    const uint32_t place = store->count ? *entry_of(store, &block->key) : 0;
    if (!place) return 0;
    const struct iovec parts[2] = {{block->distances, PART}, {block->weights, PART}};
    const ssize_t got = preadv(store->fd, parts, 2, (off_t)((place - 1) * BLOCK));
    if (got == (ssize_t)BLOCK) return 1;
    lose(store, "read back", got < 0 ? strerror(errno) : "the file has become shorter");
    return -1;
}

static int enumerate(void *user, int64_t position, fathom_block_key *key) {
    const struct block_store *store = user;
    if (position < 0 || (size_t)position >= store->count) return 0;
    *key = store->keys[position];
    return 1;
}

/* ---- life ---------------------------------------------------------------------------------------------- */

static char *template_for(const char *beside) {
    const char *folder = getenv("TMPDIR");
    if (!folder || !*folder) folder = "/var/tmp"; /* on a disk, unlike /tmp, which often is in memory */
    const char *start = beside ? beside : folder, *end = beside ? ".blocks.XXXXXX" : "/fathom.blocks.XXXXXX";
    const size_t size = strlen(start) + strlen(end) + 1;
    char *path = malloc(size);
    if (path) snprintf(path, size, "%s%s", start, end);
    return path;
}

bool block_store_open(struct block_store *store, const char *beside, fathom_config *config) {
    *store = (struct block_store){.fd = -1};
    if (config->when_full != FATHOM_FULL_DROP) return true;
    store->path = template_for(beside);
    errno = ENOMEM;
    if (store->path) store->fd = mkstemp(store->path);
    if (store->fd < 0 || unlink(store->path)) {
        cli_error(CLI_FAILED, "%s: a file for dropped blocks can't be made: %m",
                  store->path ? store->path : "");
        block_store_close(store);
        return false;
    }
    store->calls = FATHOM_STRUCT(fathom_block_store);
    store->calls.user = store;
    store->calls.put = put;
    store->calls.get = get;
    store->calls.enumerate = enumerate;
    config->block_store = &store->calls;
    return true;
}

bool block_store_report(const struct block_store *store, fathom *scan) {
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    if (!store->path || fathom_get_counters(scan, &counters)) return true;
    if (counters.blocks_dropped)
        cli_note("%lld blocks of the surface made room for others, %lld came back; the file that kept them "
                 "took %.1f MB",
                 (long long)counters.blocks_dropped, (long long)counters.blocks_restored,
                 (double)(store->count * BLOCK) / (1 << 20));
    if (store->lost)
        cli_note("%lld blocks that made room couldn't be kept or read back", (long long)store->lost);
    return store->lost == 0;
}

void block_store_close(struct block_store *store) {
    if (!store->path) return;
    if (store->fd >= 0) close(store->fd);
    free(store->path);
    free(store->keys);
    free(store->table);
    *store = (struct block_store){.fd = -1};
}
