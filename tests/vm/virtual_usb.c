#include "virtual_usb.h"

#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#define HIGH_SPEED 3

/* The kernel's Documentation/usb/usbip_protocol.rst; all numbers big-endian. */
enum { SUBMIT = 1, UNLINK = 2, SUBMITTED = 3, UNLINKED = 4 };

typedef struct {
    uint32_t command, sequence, device, is_in, endpoint;
    uint32_t a, length, c, d, e; /* flags or status; length; ... */
    uint8_t setup[8];
} packet;

_Static_assert(sizeof(packet) == 48, "a USB/IP header has 48 bytes");

static bool read_all(int s, void *to, size_t length) {
    for (uint8_t *at = to; length;) {
        const ssize_t n = recv(s, at, length, 0);
        if (n <= 0) return false;
        at += n;
        length -= (size_t)n;
    }
    return true;
}

static void write_all(virtual_usb *d, const packet *head, const uint8_t *data, size_t length) {
    pthread_mutex_lock(&d->lock);
    const uint8_t *parts[2] = {(const uint8_t *)head, data};
    const size_t lengths[2] = {sizeof *head, length};
    for (int p = 0; p < 2; p++)
        for (size_t at = 0; at < lengths[p];) {
            const ssize_t n = send(d->socket, parts[p] + at, lengths[p] - at, MSG_NOSIGNAL);
            if (n <= 0) break;
            at += (size_t)n;
        }
    pthread_mutex_unlock(&d->lock);
}

static void reply(virtual_usb *d, uint32_t sequence, int status, const uint8_t *data, uint32_t length) {
    packet head = {.command = htonl(SUBMITTED),
                   .sequence = htonl(sequence),
                   .a = htonl((uint32_t)status),
                   .length = htonl(length)};
    write_all(d, &head, data, data ? length : 0);
}

static int descriptor(const virtual_usb *d, const uint8_t *setup, uint8_t *data) {
    if (setup[0] != 0x80 || setup[1] != 6) return -1;
    const int number = setup[2];
    switch (setup[3]) {
    case 1: memcpy(data, d->kind.device, 18); return 18;
    case 2: {
        const int length = d->kind.config[2] | d->kind.config[3] << 8;
        memcpy(data, d->kind.config, (size_t)length);
        return length;
    }
    case 3:
        if (number == 0) {
            memcpy(data, "\x04\x03\x09\x04", 4);
            return 4;
        }
        if (number > 4 || !d->kind.strings[number - 1]) return -1;
        data[1] = 3;
        data[0] = 2;
        for (const char *c = d->kind.strings[number - 1]; *c; c++) {
            data[data[0]++] = (uint8_t)*c;
            data[data[0]++] = 0;
        }
        return data[0];
    }
    return -1;
}

static void control(virtual_usb *d, const packet *asked, uint32_t sequence) {
    const uint8_t *setup = asked->setup;
    const int wanted = setup[6] | setup[7] << 8;
    uint8_t data[4096];
    if (setup[0] == 0 || setup[0] == 1) { /* set address, configuration, interface */
        reply(d, sequence, 0, NULL, 0);
        return;
    }
    int length = descriptor(d, setup, data);
    if (length < 0 && d->kind.control) length = d->kind.control(d, setup, data);
    if (length < 0)
        reply(d, sequence, -EPIPE, NULL, 0);
    else if (setup[0] & 0x80)
        reply(d, sequence, 0, data, (uint32_t)(length < wanted ? length : wanted));
    else
        reply(d, sequence, 0, NULL, (uint32_t)wanted);
}

static void submit(virtual_usb *d, const packet *p) {
    static _Thread_local uint8_t data[65536];
    const uint32_t sequence = ntohl(p->sequence), length = ntohl(p->length),
                   endpoint = ntohl(p->endpoint) & 15;
    const bool in = ntohl(p->is_in) != 0;
    if (!in && length && (length > sizeof data || !read_all(d->socket, data, length))) return;
    if (endpoint == 0) {
        control(d, p, sequence);
    } else if (!in) {
        if (d->kind.out) d->kind.out(d, (int)endpoint, data, (int)length);
        reply(d, sequence, 0, NULL, length);
    } else {
        pthread_mutex_lock(&d->lock);
        if (d->waiting[endpoint].count < VIRTUAL_USB_WAITING) {
            const unsigned at =
                (d->waiting[endpoint].first + d->waiting[endpoint].count++) % VIRTUAL_USB_WAITING;
            d->waiting[endpoint].sequence[at] = sequence;
            d->waiting[endpoint].length[at] = length;
        }
        pthread_mutex_unlock(&d->lock);
    }
}

