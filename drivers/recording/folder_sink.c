/* A recording folder that grows as it is written, and is complete at any moment: all that depth.txt, confidence.txt,
 * rgb.txt or groundtruth.txt name exists, and each file ends with a whole line. The counterpart of recording.c. */
#include <errno.h>
#include <inttypes.h>
#include <limits.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "recording/folder_clear.h"
#include "recording/image_file.h"
#include "recording/line_file.h"
#include "sink.h"
#include "source_log.h"

typedef struct {
    fathom_sink base;
    char *folder, *header;
    struct line_file depth, confidence, images, poses; /* the writing thread's */
    struct line_file imu;                              /* the sample thread's */
    int64_t imu_head;                                  /* lines of imu.txt that are no samples */
    int64_t pictures;                                  /* bytes of PNG files */
    bool incomplete; /* the log has the message about samples without a sensor */
} folder_sink;

static folder_sink *of(fathom_sink *sink) {
    return (folder_sink *)sink;
}

static int fail_file(folder_sink *s, const char *name, int error) {
    return sink_fail(&s->base, FATHOM_ERROR_WRITE, "%.900s/%s: %s", s->folder, name,
                     error ? strerror(error) : "write error");
}

static bool path_in(const folder_sink *s, char path[PATH_MAX], const char *name) {
    if (snprintf(path, PATH_MAX, "%s/%s", s->folder, name) < PATH_MAX) return true;
    errno = ENAMETOOLONG;
    return false;
}

/* To the nanosecond, padded so that names sort by time. */
static const char *stamp_text(char text[32], int64_t ns, int digits) {
    const uint64_t size = ns < 0 ? 0 - (uint64_t)ns : (uint64_t)ns;
    snprintf(text, 32, "%s%0*" PRIu64 ".%09" PRIu64, ns < 0 ? "-" : "", digits, size / 1000000000,
             size % 1000000000);
    return text;
}

/* ---- text files ---- */

/* The options' header, each line of it a comment, and the names of the columns. */
static bool add_head(folder_sink *s, struct line_file *file, const char *columns) {
    for (const char *line = s->header; line && *line;) {
        const int length = (int)strcspn(line, "\r\n");
        if (!line_file_add(file, "# %.*s\n", length < 900 ? length : 900, line)) return false;
        line += length + (line[length] != 0);
    }
    return line_file_add(file, "# %s\n", columns);
}

/* Opens a file, unless it is open, and writes its head. */
static int need(folder_sink *s, struct line_file *file, const char *name, const char *columns) {
    char path[PATH_MAX];
    if (file->is_open) return FATHOM_OK;
    if (!path_in(s, path, name)) return fail_file(s, name, errno);
    if (!line_file_open(file, path) || (columns && (!add_head(s, file, columns) || !line_file_flush(file))))
        return fail_file(s, name, file->error);
    return FATHOM_OK;
}

/* What is on the disk. */
static void count(folder_sink *s) {
    const int64_t samples = s->imu.lines - s->imu_head;
    pthread_mutex_lock(&s->base.lock);
    s->base.status.samples = samples > 0 ? samples : 0;
    s->base.status.imu_bytes = s->imu.bytes;
    pthread_mutex_unlock(&s->base.lock);
}

static void count_frame(folder_sink *s, int64_t *number, int64_t stamp_ns) {
    fathom_sink_status *status = &s->base.status;
    pthread_mutex_lock(&s->base.lock);
    if (number) ++*number;
    if (number == &status->frames) {
        if (*number == 1) status->first_ns = stamp_ns;
        status->last_ns = stamp_ns;
    }
    status->frame_bytes =
        s->pictures + s->depth.bytes + s->confidence.bytes + s->images.bytes + s->poses.bytes;
    pthread_mutex_unlock(&s->base.lock);
}

/* ---- the rig ---- */

static FILE *create(folder_sink *s, const char *name) {
    char path[PATH_MAX];
    FILE *file = path_in(s, path, name) ? fopen(path, "w") : NULL;
    if (!file) fail_file(s, name, errno);
    return file;
}

/* Closes a file; a full disk may show only here. */
static int finish(folder_sink *s, FILE *file, const char *name) {
    errno = 0;
    const bool bad = fflush(file) || ferror(file);
    const int why = errno;
    if (fclose(file) && !bad) return fail_file(s, name, errno);
    return bad ? fail_file(s, name, why) : FATHOM_OK;
}

