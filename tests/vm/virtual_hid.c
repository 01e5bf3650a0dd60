#include "virtual_hid.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/uhid.h>
#include <poll.h>
#include <stdio.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

static void put(virtual_hid *d, struct uhid_event *event) {
    if (write(d->file, event, sizeof *event) < 0) perror("uhid");
}

static void answer(virtual_hid *d, const struct uhid_event *asked) {
    struct uhid_event event = {0};
    if (asked->type == UHID_GET_REPORT) {
        event.type = UHID_GET_REPORT_REPLY;
        event.u.get_report_reply.id = asked->u.get_report.id;
        const int length = d->kind.feature(d, asked->u.get_report.rnum, event.u.get_report_reply.data);
        if (length < 0)
            event.u.get_report_reply.err = EIO;
        else
            event.u.get_report_reply.size = (uint16_t)length;
    } else {
        const struct uhid_set_report_req *set = &asked->u.set_report;
        event.type = UHID_SET_REPORT_REPLY;
        event.u.set_report_reply.id = set->id;
        memcpy(d->set[set->rnum], set->data, set->size < 64 ? set->size : 64);
        d->set_count++;
    }
    put(d, &event);
}

static void *listen_to_kernel(void *user) {
    virtual_hid *d = user;
    struct pollfd waiting = {.fd = d->file, .events = POLLIN};
    while (!d->ending) {
        struct uhid_event event;
        if (poll(&waiting, 1, 50) <= 0 || read(d->file, &event, sizeof event) <= 0) continue;
        if (event.type == UHID_OPEN) d->open = true;
        if (event.type == UHID_CLOSE) d->open = false;
        if (event.type == UHID_GET_REPORT || event.type == UHID_SET_REPORT) answer(d, &event);
    }
    return NULL;
}

static void *send_reports(void *user) {
    virtual_hid *d = user;
    struct timespec due;
    clock_gettime(CLOCK_MONOTONIC, &due);
    while (!d->ending) {
        const int rate = d->rate_hz;
        due.tv_nsec += rate ? 1000000000 / rate : 10000000;
        if (due.tv_nsec >= 1000000000) {
            due.tv_nsec -= 1000000000;
            due.tv_sec++;
        }
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL);
        if (!d->rate_hz) continue;
        uint8_t report[256];
        const int length = d->kind.input(d, d->sent, report);
        virtual_hid_send(d, report, length);
        d->sent++;
    }
    return NULL;
}

int virtual_hid_plug(virtual_hid *device, const virtual_hid_kind *kind) {
    struct uhid_event event = {.type = UHID_CREATE2};
    memset(device, 0, sizeof *device);
    device->kind = *kind;
    device->file = open("/dev/uhid", O_RDWR | O_CLOEXEC);
    if (device->file < 0) return -1;
    struct uhid_create2_req *create = &event.u.create2;
    snprintf((char *)create->name, sizeof create->name, "%s", kind->name);
    snprintf((char *)create->uniq, sizeof create->uniq, "%s", kind->serial);
    memcpy(create->rd_data, kind->descriptor, (size_t)kind->descriptor_length);
    create->rd_size = (uint16_t)kind->descriptor_length;
    create->bus = 3; /* USB */
    create->vendor = kind->vendor;
    create->product = kind->product;
    put(device, &event);
    device->plugged = true;
    pthread_create(&device->listener, NULL, listen_to_kernel, device);
    pthread_create(&device->sender, NULL, send_reports, device);
    return 0;
}

void virtual_hid_send(virtual_hid *device, const uint8_t *report, int length) {
    struct uhid_event event = {.type = UHID_INPUT2};
    event.u.input2.size = (uint16_t)length;
    memcpy(event.u.input2.data, report, (size_t)length);
    put(device, &event);
}

void virtual_hid_unplug(virtual_hid *device) {
    struct uhid_event event = {.type = UHID_DESTROY};
    device->plugged = false;
    device->rate_hz = 0;
    put(device, &event);
    device->ending = true;
    pthread_join(device->listener, NULL);
    pthread_join(device->sender, NULL);
    close(device->file);
}
