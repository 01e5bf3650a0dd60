/* HID report descriptors (Device Class Definition for HID 1.11, section 6.2.2), and the fields that they lay out in
 * reports. Fixed memory, no heap; any bytes are safe to parse. */
#ifndef FATHOM_HID_DESCRIPTOR_H
#define FATHOM_HID_DESCRIPTOR_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The kernel accepts descriptors of up to 4096 bytes; the largest known devices stay far below the other limits. */
#define HID_MAX_DESCRIPTOR 4096
#define HID_MAX_FIELDS 256
#define HID_MAX_USAGES 1024
#define HID_MAX_COLLECTIONS 256
#define HID_MAX_NESTING 32         /* of collections */
#define HID_MAX_PUSHES 8           /* of global states */
#define HID_MAX_REPORT_BITS 131072 /* 16 KiB, the kernel's limit */

typedef enum { HID_INPUT = 0, HID_OUTPUT = 1, HID_FEATURE = 2 } hid_report_kind;

/* Bits of an input, output or feature item (6.2.2.5). */
enum { HID_CONSTANT = 1, HID_VARIABLE = 2, HID_RELATIVE = 4 };

/* A usage or a range of them: page in the upper 16 bits. */
typedef struct {
    uint32_t first, last;
} hid_usages;

typedef struct {
    uint32_t usage;
    int parent;   /* index, or -1 */
    uint8_t type; /* 0 physical, 1 application, 2 logical, ... */
} hid_collection;

/* The fields of one input, output or feature item: `count` elements of `bits` bits, one after the other. */
typedef struct {
    uint8_t kind;      /* hid_report_kind */
    uint8_t report_id; /* 0: the device doesn't number its reports */
    uint16_t flags;    /* HID_CONSTANT, ... */
    uint32_t at;       /* bits from the report's first data byte, the one after the number */
    uint32_t bits;     /* of an element */
    uint32_t count;
    int64_t logical_min, logical_max, physical_min, physical_max;
    uint32_t unit;
    int8_t exponent; /* power of ten of the unit */
    int first_usage; /* index in usages */
    int usages;      /* number of them; 0: padding */
    int collection;  /* index, or -1 */
} hid_field;

typedef struct {
    hid_field fields[HID_MAX_FIELDS];
    int field_count;
    hid_usages usages[HID_MAX_USAGES];
    int usage_count;
    hid_collection collections[HID_MAX_COLLECTIONS];
    int collection_count;
    bool numbered;                /* reports begin with their number */
    uint32_t report_bits[3][256]; /* by kind and number, without the number's byte */
    const char *error;            /* the fault; NULL: none */
    size_t error_at;              /* byte offset of the faulty item */
} hid_descriptor;

/* Returns false when the bytes aren't a descriptor within the limits above; then error is set, and nothing else may be
 * used. Padding (fields without a usage) takes space in reports and isn't listed. */
bool hid_descriptor_parse(hid_descriptor *descriptor, const uint8_t *bytes, size_t length);

/* Bytes of a report, with the number where reports are numbered; 0: there is no such report. */
size_t hid_report_length(const hid_descriptor *descriptor, hid_report_kind kind, uint8_t report_id);

/* The usage of an element, from the item's list, whose last entry applies to all further elements (6.2.2.8). 0:
 * none. */
uint32_t hid_field_usage(const hid_descriptor *descriptor, const hid_field *field, uint32_t element);

/* The index of a usage in a field's list (an array field's value less its logical minimum); -1: not in it. */
int hid_field_usage_index(const hid_descriptor *descriptor, const hid_field *field, uint32_t usage);

/* Whether a field's collection, or one around it, has the usage. */
bool hid_field_within(const hid_descriptor *descriptor, const hid_field *field, uint32_t usage);

/* Reads an element, sign-extended where the logical minimum is negative. report has the number first where the device
 * numbers. False: the report is too short, or the element has more than 32 bits. */
bool hid_field_read(const hid_descriptor *descriptor, const hid_field *field, uint32_t element,
                    const uint8_t *report, size_t length, int64_t *value);

/* Writes an element's lowest bits; false as above. */
bool hid_field_write(const hid_descriptor *descriptor, const hid_field *field, uint32_t element,
                     uint8_t *report, size_t length, int64_t value);

/* A logical value in the field's unit (5.8): mapped to the physical range where there is one, times 10^exponent. */
double hid_field_physical(const hid_field *field, int64_t value);

#endif
