/*
 * Looks through an .oni recording before libOpenNI2 plays it: its player believes every length and size that the file
 * names, and crashes on wrong ones.
 *
 * A recording is a header and records, all little-endian. A record is a header of 28 bytes (magic, type, node, size of
 * header and fields, size of the payload, position of the record it replaces), fields, payload. A property's fields are
 * a name and a value, each with its size before it; a frame's are a stamp, a configuration and a number; its payload is
 * the frame, compressed by the codec that its node names.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "openni2_internal.h"

enum { FILE_HEADER = 24, RECORD_HEADER = 28, MOST_FIELDS = 4096, MOST_PAYLOAD = 1 << 26, MOST_NODES = 16 };

enum {
    RECORD_INT = 3,
    RECORD_REAL = 4,
    RECORD_STRING = 5,
    RECORD_GENERAL = 6,
    RECORD_NEW_DATA = 10,
    RECORD_END = 11,
    RECORD_NODE_ADDED = 13,
    RECORD_SEEK_TABLE = 14,
    RECORD_FIRST = 2,
    RECORD_LAST = 14
};

struct node {
    char codec[5];
    uint32_t frames;        /* as its record says; 0: the recorder never came to write it */
    uint32_t width, height; /* of its frames; 0: not said yet */
    uint32_t buffer_bytes;  /* that the player is to take for a frame; 0: not said yet */
    uint32_t last_frame;    /* number of the last frame record so far */
};

struct record {
    uint32_t type, node, fields_size, payload_size; /* fields_size without the header */
    uint8_t fields[MOST_FIELDS];
};

struct reader {
    FILE *file;
    int64_t at, size; /* bytes; at: of the present record */
    struct node nodes[MOST_NODES];
    struct record record;
    char *why;
    size_t why_size;
};

