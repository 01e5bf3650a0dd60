/* The USB driver over a libusb that this program defines itself: devices without endpoints, claims that fail, transfers. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>

#include <cmocka.h>

#include <libusb.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fathom_drivers.h"
#include "imu/kinect_motor.h"
#include "imu/mtdata2.h"
#include "imu/usb_internal.h"
#include "source_contract.h"

/* ---- the bus ---- */

struct libusb_device {
    uint16_t vendor, product;
    const char *serial;
    bool has_bulk;
    int open_error, claim_error;
    int opened, closed, claimed, released; /* times */
};

struct libusb_device_handle {
    libusb_device *device;
};

static libusb_device bus[3];
static int plugged, contexts, configs, strings_asked;
static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static struct libusb_transfer *pending[16];
static int pendings;

static _Atomic int next_transfer_status, bad_transfers, after_bad; /* that many of a status, then the other; -1: all */
static int submit_error, submitted;

static int fresh_bus(void **state) {
    (void)state;
    memset(bus, 0, sizeof bus);
    for (int i = 0; i < 3; i++) bus[i] = (libusb_device){.vendor = 0x2639, .product = 0x0300, .has_bulk = true};
    plugged = contexts = configs = strings_asked = pendings = 0;
    next_transfer_status = LIBUSB_TRANSFER_COMPLETED;
    bad_transfers = -1;
    after_bad = LIBUSB_TRANSFER_COMPLETED;
    submit_error = submitted = 0;
    return 0;
}

int libusb_init(libusb_context **context) {
    *context = (libusb_context *)&contexts;
    contexts++;
    return 0;
}

void libusb_exit(libusb_context *context) {
    (void)context;
    contexts--;
}

const char *libusb_error_name(int error) {
    (void)error;
    return "an error";
}

ssize_t libusb_get_device_list(libusb_context *context, libusb_device ***list) {
    (void)context;
    *list = calloc((size_t)plugged + 1, sizeof **list);
    for (int i = 0; i < plugged; i++) (*list)[i] = &bus[i];
    return plugged;
}

void libusb_free_device_list(libusb_device **list, int unref) {
    (void)unref;
    free(list);
}

int libusb_get_device_descriptor(libusb_device *device, struct libusb_device_descriptor *d) {
    *d = (struct libusb_device_descriptor){
        .idVendor = device->vendor, .idProduct = device->product, .iSerialNumber = device->serial != NULL};
    return 0;
}

uint8_t libusb_get_bus_number(libusb_device *device) {
    (void)device;
    return 1;
}

uint8_t libusb_get_device_address(libusb_device *device) {
    return (uint8_t)(device - bus + 1);
}

int libusb_get_string_descriptor_ascii(libusb_device_handle *handle, uint8_t index, unsigned char *data, int length) {
    (void)index;
    strings_asked++;
    return snprintf((char *)data, (size_t)length, "%s", handle->device->serial);
}

int libusb_open(libusb_device *device, libusb_device_handle **handle) {
    if (device->open_error) return device->open_error;
    *handle = malloc(sizeof **handle);
    (*handle)->device = device;
    device->opened++;
    return 0;
}

void libusb_close(libusb_device_handle *handle) {
    handle->device->closed++;
    free(handle);
}

static const struct libusb_endpoint_descriptor endpoints[2] = {
    {.bEndpointAddress = 0x81, .bmAttributes = LIBUSB_TRANSFER_TYPE_BULK},
    {.bEndpointAddress = 0x01, .bmAttributes = LIBUSB_TRANSFER_TYPE_BULK}};
static const struct libusb_interface_descriptor with_bulk = {
    .bInterfaceNumber = 1, .bNumEndpoints = 2, .endpoint = endpoints},
                                                without_bulk = {0};
static const struct libusb_interface interfaces[2] = {{&without_bulk, 1}, {&with_bulk, 1}};

int libusb_get_active_config_descriptor(libusb_device *device, struct libusb_config_descriptor **config) {
    *config = calloc(1, sizeof **config);
    (*config)->bNumInterfaces = device->has_bulk ? 2 : 1;
    (*config)->interface = interfaces;
    configs++;
    return 0;
}

