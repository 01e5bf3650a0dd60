/* Depth cameras on the USB, by sysfs: which are plugged in, and why they can't be opened. */
#include <dirent.h>
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "camera/openni2_internal.h"

#define PS1080 "OpenNI2's PS1080 driver (Debian: libopenni2-0)"
#define PSLINK "OpenNI2's PSLink driver (Debian: libopenni2-0)"
#define FREENECT                                                                                             \
    "libfreenect's OpenNI2 driver: put its libFreenectDriver.so into the folder OpenNI2/Drivers "            \
    "(docs/DRIVERS.md)"
#define ORBBEC "the OpenNI2 driver of Orbbec's SDK: put its liborbbec.so into the folder OpenNI2/Drivers"
#define STRUCTURE "the OpenNI2 driver of Occipital's SDK, or PS1080 for the first Structure Sensor"
#define KINECT2                                                                                              \
    "libfreenect2's OpenNI2 driver: put its libfreenect2-openni2.so into the folder OpenNI2/Drivers"

static const struct {
    int vendor, product; /* product -1: any */
    const char *name, *plugin;
} cameras_known[] = {
    {0x1d27, 0x0609, "PrimeSense Carmine 1.09", PS1080},
    {0x1d27, 0x1280, "PrimeSense Capri", PSLINK},
    {0x1d27, -1, "PrimeSense or Asus Xtion", PS1080},
    {0x2bc5, -1, "Orbbec", ORBBEC},
    {0x2959, -1, "Occipital Structure", STRUCTURE},
    {0x045e, 0x02ae, "Kinect for Xbox 360", FREENECT},
    {0x045e, 0x02bf, "Kinect for Windows", FREENECT},
    {0x045e, 0x02c4, "Kinect 2", KINECT2},
    {0x045e, 0x02d8, "Kinect 2", KINECT2},
};

/* One number of a device in sysfs; -1: missing. */
static int read_number(const char *root, const char *path, const char *name, const char *format) {
    char file[512];
    int number = -1;
    snprintf(file, sizeof file, "%s%s/%s", root, path, name);
    FILE *in = fopen(file, "r");
    if (!in) return -1;
    if (fscanf(in, format, &number) != 1) number = -1;
    fclose(in);
    return number;
}

static void name_camera(openni2_usb *camera) {
    camera->name = camera->plugin = NULL;
    for (size_t i = 0; i < sizeof cameras_known / sizeof *cameras_known && !camera->name; i++) {
        if (camera->vendor != cameras_known[i].vendor) continue;
        if (cameras_known[i].product >= 0 && camera->product != cameras_known[i].product) continue;
        camera->name = cameras_known[i].name;
        camera->plugin = cameras_known[i].plugin;
    }
}

int openni2_usb_list(const char *root, openni2_usb *cameras, int most) {
    static const char devices[] = "/sys/bus/usb/devices";
    char path[512];
    int count = 0;
    snprintf(path, sizeof path, "%s%s", root, devices);
    DIR *folder = opendir(path);
    if (!folder) return 0;
    for (struct dirent *entry; count < most && (entry = readdir(folder));) {
        openni2_usb *camera = &cameras[count];
        if (*entry->d_name == '.' || strlen(entry->d_name) > 32) continue;
        snprintf(camera->path, sizeof camera->path, "%s/%.32s", devices, entry->d_name);
        camera->vendor = read_number(root, camera->path, "idVendor", "%x");
        camera->product = read_number(root, camera->path, "idProduct", "%x");
        camera->bus = read_number(root, camera->path, "busnum", "%d");
        camera->address = read_number(root, camera->path, "devnum", "%d");
        name_camera(camera);
        count += camera->name != NULL;
    }
    closedir(folder);
    return count;
}

/* The kernel driver at the camera's first interface ("usbfs": a program has claimed it); false: none. */
static bool interface_driver(const char *root, const openni2_usb *camera, char *driver, size_t size) {
    char link[512], target[512];
    const char *name = strrchr(camera->path, '/');
    snprintf(link, sizeof link, "%s%s%s:1.0/driver", root, camera->path, name);
    ssize_t length = readlink(link, target, sizeof target - 1);
    if (length < 0) { /* interfaces stand beside the device as well */
        snprintf(link, sizeof link, "%s%s:1.0/driver", root, camera->path);
        length = readlink(link, target, sizeof target - 1);
    }
    if (length < 0) return false;
    target[length] = 0;
    const char *slash = strrchr(target, '/');
    snprintf(driver, size, "%.60s", slash ? slash + 1 : target);
    return true;
}

int openni2_usb_fault(const char *root, const openni2_usb *camera, char *why, size_t size) {
    char node[512], driver[64];
    snprintf(node, sizeof node, "%s/dev/bus/usb/%03d/%03d", root, camera->bus, camera->address);
    if (access(node, R_OK | W_OK)) {
        if (errno == ENOENT) {
            snprintf(why, size, "%s isn't there", node);
            return FATHOM_ERROR_NO_DEVICE;
        }
        snprintf(
            why, size,
            "%s: %s; the udev rule 60-fathom-depth.rules gives access (make install, then plug the camera in "
            "again)",
            node, strerror(errno));
        return FATHOM_ERROR_PERMISSION;
    }
    if (!interface_driver(root, camera, driver, sizeof driver)) return FATHOM_OK;
    if (strcmp(driver, "usbfs") == 0)
        snprintf(why, size, "another program holds the camera");
    else
        snprintf(why, size, "the kernel's %s holds the camera; as root: modprobe -r %s", driver, driver);
    return FATHOM_ERROR_BUSY;
}
