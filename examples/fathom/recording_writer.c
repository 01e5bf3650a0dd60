/* See recording_writer.h. */
#include "fathom/recording_writer.h"

#include <dirent.h>
#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "recording/image_file.h"

#define PATH_ROOM 4096

static int fail(struct recording_writer *w, const char *name, const char *why) {
    snprintf(w->error, sizeof w->error, "%.700s%s%s: %s", w->folder, name ? "/" : "", name ? name : "", why);
    return -1;
}

static bool path_in(char *path, const char *folder, const char *name) {
    return snprintf(path, PATH_ROOM, "%s/%s", folder, name) < PATH_ROOM;
}

/* ---- The folder ---- */

static int make_folder(struct recording_writer *w, const char *folder) {
    char path[PATH_ROOM];
    if (snprintf(path, sizeof path, "%s", folder) >= PATH_ROOM) return fail(w, NULL, strerror(ENAMETOOLONG));
    for (char *slash = path + 1; *slash; slash++) {
        if (*slash != '/') continue;
        *slash = 0;
        mkdir(path, 0777); /* what is wrong shows at the last one */
        *slash = '/';
    }
    struct stat is;
    if (mkdir(path, 0777) && errno != EEXIST) return fail(w, NULL, strerror(errno));
    if (stat(path, &is) || !S_ISDIR(is.st_mode)) return fail(w, NULL, strerror(ENOTDIR));
    return 0;
}

static bool is_empty(const char *folder) {
    DIR *directory = opendir(folder);
    if (!directory) return true; /* can't be read: writing will say why */
    bool empty = true;
    for (struct dirent *entry; empty && (entry = readdir(directory));)
        empty = !strcmp(entry->d_name, ".") || !strcmp(entry->d_name, "..");
    closedir(directory);
    return empty;
}

/* depth.txt of a simulation says so in its first line. */
static bool was_simulated(const char *folder) {
    char path[PATH_ROOM], line[256] = "";
    if (!path_in(path, folder, "depth.txt")) return false;
    FILE *file = fopen(path, "r");
    if (!file) return false;
    const bool read = fgets(line, sizeof line, file) != NULL;
    fclose(file);
    return read && !strncmp(line, "# fathom simulate", 17);
}

/* Frames of a former recording are named by their stamps, NNN.NNNNNN.png or, by log, with nine decimals and perhaps a
 * sign. Halves of them count as well. */
static bool is_frame(const char *name) {
    if (*name == '-') name++;
    const size_t digits = strspn(name, "0123456789");
    if (digits < 3 || name[digits] != '.') return false;
    const size_t decimals = strspn(name + digits + 1, "0123456789");
    const char *end = name + digits + 1 + decimals;
    return (decimals == 6 || decimals == 9) && (!strcmp(end, ".png") || !strcmp(end, ".png.part"));
}

/* Removes those, and nothing else. */
static void clear_frames(const char *folder) {
    char path[PATH_ROOM];
    DIR *directory = opendir(folder);
    if (!directory) return;
    for (struct dirent *entry; (entry = readdir(directory));) {
        if (is_frame(entry->d_name) && path_in(path, folder, entry->d_name)) unlink(path);
    }
    closedir(directory);
}

static FILE *create(struct recording_writer *w, const char *name) {
    char path[PATH_ROOM];
    FILE *file = NULL;
    errno = ENAMETOOLONG;
    if (path_in(path, w->folder, name)) file = fopen(path, "w");
    if (!file) fail(w, name, strerror(errno));
    return file;
}

/* A file is good when all of it went out; a full disk may show only here. */
static int finish(struct recording_writer *w, FILE *file, const char *name) {
    errno = 0;
    const bool bad = fflush(file) || ferror(file);
    const int why = errno;
    if (fclose(file) && !bad) return fail(w, name, strerror(errno));
    return bad ? fail(w, name, why ? strerror(why) : "write error") : 0;
}

int recording_prepare(struct recording_writer *w, const char *folder, bool force) {
    static const char *const stale[] = {"depth.txt", "imu.txt", "rig.txt", "calibration.txt", "groundtruth.txt"};
    char path[PATH_ROOM];
    memset(w, 0, sizeof *w);
    w->folder = folder;
    if (make_folder(w, folder)) return -1;
    if (!force && !is_empty(folder))
        return fail(w, NULL, "isn't empty; --force writes there all the same");
    for (size_t i = 0; i < sizeof stale / sizeof stale[0]; i++)
        if (path_in(path, folder, stale[i])) unlink(path);
    if (!path_in(path, folder, "depth")) return fail(w, NULL, strerror(ENAMETOOLONG));
    if (mkdir(path, 0777) && errno != EEXIST) return fail(w, "depth", strerror(errno));
    clear_frames(path);
    return 0;
}

int recording_open(struct recording_writer *w, const char *folder, bool force, const char *header) {
    if (recording_prepare(w, folder, force || was_simulated(folder))) return -1;
    w->depth = create(w, "depth.txt");
    if (!w->depth) return -1;
    w->truth = create(w, "groundtruth.txt");
    if (!w->truth) return -1;
    fprintf(w->depth, "# %s\n# t[s] file\n", header);
    fprintf(w->truth, "# %s\n# t[s] tx ty tz qx qy qz qw, camera to world, world z up\n", header);
    return 0;
}

int recording_calibration(struct recording_writer *w, const double *values, int count) {
    FILE *file = create(w, "calibration.txt");
    if (!file) return -1;
    for (int i = 0; i < count; i++) fprintf(file, "%s%.10g", i ? " " : "", values[i]);
    fputc('\n', file);
    return finish(w, file, "calibration.txt");
}

