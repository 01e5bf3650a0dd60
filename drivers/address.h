/* The part of a source's uri after the driver's name: `what?key=value&key=value`. */
#ifndef FATHOM_ADDRESS_H
#define FATHOM_ADDRESS_H

#include <stdbool.h>
#include <stdint.h>

#define ADDRESS_SETTINGS 8

typedef struct {
    char what[256];
    struct {
        char key[32], value[128];
        bool used;
    } settings[ADDRESS_SETTINGS];
    int count;
} source_address;

/* False: too long, too many settings, or one without a "=". */
bool address_parse(source_address *address, const char *text);

/* The value of a setting, marked as used; NULL: not given. */
const char *address_setting(source_address *address, const char *key);

/* The first setting that wasn't used; NULL: none. */
const char *address_unknown(const source_address *address);

/* A choice of USB devices: any, those of a model, or one by its serial number. */
typedef struct {
    bool by_id, by_serial;
    uint16_t vendor, product;
    char serial[64];
} usb_choice;

/* From "", "vvvv:pppp" or "vvvv:pppp:serial" (hexadecimal). False: it is none of these. */
bool address_usb(usb_choice *choice, const char *what);

#endif
