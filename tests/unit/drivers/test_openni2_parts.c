/* Parts of the OpenNI2 driver that need no camera: modes, frames, what the USB tells, compressed depth. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "camera/openni2_internal.h"
#include "camera/openni2_oni.h"

static char folder[256];

static int make_folder(void **state) {
    (void)state;
    snprintf(folder, sizeof folder, "%s/fathom-openni2-XXXXXX", getenv("TMPDIR") ? getenv("TMPDIR") : "/tmp");
    return mkdtemp(folder) ? 0 : -1;
}

static int remove_folder(void **state) {
    (void)state;
    char command[300];
    snprintf(command, sizeof command, "rm -rf '%s'", folder);
    return system(command);
}

static void the_nearest_mode_is_chosen(void **state) {
    (void)state;
    const OniVideoMode modes[] = {
        {ONI_PIXEL_FORMAT_SHIFT_9_2, 640, 480, 30},  {ONI_PIXEL_FORMAT_DEPTH_1_MM, 320, 240, 30},
        {ONI_PIXEL_FORMAT_DEPTH_1_MM, 320, 240, 60}, {ONI_PIXEL_FORMAT_DEPTH_100_UM, 640, 480, 30},
        {ONI_PIXEL_FORMAT_DEPTH_1_MM, 640, 480, 30}, {ONI_PIXEL_FORMAT_DEPTH_1_MM, 640, 480, 5},
        {ONI_PIXEL_FORMAT_DEPTH_1_MM, 0, -4, 30}};
    const openni2_wish usual = {640, 480, 0, ONI_PIXEL_FORMAT_DEPTH_1_MM, false};
    const openni2_wish small = {300, 200, 60, ONI_PIXEL_FORMAT_DEPTH_1_MM, false};
    const openni2_wish fine = {640, 480, 30, ONI_PIXEL_FORMAT_DEPTH_100_UM, false};
    assert_ptr_equal(openni2_choose_mode(modes, 7, &usual), &modes[4]);
    assert_ptr_equal(openni2_choose_mode(modes, 7, &small), &modes[2]);
    assert_ptr_equal(openni2_choose_mode(modes, 7, &fine), &modes[3]);
    assert_null(openni2_choose_mode(modes, 1, &usual));
    assert_null(openni2_choose_mode(modes, 0, &usual));
}

static void run(const char *format, ...) {
    char command[2048];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(command, sizeof command, format, arguments);
    va_end(arguments);
    assert_int_equal(system(command), 0);
}

static int open_descriptors(void) {
    int count = 0;
    for (int i = 0; i < 256; i++) count += fcntl(i, F_GETFD) >= 0;
    return count;
}

/* A made-up sysfs with a Kinect: what keeps it from being opened is told. */
static void what_is_on_the_usb_is_explained(void **state) {
    (void)state;
    char why[256];
    openni2_usb cameras[4];
    run("cd '%s' && mkdir -p root/sys/bus/usb/devices/1-2 root/sys/bus/usb/devices/1-3 "
        "root/sys/bus/usb/devices/1-2:1.0 "
        "root/dev/bus/usb/001 root/drivers/gspca_kinect root/drivers/usbfs && cd root/sys/bus/usb/devices && "
        "echo 045e >1-2/idVendor && echo 02ae >1-2/idProduct && echo 1 >1-2/busnum && echo 7 >1-2/devnum && "
        "echo dead >1-3/idVendor && echo beef >1-3/idProduct",
        folder);
    char here[512];
    snprintf(here, sizeof here, "%s/root", folder);
    assert_int_equal(openni2_usb_list("/no/such/root", cameras, 4), 0);
    const int open_before = open_descriptors();
    assert_int_equal(openni2_usb_list(here, cameras, 4), 1);
    assert_int_equal(openni2_usb_list(here, cameras, 0), 0);
    assert_int_equal(open_descriptors(), open_before);
    assert_string_equal(cameras[0].name, "Kinect for Xbox 360");
    assert_non_null(strstr(cameras[0].plugin, "libfreenect"));
    assert_int_equal(openni2_usb_fault(here, &cameras[0], why, sizeof why), FATHOM_ERROR_NO_DEVICE);
    run("touch '%s/dev/bus/usb/001/007'", here);
    assert_int_equal(openni2_usb_fault(here, &cameras[0], why, sizeof why), FATHOM_OK);
    run("cd '%s' && ln -s ../../../../../drivers/gspca_kinect sys/bus/usb/devices/1-2:1.0/driver", here);
    assert_int_equal(openni2_usb_fault(here, &cameras[0], why, sizeof why), FATHOM_ERROR_BUSY);
    assert_non_null(strstr(why, "modprobe -r gspca_kinect"));
    run("cd '%s' && ln -sfn ../../../../../drivers/usbfs sys/bus/usb/devices/1-2:1.0/driver", here);
    assert_int_equal(openni2_usb_fault(here, &cameras[0], why, sizeof why), FATHOM_ERROR_BUSY);
    assert_non_null(strstr(why, "another program"));
    if (geteuid() == 0) return; /* root may open everything */
    run("chmod 400 '%s/dev/bus/usb/001/007'", here);
    assert_int_equal(openni2_usb_fault(here, &cameras[0], why, sizeof why), FATHOM_ERROR_PERMISSION);
    assert_non_null(strstr(why, "60-fathom-depth.rules"));
}

