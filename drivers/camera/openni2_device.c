#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "camera/openni2_internal.h"

/* ---- what went wrong ---- */

int openni2_open_fault(const char *uri, char *why, size_t size) {
    openni2_usb camera = {0};
    char words[256], fault[256];
    openni2_words(words, sizeof words);
    /* PS1080 and its kin: vendor/product@bus/address */
    if (sscanf(uri, "%x/%x@%d/%d", (unsigned *)&camera.vendor, (unsigned *)&camera.product, &camera.bus,
               &camera.address) == 4) {
        openni2_usb cameras[16];
        const int count = openni2_usb_list("", cameras, 16);
        for (int i = 0; i < count; i++)
            if (cameras[i].bus == camera.bus && cameras[i].address == camera.address) camera = cameras[i];
        const int error = openni2_usb_fault("", &camera, fault, sizeof fault);
        if (error) {
            snprintf(why, size, "%s", fault);
            return error;
        }
    }
    snprintf(why, size, "%s", words);
    return FATHOM_ERROR_DEVICE;
}

/* ---- modes ---- */

static double mode_cost(const OniVideoMode *mode, const openni2_wish *wish) {
    const double size =
        fabs((double)mode->resolutionX - wish->width) + fabs((double)mode->resolutionY - wish->height);
    const double rate = fabs(mode->fps - (wish->rate_hz > 0 ? wish->rate_hz : 30));
    return 1e6 * size + 10 * rate + (mode->pixelFormat != wish->format);
}

const OniVideoMode *openni2_choose_mode(const OniVideoMode *modes, int count, const openni2_wish *wish) {
    const OniVideoMode *best = NULL;
    for (int i = 0; i < count; i++) {
        const OniVideoMode *mode = &modes[i];
        if (mode->pixelFormat != ONI_PIXEL_FORMAT_DEPTH_1_MM &&
            mode->pixelFormat != ONI_PIXEL_FORMAT_DEPTH_100_UM)
            continue;
        if (mode->resolutionX < 8 || mode->resolutionY < 8 || mode->resolutionX > 16384 ||
            mode->resolutionY > 16384)
            continue;
        if (!best || mode_cost(mode, wish) < mode_cost(best, wish)) best = mode;
    }
    return best;
}

static bool get(OniStreamHandle stream, int property, void *value, int size) {
    int got = size;
    return oniStreamGetProperty(stream, property, value, &got) == ONI_STATUS_OK && got == size;
}

/* ---- streams ---- */

static int fail(char *why, size_t size, int error, const char *what) {
    char words[256];
    snprintf(why, size, "%s: %s", what, openni2_words(words, sizeof words));
    return error;
}

static int set_mode(openni2_device *d, const openni2_wish *wish, char *why, size_t size) {
    const OniSensorInfo *info = oniDeviceGetSensorInfo(d->device, ONI_SENSOR_DEPTH);
    const OniVideoMode *mode =
        info ? openni2_choose_mode(info->pSupportedVideoModes, info->numSupportedVideoModes, wish) : NULL;
    if (!mode) {
        snprintf(why, size, "it gives no depth in millimetres or tenths of them");
        return FATHOM_ERROR_UNSUPPORTED;
    }
    d->mode = *mode;
    if (oniStreamSetProperty(d->depth, ONI_STREAM_PROPERTY_VIDEO_MODE, &d->mode, sizeof d->mode) !=
        ONI_STATUS_OK)
        return fail(why, size, FATHOM_ERROR_DEVICE, "the video mode can't be set");
    return FATHOM_OK;
}

static void stop_mirroring(openni2_device *d) {
    OniBool mirrored = FALSE;
    oniStreamSetProperty(d->depth, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, sizeof mirrored);
    d->mirrored = get(d->depth, ONI_STREAM_PROPERTY_MIRRORING, &mirrored, sizeof mirrored) && mirrored;
}

static int read_view(openni2_device *d, char *why, size_t size) {
    const bool got = get(d->depth, ONI_STREAM_PROPERTY_HORIZONTAL_FOV, &d->fov[0], sizeof d->fov[0]) &&
                     get(d->depth, ONI_STREAM_PROPERTY_VERTICAL_FOV, &d->fov[1], sizeof d->fov[1]);
    if (got && d->fov[0] > 0.05f && d->fov[0] < 3.1f && d->fov[1] > 0.05f && d->fov[1] < 3.1f)
        return FATHOM_OK;
    snprintf(why, size, "it doesn't say its field of view");
    return FATHOM_ERROR_PROTOCOL;
}

