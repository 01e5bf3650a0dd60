/* The files of a recording that describe the rig: calibration.txt and rig.txt. */
#include "recording/recording_internal.h"
#include "recording/recording_text.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

const char *recording_intrinsics_fault(const fathom_pinhole *camera) {
    const double fx = camera->fx, fy = camera->fy, cx = camera->cx, cy = camera->cy;
    const int width = camera->width, height = camera->height;
    if (!isfinite(fx) || !isfinite(fy) || !isfinite(cx) || !isfinite(cy)) return "must be finite";
    if (fx <= 0 || fy <= 0) return "fx and fy must be above zero";
    /* Views wider than 157 degrees or narrower than 3 indicate other units (normalised, millimetres). */
    if (fx < 0.1 * width || fx > 20.0 * width || fy < 0.1 * height || fy > 20.0 * height)
        return "fx and fy don't suit the size of the frames; they are in pixels";
    if (cx <= 0 || cx >= width || cy <= 0 || cy >= height)
        return "cx and cy must lie inside the frame; the order is fx fy cx cy, in pixels";
    return NULL;
}

/* ---- calibration.txt ----------------------------------------------------------------------------------- */

static int read_calibration_line(struct recording *recording, const char *path, struct text_file *text) {
    fathom_recording *shown = &recording->shown;
    double v[12] = {0};
    int count = 0;
    bool numbers = true;
    while (count < 12 && numbers && !text_at_end(text)) numbers = text_number(text, &v[count++]);
    if (!numbers || !text_at_end(text) || (count != 4 && count != 8 && count != 9 && count != 12))
        return recording_fail(recording, FATHOM_ERROR_CONFIG,
                              "%s:%d: expected `fx fy cx cy [k1 k2 p1 p2 [k3 [k4 k5 k6]]]`", path,
                              text->number);
    fathom_pinhole camera = {.width = shown->camera.width, .height = shown->camera.height,
                             .fx = v[0], .fy = v[1], .cx = v[2], .cy = v[3]};
    const char *fault = recording_intrinsics_fault(&camera);
    if (fault)
        return recording_fail(recording, FATHOM_ERROR_CONFIG,
                              "%s:%d: intrinsics %g %g %g %g for %dx%d frames: %s", path, text->number, v[0],
                              v[1], v[2], v[3], camera.width, camera.height, fault);
    for (int i = 4; i < 12; i++) {
        if (!isfinite(v[i]))
            return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: distortion must be finite", path,
                                  text->number);
        camera.coefficients[i - 4] = v[i];
        if (v[i] != 0) camera.lens = i < 9 ? FATHOM_LENS_FIVE : FATHOM_LENS_RATIONAL;
    }
    shown->camera = camera;
    recording->has_calibration = true;
    return FATHOM_OK;
}

int recording_read_calibration(struct recording *recording) {
    struct text_file text;
    int result = FATHOM_OK;
    char *path = recording_path(recording, "calibration.txt");
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int missing = text_open(&text, path);
    if (missing && missing != ENOENT)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(missing));
    if (!missing) {
        if (text_next(&text))
            result = read_calibration_line(recording, path, &text);
        else
            result =
                recording_fail(recording, text.error ? FATHOM_ERROR_NO_DATA : FATHOM_ERROR_CONFIG, "%s: %s",
                               path, text.error ? strerror(text.error) : "no intrinsics in it");
    }
    text_close(&text);
    free(path);
    return result;
}

/* ---- rig.txt ------------------------------------------------------------------------------------------- */

/* Rodrigues' formula for a rotation vector in degrees. */
static void rotation_from_degrees(const double degrees[3], double r[9]) {
    const double to_radians = acos(-1.0) / 180;
    const double x = degrees[0] * to_radians, y = degrees[1] * to_radians, z = degrees[2] * to_radians;
    const double angle = sqrt(x * x + y * y + z * z);
    const double s = angle > 1e-12 ? sin(angle) / angle : 1;
    const double c = angle > 1e-12 ? (1 - cos(angle)) / (angle * angle) : 0.5;
    const double out[9] = {1 - c * (y * y + z * z), c * x * y - s * z,       c * x * z + s * y,
                           c * x * y + s * z,       1 - c * (x * x + z * z), c * y * z - s * x,
                           c * x * z - s * y,       c * y * z + s * x,       1 - c * (x * x + y * y)};
    memcpy(r, out, sizeof out);
}

/* The same as a unit quaternion x y z w. */
static void orientation_from_degrees(const double degrees[3], double q[4]) {
    const double to_radians = acos(-1.0) / 180;
    double angle = 0;
    for (int i = 0; i < 3; i++) angle += degrees[i] * degrees[i];
    angle = sqrt(angle) * to_radians;
    for (int i = 0; i < 3; i++) q[i] = angle > 1e-12 ? degrees[i] * to_radians / angle * sin(angle / 2) : 0;
    q[3] = cos(angle / 2);
}