/* The coefficients only where there is distortion. */
static int write_calibration(folder_sink *s, const fathom_pinhole *camera) {
    const int coefficients[] = {
        [FATHOM_LENS_PINHOLE] = 0, [FATHOM_LENS_FIVE] = 5, [FATHOM_LENS_RATIONAL] = 8};
    if (camera->lens < FATHOM_LENS_PINHOLE || camera->lens > FATHOM_LENS_RATIONAL)
        return sink_fail(&s->base, FATHOM_ERROR_ARGUMENT, "%.900s: lens %d", s->folder, camera->lens);
    FILE *file = create(s, "calibration.txt");
    if (!file) return FATHOM_ERROR_WRITE;
    fprintf(file, "%.10g %.10g %.10g %.10g", camera->fx, camera->fy, camera->cx, camera->cy);
    for (int i = 0; i < coefficients[camera->lens]; i++) fprintf(file, " %.10g", camera->coefficients[i]);
    fputc('\n', file);
    return finish(s, file, "calibration.txt");
}

/* Copies the lines of another folder's file that don't begin with `without`; a missing file has none. */
static int each_line(folder_sink *s, const char *folder, const char *name, const char *without,
                     bool (*take)(void *user, const char *line), void *user) {
    char path[PATH_MAX];
    char *line = NULL;
    size_t capacity = 0;
    bool more = true;
    FILE *in = snprintf(path, sizeof path, "%s/%s", folder, name) < PATH_MAX ? fopen(path, "r") : NULL;
    if (!in && errno == ENOENT) return FATHOM_OK;
    if (!in) return sink_fail(&s->base, FATHOM_ERROR_NO_DATA, "%.900s/%s: %s", folder, name, strerror(errno));
    for (ssize_t length; more && (length = getline(&line, &capacity, in)) > 0;) {
        if (line[length - 1] == '\n') line[length - 1] = 0;
        const bool left_out = without && !strncmp(line + strspn(line, " \t"), without, strlen(without));
        more = left_out || take(user, line);
    }
    const bool bad = ferror(in) != 0;
    free(line);
    fclose(in);
    return bad ? sink_fail(&s->base, FATHOM_ERROR_NO_DATA, "%.900s/%s: can't be read", folder, name)
               : FATHOM_OK;
}

static bool put_line(void *user, const char *line) {
    return fprintf(user, "%s\n", line) > 0;
}

static int write_rig(fathom_sink *sink, const fathom_sink_rig *rig) {
    folder_sink *s = of(sink);
    const double *r = rig->imu_to_camera_rotation_deg, *t = rig->imu_to_camera_translation_m;
    int result = write_calibration(s, &rig->camera);
    if (result) return result;
    FILE *file = create(s, "rig.txt");
    if (!file) return FATHOM_ERROR_WRITE;
    fprintf(file, "depth_scale %.10g\n", rig->depth_units_per_metre);
    if (rig->has_imu) {
        fprintf(file, "imu_to_camera_rotation %.10g %.10g %.10g\n", r[0], r[1], r[2]);
        fprintf(file, "imu_to_camera_translation %.10g %.10g %.10g\n", t[0], t[1], t[2]);
        fprintf(file, "imu_clock_offset %.10g\n", 1e-9 * (double)rig->imu_clock_offset_ns);
        if (rig->gravity > 0) fprintf(file, "gravity %.10g\n", rig->gravity);
    } else if (rig->lines_of) {
        result = each_line(s, rig->lines_of, "rig.txt", "depth_scale", put_line, file);
    }
    /* The last, so that it holds whatever was copied. */
    if (rig->min_confidence > 0) fprintf(file, "confidence_min %d\n", (int)rig->min_confidence);
    const int finished = finish(s, file, "rig.txt");
    return result ? result : finished;
}

/* ---- frames ---- */

/* Adds a line that names the file just written. */
static int name_it(folder_sink *s, struct line_file *file, const char *list, int64_t stamp_ns,
                   const char *name) {
    char stamp[32], path[PATH_MAX];
    struct stat is;
    if (!line_file_add(file, "%s %s\n", stamp_text(stamp, stamp_ns, 1), name) || !line_file_flush(file))
        return fail_file(s, list, file->error);
    if (path_in(s, path, name) && stat(path, &is) == 0) s->pictures += (int64_t)is.st_size;
    return FATHOM_OK;
}