/* The compressed form by hand: a value, changes, repeats, a great change, a whole value. */
static void compressed_depth(void **state) {
    (void)state;
    static const uint8_t plain[] = {0x10, 0x27, 0x5f, 0xe2, 0xff, 0x80, 0xff, 0x12, 0x34};
    static const uint8_t table[] = {3, 0, 10, 0, 20, 0, 30, 0, 1, 0, 0x57};
    uint16_t depth[8];
    /* 10000, +1, (none), 2 * 2 repeats, +64, 0x1234 */
    assert_true(oni_decode(plain, sizeof plain, false, depth, 8));
    assert_int_equal(depth[0], 10000);
    assert_int_equal(depth[1], 10001);
    assert_int_equal(depth[5], 10001);
    assert_int_equal(depth[6], 10065);
    assert_int_equal(depth[7], 0x1234);
    assert_false(oni_decode(plain, sizeof plain, false, depth, 7));
    assert_false(oni_decode(plain, sizeof plain, false, depth, 9));
    for (size_t cut = 0; cut < sizeof plain; cut++) assert_false(oni_decode(plain, cut, false, depth, 8));
    /* the second, the third, the second */
    assert_true(oni_decode(table, sizeof table, true, depth, 3));
    assert_int_equal(depth[0], 20);
    assert_int_equal(depth[1], 30);
    assert_int_equal(depth[2], 20);
    static const uint8_t beyond[] = {1, 0, 10, 0, 0, 0, 0x5f};
    assert_false(oni_decode(beyond, sizeof beyond, true, depth, 2));
    assert_false(oni_decode(table, 4, true, depth, 3));
}

/* Rows longer than the picture, and a mirrored one. */
static void frames_are_copied_row_by_row(void **state) {
    (void)state;
    uint16_t data[2 * 12], depth[2 * 8];
    const OniVideoMode mode = {ONI_PIXEL_FORMAT_DEPTH_1_MM, 8, 2, 30};
    OniFrame frame = {
        .data = data, .width = 8, .height = 2, .stride = 24, .dataSize = 24 + 16, .videoMode = mode};
    char why[128];
    for (int i = 0; i < 24; i++) data[i] = (uint16_t)i;
    assert_true(openni2_frame_is_good(&frame, &mode, why, sizeof why));
    openni2_copy_depth(&frame, false, depth);
    for (int i = 0; i < 16; i++) assert_int_equal(depth[i], 12 * (i / 8) + i % 8);
    openni2_copy_depth(&frame, true, depth);
    for (int i = 0; i < 16; i++) assert_int_equal(depth[i], 12 * (i / 8) + 7 - i % 8);
    frame.dataSize--;
    assert_false(openni2_frame_is_good(&frame, &mode, why, sizeof why));
    frame.dataSize = 1000000;
    frame.stride = 14;
    assert_false(openni2_frame_is_good(&frame, &mode, why, sizeof why));
    frame.stride = 16;
    frame.timestamp = UINT64_MAX;
    assert_false(openni2_frame_is_good(&frame, &mode, why, sizeof why));
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_nearest_mode_is_chosen),
        cmocka_unit_test(what_is_on_the_usb_is_explained),
        cmocka_unit_test(compressed_depth),
        cmocka_unit_test(frames_are_copied_row_by_row),
    };
    return cmocka_run_group_tests_name("openni2_parts", tests, make_folder, remove_folder);
}
