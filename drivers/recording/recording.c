/* Recording folders in the TUM RGB-D / ETH3D SLAM layout: opening, settings, frames. */
#include "caller_config.h"
#include "recording/recording_internal.h"
#include "recording/image_file.h"
#include "recording/stray_scanner.h"

#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

/* The default of TUM RGB-D's tools for folders without intrinsics (its "file formats" page), at 640x480. */
static const double tum_intrinsics[4] = {525, 525, 319.5, 239.5};
static const double tum_depth_units = 5000;

static int find_size(struct recording *recording) {
    char error[512];
    char *path = recording_path(recording, recording->frames[0].file);
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    fathom_pinhole *camera = &recording->shown.camera;
    const int failed = image_read_size(path, &camera->width, &camera->height, error, sizeof error);
    free(path);
    return failed ? recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s", error) : FATHOM_OK;
}

/* The options' intrinsics, else the file's (already set), else TUM's. A principal point at the middle of the pixels of
 * one size lies at the middle of the other's: cx + 0.5 scales. */
static int settle_intrinsics(struct recording *recording, const fathom_recording_options *options) {
    fathom_recording *shown = &recording->shown;
    const int width = shown->camera.width, height = shown->camera.height;
    if (options->camera.fx != 0) {
        fathom_pinhole given = options->camera;
        given.width = width;
        given.height = height;
        const char *fault = recording_intrinsics_fault(&given);
        if (fault)
            return recording_fail(recording, FATHOM_ERROR_ARGUMENT,
                                  "intrinsics %g,%g,%g,%g for %dx%d frames: %s", given.fx, given.fy, given.cx,
                                  given.cy, width, height, fault);
        shown->camera = given;
    } else if (!recording->has_calibration) {
        const double x = width / 640.0, y = height / 480.0;
        shown->camera.fx = tum_intrinsics[0] * x;
        shown->camera.fy = tum_intrinsics[1] * y;
        shown->camera.cx = (tum_intrinsics[2] + 0.5) * x - 0.5;
        shown->camera.cy = (tum_intrinsics[3] + 0.5) * y - 0.5;
        shown->intrinsics_assumed = true;
    }
    return FATHOM_OK;
}

static int settle_depth_scale(struct recording *recording, const fathom_recording_options *options) {
    fathom_recording *shown = &recording->shown;
    if (options->depth_units_per_metre != 0) {
        if (!(options->depth_units_per_metre >= 1 && options->depth_units_per_metre <= 1e6))
            return recording_fail(recording, FATHOM_ERROR_ARGUMENT,
                                  "depth scale %g isn't within 1 to 1e+06 units a metre",
                                  options->depth_units_per_metre);
        shown->depth_units_per_metre = options->depth_units_per_metre;
    } else if (!recording->has_depth_scale) {
        shown->depth_units_per_metre = tum_depth_units;
        shown->depth_units_assumed = true;
        return recording_judge_depth_scale(recording);
    }
    return FATHOM_OK;
}

static int read_all(struct recording *recording, const void *user) {
    const fathom_recording_options *options = user;
    const bool stray = stray_scanner_is(recording);
    int result = stray ? stray_scanner_read_frames(recording) : recording_read_frames(recording);
    if (!result) result = find_size(recording);
    if (!result) result = stray ? stray_scanner_read_camera(recording) : recording_read_calibration(recording);
    if (!result) result = recording_read_rig(recording);
    if (!result)
        result = stray ? recording_pair_confidence(recording, "confidence") : recording_read_confidence_list(recording);
    if (!result) result = settle_intrinsics(recording, options);
    if (!result) result = settle_depth_scale(recording, options);
    if (!result) result = stray ? stray_scanner_read_poses(recording) : recording_read_poses(recording);
    const bool no_imu = options->imu_file && !*options->imu_file;
    if (!result && !no_imu)
        result = stray && !options->imu_file ? stray_scanner_read_imu(recording)
                                             : recording_read_imu(recording, options->imu_file);
    return result;
}

/* Runs read(recording, user) on an empty recording of that folder. The files have decimal points whatever the
 * caller's locale has. */
