#include "fathom/replay/disturb.h"
#include "fathom/shell/cli.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The range that the frame is in, or -1. */
static int range_of(const struct frame_ranges *ranges, int frame) {
    for (int i = 0; i < ranges->count; i++)
        if (frame >= ranges->range[i].from && frame < ranges->range[i].to) return i;
    return -1;
}

/* The median valid depth, in units, of frames from..to-1 together; 0 when they are empty, -1 when one can't be read. */
static int median_units(const fathom_recording *recording, int from, int to, uint16_t *pixels) {
    const size_t count = (size_t)recording->camera.width * (size_t)recording->camera.height;
    uint64_t *histogram = calloc(65536, sizeof *histogram);
    uint64_t valid = 0, below = 0;
    int units = 0;
    if (!histogram) return -1;
    for (int frame = from; frame < to; frame++) {
        if (fathom_recording_read_depth(recording, frame, pixels)) {
            free(histogram);
            return -1;
        }
        for (size_t i = 0; i < count; i++)
            if (pixels[i] != 0 && pixels[i] != 65535) {
                histogram[pixels[i]]++;
                valid++;
            }
    }
    while (valid && units < 65534 && 2 * (below += histogram[units]) < valid) units++;
    free(histogram);
    return units;
}

/* Camera to world, row-major 4x4. */
static bool reference_pose(const fathom_recording *recording, int frame, double m[16]) {
    fathom_pose pose;
    const int64_t stamp = recording->frames[frame].timestamp_ns;
    if (fathom_recording_pose_at(recording, stamp, &pose)) {
        cli_error(CLI_FAILED, "--wall: %s/groundtruth.txt has no pose for frame %d (t = %.6f)",
                  recording->folder, frame, (double)stamp * 1e-9);
        return false;
    }
    return fathom_pose_to_matrix(&pose, m) == FATHOM_OK;
}

static int check_ranges(const char *option, const struct frame_ranges *ranges, int frames) {
    for (int i = 0; i < ranges->count; i++)
        if (ranges->range[i].from >= frames)
            return cli_error(CLI_USAGE, "%s: the recording has frames 0 to %d, no %d", option, frames - 1,
                             ranges->range[i].from);
    return CLI_DONE;
}

static int prepare_wall(struct disturb *disturb, int i, uint16_t *pixels) {
    const fathom_recording *recording = disturb->recording;
    const int frame = disturb->walls->range[i].from;
    const int units = median_units(recording, frame, frame + 1, pixels);
    double m[16];
    struct disturb_wall *wall = &disturb->wall[i];
    if (units < 0) return CLI_FAILED;
    if (units == 0) return cli_error(CLI_FAILED, "--wall: frame %d shows no surface to put a wall at", frame);
    if (!reference_pose(recording, frame, m)) return CLI_FAILED;
    wall->offset = units / recording->depth_units_per_metre;
    for (int k = 0; k < 3; k++) {
        wall->normal[k] = m[4 * k + 2];
        wall->offset += m[4 * k + 2] * m[4 * k + 3];
    }
    return CLI_DONE;
}

static int prepare_card(struct disturb *disturb, int i, uint16_t *pixels) {
    const struct frame_range range = disturb->cards->range[i];
    const int frames = disturb->recording->frame_count;
    const int units =
        median_units(disturb->recording, range.from, range.to < frames ? range.to : frames, pixels);
    if (units < 0) return CLI_FAILED;
    if (units == 0)
        return cli_error(CLI_FAILED, "--card: frames from %d on show no surface to put a card at",
                         range.from);
    disturb->card[i] = (uint16_t)units;
    return CLI_DONE;
}

int disturb_prepare(struct disturb *disturb, const fathom_recording *recording,
                    const struct frame_ranges *outages, const struct frame_ranges *walls,
                    const struct frame_ranges *cards, uint16_t *pixels) {
    *disturb = (struct disturb){.recording = recording, .outages = outages, .walls = walls, .cards = cards};
    int status = check_ranges("--outage", outages, recording->frame_count);
    if (!status) status = check_ranges("--wall", walls, recording->frame_count);
    if (!status) status = check_ranges("--card", cards, recording->frame_count);
    if (!status && walls->count && !recording->pose_count)
        status = cli_error(CLI_USAGE, "--wall: %s has no groundtruth.txt to render it by", recording->folder);
    for (int i = 0; !status && i < walls->count; i++) status = prepare_wall(disturb, i, pixels);
    for (int i = 0; !status && i < cards->count; i++) status = prepare_card(disturb, i, pixels);
    return status;
}

bool disturb_replaces(const struct disturb *disturb, int frame) {
    return range_of(disturb->outages, frame) >= 0 || range_of(disturb->walls, frame) >= 0 ||
           range_of(disturb->cards, frame) >= 0;
}

/* Undoes the lens's distortion of a point at depth one, by fixed-point iteration. */
static void undistort(const double k[8], double *x, double *y) {
    const double x0 = *x, y0 = *y;
    for (int i = 0; i < 10; i++) {
        const double r2 = *x * *x + *y * *y;
        const double over = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4])),
                     under = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
        const double dx = 2 * k[2] * *x * *y + k[3] * (r2 + 2 * *x * *x);
        const double dy = k[2] * (r2 + 2 * *y * *y) + 2 * k[3] * *x * *y;
        *x = (x0 - dx) * under / over;
        *y = (y0 - dy) * under / over;
    }
}

static bool render_wall(const struct disturb *disturb, const struct disturb_wall *wall, int frame,
                        uint16_t *pixels) {
    const fathom_recording *recording = disturb->recording;
    const fathom_pinhole *camera = &recording->camera;
    double m[16], normal[3] = {0}, distance = wall->offset;
    if (!reference_pose(recording, frame, m)) return false;
    for (int k = 0; k < 3; k++) {
        distance -= wall->normal[k] * m[4 * k + 3];
        for (int l = 0; l < 3; l++) normal[l] += wall->normal[k] * m[4 * k + l]; /* into the camera's axes */
    }
    for (int v = 0; v < camera->height; v++)
        for (int u = 0; u < camera->width; u++) {
            double x = (u - camera->cx) / camera->fx, y = (v - camera->cy) / camera->fy;
            if (camera->lens != FATHOM_LENS_PINHOLE) undistort(camera->coefficients, &x, &y);
            const double facing = normal[0] * x + normal[1] * y + normal[2];
            const double units = facing != 0 ? distance / facing * recording->depth_units_per_metre : 0;
            pixels[(size_t)v * (size_t)camera->width + (size_t)u] =
                units >= 0.5 && units < 65534.5 ? (uint16_t)lround(units) : 0;
        }
    return true;
}

bool disturb_render(const struct disturb *disturb, int frame, uint16_t *pixels) {
    const size_t count = (size_t)disturb->recording->camera.width * (size_t)disturb->recording->camera.height;
    const int card = range_of(disturb->cards, frame), wall = range_of(disturb->walls, frame);
    /* A covered lens hides wall and card, and a card hides the wall. */
    if (range_of(disturb->outages, frame) >= 0) {
        memset(pixels, 0, count * sizeof *pixels);
    } else if (card >= 0) {
        for (size_t i = 0; i < count; i++) pixels[i] = disturb->card[card];
    } else if (wall >= 0) {
        return render_wall(disturb, &disturb->wall[wall], frame, pixels);
    }
    return true;
}