/* ---- The IMU ---- */

int recording_imu(struct recording_writer *w, struct imu_model *model, const struct camera_path *path,
                  double until, const char *header) {
    const struct imu_mounting *m = &model->mounting;
    FILE *file = create(w, "rig.txt");
    if (!file) return -1;
    fprintf(file, "depth_scale %d\n", RECORDING_DEPTH_SCALE);
    fprintf(file, "imu_to_camera_rotation %.10g %.10g %.10g\n", m->rotation_deg[0], m->rotation_deg[1],
            m->rotation_deg[2]);
    fprintf(file, "imu_to_camera_translation %.10g %.10g %.10g\n", m->translation[0], m->translation[1],
            m->translation[2]);
    fprintf(file, "imu_clock_offset %.10g\ngravity %.10g\n", m->clock_offset, STANDARD_GRAVITY);
    if (finish(w, file, "rig.txt")) return -1;

    file = create(w, "imu.txt");
    if (!file) return -1;
    fprintf(file, "# %s\n# IMU: %s (%s), %g samples a second\n", header, model->grade.name, model->grade.part,
            model->rate);
    fprintf(file, "# t[s] gx gy gz [rad/s] ax ay az [m/s^2]\n");
    const double count = floor(until * model->rate) + 1.0;
    for (double i = 0; i < count && !ferror(file); i++) {
        struct imu_sample s;
        imu_model_next(model, path, &s);
        fprintf(file, "%.6f %.9f %.9f %.9f %.8f %.8f %.8f\n", s.stamp, s.gyro[0], s.gyro[1], s.gyro[2],
                s.accel[0], s.accel[1], s.accel[2]);
    }
    return finish(w, file, "imu.txt");
}

/* Copies lines; those that begin with `without` are left out. A file that isn't there is none. */
static int copy_lines(struct recording_writer *w, const char *from, const char *name, const char *without,
                      FILE *to) {
    char path[PATH_ROOM], line[4096];
    errno = ENAMETOOLONG;
    FILE *in = path_in(path, from, name) ? fopen(path, "r") : NULL;
    if (!in && errno == ENOENT) return 0;
    if (!in) {
        snprintf(w->error, sizeof w->error, "%s/%s: %s", from, name, strerror(errno));
        return -1;
    }
    bool newline = true;
    while (fgets(line, sizeof line, in)) {
        if (without && !strncmp(line + strspn(line, " \t"), without, strlen(without))) continue;
        fputs(line, to);
        newline = line[strlen(line) - 1] == '\n';
    }
    if (!newline) fputc('\n', to);
    const bool bad = ferror(in) != 0;
    fclose(in);
    if (!bad) return 0;
    snprintf(w->error, sizeof w->error, "%s/%s: can't be read", from, name);
    return -1;
}

int recording_rig(struct recording_writer *w, const char *from, double depth_scale) {
    FILE *file = create(w, "rig.txt");
    if (!file) return -1;
    fprintf(file, "depth_scale %.10g\n", depth_scale);
    const int result = from ? copy_lines(w, from, "rig.txt", "depth_scale", file) : 0;
    return finish(w, file, "rig.txt") || result ? -1 : 0;
}

int recording_copy_imu(struct recording_writer *w, const char *from) {
    char path[PATH_ROOM];
    if (recording_rig(w, from, RECORDING_DEPTH_SCALE)) return -1;
    if (!path_in(path, from, "imu.txt") || access(path, F_OK)) return 0;
    FILE *file = create(w, "imu.txt");
    if (!file) return -1;
    const int result = copy_lines(w, from, "imu.txt", NULL, file);
    if (finish(w, file, "imu.txt")) return -1;
    return result;
}

/* ---- Frames ---- */

int recording_frame(struct recording_writer *w, double t, const uint16_t *depth,
                    const struct render_camera *camera, const struct camera_pose *pose) {
    char name[64], path[PATH_ROOM];
    double q[4];
    snprintf(name, sizeof name, "depth/%010.6f.png", t);
    if (!path_in(path, w->folder, name)) return fail(w, name, strerror(ENAMETOOLONG));
    if (image_write_gray16(path, depth, camera->width, camera->height, w->error, sizeof w->error)) return -1;
    quaternion_of(pose->rotation, q);
    /* The truth first: a frame that depth.txt names then has its pose, whenever the writing stops. */
    errno = 0;
    fprintf(w->truth, "%.6f %.9f %.9f %.9f %.10f %.10f %.10f %.10f\n", t, pose->position[0],
            pose->position[1], pose->position[2], q[0], q[1], q[2], q[3]);
    if (fflush(w->truth) || ferror(w->truth)) return fail(w, "groundtruth.txt", strerror(errno));
    fprintf(w->depth, "%.6f %s\n", t, name);
    if (fflush(w->depth) || ferror(w->depth)) return fail(w, "depth.txt", strerror(errno));
    return 0;
}

int recording_close(struct recording_writer *w) {
    char before[sizeof w->error];
    memcpy(before, w->error, sizeof before);
    int result = 0;
    if (w->truth) result |= finish(w, w->truth, "groundtruth.txt");
    if (w->depth) result |= finish(w, w->depth, "depth.txt");
    w->truth = w->depth = NULL;
    if (before[0])
        memcpy(w->error, before, sizeof before); /* the first thing that went wrong is the one to tell */
    return result;
}