static int with_folder(struct recording **out, const char *folder, fathom_log log, void *log_user,
                       int (*read)(struct recording *, const void *), const void *user) {
    static const double identity[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    *out = NULL;
    struct recording *recording = calloc(1, sizeof *recording);
    if (recording) recording->folder = strdup(folder);
    if (!recording || !recording->folder) {
        free(recording);
        return FATHOM_ERROR_MEMORY;
    }
    recording->shown.struct_size = sizeof recording->shown;
    recording->shown.folder = recording->folder;
    recording->log = log;
    recording->log_user = log_user;
    memcpy(recording->shown.imu_to_camera_rotation, identity, sizeof identity);
    recording->shown.color_to_depth.orientation[3] = 1;

    const locale_t plain = newlocale(LC_NUMERIC_MASK, "C", (locale_t)0);
    const locale_t before = plain ? uselocale(plain) : (locale_t)0;
    const int result = plain ? read(recording, user)
                             : recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", folder);
    if (plain) {
        uselocale(before);
        freelocale(plain);
    }
    if (result)
        fathom_recording_close(&recording->shown);
    else
        *out = recording;
    return result;
}

int fathom_recording_open(fathom_recording **out, const char *folder,
                          const fathom_recording_options *options) {
    fathom_recording_options whole = FATHOM_STRUCT(fathom_recording_options);
    struct recording *recording;
    if (out) *out = NULL;
    if (!out || !folder || (options && !sized_in(&whole, sizeof whole, options)))
        return FATHOM_ERROR_ARGUMENT;
    const int result = with_folder(&recording, folder, whole.log, whole.log_user, read_all, &whole);
    *out = result ? NULL : &recording->shown;
    return result;
}

static void configure(const fathom_recording *recording, fathom_config *config) {
    config->depth_camera = recording->camera;
    config->depth_units_per_metre = (float)recording->depth_units_per_metre;
    for (int i = 0; i < 9; i++)
        config->imu_to_camera_rotation[i] = (float)recording->imu_to_camera_rotation[i];
    for (int i = 0; i < 3; i++)
        config->imu_to_camera_translation[i] = (float)recording->imu_to_camera_translation[i];
    config->imu_clock_offset_ns = recording->imu_clock_offset_ns;
    if (recording->gravity > 0) config->gravity_m_s2 = (float)recording->gravity;
    if (recording->min_confidence > 0) config->min_confidence = recording->min_confidence;
    if (recording->has_depth_noise) {
        config->depth_noise_base_m = (float)fmax(recording->depth_noise[0], 1e-6);
        config->depth_noise_slope = (float)recording->depth_noise[1];
        config->depth_noise_growth_per_m = (float)recording->depth_noise[2];
        config->refine_depth_noise = false;
    }
}

/* ---- a folder that only describes a rig ---- */

static int read_description(struct recording *recording, const void *user) {
    const fathom_config *config = user;
    fathom_recording *shown = &recording->shown;
    shown->camera = config->depth_camera;
    char *rig = recording_path(recording, "rig.txt");
    const bool there = rig && access(rig, F_OK) == 0;
    free(rig);
    int result = recording_read_calibration(recording);
    if (!result && !there && !recording->has_calibration)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA,
                                "%s: there is neither rig.txt nor calibration.txt", recording->folder);
    if (!result) result = recording_read_rig(recording);
    shown->depth_units_per_metre = config->depth_units_per_metre;
    return result;
}

int fathom_rig_configure(const char *folder, fathom_config *config, fathom_log log, void *log_user) {
    struct recording *recording;
    fathom_config whole;
    const size_t common = caller_config_take(&whole, config);
    if (!folder || !common) return FATHOM_ERROR_ARGUMENT;
    const int result = with_folder(&recording, folder, log, log_user, read_description, &whole);
    if (result) return result;
    configure(&recording->shown, &whole);
    caller_config_give(config, common, &whole);
    fathom_recording_close(&recording->shown);
    return FATHOM_OK;
}

void fathom_recording_close(fathom_recording *shown) {
    struct recording *recording = (struct recording *)shown;
    if (!recording) return;
    for (int i = 0; i < shown->frame_count; i++) free((char *)recording->frames[i].file);
    for (int i = 0; recording->confidence && i < shown->frame_count; i++) free(recording->confidence[i]);
    free(recording->confidence);
    free(recording->frames);
    free(recording->imu);
    free(recording->poses);
    free(recording->folder);
    free(recording);
}

int fathom_recording_configure(const fathom_recording *recording, fathom_config *config) {
    fathom_config whole;
    const size_t common = caller_config_take(&whole, config);
    if (!recording || !common) return FATHOM_ERROR_ARGUMENT;
    configure(recording, &whole);
    caller_config_give(config, common, &whole);
    return FATHOM_OK;
}

int fathom_recording_read_depth(const fathom_recording *shown, int index, uint16_t *pixels) {
    const struct recording *recording = (const struct recording *)shown;
    char error[512];
    int width = 0, height = 0, result = FATHOM_OK;
    if (!shown || !pixels || index < 0 || index >= shown->frame_count) return FATHOM_ERROR_ARGUMENT;
    char *path = recording_path(recording, shown->frames[index].file);
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", shown->folder);
    const fathom_pinhole *camera = &shown->camera;
    const size_t capacity = (size_t)camera->width * (size_t)camera->height;
    const int failed = image_read_gray16(path, pixels, capacity, &width, &height, error, sizeof error);
    /* A larger frame fails for lack of room; its header then gives a better reason. */
    if (failed) {
        char ignored[64];
        if (image_read_size(path, &width, &height, ignored, sizeof ignored)) width = height = 0;
    }
    if (width && (width != camera->width || height != camera->height))
        result =
            recording_fail(recording, FATHOM_ERROR_SIZE, "%s: %dx%d, where the recording's frames are %dx%d",
                           path, width, height, camera->width, camera->height);
    else if (failed)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s", error);
    free(path);
    return result;
}