/* Colour is used only when it can be registered to the depth. */
static void add_color(openni2_device *d) {
    const OniImageRegistrationMode mode = ONI_IMAGE_REGISTRATION_DEPTH_TO_COLOR;
    const OniVideoMode wanted = {.pixelFormat = ONI_PIXEL_FORMAT_RGB888,
                                 .resolutionX = d->mode.resolutionX,
                                 .resolutionY = d->mode.resolutionY,
                                 .fps = d->mode.fps};
    const OniBool straight = FALSE;
    if (!oniDeviceGetSensorInfo(d->device, ONI_SENSOR_COLOR)) return;
    if (!oniDeviceIsImageRegistrationModeSupported(d->device, mode) ||
        oniDeviceSetProperty(d->device, ONI_DEVICE_PROPERTY_IMAGE_REGISTRATION, &mode, sizeof mode) !=
            ONI_STATUS_OK)
        return;
    if (oniDeviceCreateStream(d->device, ONI_SENSOR_COLOR, &d->color) != ONI_STATUS_OK) {
        d->color = NULL;
        return;
    }
    OniVideoMode set = wanted;
    oniStreamSetProperty(d->color, ONI_STREAM_PROPERTY_VIDEO_MODE, &wanted, sizeof wanted);
    oniStreamSetProperty(d->color, ONI_STREAM_PROPERTY_MIRRORING, &straight, sizeof straight);
    oniDeviceEnableDepthColorSync(d->device);
    if (get(d->color, ONI_STREAM_PROPERTY_VIDEO_MODE, &set, sizeof set) &&
        set.pixelFormat == wanted.pixelFormat && set.resolutionX == wanted.resolutionX &&
        set.resolutionY == wanted.resolutionY)
        return;
    oniStreamDestroy(d->color);
    d->color = NULL;
}

/* ---- the device ---- */

void openni2_device_serial(OniDeviceHandle device, char *serial, size_t size) {
    char text[64] = "";
    int got = sizeof text - 1;
    *serial = 0;
    if (oniDeviceGetProperty(device, ONI_DEVICE_PROPERTY_SERIAL_NUMBER, text, &got) != ONI_STATUS_OK) return;
    text[sizeof text - 1] = 0;
    for (size_t i = 0; text[i]; i++)
        if ((unsigned char)text[i] <= ' ') text[i] = 0;
    snprintf(serial, size, "%s", text);
}

static int open_streams(openni2_device *d, const openni2_wish *wish, char *why, size_t size) {
    if (!oniDeviceGetSensorInfo(d->device, ONI_SENSOR_DEPTH)) {
        snprintf(why, size, "it has no depth");
        return FATHOM_ERROR_UNSUPPORTED;
    }
    if (oniDeviceCreateStream(d->device, ONI_SENSOR_DEPTH, &d->depth) != ONI_STATUS_OK) {
        d->depth = NULL;
        return fail(why, size, FATHOM_ERROR_DEVICE, "its depth can't be opened");
    }
    int result = set_mode(d, wish, why, size);
    if (!result) result = read_view(d, why, size);
    if (result) return result;
    stop_mirroring(d);
    if (wish->color) add_color(d);
    return FATHOM_OK;
}

int openni2_device_open(openni2_device *d, const openni2_wish *wish, char *why, size_t size) {
    int result;
    openni2_lock();
    d->depth = d->color = NULL;
    if (oniDeviceOpen(d->uri, &d->device) != ONI_STATUS_OK) {
        d->device = NULL;
        result = openni2_open_fault(d->uri, why, size);
    } else {
        openni2_device_serial(d->device, d->serial, sizeof d->serial);
        result = open_streams(d, wish, why, size);
    }
    openni2_unlock();
    if (result) openni2_device_close(d);
    return result;
}

void openni2_device_close(openni2_device *d) {
    openni2_lock();
    if (d->color) oniStreamDestroy(d->color);
    if (d->depth) oniStreamDestroy(d->depth);
    if (d->device) oniDeviceClose(d->device);
    d->device = NULL;
    d->depth = d->color = NULL;
    openni2_unlock();
}
