/*
 * An .oni recording is a header and records, all little-endian. A record is a header of 28 bytes (magic, type, node,
 * size of header and fields, size of the payload, position of the record it replaces), fields, payload. A property's
 * fields are a name and a value, each with its size before it; a frame's are a stamp in microseconds and a number; its
 * payload is the frame, compressed by the codec that its node (stream) names.
 */
#include "camera/openni2_oni.h"

#include <stdlib.h>
#include <string.h>

#include "fathom_drivers.h"

enum { FILE_HEADER = 24, RECORD_HEADER = 28, MOST_FIELDS = 4096, MOST_SIDE = 16384 };
enum { TYPE_DEPTH = 2 };                                /* of a node */
enum { CODEC_PLAIN, CODEC_16Z, CODEC_16Z_TABLE };       /* NONE, 16zP, 16zT */
enum { FORMAT_MILLIMETRES = 100, FORMAT_TENTHS = 101 }; /* of pixels */
enum {
    RECORD_FIRST = 2,
    RECORD_INT = 3,
    RECORD_REAL = 4,
    RECORD_STRING = 5,
    RECORD_GENERAL = 6,
    RECORD_FRAME = 10,
    RECORD_END = 11,
    RECORD_NODE = 13,
    RECORD_LAST = 14
};

struct oni_file {
    FILE *file;
    int64_t at, first_frame; /* bytes: of the present record, and of the first frame's */

    uint32_t type, record_node, fields_size,
        payload_size; /* of the present record; fields_size without the header */
    uint8_t fields[MOST_FIELDS];

    bool has_depth;
    uint32_t node; /* the depth's */
    int codec;
    uint32_t width, height, format;
    double fov[2];
    bool mirrored, cropped;
    uint32_t frame_total;

    uint8_t *payload; /* room for the longest frame */
    size_t payload_room;
};

