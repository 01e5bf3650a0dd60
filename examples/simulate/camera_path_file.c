/* Reading a measured trajectory (TUM lines) as a camera path. */
#include "simulate/camera_path.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int fail(char *error, size_t error_size, const char *file, long line, const char *what) {
    if (line)
        snprintf(error, error_size, "%s:%ld: %s", file, line, what);
    else
        snprintf(error, error_size, "%s: %s", file, what);
    return -1;
}

/* Reads the line's pose into *sample; returns its fault, or NULL. */
static const char *parse(const char *text, const struct path_sample *before, struct path_sample *sample) {
    double v[8], norm = 0.0, cosine = 0.0;
    if (sscanf(text, "%lf %lf %lf %lf %lf %lf %lf %lf", &v[0], &v[1], &v[2], &v[3], &v[4], &v[5], &v[6],
               &v[7]) != 8)
        return "not a line of t tx ty tz qx qy qz qw";
    for (int i = 0; i < 8; i++)
        if (!isfinite(v[i])) return "a number that isn't finite";
    for (int i = 0; i < 4; i++) norm += v[4 + i] * v[4 + i];
    norm = sqrt(norm);
    if (fabs(norm - 1.0) > 0.01) return "a quaternion that isn't of unit length";
    if (before && v[0] <= before->t) return "time that doesn't go on";
    sample->t = v[0];
    memcpy(sample->position, v + 1, sizeof sample->position);
    for (int i = 0; i < 4; i++) {
        sample->quaternion[i] = v[4 + i] / norm;
        if (before) cosine += sample->quaternion[i] * before->quaternion[i];
    }
    for (int i = 0; cosine < 0.0 && i < 4; i++) sample->quaternion[i] = -sample->quaternion[i];
    return NULL;
}

int camera_path_read(struct camera_path *path, const char *file, char *error, size_t error_size) {
    memset(path, 0, sizeof *path);
    FILE *in = fopen(file, "r");
    if (!in) return fail(error, error_size, file, 0, strerror(errno));
    char text[512];
    size_t capacity = 0;
    const char *wrong = NULL;
    long line = 0;
    while (!wrong && fgets(text, sizeof text, in)) {
        line++;
        const char *start = text + strspn(text, " \t\r\n");
        if (!*start || *start == '#') continue;
        if (path->count == capacity) {
            capacity = capacity ? 2 * capacity : 4096;
            struct path_sample *grown = realloc(path->samples, capacity * sizeof *grown);
            if (!grown) {
                wrong = "out of memory";
                break;
            }
            path->samples = grown;
        }
        const struct path_sample *before = path->count ? &path->samples[path->count - 1] : NULL;
        wrong = parse(start, before, &path->samples[path->count]);
        path->count += !wrong;
    }
    if (!wrong && ferror(in)) {
        wrong = "can't be read";
        line = 0;
    }
    if (!wrong && path->count < 2) {
        wrong = "fewer than two poses";
        line = 0;
    }
    fclose(in);
    if (!wrong) return 0;
    camera_path_free(path);
    return fail(error, error_size, file, line, wrong);
}

void camera_path_free(struct camera_path *path) {
    free(path->samples);
    path->samples = NULL;
    path->count = 0;
}
