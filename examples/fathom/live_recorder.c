#include "fathom/live_recorder.h"
#include "fathom/shell/cli.h"
#include "recording/image_file.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <sys/stat.h>

#define PATH_ROOM 4096
#define HEADER_LINES 2

static bool fail(struct live_recorder *r, const char *what) {
    if (!*r->error) snprintf(r->error, sizeof r->error, "%s", what);
    return false;
}

static bool fail_file(struct live_recorder *r, const struct line_file *file, const char *name) {
    char what[sizeof r->error];
    snprintf(what, sizeof what, "%.900s/%s: %s", r->folder.folder, name, strerror(file->error));
    return fail(r, what);
}

/* To the nanosecond, padded so that names sort by time. */
static const char *stamp_text(char text[32], int64_t ns, int digits) {
    const uint64_t size = ns < 0 ? 0 - (uint64_t)ns : (uint64_t)ns;
    snprintf(text, 32, "%s%0*" PRIu64 ".%09" PRIu64, ns < 0 ? "-" : "", digits, size / 1000000000,
             size % 1000000000);
    return text;
}

/* ---- opening ---- */

static bool open_lines(struct live_recorder *r, struct line_file *file, const char *name, const char *header,
                       const char *columns) {
    char path[PATH_ROOM];
    if (snprintf(path, sizeof path, "%s/%s", r->folder.folder, name) >= PATH_ROOM)
        return fail(r, "the folder's path is too long");
    if (!line_file_open(file, path) || !line_file_add(file, "# %s\n", header) ||
        !line_file_add(file, "# %s\n", columns) || !line_file_flush(file))
        return fail_file(r, file, name);
    return true;
}

/* The five coefficients only where there is distortion. */
static bool write_calibration(struct live_recorder *r, const fathom_config *config) {
    const fathom_pinhole *c = &config->depth_camera;
    if (c->lens == FATHOM_LENS_RATIONAL) {
        cli_error(CLI_FAILED, "%s: calibration.txt has room for five coefficients of distortion, not for eight",
                  r->folder.folder);
        return false;
    }
    double values[9] = {c->fx, c->fy, c->cx, c->cy};
    memcpy(values + 4, c->coefficients, 5 * sizeof *values);
    return !recording_calibration(&r->folder, values, c->lens == FATHOM_LENS_FIVE ? 9 : 4);
}

bool live_recorder_open(struct live_recorder *r, const char *folder, bool force, const fathom_config *config,
                        const char *mounting, const char *header) {
    *r = (struct live_recorder){0};
    if (recording_prepare(&r->folder, folder, force) || !write_calibration(r, config) ||
        recording_rig(&r->folder, mounting, config->depth_units_per_metre))
        return fail(r, r->folder.error);
    if (config->imu && !open_lines(r, &r->imu, "imu.txt", header, "t[s] gx gy gz [rad/s] ax ay az [m/s^2]"))
        return false;
    return open_lines(r, &r->depth, "depth.txt", header, "t[s] file");
}

/* ---- frames and samples ---- */

bool live_recorder_frame(struct live_recorder *r, const fathom_depth_frame *frame) {
    char stamp[32], name[48], path[PATH_ROOM], why[1024];
    struct stat is;
    snprintf(name, sizeof name, "depth/%s.png", stamp_text(stamp, frame->timestamp_ns, 6));
    if (snprintf(path, sizeof path, "%s/%s", r->folder.folder, name) >= PATH_ROOM)
        return fail(r, "the folder's path is too long");
    if (image_write_gray16(path, frame->depth, frame->width, frame->height, why, sizeof why))
        return fail(r, why);
    if (!line_file_add(&r->depth, "%s %s\n", stamp_text(stamp, frame->timestamp_ns, 1), name) ||
        !line_file_flush(&r->depth))
        return fail_file(r, &r->depth, "depth.txt");
    if (stat(path, &is) == 0) r->frame_bytes += (int64_t)is.st_size;
    if (!r->frames++) r->first_ns = frame->timestamp_ns;
    r->last_ns = frame->timestamp_ns;
    return true;
}

/* Those that are on the disk. */
static void count_samples(struct live_recorder *r) {
    r->samples = r->imu.lines > HEADER_LINES ? r->imu.lines - HEADER_LINES : 0;
    r->imu_bytes = r->imu.bytes;
}

static bool is_complete(const fathom_imu_sample *s) {
    for (int i = 0; i < 3; i++)
        if (!isfinite(s->gyro[i]) || !isfinite(s->accel[i])) return false;
    return true;
}

void live_recorder_take(void *user, const fathom_imu_sample *samples, int count) {
    struct live_recorder *r = user;
    char stamp[32];
    for (int i = 0; i < count && !r->imu_failed; i++) {
        const fathom_imu_sample *s = &samples[i];
        if (!r->incomplete && !is_complete(s)) {
            cli_warning("the IMU gives no rates or no accelerations: a replay will leave such samples out");
            r->incomplete = true;
        }
        /* Nine digits give a float back as it was. */
        if (!line_file_add(&r->imu, "%s %.9g %.9g %.9g %.9g %.9g %.9g\n",
                           stamp_text(stamp, s->timestamp_ns, 1), (double)s->gyro[0], (double)s->gyro[1],
                           (double)s->gyro[2], (double)s->accel[0], (double)s->accel[1], (double)s->accel[2]))
            r->imu_failed = true;
    }
    count_samples(r);
}

long long live_recorder_bytes(const struct live_recorder *r) {
    return r->frame_bytes + r->depth.bytes + r->imu_bytes;
}

bool live_recorder_close(struct live_recorder *r) {
    if (!line_file_close(&r->depth)) fail_file(r, &r->depth, "depth.txt");
    if (!line_file_close(&r->imu)) fail_file(r, &r->imu, "imu.txt");
    count_samples(r);
    return !*r->error;
}