void libusb_free_config_descriptor(struct libusb_config_descriptor *config) {
    free(config);
    configs--;
}

int libusb_set_auto_detach_kernel_driver(libusb_device_handle *handle, int enable) {
    (void)handle, (void)enable;
    return 0;
}

int libusb_claim_interface(libusb_device_handle *handle, int interface) {
    assert_int_equal(interface, 1);
    if (handle->device->claim_error) return handle->device->claim_error;
    handle->device->claimed++;
    return 0;
}

int libusb_release_interface(libusb_device_handle *handle, int interface) {
    assert_int_equal(interface, 1);
    handle->device->released++;
    return 0;
}

int libusb_bulk_transfer(libusb_device_handle *handle, unsigned char endpoint, unsigned char *data, int length,
                         int *sent, unsigned timeout) {
    (void)handle, (void)data, (void)timeout;
    assert_int_equal(endpoint, 0x01);
    *sent = length;
    return 0;
}

int libusb_clear_halt(libusb_device_handle *handle, unsigned char endpoint) {
    (void)handle, (void)endpoint;
    return 0;
}

struct libusb_transfer *libusb_alloc_transfer(int packets) {
    (void)packets;
    return calloc(1, sizeof(struct libusb_transfer));
}

void libusb_free_transfer(struct libusb_transfer *transfer) {
    free(transfer);
}

int libusb_submit_transfer(struct libusb_transfer *transfer) {
    submitted++;
    if (submit_error) return submit_error;
    pthread_mutex_lock(&lock);
    pending[pendings++] = transfer;
    transfer->status = LIBUSB_TRANSFER_COMPLETED;
    pthread_mutex_unlock(&lock);
    return 0;
}

int libusb_cancel_transfer(struct libusb_transfer *transfer) {
    pthread_mutex_lock(&lock);
    transfer->status = LIBUSB_TRANSFER_CANCELLED;
    pthread_mutex_unlock(&lock);
    return 0;
}

/* Finishes the transfers: those that were cancelled, and the first with a message. */
int libusb_handle_events_timeout_completed(libusb_context *context, struct timeval *time, int *completed) {
    (void)context, (void)time, (void)completed;
    struct libusb_transfer *finished[16];
    int count = 0;
    usleep(1000);
    pthread_mutex_lock(&lock);
    for (int i = 0; i < pendings;) {
        const bool cancelled = pending[i]->status == LIBUSB_TRANSFER_CANCELLED;
        if (!cancelled && count) {
            i++;
            continue;
        }
        finished[count++] = pending[i];
        pending[i] = pending[--pendings];
        if (!cancelled) {
            static const uint8_t gyro[] = {0x80, 0x20, 12, 0x3F, 0x80, 0, 0, 0x40, 0, 0, 0, 0x40, 0x40, 0, 0,
                                           0x40, 0x20, 12, 0,    0,    0, 0, 0,    0, 0, 0, 0x41, 0x20, 0, 0};
            const bool good = bad_transfers == 0;
            bad_transfers -= bad_transfers > 0;
            finished[count - 1]->status =
                (enum libusb_transfer_status)(good ? after_bad : next_transfer_status);
            finished[count - 1]->actual_length = (int)xbus_build(
                finished[count - 1]->buffer, (size_t)finished[count - 1]->length, XBUS_MTDATA2, gyro, sizeof gyro);
        }
    }
    pthread_mutex_unlock(&lock);
    for (int i = 0; i < count; i++) finished[i]->callback(finished[i]);
    return 0;
}

/* ---- tests ---- */

static char errors[1024];

static void keep_log(void *user, fathom_log_level level, const char *text) {
    (void)user;
    if (level == FATHOM_LOG_ERROR) snprintf(errors, sizeof errors, "%s", text);
}

static int open_usb(fathom_source **source, const char *uri) {
    const fathom_source_options options = {.struct_size = sizeof options, .log = keep_log};
    *errors = 0;
    return fathom_source_open(source, uri, &options);
}

