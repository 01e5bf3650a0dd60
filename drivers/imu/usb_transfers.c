/* Asynchronous transfers of the USB driver, and their content. */
#include "imu/kinect_motor.h"
#include "imu/usb_internal.h"
#include "monotonic.h"
#include "source_log.h"

#define WARN_SILENT 200 /* messages without samples before a log message */

int usb_submit(usb_slot *slot) {
    slot->submitted_ns = monotonic_now_ns();
    const int error = libusb_submit_transfer(slot->transfer);
    slot->pending = error == 0;
    if (error == LIBUSB_ERROR_NO_DEVICE) slot->source->gone = true;
    return error;
}

static void take_bulk(usb_source *s, const uint8_t *bytes, size_t length) {
    const int64_t arrival_ns = monotonic_now_ns();
    const int64_t broken = s->parser.broken;
    for (size_t taken = 0;;) {
        xbus_message message;
        bool whole;
        taken += xbus_take(&s->parser, bytes + taken, length - taken, &message, &whole);
        if (!whole) break;
        if (message.id == XBUS_ERROR)
            source_warn(&s->base.base.options, "%s: reports error %d", s->base.name,
                        message.length ? message.data[0] : -1);
        if (message.id != XBUS_MTDATA2) continue;
        imu_reading reading;
        const mtdata2_result r = mtdata2_read(&s->data, message.data, message.length, arrival_ns, &reading);
        if (r == MTDATA2_READING) {
            imu_stream_take(&s->base.stream, &reading, arrival_ns);
            s->taken++;
        } else if (r == MTDATA2_MALFORMED) {
            source_queue_count_malformed(&s->base.queue, 1);
        }
        s->silent = r == MTDATA2_OTHER ? s->silent + 1 : 0;
        if (s->silent == WARN_SILENT)
            source_warn(&s->base.base.options,
                        "%s: sends no rate of turn or acceleration: set its output so, or open it with "
                        "?configure=yes",
                        s->base.name);
    }
    if (s->parser.broken > broken) source_queue_count_malformed(&s->base.queue, s->parser.broken - broken);
}

static void take_control(usb_source *s, const usb_slot *slot) {
    imu_reading reading;
    const int64_t now_ns = monotonic_now_ns();
    if (!kinect_motor_read(libusb_control_transfer_get_data(slot->transfer),
                           (size_t)slot->transfer->actual_length, &reading)) {
        source_queue_count_malformed(&s->base.queue, 1);
        return;
    }
    imu_stream_take(&s->base.stream, &reading, slot->submitted_ns + (now_ns - slot->submitted_ns) / 2);
    s->taken++;
}

void LIBUSB_CALL usb_done(struct libusb_transfer *transfer) {
    usb_slot *slot = transfer->user_data;
    usb_source *s = slot->source;
    slot->pending = false;
    switch (transfer->status) {
    case LIBUSB_TRANSFER_COMPLETED:
        s->errors = 0;
        if (s->stopping) break;
        if (s->kind == USB_MTI)
            take_bulk(s, transfer->buffer, (size_t)transfer->actual_length);
        else
            take_control(s, slot);
        break;
    case LIBUSB_TRANSFER_NO_DEVICE: s->gone = true; break;
    case LIBUSB_TRANSFER_STALL: s->halted = true;                                   /* fall through */
    case LIBUSB_TRANSFER_OVERFLOW: source_queue_count_malformed(&s->base.queue, 1); /* fall through */
    case LIBUSB_TRANSFER_ERROR: /* some host controllers report this when a device is unplugged */
        if (++s->errors >= USB_MOST_ERRORS) s->gone = true;
        break;
    case LIBUSB_TRANSFER_TIMED_OUT:
    case LIBUSB_TRANSFER_CANCELLED: break;
    }
    if (s->kind == USB_MTI && !s->stopping && !s->gone && !s->halted) usb_submit(slot);
}

int usb_make_slots(usb_source *s, int count) {
    for (s->slot_count = 0; s->slot_count < count; s->slot_count++) {
        usb_slot *slot = &s->slots[s->slot_count];
        slot->source = s;
        slot->pending = false;
        if (!slot->transfer) slot->transfer = libusb_alloc_transfer(0);
        if (!slot->transfer)
            return source_fail(&s->base.base.options, FATHOM_ERROR_MEMORY, "usb: no memory for transfers");
    }
    return FATHOM_OK;
}

static bool any_pending(const usb_source *s) {
    for (int i = 0; i < s->slot_count; i++)
        if (s->slots[i].pending) return true;
    return false;
}

/* Every transfer must complete before its memory is freed. */
void usb_cancel_all(usb_source *s) {
    struct timeval slice = {.tv_usec = 10000};
    s->stopping = true;
    for (int i = 0; i < s->slot_count; i++)
        if (s->slots[i].pending) libusb_cancel_transfer(s->slots[i].transfer);
    while (any_pending(s)) {
        const int error = libusb_handle_events_timeout_completed(s->context, &slice, NULL);
        if (error && error != LIBUSB_ERROR_INTERRUPTED) break;
    }
}