/* Writes DIRECTORY/STAMP.png and names it in the list. */
static int write_picture(folder_sink *s, struct line_file *list, const char *list_name, const char *directory,
                         int64_t stamp_ns, const image_pixels *picture) {
    char stamp[32], name[48], path[PATH_MAX], why[1024];
    if (!list->is_open && !folder_make(s->folder, directory)) return fail_file(s, directory, errno);
    const int result = need(s, list, list_name, "t[s] file");
    if (result) return result;
    snprintf(name, sizeof name, "%s/%s.png", directory, stamp_text(stamp, stamp_ns, 6));
    if (!path_in(s, path, name)) return fail_file(s, name, errno);
    if (image_write(path, picture, why, sizeof why))
        return sink_fail(&s->base, FATHOM_ERROR_WRITE, "%s", why);
    return name_it(s, list, list_name, stamp_ns, name);
}

/* The confidence first: a frame that depth.txt names then has it. */
static int write_depth(fathom_sink *sink, const fathom_depth_frame *frame) {
    folder_sink *s = of(sink);
    const image_pixels depth = {.pixels = frame->depth,
                                .width = frame->width,
                                .height = frame->height,
                                .stride_bytes = (size_t)frame->row_stride_bytes};
    const image_pixels confidence = {.pixels = frame->confidence,
                                     .width = frame->width,
                                     .height = frame->height,
                                     .stride_bytes = (size_t)frame->confidence_stride_bytes,
                                     .kind = IMAGE_GRAY8};
    int result = FATHOM_OK;
    if (frame->confidence)
        result = write_picture(s, &s->confidence, "confidence.txt", "confidence", frame->timestamp_ns,
                               &confidence);
    if (!result) result = write_picture(s, &s->depth, "depth.txt", "depth", frame->timestamp_ns, &depth);
    if (!result) count_frame(s, &sink->status.frames, frame->timestamp_ns);
    return result;
}

static int write_image(fathom_sink *sink, const fathom_image *image) {
    folder_sink *s = of(sink);
    if (image->format != FATHOM_IMAGE_RGB8)
        return sink_fail(sink, FATHOM_ERROR_UNSUPPORTED, "%.900s: images are written from RGB8 only",
                         s->folder);
    const image_pixels picture = {.pixels = image->data,
                                  .width = image->width,
                                  .height = image->height,
                                  .stride_bytes = (size_t)image->stride_bytes,
                                  .kind = IMAGE_RGB8};
    const int result = write_picture(s, &s->images, "rgb.txt", "rgb", image->timestamp_ns, &picture);
    if (!result) count_frame(s, &sink->status.images, image->timestamp_ns);
    return result;
}

static int write_pose(fathom_sink *sink, int64_t timestamp_ns, const fathom_pose *pose) {
    folder_sink *s = of(sink);
    char stamp[32];
    const double *p = pose->position, *q = pose->orientation;
    const int result = need(s, &s->poses, "groundtruth.txt", "t[s] tx ty tz qx qy qz qw, camera to world");
    if (result) return result;
    if (!line_file_add(&s->poses, "%s %.9f %.9f %.9f %.10f %.10f %.10f %.10f\n",
                       stamp_text(stamp, timestamp_ns, 1), p[0], p[1], p[2], q[0], q[1], q[2], q[3]) ||
        !line_file_flush(&s->poses))
        return fail_file(s, "groundtruth.txt", s->poses.error);
    count_frame(s, &sink->status.poses, timestamp_ns);
    return FATHOM_OK;
}

/* ---- samples ---- */

#define IMU_COLUMNS "t[s] gx gy gz [rad/s] ax ay az [m/s^2]"

static bool is_complete(const fathom_imu_sample *sample) {
    for (int i = 0; i < 3; i++)
        if (!isfinite(sample->gyro[i]) || !isfinite(sample->accel[i])) return false;
    return true;
}