static void nothing_is_left_open(void) {
    assert_int_equal(contexts, 0);
    assert_int_equal(configs, 0);
    for (int i = 0; i < plugged; i++) {
        assert_int_equal(bus[i].opened, bus[i].closed);
        assert_int_equal(bus[i].claimed, bus[i].released);
    }
}

static void a_device_without_bulk_endpoints_is_closed_before_the_next_is_opened(void **state) {
    (void)state;
    fathom_source *source;
    plugged = 2;
    bus[0].has_bulk = false;
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_OK);
    assert_int_equal(bus[0].opened, 1);
    assert_int_equal(bus[0].closed, 1);
    assert_int_equal(bus[1].claimed, 1);
    fathom_source_close(source);
    nothing_is_left_open();
}

static void a_device_whose_claim_fails_is_closed_before_the_next_is_opened(void **state) {
    (void)state;
    fathom_source *source;
    plugged = 3;
    bus[0].claim_error = LIBUSB_ERROR_BUSY;
    bus[1].claim_error = LIBUSB_ERROR_NO_DEVICE;
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_OK);
    assert_int_equal(bus[0].closed, 1);
    assert_int_equal(bus[1].closed, 1);
    assert_int_equal(bus[2].claimed, 1);
    fathom_source_close(source);
    nothing_is_left_open();
}

static void a_device_that_may_not_be_opened_is_passed_over(void **state) {
    (void)state;
    fathom_source *source;
    plugged = 2;
    bus[0].open_error = LIBUSB_ERROR_ACCESS;
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_OK);
    fathom_source_close(source);
    nothing_is_left_open();
}

static void a_failed_opening_leaves_nothing_open_and_says_why(void **state) {
    (void)state;
    fathom_source *source;
    plugged = 1;
    bus[0].has_bulk = false;
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_ERROR_PROTOCOL);
    assert_non_null(strstr(errors, "no interface with bulk endpoints"));
    nothing_is_left_open();
    fresh_bus(NULL);
    plugged = 1;
    bus[0].claim_error = LIBUSB_ERROR_BUSY;
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_ERROR_BUSY);
    assert_non_null(strstr(errors, "another program holds"));
    nothing_is_left_open();
    fresh_bus(NULL);
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_ERROR_NO_DEVICE);
    nothing_is_left_open();
}

static void a_serial_number_picks_the_device(void **state) {
    (void)state;
    fathom_source *source;
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    plugged = 3;
    bus[0].serial = "one";
    bus[1].serial = "two";
    assert_int_equal(open_usb(&source, "usb:2639:0300:two"), FATHOM_OK);
    assert_int_equal(bus[0].closed, 1);
    assert_int_equal(fathom_source_get_status(source, &status), FATHOM_OK);
    assert_string_equal(status.serial, "two");
    fathom_source_close(source);
    nothing_is_left_open();
}

static void samples_arrive_and_stopping_takes_the_transfers_back(void **state) {
    (void)state;
    fathom_source *source;
    fathom_imu_sample sample;
    plugged = 1;
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_OK);
    for (int round = 0; round < 2; round++) {
        assert_int_equal(fathom_source_start(source), FATHOM_OK);
        assert_int_equal(fathom_source_wait(source, 2000), FATHOM_OK);
        assert_int_equal(fathom_source_read_imu(source, &sample, 1), 1);
        assert_true(sample.gyro[1] == 2 && sample.accel[2] == 10);
        assert_int_equal(fathom_source_stop(source), FATHOM_OK);
        assert_int_equal(pendings, 0);
    }
    fathom_source_close(source);
    nothing_is_left_open();
}