enum rig_key {
    RIG_DEPTH_SCALE,
    RIG_IMU_ROTATION,
    RIG_IMU_TRANSLATION,
    RIG_IMU_OFFSET,
    RIG_GRAVITY,
    RIG_COLOR_INTRINSICS,
    RIG_COLOR_ROTATION,
    RIG_COLOR_TRANSLATION,
    RIG_DEPTH_NOISE,
    RIG_MIN_CONFIDENCE,
    RIG_KEYS
};

static const struct {
    const char *name;
    int values;
    double low, high; /* of each value */
} rig_keys[RIG_KEYS] = {
    [RIG_DEPTH_SCALE] = {"depth_scale", 1, 1, 1e6},
    [RIG_IMU_ROTATION] = {"imu_to_camera_rotation", 3, -360, 360},
    [RIG_IMU_TRANSLATION] = {"imu_to_camera_translation", 3, -10, 10},
    [RIG_IMU_OFFSET] = {"imu_clock_offset", 1, -9e9, 9e9},
    [RIG_GRAVITY] = {"gravity", 1, 0.1, 30},
    [RIG_COLOR_INTRINSICS] = {"color_intrinsics", 4, 0, 1e5},
    [RIG_COLOR_ROTATION] = {"color_to_depth_rotation", 3, -360, 360},
    [RIG_COLOR_TRANSLATION] = {"color_to_depth_translation", 3, -10, 10},
    [RIG_DEPTH_NOISE] = {"depth_noise", 3, 0, 1},
    [RIG_MIN_CONFIDENCE] = {"confidence_min", 1, 0, 255},
};

static void set_rig(struct recording *recording, enum rig_key key, const double v[4]) {
    fathom_recording *shown = &recording->shown;
    switch (key) {
    case RIG_DEPTH_SCALE:
        shown->depth_units_per_metre = v[0];
        recording->has_depth_scale = true;
        break;
    case RIG_IMU_ROTATION: rotation_from_degrees(v, shown->imu_to_camera_rotation); break;
    case RIG_IMU_TRANSLATION: memcpy(shown->imu_to_camera_translation, v, 3 * sizeof *v); break;
    case RIG_IMU_OFFSET: shown->imu_clock_offset_ns = llround(v[0] * 1e9); break;
    case RIG_GRAVITY: shown->gravity = v[0]; break;
    case RIG_COLOR_INTRINSICS:
        shown->color_camera = (fathom_pinhole){.fx = v[0], .fy = v[1], .cx = v[2], .cy = v[3]};
        shown->has_color_camera = true;
        break;
    case RIG_COLOR_ROTATION: orientation_from_degrees(v, shown->color_to_depth.orientation); break;
    case RIG_COLOR_TRANSLATION: memcpy(shown->color_to_depth.position, v, 3 * sizeof *v); break;
    case RIG_DEPTH_NOISE:
        memcpy(shown->depth_noise, v, 3 * sizeof *v);
        shown->has_depth_noise = v[0] + v[1] + v[2] > 0;
        break;
    case RIG_MIN_CONFIDENCE: shown->min_confidence = (int32_t)v[0]; break;
    case RIG_KEYS: break;
    }
}

static int read_rig_line(struct recording *recording, const char *path, struct text_file *text) {
    char *name = NULL;
    int key = 0;
    if (!text_word(text, &name)) return FATHOM_OK;
    while (key < RIG_KEYS && strcmp(rig_keys[key].name, name) != 0) key++;
    if (key == RIG_KEYS) {
        recording_say(recording, FATHOM_LOG_WARNING, "%s:%d: unknown key %s ignored", path, text->number,
                      name);
        return FATHOM_OK;
    }
    double v[4];
    for (int i = 0; i < rig_keys[key].values; i++)
        if (!text_number(text, &v[i]) || !(v[i] >= rig_keys[key].low && v[i] <= rig_keys[key].high))
            return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: %s takes %d number%s from %g to %g",
                                  path, text->number, name, rig_keys[key].values,
                                  rig_keys[key].values == 1 ? "" : "s", rig_keys[key].low,
                                  rig_keys[key].high);
    if (!text_at_end(text))
        return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: more than %d values for %s", path,
                              text->number, rig_keys[key].values, name);
    set_rig(recording, (enum rig_key)key, v);
    return FATHOM_OK;
}

int recording_read_rig(struct recording *recording) {
    struct text_file text;
    int result = FATHOM_OK;
    char *path = recording_path(recording, "rig.txt");
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int missing = text_open(&text, path);
    if (missing && missing != ENOENT)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(missing));
    while (!result && !missing && text_next(&text)) result = read_rig_line(recording, path, &text);
    if (!result && text.error)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(text.error));
    text_close(&text);
    free(path);
    return result;
}
