#include "imu/hid_descriptor.h"

#include <math.h>
#include <string.h>

/* Item prefixes without the size bits (6.2.2.4 to 6.2.2.8). */
enum {
    ITEM_INPUT = 0x80,
    ITEM_OUTPUT = 0x90,
    ITEM_COLLECTION = 0xA0,
    ITEM_FEATURE = 0xB0,
    ITEM_END_COLLECTION = 0xC0,
    ITEM_USAGE_PAGE = 0x04,
    ITEM_LOGICAL_MIN = 0x14,
    ITEM_LOGICAL_MAX = 0x24,
    ITEM_PHYSICAL_MIN = 0x34,
    ITEM_PHYSICAL_MAX = 0x44,
    ITEM_EXPONENT = 0x54,
    ITEM_UNIT = 0x64,
    ITEM_REPORT_SIZE = 0x74,
    ITEM_REPORT_ID = 0x84,
    ITEM_REPORT_COUNT = 0x94,
    ITEM_PUSH = 0xA4,
    ITEM_POP = 0xB4,
    ITEM_USAGE = 0x08,
    ITEM_USAGE_MIN = 0x18,
    ITEM_USAGE_MAX = 0x28,
    ITEM_LONG = 0xFE
};

/* An item's data, little-endian, both ways to read it. */
typedef struct {
    uint32_t plain;
    int32_t extended;
    int size;
} item_data;

typedef struct {
    uint32_t page, report_size, report_count, unit;
    item_data logical_min, logical_max, physical_min, physical_max;
    int8_t exponent;
    uint8_t report_id;
} global_state;

/* The parser's state. Usages go to the descriptor's list right away; a main item takes those since local_from. */
typedef struct {
    hid_descriptor *out;
    global_state global, pushed[HID_MAX_PUSHES];
    int pushes;
    int nesting[HID_MAX_NESTING]; /* indices of the open collections */
    int depth;
    int local_from;
    bool page_open
        [HID_MAX_USAGES];  /* the usage was given without a page: the main item's page counts (6.2.2.8) */
    bool has_min, has_max; /* a range lacks its other end */
    item_data usage_min, usage_max;
    bool any_field_unnumbered;
} parser;

static const char *add_usages(parser *p, uint32_t first, uint32_t last, bool open) {
    hid_descriptor *d = p->out;
    if (d->usage_count == HID_MAX_USAGES) return "too many usages";
    if (last < first) return "a usage range ends before it begins";
    p->page_open[d->usage_count] = open;
    d->usages[d->usage_count++] = (hid_usages){first, last};
    return NULL;
}

static const char *end_of_range(parser *p) {
    if (!p->has_min || !p->has_max) return NULL;
    p->has_min = p->has_max = false;
    const bool open = p->usage_min.size < 4;
    if (open != (p->usage_max.size < 4)) return "a usage range has a page at one end only";
    if (!open && p->usage_min.plain >> 16 != p->usage_max.plain >> 16) return "a usage range spans pages";
    return add_usages(p, p->usage_min.plain, p->usage_max.plain, open);
}

static const char *local_item(parser *p, int item, item_data data) {
    switch (item) {
    case ITEM_USAGE: return add_usages(p, data.plain, data.plain, data.size < 4);
    case ITEM_USAGE_MIN:
        p->usage_min = data;
        p->has_min = true;
        return end_of_range(p);
    case ITEM_USAGE_MAX:
        p->usage_max = data;
        p->has_max = true;
        return end_of_range(p);
    }
    return NULL; /* designators, strings and delimiters don't change the layout */
}

static const char *global_item(parser *p, int item, item_data data) {
    global_state *g = &p->global;
    switch (item) {
    case ITEM_USAGE_PAGE:
        if (data.plain > 0xFFFF) return "a usage page has more than 16 bits";
        g->page = data.plain;
        return NULL;
    case ITEM_LOGICAL_MIN: g->logical_min = data; return NULL;
    case ITEM_LOGICAL_MAX: g->logical_max = data; return NULL;
    case ITEM_PHYSICAL_MIN: g->physical_min = data; return NULL;
    case ITEM_PHYSICAL_MAX: g->physical_max = data; return NULL;
    case ITEM_EXPONENT:
        /* A nibble in two's complement by 6.2.2.7; devices also write it as a signed byte. */
        if (data.plain <= 0xF)
            g->exponent = (int8_t)(data.plain < 8 ? (int)data.plain : (int)data.plain - 16);
        else if (data.extended < -30 || data.extended > 30)
            return "a unit exponent is out of range";
        else
            g->exponent = (int8_t)data.extended;
        return NULL;
    case ITEM_UNIT: g->unit = data.plain; return NULL;
    case ITEM_REPORT_SIZE:
        if (data.plain > HID_MAX_REPORT_BITS) return "a report size is too large";
        g->report_size = data.plain;
        return NULL;
    case ITEM_REPORT_COUNT:
        if (data.plain > HID_MAX_REPORT_BITS) return "a report count is too large";
        g->report_count = data.plain;
        return NULL;
    case ITEM_REPORT_ID:
        if (data.plain == 0 || data.plain > 255) return "a report number isn't 1 to 255";
        g->report_id = (uint8_t)data.plain;
        p->out->numbered = true;
        return NULL;
    case ITEM_PUSH:
        if (p->pushes == HID_MAX_PUSHES) return "too many pushes";
        p->pushed[p->pushes++] = *g;
        return NULL;
    case ITEM_POP:
        if (p->pushes == 0) return "a pop without a push";
        *g = p->pushed[--p->pushes];
        return NULL;
    }
    return NULL; /* reserved */
}

