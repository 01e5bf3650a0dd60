/* Stamps are seconds since the phone's start; poses are ARKit's, camera to world with x right, y down, z forward;
 * samples are CoreMotion's raw ones. */
#include "recording/stray_scanner.h"
#include "recording/record_list.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define SURE 2 /* ARKit's confidences are 0, 1 and 2 */

static bool there(const struct recording *recording, const char *file) {
    char *path = recording_path(recording, file);
    const bool found = path && access(path, F_OK) == 0;
    free(path);
    return found;
}

bool stray_scanner_is(const struct recording *recording) {
    return !there(recording, "depth.txt") && there(recording, "camera_matrix.csv") &&
           there(recording, "odometry.csv");
}

/* ---- odometry.csv: timestamp, frame, x, y, z, qx, qy, qz, qw; later versions append more ---- */

static bool row_of(struct text_file *text, int64_t *stamp, double v[8], struct record_faults *faults) {
    bool good = text_stamp(text, stamp);
    for (int i = 0; i < 8 && good; i++) good = text_number(text, &v[i]) && isfinite(v[i]);
    if (good && v[0] >= 0 && v[0] < 1e9) return true;
    record_fault(faults, &faults->unreadable, text->number);
    return false;
}

static bool take_frame(struct text_file *text, struct record_list *list, struct record_faults *faults) {
    int64_t stamp;
    double v[8];
    void *item;
    char file[32];
    if (!row_of(text, &stamp, v, faults)) return true;
    if (record_list_order(list, stamp) == ORDER_REPLACE)
        free((char *)((fathom_recording_frame *)list->items)[list->count - 1].file);
    if (!record_place(list, stamp, faults, text->number, &item)) return false;
    if (!item) return true;
    snprintf(file, sizeof file, "depth/%06d.png", (int)v[0]);
    *(fathom_recording_frame *)item = (fathom_recording_frame){stamp, strdup(file), text->number};
    return ((fathom_recording_frame *)item)->file != NULL;
}

static bool take_pose(struct text_file *text, struct record_list *list, struct record_faults *faults) {
    int64_t stamp;
    double v[8];
    return !row_of(text, &stamp, v, faults) || record_pose(list, stamp, v + 1, v + 4, faults, text->number);
}

/* Gravity's reaction is negative in CoreMotion's raw samples: they point along gravity. */
static bool take_sample(struct text_file *text, struct record_list *list, struct record_faults *faults) {
    int64_t stamp;
    double v[6];
    void *item;
    if (!record_numbers(text, &stamp, v, 6, faults)) return true;
    if (!record_place(list, stamp, faults, text->number, &item)) return false;
    if (item)
        *(fathom_imu_sample *)item = (fathom_imu_sample){
            stamp, {(float)v[3], (float)v[4], (float)v[5]}, {(float)-v[0], (float)-v[1], (float)-v[2]}};
    return true;
}

static int read_rows(struct recording *recording, const char *file, bool may_be_missing,
                     struct record_list *list,
                     bool (*take)(struct text_file *, struct record_list *, struct record_faults *)) {
    char *path = recording_path(recording, file);
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int result = record_list_read(recording, path, may_be_missing, ',', list, take);
    free(path);
    return result;
}

int stray_scanner_read_frames(struct recording *recording) {
    struct record_list list = {.item_size = sizeof(fathom_recording_frame)};
    const int result = read_rows(recording, "odometry.csv", false, &list, take_frame);
    recording->frames = list.items;
    recording->shown.frames = list.items;
    recording->shown.frame_count = list.count;
    if (result || list.count > 0) return result;
    return recording_fail(recording, FATHOM_ERROR_CONFIG, "%s/odometry.csv: no frames in it",
                          recording->folder);
}

int stray_scanner_read_poses(struct recording *recording) {
    struct record_list list = {.item_size = sizeof(fathom_recording_pose)};
    const int result = read_rows(recording, "odometry.csv", false, &list, take_pose);
    recording->poses = list.items;
    recording->shown.poses = list.items;
    recording->shown.pose_count = list.count;
    return result;
}

int stray_scanner_read_imu(struct recording *recording) {
    struct record_list list = {.item_size = sizeof(fathom_imu_sample)};
    const int result = read_rows(recording, "imu.csv", true, &list, take_sample);
    recording->imu = list.items;
    recording->shown.imu = list.items;
    recording->shown.imu_count = list.count;
    return result;
}

/* ---- camera_matrix.csv: the colour camera's, three rows ---- */

/* The phone's colour video is one of these wide, and its principal point about the middle. */
static double color_width(double cx) {
    static const double widths[] = {640, 1280, 1440, 1920, 3840};
    double best = widths[0];
    for (size_t i = 1; i < sizeof widths / sizeof *widths; i++)
        if (fabs(widths[i] - 2 * cx) < fabs(best - 2 * cx)) best = widths[i];
    return best;
}

static bool read_matrix(struct text_file *text, double k[9]) {
    for (int i = 0; i < 9; i++) {
        if (i % 3 == 0) {
            if (!text_next(text)) return false;
            for (char *c = text->at; *c; c++)
                if (*c == ',') *c = ' ';
        }
        if (!text_number(text, &k[i])) return false;
    }
    return true;
}

/* Depth is registered to the colour camera, at a fraction of its size. */
static int scale_camera(struct recording *recording, const char *path, const double k[9]) {
    fathom_pinhole *camera = &recording->shown.camera;
    const double scale = camera->width / color_width(k[2]);
    camera->fx = k[0] * scale;
    camera->fy = k[4] * scale;
    camera->cx = (k[2] + 0.5) * scale - 0.5;
    camera->cy = (k[5] + 0.5) * scale - 0.5;
    const char *fault = recording_intrinsics_fault(camera);
    return fault ? recording_fail(recording, FATHOM_ERROR_CONFIG, "%s: for depth of %dx%d: %s", path,
                                  camera->width, camera->height, fault)
                 : FATHOM_OK;
}

int stray_scanner_read_camera(struct recording *recording) {
    /* v_camera = (-y, -x, -z) of the phone's axes */
    static const double mounting[9] = {0, -1, 0, -1, 0, 0, 0, 0, -1};
    struct text_file text;
    double k[9];
    int result = FATHOM_OK;
    char *path = recording_path(recording, "camera_matrix.csv");
    if (!path) return recording_fail(recording, FATHOM_ERROR_MEMORY, "%s: out of memory", recording->folder);
    const int missing = text_open(&text, path);
    if (missing)
        result = recording_fail(recording, FATHOM_ERROR_NO_DATA, "%s: %s", path, strerror(missing));
    else if (!read_matrix(&text, k))
        result = recording_fail(recording, FATHOM_ERROR_CONFIG, "%s:%d: expected three rows of three numbers",
                                path, text.number);
    else
        result = scale_camera(recording, path, k);
    text_close(&text);
    free(path);
    memcpy(recording->shown.imu_to_camera_rotation, mounting, sizeof mounting);
    recording->shown.depth_units_per_metre = 1000;
    recording->shown.min_confidence = SURE;
    recording->has_calibration = recording->has_depth_scale = true;
    return result;
}