static uint32_t u32(const uint8_t *bytes) {
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static uint64_t u64(const uint8_t *bytes) {
    return u32(bytes) | (uint64_t)u32(bytes + 4) << 32;
}

static bool wrong(struct reader *r, const char *what) {
    snprintf(r->why, r->why_size, "damaged at byte %lld: %s", (long long)r->at, what);
    return false;
}

/* ---- records ---- */

/* A name with its size before it; the bytes up to its end, or 0. Names are plain text: the player's table of names
 * fails on other bytes. */
static uint32_t read_name(const struct record *record, const char **name) {
    if (record->fields_size < 5) return 0;
    const uint32_t length = u32(record->fields);
    if (length < 1 || length > record->fields_size - 4 || record->fields[4 + length - 1]) return 0;
    for (uint32_t i = 0; i + 1 < length; i++)
        if (record->fields[4 + i] <= ' ' || record->fields[4 + i] >= 127) return 0;
    *name = (const char *)record->fields + 4;
    return 4 + length;
}

static bool check_size(struct reader *r, struct node *node, const uint8_t *mode) {
    node->width = u32(mode);
    node->height = u32(mode + 4);
    return (node->width >= 8 && node->width <= 16384 && node->height >= 8 && node->height <= 16384) ||
           wrong(r, "an impossible frame size");
}

static bool check_modes(struct reader *r, const uint8_t *modes, uint32_t bytes) {
    struct node scrap;
    if (bytes == 0 || bytes % 12) return wrong(r, "a list of modes that doesn't end with one");
    for (uint32_t i = 0; i < bytes; i += 12)
        if (!check_size(r, &scrap, modes + i)) return false;
    return true;
}

/* Two angles in radians. */
static bool check_view(struct reader *r, const uint8_t *value, uint32_t bytes) {
    if (bytes != 16) return wrong(r, "a field of view of a wrong size");
    for (int i = 0; i < 2; i++) {
        const uint64_t bits = u64(value + 8 * i);
        double angle;
        memcpy(&angle, &bits, sizeof angle);
        if (!(angle > 0.05 && angle < 3.1)) return wrong(r, "an impossible field of view");
    }
    return true;
}

static bool check_property(struct reader *r, struct node *node) {
    const struct record *record = &r->record;
    const char *name = NULL;
    const uint32_t at = read_name(record, &name);
    if (!at || record->fields_size < at + 4) return wrong(r, "a property without a whole name");
    const uint32_t bytes = u32(record->fields + at);
    const uint8_t *value = record->fields + at + 4;
    if (bytes != record->fields_size - at - 4) return wrong(r, "a property of another size than its record");
    if (record->type == RECORD_INT && bytes != 8) return wrong(r, "a whole number of a wrong size");
    if (record->type == RECORD_REAL && bytes != 8) return wrong(r, "a number of a wrong size");
    if (strcmp(name, "oniRequiredFrameSize") == 0 && record->type == RECORD_INT) {
        if (u64(value) < 128 || u64(value) > MOST_PAYLOAD)
            return wrong(r, "an impossible size of frames in memory");
        node->buffer_bytes = u32(value);
    }
    if (strcmp(name, "xnFOV") == 0) return check_view(r, value, bytes);
    if (strcmp(name, "xnMapOutputMode") == 0)
        return bytes == 12 ? check_size(r, node, value) : wrong(r, "a mode of a wrong size");
    if (strcmp(name, "xnSupportedMapOutputModes") == 0) return check_modes(r, value, bytes);
    if (strcmp(name, "xnSupportedMapOutputModesCount") == 0 && u64(value) > MOST_FIELDS / 12)
        return wrong(r, "an impossible number of modes");
    return true;
}

static bool check_node(struct reader *r, struct node *node) {
    static const char *const codecs[] = {"16zP", "16zT", "Im8z", "JPEG", "NONE"};
    const struct record *record = &r->record;
    const char *name = NULL;
    const uint32_t at = read_name(record, &name);
    if (!at || record->fields_size != at + 36) return wrong(r, "a stream's description of a wrong size");
    *node = (struct node){.frames = u32(record->fields + at + 8)};
    memcpy(node->codec, record->fields + at + 4, 4);
    for (size_t i = 0; i < sizeof codecs / sizeof *codecs; i++)
        if (memcmp(node->codec, codecs[i], 4) == 0) return true;
    return memcmp(node->codec, "\0\0\0\0", 4) == 0 || wrong(r, "a codec that isn't known");
}

/* A frame of no more bytes than it can have, in room enough for it. */
static bool check_frame(struct reader *r, struct node *node, const uint8_t *start) {
    const struct record *record = &r->record;
    const uint64_t pixels = (uint64_t)node->width * node->height;
    if (record->fields_size != 12) return wrong(r, "a frame's record of a wrong size");
    if (record->payload_size == 0) return true; /* one that got lost */
    const uint32_t number = u32(record->fields + 8);
    if (number <= node->last_frame || (node->frames && number > node->frames))
        return wrong(r, "frames out of order");
    node->last_frame = number;
    if (node->buffer_bytes < 2 * pixels || pixels == 0)
        return wrong(r, "frames greater than the room for them");
    if (record->payload_size > 2 * (uint64_t)node->buffer_bytes + 4096)
        return wrong(r, "a frame that is too long");
    if (memcmp(node->codec, "16zT", 4) == 0 &&
        2 + 2 * (uint64_t)(start[0] | start[1] << 8) > record->payload_size)
        return wrong(r, "a frame whose table is longer than itself");
    return true;
}

/* Places of frames, 20 bytes each, the first one unused. */
static bool check_seek_table(struct reader *r, const struct node *node) {
    const uint32_t entries = r->record.payload_size / 20;
    if (r->record.payload_size % 20 || entries != node->frames + 1)
        return wrong(r, "a table of frames of a wrong size");
    for (uint32_t i = 0; i < entries; i++) {
        uint8_t entry[20];
        if (fread(entry, 1, sizeof entry, r->file) != sizeof entry) return wrong(r, "it can't be read");
        if (u64(entry + 12) >= (uint64_t)r->size)
            return wrong(r, "a table of frames that leads out of the file");
    }
    return true;
}

static bool check_record(struct reader *r) {
    struct record *record = &r->record;
    uint8_t start[2] = {0};
    if (record->node >= MOST_NODES) return wrong(r, "more streams than a recording has");
    struct node *node = &r->nodes[record->node];
    switch (record->type) {
    case RECORD_INT:
    case RECORD_REAL:
    case RECORD_STRING:
    case RECORD_GENERAL: return check_property(r, node);
    case RECORD_NODE_ADDED: return check_node(r, node);
    case RECORD_SEEK_TABLE: return check_seek_table(r, node);
    case RECORD_NEW_DATA:
        if (record->payload_size >= 2 && fread(start, 1, 2, r->file) != 2)
            return wrong(r, "it can't be read");
        return check_frame(r, node, start);
    default: return true;
    }
}

/* ---- the file ---- */

/* The record at r->at. *whole: it is all there. */
static bool read_record(struct reader *r, bool *whole) {
    struct record *record = &r->record;
    uint8_t header[RECORD_HEADER];
    *whole = false;
    if (fseeko(r->file, r->at, SEEK_SET) || fread(header, 1, sizeof header, r->file) != sizeof header)
        return true;
    const uint32_t bytes = u32(header + 12);
    record->type = u32(header + 4);
    record->node = u32(header + 8);
    record->payload_size = u32(header + 16);
    if (memcmp(header, "NIR\0", 4) != 0) return wrong(r, "no record begins here");
    if (record->type < RECORD_FIRST || record->type > RECORD_LAST)
        return wrong(r, "a record of an unknown kind");
    if (bytes < RECORD_HEADER || bytes - RECORD_HEADER > MOST_FIELDS || record->payload_size > MOST_PAYLOAD)
        return wrong(r, "a record of an impossible size");
    if (u64(header + 20) >= (uint64_t)r->at) return wrong(r, "a record that replaces a later one");
    record->fields_size = bytes - RECORD_HEADER;
    if (r->at + bytes + record->payload_size > r->size) return true;
    *whole = fread(record->fields, 1, record->fields_size, r->file) == record->fields_size;
    return true;
}

static bool check_records(struct reader *r) {
    uint8_t header[FILE_HEADER];
    if (fread(header, 1, sizeof header, r->file) != sizeof header || memcmp(header, "NI10", 4) != 0) {
        snprintf(r->why, r->why_size, "it doesn't begin as a recording does");
        return false;
    }
    for (r->at = FILE_HEADER;;) {
        bool whole;
        if (!read_record(r, &whole)) return false;
        if (!whole) return true; /* cut here: what is before can be played */
        if (!check_record(r)) return false;
        if (r->record.type == RECORD_END) return true;
        r->at += RECORD_HEADER + (int64_t)r->record.fields_size + r->record.payload_size;
    }
}

bool openni2_file_is_good(const char *path, char *why, size_t size) {
    struct stat status;
    struct reader *r = calloc(1, sizeof *r);
    if (!r) {
        snprintf(why, size, "out of memory");
        return false;
    }
    r->why = why;
    r->why_size = size;
    r->file = fopen(path, "rb");
    bool good = r->file && fstat(fileno(r->file), &status) == 0;
    if (good) {
        r->size = status.st_size;
        good = check_records(r);
    } else {
        snprintf(why, size, "%m");
    }
    if (r->file) fclose(r->file);
    free(r);
    return good;
}