/* Takes a waiting request back. */
static void unlink_request(virtual_usb *d, const packet *p) {
    const uint32_t victim = ntohl(p->a);
    bool found = false;
    pthread_mutex_lock(&d->lock);
    for (int e = 1; e < 16 && !found; e++)
        for (unsigned i = 0; i < d->waiting[e].count; i++) {
            const unsigned at = (d->waiting[e].first + i) % VIRTUAL_USB_WAITING,
                           before = (at + VIRTUAL_USB_WAITING - 1) % VIRTUAL_USB_WAITING;
            if (found) { /* those behind it move up */
                d->waiting[e].sequence[before] = d->waiting[e].sequence[at];
                d->waiting[e].length[before] = d->waiting[e].length[at];
            }
            found |= d->waiting[e].sequence[at] == victim;
            if (found && i + 1 == d->waiting[e].count) {
                d->waiting[e].count--;
                break;
            }
        }
    pthread_mutex_unlock(&d->lock);
    packet head = {
        .command = htonl(UNLINKED), .sequence = p->sequence, .a = htonl((uint32_t)(found ? -ECONNRESET : 0))};
    write_all(d, &head, NULL, 0);
}

static void *serve(void *user) {
    virtual_usb *d = user;
    packet p;
    while (read_all(d->socket, &p, sizeof p)) {
        if (ntohl(p.command) == SUBMIT) submit(d, &p);
        if (ntohl(p.command) == UNLINK) unlink_request(d, &p);
    }
    return NULL;
}

int virtual_usb_plug(virtual_usb *device, const virtual_usb_kind *kind) {
    int ends[2];
    char line[64];
    memset(device, 0, sizeof *device);
    device->kind = *kind;
    pthread_mutex_init(&device->lock, NULL);
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends)) return -1;
    device->socket = ends[0];
    const int attach = open("/sys/devices/platform/vhci_hcd.0/attach", O_WRONLY);
    const int length =
        snprintf(line, sizeof line, "%d %d %d %d", kind->port, ends[1], 0x10000 + kind->port, HIGH_SPEED);
    bool attached = false;
    /* The port may still be busy with what was unplugged from it. */
    for (int i = 0; i < 100 && attach >= 0 && !attached; i++) {
        attached = write(attach, line, (size_t)length) == length;
        if (!attached && errno != EBUSY) break;
        if (!attached) usleep(50000);
    }
    if (!attached) perror("vhci attach");
    if (attach >= 0) close(attach);
    close(ends[1]);
    if (!attached) {
        close(ends[0]);
        return -1;
    }
    device->plugged = pthread_create(&device->thread, NULL, serve, device) == 0;
    return device->plugged ? 0 : -1;
}

bool virtual_usb_send(virtual_usb *device, int endpoint, const uint8_t *data, int length) {
    pthread_mutex_lock(&device->lock);
    const bool there = device->waiting[endpoint].count > 0;
    const unsigned first = device->waiting[endpoint].first;
    const uint32_t sequence = device->waiting[endpoint].sequence[first],
                   room = device->waiting[endpoint].length[first];
    if (there) {
        device->waiting[endpoint].first = (first + 1) % VIRTUAL_USB_WAITING;
        device->waiting[endpoint].count--;
    }
    pthread_mutex_unlock(&device->lock);
    if (there) reply(device, sequence, 0, data, (uint32_t)length < room ? (uint32_t)length : room);
    return there;
}

void virtual_usb_unplug(virtual_usb *device) {
    device->plugged = false;
    shutdown(device->socket, SHUT_RDWR);
    pthread_join(device->thread, NULL);
    close(device->socket);
    pthread_mutex_destroy(&device->lock);
}
