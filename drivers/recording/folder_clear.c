#include "recording/folder_clear.h"

#include <dirent.h>
#include <errno.h>
#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

static bool fail(const char *folder, int error, char *why, size_t size) {
    snprintf(why, size, "%.700s: %s", folder, strerror(error));
    return false;
}

static bool path_in(char path[PATH_MAX], const char *folder, const char *name) {
    if (snprintf(path, PATH_MAX, "%s/%s", folder, name) < PATH_MAX) return true;
    errno = ENAMETOOLONG;
    return false;
}

bool folder_make(const char *folder, const char *name) {
    char path[PATH_MAX];
    return path_in(path, folder, name) && (mkdir(path, 0777) == 0 || errno == EEXIST);
}

static bool make_all(const char *folder, char *why, size_t size) {
    char path[PATH_MAX];
    if (snprintf(path, sizeof path, "%s", folder) >= PATH_MAX) return fail(folder, ENAMETOOLONG, why, size);
    for (char *slash = path + 1; *slash; slash++) {
        if (*slash != '/') continue;
        *slash = 0;
        mkdir(path, 0777); /* a failure shows at the last one */
        *slash = '/';
    }
    struct stat is;
    if (mkdir(path, 0777) && errno != EEXIST) return fail(folder, errno, why, size);
    if (stat(path, &is) || !S_ISDIR(is.st_mode)) return fail(folder, ENOTDIR, why, size);
    return true;
}

static bool is_empty(const char *folder) {
    DIR *directory = opendir(folder);
    if (!directory) return true; /* can't be read: writing will report the reason */
    bool empty = true;
    for (struct dirent *entry; empty && (entry = readdir(directory));)
        empty = !strcmp(entry->d_name, ".") || !strcmp(entry->d_name, "..");
    closedir(directory);
    return empty;
}

/* Frames of a previous recording are named by their stamps, with six or nine decimals and perhaps a sign. Halves of
 * them count as well. */
static bool is_frame(const char *name) {
    if (*name == '-') name++;
    const size_t digits = strspn(name, "0123456789");
    if (digits < 3 || name[digits] != '.') return false;
    const size_t decimals = strspn(name + digits + 1, "0123456789");
    const char *end = name + digits + 1 + decimals;
    return (decimals == 6 || decimals == 9) && (!strcmp(end, ".png") || !strcmp(end, ".png.part"));
}

static void remove_frames(const char *folder, const char *name) {
    char frames[PATH_MAX], path[PATH_MAX];
    DIR *directory = path_in(frames, folder, name) ? opendir(frames) : NULL;
    if (!directory) return;
    for (struct dirent *entry; (entry = readdir(directory));)
        if (is_frame(entry->d_name) && path_in(path, frames, entry->d_name)) unlink(path);
    closedir(directory);
}

bool folder_clear(const char *folder, bool force, char *why, size_t size) {
    static const char *const stale[] = {"depth.txt", "confidence.txt",  "rgb.txt",        "imu.txt",
                                        "rig.txt",   "calibration.txt", "groundtruth.txt"};
    char path[PATH_MAX];
    if (!make_all(folder, why, size)) return false;
    if (!force && !is_empty(folder)) {
        snprintf(why, size, "%.700s: isn't empty; --force (options.force) writes there all the same", folder);
        return false;
    }
    for (size_t i = 0; i < sizeof stale / sizeof *stale; i++)
        if (path_in(path, folder, stale[i])) unlink(path);
    remove_frames(folder, "depth");
    remove_frames(folder, "confidence");
    remove_frames(folder, "rgb");
    return true;
}