/* Nine digits restore a float exactly. */
static bool add_sample(folder_sink *s, const fathom_imu_sample *sample) {
    char stamp[32];
    const float *g = sample->gyro, *a = sample->accel;
    if (!s->incomplete && !is_complete(sample)) {
        source_say(s->base.options.log, s->base.options.log_user, FATHOM_LOG_WARNING,
                   "the IMU gives no rates or no accelerations: a replay will leave such samples out");
        s->incomplete = true;
    }
    return line_file_add(&s->imu, "%s %.9g %.9g %.9g %.9g %.9g %.9g\n",
                         stamp_text(stamp, sample->timestamp_ns, 1), (double)g[0], (double)g[1], (double)g[2],
                         (double)a[0], (double)a[1], (double)a[2]);
}

static int write_imu(fathom_sink *sink, const fathom_imu_sample *samples, int number) {
    folder_sink *s = of(sink);
    if (!s->imu.is_open) {
        const int result = need(s, &s->imu, "imu.txt", IMU_COLUMNS);
        if (result) return result;
        s->imu_head = s->imu.lines;
    }
    bool good = true;
    for (int i = 0; i < number && good; i++) good = add_sample(s, &samples[i]);
    count(s);
    return good ? FATHOM_OK : fail_file(s, "imu.txt", s->imu.error);
}

static bool copy_sample(void *user, const char *line) {
    folder_sink *s = user;
    if (*line == '#') s->imu_head++;
    return line_file_add(&s->imu, "%s\n", line);
}

static int copy_imu(fathom_sink *sink, const char *folder) {
    folder_sink *s = of(sink);
    char path[PATH_MAX];
    struct stat is;
    if (snprintf(path, sizeof path, "%s/imu.txt", folder) < PATH_MAX && stat(path, &is)) return FATHOM_OK;
    int result = need(s, &s->imu, "imu.txt", NULL);
    if (!result) result = each_line(s, folder, "imu.txt", NULL, copy_sample, s);
    if (!result && !line_file_flush(&s->imu)) result = fail_file(s, "imu.txt", s->imu.error);
    count(s);
    return result;
}

/* ---- life ---- */

static int flush(fathom_sink *sink) {
    folder_sink *s = of(sink);
    const bool good = !s->imu.is_open || line_file_flush(&s->imu);
    count(s);
    return good ? FATHOM_OK : fail_file(s, "imu.txt", s->imu.error);
}

static void close_file(folder_sink *s, struct line_file *file, const char *name) {
    const int before = file->error; /* already reported */
    if (!line_file_close(file) && !before) fail_file(s, name, file->error);
}

static void close_all(fathom_sink *sink) {
    folder_sink *s = of(sink);
    close_file(s, &s->poses, "groundtruth.txt");
    close_file(s, &s->images, "rgb.txt");
    close_file(s, &s->depth, "depth.txt");
    close_file(s, &s->confidence, "confidence.txt");
    close_file(s, &s->imu, "imu.txt");
    free(s->folder);
    free(s->header);
}

static const sink_operations operations = {.write_rig = write_rig,
                                           .write_depth = write_depth,
                                           .write_image = write_image,
                                           .write_imu = write_imu,
                                           .copy_imu = copy_imu,
                                           .write_pose = write_pose,
                                           .flush = flush,
                                           .close = close_all};

int folder_sink_open(fathom_sink **sink, const char *path, const fathom_sink_options *options) {
    char why[1024];
    folder_sink *s = calloc(1, sizeof *s);
    const char *header = options->header ? options->header : "";
    if (!s || !(s->folder = strdup(path)) || !(s->header = strdup(header))) {
        if (s) free(s->folder);
        free(s);
        source_say(options->log, options->log_user, FATHOM_LOG_ERROR, "%s: no memory for a sink", path);
        return FATHOM_ERROR_MEMORY;
    }
    s->base.does = &operations;
    s->base.options = *options;
    pthread_mutex_init(&s->base.lock, NULL);
    int result = FATHOM_OK;
    if (!folder_clear(path, options->force, why, sizeof why))
        result = sink_fail(&s->base, FATHOM_ERROR_WRITE, "%s", why);
    else if (!folder_make(path, "depth"))
        result = fail_file(s, "depth", errno);
    if (!result) result = need(s, &s->depth, "depth.txt", "t[s] file");
    if (result) {
        fathom_sink_close(&s->base);
        return result;
    }
    count_frame(s, NULL, 0);
    *sink = &s->base;
    return FATHOM_OK;
}
