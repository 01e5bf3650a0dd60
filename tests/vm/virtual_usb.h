/* USB devices that the kernel believes in: USB/IP's vhci_hcd on one end of a socket pair, this on the other. */
#ifndef VIRTUAL_USB_H
#define VIRTUAL_USB_H

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdint.h>

#define VIRTUAL_USB_WAITING 256 /* requests that wait on an endpoint */

typedef struct virtual_usb virtual_usb;

typedef struct {
    int port; /* of the virtual hub */
    const uint8_t *device, *config;
    const char *strings[4]; /* from number 1 */
    /* A control request that isn't answered by the descriptors: fills in up to wanted bytes; their number, or -1: stall. */
    int (*control)(virtual_usb *device, const uint8_t setup[8], uint8_t *data);
    /* What the host wrote to an endpoint; NULL: ignored. */
    void (*out)(virtual_usb *device, int endpoint, const uint8_t *data, int length);
} virtual_usb_kind;

struct virtual_usb {
    virtual_usb_kind kind;
    int socket;
    bool plugged;
    pthread_t thread;
    pthread_mutex_t lock;
    struct {
        uint32_t sequence[VIRTUAL_USB_WAITING], length[VIRTUAL_USB_WAITING];
        unsigned first, count;
    } waiting[16];
    void *user;
};

int virtual_usb_plug(virtual_usb *device, const virtual_usb_kind *kind);
/* Answers a request that waits on an IN endpoint; false: none does. */
bool virtual_usb_send(virtual_usb *device, int endpoint, const uint8_t *data, int length);
void virtual_usb_unplug(virtual_usb *device);

#endif