static void a_device_that_goes_ends_the_source(void **state) {
    (void)state;
    fathom_source *source;
    fathom_imu_sample samples[64];
    int result;
    plugged = 1;
    next_transfer_status = LIBUSB_TRANSFER_NO_DEVICE;
    assert_int_equal(open_usb(&source, "usb:"), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    while ((result = fathom_source_wait(source, 2000)) == FATHOM_OK) fathom_source_read_imu(source, samples, 64);
    assert_int_equal(result, FATHOM_ERROR_UNPLUGGED);
    fathom_source_close(source);
    nothing_is_left_open();
}

static int bad_left(void) {
    pthread_mutex_lock(&lock);
    const int left = bad_transfers;
    pthread_mutex_unlock(&lock);
    return left;
}

/* So many failures in a row and the device counts as gone, one less and it goes on. */
static void the_last_of_many_failures_in_a_row_ends_the_source(void **state) {
    (void)state;
    static const enum libusb_transfer_status failures[] = {LIBUSB_TRANSFER_ERROR, LIBUSB_TRANSFER_OVERFLOW,
                                                           LIBUSB_TRANSFER_STALL};
    for (int kind = 0; kind < 3; kind++)
        for (int less = 0; less < 2; less++) {
            fathom_source *source;
            fathom_imu_sample samples[64];
            fresh_bus(NULL);
            plugged = 1;
            next_transfer_status = failures[kind];
            assert_int_equal(open_usb(&source, "usb:"), FATHOM_OK);
            for (int round = 0; round <= less; round++) { /* counted anew at each start: the first ends without a good one */
                after_bad = less && round == 0 ? LIBUSB_TRANSFER_TIMED_OUT : LIBUSB_TRANSFER_COMPLETED;
                bad_transfers = USB_MOST_ERRORS - less;
                assert_int_equal(fathom_source_start(source), FATHOM_OK);
                for (int i = 0; i < 2000 && bad_left() > 0; i++) usleep(1000);
                assert_int_equal(bad_left(), 0);
                if (round || !less)
                    assert_int_equal(fathom_source_wait(source, 2000), less ? FATHOM_OK : FATHOM_ERROR_UNPLUGGED);
                if (round) assert_true(fathom_source_read_imu(source, samples, 64) > 0);
                assert_int_equal(fathom_source_stop(source), FATHOM_OK);
            }
            fathom_source_close(source);
            nothing_is_left_open();
        }
}

/* The same of a device that must be asked: as many questions that can't be put. */
static void a_motor_that_cannot_be_asked_counts_as_gone(void **state) {
    (void)state;
    fathom_source *source;
    plugged = 1;
    bus[0].vendor = KINECT_VENDOR;
    bus[0].product = KINECT_MOTOR_PRODUCT;
    submit_error = LIBUSB_ERROR_IO;
    const fathom_source_options options = {.struct_size = sizeof options, .rate_hz = 1000, .log = keep_log};
    assert_int_equal(fathom_source_open(&source, "usb:", &options), FATHOM_OK);
    assert_int_equal(fathom_source_start(source), FATHOM_OK);
    assert_int_equal(fathom_source_wait(source, 5000), FATHOM_ERROR_UNPLUGGED);
    assert_int_equal(submitted, USB_MOST_ERRORS);
    fathom_source_close(source);
    nothing_is_left_open();
}

static void a_second_start_is_refused_and_the_source_goes_on(void **state) {
    (void)state;
    plugged = 1;
    check_source_contract("usb:", NULL);
    nothing_is_left_open();
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_device_without_bulk_endpoints_is_closed_before_the_next_is_opened, fresh_bus),
        cmocka_unit_test_setup(a_device_whose_claim_fails_is_closed_before_the_next_is_opened, fresh_bus),
        cmocka_unit_test_setup(a_device_that_may_not_be_opened_is_passed_over, fresh_bus),
        cmocka_unit_test_setup(a_failed_opening_leaves_nothing_open_and_says_why, fresh_bus),
        cmocka_unit_test_setup(a_serial_number_picks_the_device, fresh_bus),
        cmocka_unit_test_setup(samples_arrive_and_stopping_takes_the_transfers_back, fresh_bus),
        cmocka_unit_test_setup(a_device_that_goes_ends_the_source, fresh_bus),
        cmocka_unit_test_setup(the_last_of_many_failures_in_a_row_ends_the_source, fresh_bus),
        cmocka_unit_test_setup(a_motor_that_cannot_be_asked_counts_as_gone, fresh_bus),
        cmocka_unit_test_setup(a_second_start_is_refused_and_the_source_goes_on, fresh_bus),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
