/* The part of a source's uri after the driver's name: `what?key=value&key=value`. */
#ifndef FATHOM_ADDRESS_H
#define FATHOM_ADDRESS_H

#include <stdbool.h>

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

/* The first setting that nobody asked for; NULL: none. */
const char *address_unknown(const source_address *address);

#endif