static void clear_locals(parser *p, bool keep) {
    if (!keep) p->out->usage_count = p->local_from;
    p->local_from = p->out->usage_count;
    p->has_min = p->has_max = false;
}

/* Usages without a page get the one in force at the main item. */
static void close_pages(parser *p) {
    for (int i = p->local_from; i < p->out->usage_count; i++) {
        if (!p->page_open[i]) continue;
        p->out->usages[i].first |= p->global.page << 16;
        p->out->usages[i].last |= p->global.page << 16;
    }
}

static const char *open_collection(parser *p, item_data data) {
    hid_descriptor *d = p->out;
    if (p->depth == HID_MAX_NESTING) return "collections nest too deep";
    if (d->collection_count == HID_MAX_COLLECTIONS) return "too many collections";
    close_pages(p);
    hid_collection *c = &d->collections[d->collection_count];
    c->usage = d->usage_count > p->local_from ? d->usages[p->local_from].first : 0;
    c->parent = p->depth ? p->nesting[p->depth - 1] : -1;
    c->type = (uint8_t)data.plain;
    p->nesting[p->depth++] = d->collection_count++;
    clear_locals(p, false);
    return NULL;
}

/* A maximum is signed only when its minimum is: 0..255 is often written with the one byte 0xFF. */
static void limits(item_data min, item_data max, int64_t *low, int64_t *high) {
    *low = min.extended;
    *high = min.extended < 0 ? max.extended : (int64_t)max.plain;
}

static const char *add_field(parser *p, hid_report_kind kind, item_data data) {
    hid_descriptor *d = p->out;
    const global_state *g = &p->global;
    if (g->report_size == 0 || g->report_count == 0) { /* lays out nothing */
        clear_locals(p, false);
        return NULL;
    }
    uint32_t *end = &d->report_bits[kind][g->report_id];
    const uint64_t bits = (uint64_t)g->report_size * g->report_count;
    if (*end + bits > HID_MAX_REPORT_BITS) return "a report is too long";
    if (g->report_id == 0) p->any_field_unnumbered = true;
    const uint32_t at = *end;
    *end += (uint32_t)bits;
    const int usages = d->usage_count - p->local_from;
    if (usages == 0) { /* padding */
        clear_locals(p, false);
        return NULL;
    }
    if (d->field_count == HID_MAX_FIELDS) return "too many fields";
    close_pages(p);
    hid_field *f = &d->fields[d->field_count++];
    *f = (hid_field){.kind = (uint8_t)kind,
                     .report_id = g->report_id,
                     .flags = (uint16_t)data.plain,
                     .at = at,
                     .bits = g->report_size,
                     .count = g->report_count,
                     .unit = g->unit,
                     .exponent = g->exponent,
                     .first_usage = p->local_from,
                     .usages = usages,
                     .collection = p->depth ? p->nesting[p->depth - 1] : -1};
    limits(g->logical_min, g->logical_max, &f->logical_min, &f->logical_max);
    limits(g->physical_min, g->physical_max, &f->physical_min, &f->physical_max);
    if (f->logical_min > f->logical_max) return "a logical minimum lies above its maximum";
    clear_locals(p, true);
    return NULL;
}

static const char *main_item(parser *p, int item, item_data data) {
    if (p->has_min || p->has_max) return "a usage range has one end only";
    switch (item) {
    case ITEM_INPUT: return add_field(p, HID_INPUT, data);
    case ITEM_OUTPUT: return add_field(p, HID_OUTPUT, data);
    case ITEM_FEATURE: return add_field(p, HID_FEATURE, data);
    case ITEM_COLLECTION: return open_collection(p, data);
    case ITEM_END_COLLECTION:
        if (p->depth == 0) return "an end without a collection";
        p->depth--;
        break;
    }
    clear_locals(p, false);
    return NULL;
}

static item_data read_item(const uint8_t *bytes, int size) {
    item_data data = {.size = size};
    for (int i = 0; i < size; i++) data.plain |= (uint32_t)bytes[i] << (8 * i);
    data.extended = (int32_t)data.plain;
    if (size == 1) data.extended = (int8_t)data.plain;
    if (size == 2) data.extended = (int16_t)data.plain;
    return data;
}