static uint32_t u32(const uint8_t *bytes) {
    return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

static uint64_t u64(const uint8_t *bytes) {
    return u32(bytes) | (uint64_t)u32(bytes + 4) << 32;
}

static int damaged(const oni_file *f, char *why, size_t size, const char *what) {
    snprintf(why, size, "damaged at byte %lld: %s", (long long)f->at, what);
    return FATHOM_ERROR_PROTOCOL;
}

/* ---- frames ---- */

/* The index of a value's table, or the value itself. */
struct decoder {
    const uint8_t *table; /* 16-bit values, or NULL */
    int32_t values;       /* in it */
    int32_t last;
    uint16_t *depth;
    size_t count, pixels;
};

/* The last value once more. */
static bool put(struct decoder *d) {
    if (d->last < 0 || d->last >= d->values || d->count >= d->pixels) return false;
    const uint8_t *value = d->table ? d->table + 2 * d->last : NULL;
    d->depth[d->count++] = value ? (uint16_t)(value[0] | value[1] << 8) : (uint16_t)d->last;
    return true;
}

static bool put_change(struct decoder *d, int change) {
    d->last -= change;
    return put(d);
}

/* A byte below 0xe0 holds two changes of -6..8 (the second one 15: none); 0xe0..0xfe stands for 2 (byte - 0xe0)
 * repeats; 0xff precedes a larger change (top bit set) or a whole value. */
bool oni_decode(const uint8_t *bytes, size_t size, bool with_table, uint16_t *depth, size_t pixels) {
    struct decoder d = {.values = 0x10000, .depth = depth, .pixels = pixels};
    size_t at = 0;
    if (with_table) {
        if (size < 2) return false;
        d.values = bytes[0] | bytes[1] << 8;
        d.table = bytes + 2;
        at = 2 + 2 * (size_t)d.values;
    }
    if (size < at + 2) return false;
    d.last = bytes[at] | bytes[at + 1] << 8;
    bool good = put(&d);
    for (at += 2; good && at < size; at++) {
        const int byte = bytes[at];
        if (byte < 0xe0) {
            good = put_change(&d, (byte >> 4) - 6) && ((byte & 15) == 15 || put_change(&d, (byte & 15) - 6));
        } else if (byte < 0xff) {
            for (int i = 0; good && i < 2 * (byte - 0xe0); i++) good = put(&d);
        } else if (at + 1 < size && bytes[at + 1] & 0x80) {
            good = put_change(&d, bytes[++at] - 192);
        } else if (at + 2 < size) {
            d.last = bytes[at + 1] << 8 | bytes[at + 2];
            at += 2;
            good = put(&d);
        } else {
            good = false;
        }
    }
    return good && d.count == pixels;
}

static void turn_round(uint16_t *depth, size_t width, size_t height) {
    for (; height > 0; height--, depth += width)
        for (size_t x = 0; x < width / 2; x++) {
            const uint16_t left = depth[x];
            depth[x] = depth[width - 1 - x];
            depth[width - 1 - x] = left;
        }
}

static bool decode(const oni_file *f, uint16_t *depth) {
    const size_t pixels = (size_t)f->width * f->height;
    if (f->codec != CODEC_PLAIN)
        return oni_decode(f->payload, f->payload_size, f->codec == CODEC_16Z_TABLE, depth, pixels);
    if (f->payload_size != 2 * pixels) return false;
    for (size_t i = 0; i < pixels; i++) depth[i] = (uint16_t)(f->payload[2 * i] | f->payload[2 * i + 1] << 8);
    return true;
}

/* ---- records ---- */

/* Reads the record at f->at without its payload. FATHOM_ERROR_NO_DATA: the file ends within it. */
static int read_record(oni_file *f, char *why, size_t size) {
    uint8_t header[RECORD_HEADER];
    if (fseeko(f->file, f->at, SEEK_SET) || fread(header, 1, sizeof header, f->file) != sizeof header)
        return FATHOM_ERROR_NO_DATA;
    const uint32_t bytes = u32(header + 12);
    f->type = u32(header + 4);
    f->record_node = u32(header + 8);
    f->payload_size = u32(header + 16);
    if (memcmp(header, "NIR\0", 4) != 0) return damaged(f, why, size, "no record begins here");
    if (f->type < RECORD_FIRST || f->type > RECORD_LAST)
        return damaged(f, why, size, "a record of an unknown kind");
    if (bytes < RECORD_HEADER || bytes - RECORD_HEADER > MOST_FIELDS)
        return damaged(f, why, size, "a record of an impossible size");
    f->fields_size = bytes - RECORD_HEADER;
    return fread(f->fields, 1, f->fields_size, f->file) == f->fields_size ? FATHOM_OK : FATHOM_ERROR_NO_DATA;
}

static void skip_record(oni_file *f) {
    f->at += (int64_t)RECORD_HEADER + f->fields_size + f->payload_size;
}

/* A name with its size before it; the bytes up to its end, or 0. */
static uint32_t read_name(const oni_file *f, const char **name) {
    if (f->fields_size < 5) return 0;
    const uint32_t length = u32(f->fields);
    if (length < 1 || length > f->fields_size - 4 || f->fields[4 + length - 1]) return 0;
    *name = (const char *)f->fields + 4;
    return 4 + length;
}

/* Reads a stream; only the first one of depth is used. */
static int read_node(oni_file *f, char *why, size_t size) {
    static const char *const codecs[] = {"NONE", "16zP", "16zT"};
    const char *name;
    const uint32_t at = read_name(f, &name);
    if (!at || f->fields_size < at + 12)
        return damaged(f, why, size, "a stream's description of a wrong size");
    const uint8_t *fields = f->fields + at;
    if (u32(fields) != TYPE_DEPTH || f->has_depth) return FATHOM_OK;
    f->has_depth = true;
    f->node = f->record_node;
    f->frame_total = u32(fields + 8);
    for (f->codec = 0; f->codec < 3; f->codec++)
        if (memcmp(fields + 4, codecs[f->codec], 4) == 0) return FATHOM_OK;
    snprintf(why, size, "its depth is compressed in a way that isn't known");
    return FATHOM_ERROR_UNSUPPORTED;
}

static int read_mode(oni_file *f, const uint8_t *value, char *why, size_t size) {
    const uint32_t width = u32(value), height = u32(value + 4);
    if (width < 8 || width > MOST_SIDE || height < 8 || height > MOST_SIDE)
        return damaged(f, why, size, "an impossible frame size");
    if (f->payload && (width != f->width || height != f->height))
        return damaged(f, why, size, "frames of another size from here on");
    f->width = width;
    f->height = height;
    return FATHOM_OK;
}

static double real(const uint8_t *bytes) {
    const uint64_t bits = u64(bytes);
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Reads a property of the depth stream; most are ignored. */
static int read_property(oni_file *f, char *why, size_t size) {
    const char *name;
    const uint32_t at = read_name(f, &name);
    if (!at || f->fields_size < at + 4 || u32(f->fields + at) != f->fields_size - at - 4)
        return damaged(f, why, size, "a property of a wrong size");
    const uint32_t bytes = f->fields_size - at - 4;
    const uint8_t *value = f->fields + at + 4;
    if (strcmp(name, "xnMapOutputMode") == 0 && bytes == 12) return read_mode(f, value, why, size);
    if (strcmp(name, "xnMirror") == 0 && bytes == 8) f->mirrored = u64(value) != 0;
    if (strcmp(name, "oniPixelFormat") == 0 && bytes == 8) f->format = u32(value);
    if (strcmp(name, "xnCropping") == 0 && bytes == 12) f->cropped = u32(value) != 0;
    if (strcmp(name, "xnFOV") == 0 && bytes == 16)
        for (int i = 0; i < 2; i++) f->fov[i] = real(value + 8 * i);
    return FATHOM_OK;
}

static int read_description(oni_file *f, char *why, size_t size) {
    if (f->type == RECORD_NODE) return read_node(f, why, size);
    if (f->type < RECORD_INT || f->type > RECORD_GENERAL || !f->has_depth || f->record_node != f->node)
        return FATHOM_OK;
    return read_property(f, why, size);
}

static bool is_frame(const oni_file *f) {
    return f->type == RECORD_FRAME && f->has_depth && f->record_node == f->node && f->payload_size > 0;
}

/* ---- the file ---- */

/* Reads up to the first frame, or to the end of a recording without one. */
static int read_head(oni_file *f, char *why, size_t size) {
    uint8_t header[FILE_HEADER];
    if (fread(header, 1, sizeof header, f->file) != sizeof header || memcmp(header, "NI10", 4) != 0) {
        snprintf(why, size, "it doesn't begin as a recording does");
        return FATHOM_ERROR_PROTOCOL;
    }
    int result = FATHOM_OK;
    for (f->at = FILE_HEADER; !result; skip_record(f)) {
        result = read_record(f, why, size);
        if (result == FATHOM_ERROR_NO_DATA)
            return damaged(f, why, size, "it breaks off before the first frame");
        if (!result) result = read_description(f, why, size);
        if (result || is_frame(f) || f->type == RECORD_END) break;
    }
    f->first_frame = f->at;
    return result;
}

static int check_head(oni_file *f, char *why, size_t size) {
    const char *wrong = NULL;
    if (!f->has_depth)
        wrong = "it has no depth";
    else if (!f->width)
        wrong = "it doesn't say how large its frames are";
    else if (f->format != FORMAT_MILLIMETRES && f->format != FORMAT_TENTHS)
        wrong = "it gives no depth in millimetres or tenths of them";
    else if (f->cropped)
        wrong = "its frames are cropped";
    else
        for (int i = 0; i < 2; i++)
            if (!(f->fov[i] > 0.05 && f->fov[i] < 3.1)) wrong = "it doesn't say its field of view";
    if (!wrong) return FATHOM_OK;
    snprintf(why, size, "%s", wrong);
    return FATHOM_ERROR_UNSUPPORTED;
}

int oni_open(oni_file **file, FILE *stream, oni_description *description, char *why, size_t size) {
    *file = NULL;
    oni_file *f = calloc(1, sizeof *f);
    if (!f) {
        fclose(stream);
        snprintf(why, size, "out of memory");
        return FATHOM_ERROR_MEMORY;
    }
    f->format = FORMAT_MILLIMETRES; /* OpenNI 1 knows no other */
    f->file = stream;
    int result = read_head(f, why, size);
    if (!result) result = check_head(f, why, size);
    if (!result) {
        f->payload_room = 4 * (size_t)f->width * f->height + 2 * 0x10000 + 4; /* whole values, and a table */
        f->payload = malloc(f->payload_room);
        if (!f->payload) {
            snprintf(why, size, "out of memory");
            result = FATHOM_ERROR_MEMORY;
        }
    }
    if (result) {
        oni_close(f);
        return result;
    }
    *description = (oni_description){.width = (int)f->width,
                                     .height = (int)f->height,
                                     .fov = {f->fov[0], f->fov[1]},
                                     .units_per_metre = f->format == FORMAT_TENTHS ? 10000 : 1000,
                                     .frame_total = f->frame_total <= INT32_MAX ? (int)f->frame_total : 0};
    *file = f;
    return FATHOM_OK;
}

void oni_close(oni_file *f) {
    if (!f) return;
    fclose(f->file);
    free(f->payload);
    free(f);
}

void oni_rewind(oni_file *f) {
    f->at = f->first_frame;
}

static int read_frame(oni_file *f, uint16_t *depth, int64_t *stamp_ns, int *number, char *why, size_t size) {
    if (f->fields_size != 12) return damaged(f, why, size, "a frame's record of a wrong size");
    const uint64_t stamp_us = u64(f->fields);
    *number = (int)(u32(f->fields + 8) & INT32_MAX);
    *stamp_ns = stamp_us < INT64_MAX / 4096 ? (int64_t)stamp_us * 1000 : -1;
    if (f->payload_size > f->payload_room) {
        snprintf(why, size, "frame %d is too long", *number);
        return FATHOM_ERROR_SIZE;
    }
    if (fread(f->payload, 1, f->payload_size, f->file) != f->payload_size) return FATHOM_ERROR_NO_DATA;
    if (*stamp_ns < 0 || !decode(f, depth)) {
        snprintf(why, size, "frame %d is damaged", *number);
        return FATHOM_ERROR_SIZE;
    }
    if (f->mirrored) turn_round(depth, f->width, f->height);
    return FATHOM_OK;
}

int oni_next(oni_file *f, uint16_t *depth, int64_t *stamp_ns, int *number, char *why, size_t size) {
    for (;;) {
        int result = read_record(f, why, size);
        if (!result && f->type == RECORD_END) return FATHOM_ERROR_ENDED;
        const bool frame = !result && is_frame(f);
        if (!result)
            result =
                frame ? read_frame(f, depth, stamp_ns, number, why, size) : read_description(f, why, size);
        if (result == FATHOM_ERROR_NO_DATA) return damaged(f, why, size, "the recording breaks off here");
        if (!result || result == FATHOM_ERROR_SIZE) skip_record(f);
        if (result || frame) return result;
    }
}
