#include "fathom/files/corners.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define WINDOW_SETS (1u << 14)
#define WINDOW_WAYS 4u
#define FIRST_SIZE 65536 /* of the table */
#define CHUNK 512        /* vertices per read when the table grows */

struct corner_slot {
    float position[3];
    uint32_t number_plus_one; /* 0: free */
};

static uint64_t hash_of(const float position[3]) {
    uint64_t hash = 0;
    for (int i = 0; i < 3; i++) {
        const float coordinate = position[i] + 0.0f; /* -0 becomes 0: they compare as equal */
        uint32_t bits;
        memcpy(&bits, &coordinate, sizeof bits);
        hash = (hash ^ bits) * 0x9E3779B97F4A7C15u;
        hash ^= hash >> 32;
    }
    return hash * 0x9E3779B97F4A7C15u;
}

static bool same_position(const float a[3], const float b[3]) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

/* ---- the file --------------------------------------------------------------------------------------------------- */

/* Reads vertices number..number+count-1. */
static bool read_vertices(struct corners *c, uint32_t number, size_t count, unsigned char *bytes) {
    if (number + count > c->readable) {
        if (fflush(c->file)) return false;
        c->readable = (uint32_t)c->count;
    }
    size_t done = 0;
    const size_t size = count * CORNER_BYTES;
    while (done < size) {
        const off_t at = (off_t)c->first + (off_t)number * CORNER_BYTES + (off_t)done;
        const ssize_t n = pread(fileno(c->file), bytes + done, size - done, at);
        if (n < 0 && errno == EINTR) continue;
        if (n == 0) errno = EIO; /* the file has been cut */
        if (n <= 0) return false;
        done += (size_t)n;
    }
    return true;
}

static void position_of(const unsigned char *bytes, float position[3]) {
    for (int i = 0; i < 3; i++, bytes += 4) {
        const uint32_t bits = (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 |
                              (uint32_t)bytes[3] << 24;
        memcpy(&position[i], &bits, sizeof bits);
    }
}

/* ---- the table -------------------------------------------------------------------------------------------------- */

static uint64_t place_of(const struct corners *c, uint64_t hash) {
    return (hash >> 32) * c->size >> 32;
}

static uint8_t tag_of(uint64_t hash) {
    return (uint8_t)(hash % 255 + 1);
}

static uint64_t next_place(const struct corners *c, uint64_t place) {
    return place + 1 < c->size ? place + 1 : 0;
}

/* Makes a larger table and fills it from the file; frees the old one first, so that both are never in memory at
 * once. */
static bool grow(struct corners *c) {
    unsigned char bytes[CHUNK * CORNER_BYTES];
    free(c->numbers);
    free(c->tags);
    c->size = c->size ? c->size + c->size / 2 : FIRST_SIZE;
    const bool fits = c->size <= SIZE_MAX / sizeof *c->numbers;
    c->numbers = fits ? malloc(c->size * sizeof *c->numbers) : NULL;
    c->tags = fits ? calloc(c->size, sizeof *c->tags) : NULL;
    errno = ENOMEM;
    if (!c->numbers || !c->tags) return false;
    for (uint64_t number = 0; number < c->count; number++) {
        const uint64_t left = c->count - number;
        float position[3];
        if (number % CHUNK == 0 &&
            !read_vertices(c, (uint32_t)number, left < CHUNK ? (size_t)left : CHUNK, bytes))
            return false;
        position_of(bytes + number % CHUNK * CORNER_BYTES, position);
        const uint64_t hash = hash_of(position);
        uint64_t place = place_of(c, hash);
        while (c->tags[place]) place = next_place(c, place);
        c->tags[place] = tag_of(hash);
        c->numbers[place] = (uint32_t)number;
    }
    return true;
}

static int find_in_table(struct corners *c, const float position[3], uint64_t hash, uint32_t *number) {
    if (c->count >= c->size / 4 * 3 && !grow(c)) return -1;
    c->tag = tag_of(hash);
    for (c->place = place_of(c, hash); c->tags[c->place]; c->place = next_place(c, c->place)) {
        unsigned char bytes[CORNER_BYTES];
        float there[3];
        if (c->tags[c->place] != c->tag) continue;
        if (!read_vertices(c, c->numbers[c->place], 1, bytes)) return -1;
        position_of(bytes, there);
        if (!same_position(there, position)) continue;
        *number = c->numbers[c->place];
        return 1;
    }
    return 0;
}

/* ---- the window ------------------------------------------------------------------------------------------------- */

static struct corner_slot *set_of(const struct corners *c, uint64_t hash) {
    return c->window + (size_t)(hash >> 16) % WINDOW_SETS * WINDOW_WAYS;
}

static void remember(struct corners *c, const float position[3], uint64_t hash, uint32_t number) {
    struct corner_slot *set = set_of(c, hash), *slot = NULL;
    for (uint32_t way = 0; way < WINDOW_WAYS && !slot; way++)
        if (!set[way].number_plus_one) slot = &set[way];
    if (!slot) slot = &set[c->clock++ % WINDOW_WAYS];
    memcpy(slot->position, position, sizeof slot->position);
    slot->number_plus_one = number + 1;
}

bool corners_open(struct corners *c, FILE *file, long first) {
    *c = (struct corners){.file = file, .first = first};
    c->window = calloc(WINDOW_SETS * WINDOW_WAYS, sizeof *c->window);
    errno = ENOMEM;
    return c->window && grow(c);
}

void corners_close(struct corners *c) {
    free(c->window);
    free(c->numbers);
    free(c->tags);
    *c = (struct corners){0};
}

int corners_find(struct corners *c, const float position[3], uint32_t *number) {
    const uint64_t hash = hash_of(position);
    const struct corner_slot *set = set_of(c, hash);
    for (uint32_t way = 0; way < WINDOW_WAYS; way++)
        if (set[way].number_plus_one && same_position(set[way].position, position)) {
            *number = set[way].number_plus_one - 1;
            return 1;
        }
    const int found = find_in_table(c, position, hash, number);
    if (found > 0) remember(c, position, hash, *number);
    return found;
}

void corners_add(struct corners *c, const float position[3], uint32_t number) {
    c->tags[c->place] = c->tag;
    c->numbers[c->place] = number;
    c->count++;
    remember(c, position, hash_of(position), number);
}
