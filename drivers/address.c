#include "address.h"

#include <stdio.h>
#include <string.h>

/* Copies up to an end; false: it doesn't fit. */
static bool copy(char *out, size_t size, const char *from, size_t length) {
    if (length >= size) return false;
    memcpy(out, from, length);
    out[length] = 0;
    return true;
}

bool address_parse(source_address *address, const char *text) {
    memset(address, 0, sizeof *address);
    size_t length = strcspn(text, "?");
    if (!copy(address->what, sizeof address->what, text, length)) return false;
    text += length;
    while (*text) {
        text++; /* ? or & */
        length = strcspn(text, "&");
        const char *equals = memchr(text, '=', length);
        if (!equals || address->count == ADDRESS_SETTINGS) return false;
        const size_t key = (size_t)(equals - text);
        if (!copy(address->settings[address->count].key, sizeof address->settings->key, text, key) ||
            !copy(address->settings[address->count].value, sizeof address->settings->value, equals + 1,
                  length - key - 1))
            return false;
        address->count++;
        text += length;
    }
    return true;
}

const char *address_setting(source_address *address, const char *key) {
    for (int i = 0; i < address->count; i++)
        if (!strcmp(address->settings[i].key, key)) {
            address->settings[i].used = true;
            return address->settings[i].value;
        }
    return NULL;
}

const char *address_unknown(const source_address *address) {
    for (int i = 0; i < address->count; i++)
        if (!address->settings[i].used) return address->settings[i].key;
    return NULL;
}

bool address_usb(usb_choice *choice, const char *what) {
    unsigned vendor, product;
    int length = 0;
    *choice = (usb_choice){0};
    if (!*what) return true;
    if (sscanf(what, "%4x:%4x%n", &vendor, &product, &length) != 2) return false;
    choice->by_id = true;
    choice->vendor = (uint16_t)vendor;
    choice->product = (uint16_t)product;
    what += length;
    if (!*what) return true;
    if (*what != ':' || strlen(what + 1) >= sizeof choice->serial) return false;
    choice->by_serial = true;
    snprintf(choice->serial, sizeof choice->serial, "%s", what + 1);
    return true;
}
