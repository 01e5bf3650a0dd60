/* HID devices that the kernel believes in, by /dev/uhid. */
#ifndef VIRTUAL_HID_H
#define VIRTUAL_HID_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

typedef struct virtual_hid virtual_hid;

typedef struct {
    const char *name, *serial;
    uint16_t vendor, product;
    const uint8_t *descriptor;
    int descriptor_length;
    /* Fills in a feature report; its length, or -1: there is none. */
    int (*feature)(virtual_hid *device, uint8_t id, uint8_t *report);
    /* Fills in the next input report; its length. n counts from 0. */
    int (*input)(virtual_hid *device, uint32_t n, uint8_t *report);
} virtual_hid_kind;

struct virtual_hid {
    virtual_hid_kind kind;
    int file;
    pthread_t listener, sender;
    bool plugged;
    atomic_bool ending, open;
    atomic_int rate_hz; /* 0: silent */
    atomic_uint sent;
    uint8_t set[256][64]; /* feature reports as the host set them */
    atomic_int set_count;
};

/* Plugs it in; 0, or -1. */
int virtual_hid_plug(virtual_hid *device, const virtual_hid_kind *kind);
/* A report of one's own, whatever rate_hz is. */
void virtual_hid_send(virtual_hid *device, const uint8_t *report, int length);
void virtual_hid_unplug(virtual_hid *device);

#endif