static const char *parse_items(parser *p, const uint8_t *bytes, size_t length) {
    for (size_t at = 0; at < length;) {
        p->out->error_at = at;
        const uint8_t prefix = bytes[at++];
        if (prefix == ITEM_LONG) { /* 6.2.2.3: size, tag, data; no tag is defined */
            if (length - at < 2 || length - at - 2 < bytes[at]) return "a long item is cut short";
            at += 2u + bytes[at];
            continue;
        }
        const int size = (prefix & 3) == 3 ? 4 : prefix & 3;
        if (length - at < (size_t)size) return "an item is cut short";
        const item_data data = read_item(bytes + at, size);
        at += (size_t)size;
        const int item = prefix & 0xFC;
        const char *error = NULL;
        switch (prefix >> 2 & 3) {
        case 0: error = main_item(p, item, data); break;
        case 1: error = global_item(p, item, data); break;
        case 2: error = local_item(p, item, data); break;
        default: error = "an item of the reserved type"; break;
        }
        if (error) return error;
    }
    p->out->error_at = length;
    if (p->depth) return "a collection has no end";
    if (p->any_field_unnumbered && p->out->numbered) return "some reports have a number and some have none";
    if (p->out->collection_count == 0) return "no collection";
    return NULL;
}

bool hid_descriptor_parse(hid_descriptor *descriptor, const uint8_t *bytes, size_t length) {
    memset(descriptor, 0, sizeof *descriptor);
    parser p = {.out = descriptor};
    descriptor->error =
        length > HID_MAX_DESCRIPTOR ? "longer than 4096 bytes" : parse_items(&p, bytes, length);
    return !descriptor->error;
}

size_t hid_report_length(const hid_descriptor *descriptor, hid_report_kind kind, uint8_t report_id) {
    const uint32_t bits = descriptor->report_bits[kind][report_id];
    return bits ? (bits + 7) / 8 + (descriptor->numbered ? 1 : 0) : 0;
}

uint32_t hid_field_usage(const hid_descriptor *descriptor, const hid_field *field, uint32_t element) {
    const hid_usages *list = descriptor->usages + field->first_usage;
    for (int i = 0; i < field->usages; i++) {
        const uint32_t size = list[i].last - list[i].first;
        if (element <= size) return list[i].first + element;
        element -= size + 1;
    }
    return field->usages ? list[field->usages - 1].last : 0;
}

int hid_field_usage_index(const hid_descriptor *descriptor, const hid_field *field, uint32_t usage) {
    const hid_usages *list = descriptor->usages + field->first_usage;
    int index = 0;
    for (int i = 0; i < field->usages; i++) {
        if (usage >= list[i].first && usage <= list[i].last) return index + (int)(usage - list[i].first);
        index += (int)(list[i].last - list[i].first) + 1;
    }
    return -1;
}

bool hid_field_within(const hid_descriptor *descriptor, const hid_field *field, uint32_t usage) {
    for (int c = field->collection; c >= 0; c = descriptor->collections[c].parent)
        if (descriptor->collections[c].usage == usage) return true;
    return false;
}

/* The position of an element in the report, in bits; false when it lies outside. */
static bool locate(const hid_descriptor *descriptor, const hid_field *field, uint32_t element, size_t length,
                   size_t *at) {
    if (element >= field->count || field->bits > 32) return false;
    *at = field->at + (size_t)element * field->bits + (descriptor->numbered ? 8 : 0);
    return *at + field->bits <= 8 * length;
}

bool hid_field_read(const hid_descriptor *descriptor, const hid_field *field, uint32_t element,
                    const uint8_t *report, size_t length, int64_t *value) {
    size_t at;
    if (!locate(descriptor, field, element, length, &at)) return false;
    uint64_t raw = 0;
    const size_t first = at / 8, last = (at + field->bits - 1) / 8;
    for (size_t i = first; i <= last; i++) raw |= (uint64_t)report[i] << (8 * (i - first));
    raw = raw >> at % 8 & ((UINT64_C(1) << field->bits) - 1);
    *value = (int64_t)raw;
    if (field->logical_min < 0 && raw >> (field->bits - 1)) *value -= INT64_C(1) << field->bits;
    return true;
}

bool hid_field_write(const hid_descriptor *descriptor, const hid_field *field, uint32_t element,
                     uint8_t *report, size_t length, int64_t value) {
    size_t at;
    if (!locate(descriptor, field, element, length, &at)) return false;
    for (uint32_t i = 0; i < field->bits; i++, at++) {
        const uint8_t bit = (uint8_t)(1u << at % 8);
        report[at / 8] = (uint8_t)((uint64_t)value >> i & 1 ? report[at / 8] | bit : report[at / 8] & ~bit);
    }
    return true;
}

double hid_field_physical(const hid_field *field, int64_t value) {
    double physical = (double)value;
    if (field->physical_min != field->physical_max && field->logical_min != field->logical_max)
        physical =
            ((double)(value - field->logical_min) * (double)(field->physical_max - field->physical_min)) /
                (double)(field->logical_max - field->logical_min) +
            (double)field->physical_min;
    return physical * pow(10, field->exponent);
}
