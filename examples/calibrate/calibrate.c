/* fathom calibrate: extrinsics and clock offset of the IMU, from a recording that tracks. */
#include "calibrate/calibration.h"
#include "simulate/camera_path.h"
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/replay/playback.h"
#include "calibrate/rig_file.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define ROUGH_SIGMA 0.15 /* radians: a mounting known this well still helps tracking */
#define DEGREES 57.29577951308232
#define WARN_SIGMA_DEG 1.0
#define TELL_MOVED 0.5 /* sigmas */

struct calibrate {
    const char *folder, *output, *imu;
    double offset_start, offset_range;
    bool progress, verbose;
    struct settings settings;
    struct cli_log log;
    fathom_recording *recording;
    char *rig; /* FOLDER/rig.txt */
    uint16_t *pixels;
    struct path path;
    struct calibration found;
};

/* ---- before the first frame ---------------------------------------------------------------------------- */

static int prepare(struct calibrate *c) {
    const size_t size = strlen(c->folder) + sizeof "/rig.txt";
    c->rig = malloc(size);
    if (!c->rig) return cli_error(CLI_FAILED, "out of memory");
    snprintf(c->rig, size, "%s/rig.txt", c->folder);
    const int status = playback_open(&c->recording, c->folder, c->imu, &c->settings, &c->log);
    if (status) return status;
    const fathom_recording *recording = c->recording;
    if (!recording->imu_count)
        return cli_error(CLI_FAILED, "%s/imu.txt: there are no IMU samples to calibrate by", c->folder);
    if (recording->frame_count < CALIBRATION_LEAST_WINDOWS)
        return cli_error(CLI_FAILED, "%s: %d frames are too few to calibrate by", c->folder,
                         recording->frame_count);
    const double imu_from = 1e-9 * (double)recording->imu[0].timestamp_ns + c->offset_start,
                 imu_to =
                     1e-9 * (double)recording->imu[recording->imu_count - 1].timestamp_ns + c->offset_start,
                 from = 1e-9 * (double)recording->frames[0].timestamp_ns,
                 to = 1e-9 * (double)recording->frames[recording->frame_count - 1].timestamp_ns;
    if (imu_from - c->offset_range > to || imu_to + c->offset_range < from)
        return cli_error(
            CLI_FAILED,
            "%s: the frames are from %.3f to %.3f s, the IMU samples from %.3f to %.3f s: they never "
            "meet; --offset-start shifts the samples",
            c->folder, from, to, imu_from, imu_to);
    c->pixels =
        malloc((size_t)recording->camera.width * (size_t)recording->camera.height * sizeof *c->pixels);
    c->path.points = malloc((size_t)recording->frame_count * sizeof *c->path.points);
    if (!c->pixels || !c->path.points) return cli_error(CLI_FAILED, "out of memory");
    return rig_file_can_write(c->output ? c->output : c->rig) ? CLI_DONE : CLI_FAILED;
}

/* ---- tracking ------------------------------------------------------------------------------------------ */

static int take_frame(struct calibrate *c, struct playback *playback, const fathom_recording *rig,
                      int index) {
    log_clear(&c->log);
    const int read = fathom_recording_read_depth(c->recording, index, c->pixels);
    if (read) return cli_error(CLI_FAILED, "%s", log_reason(&c->log, read));
    playback_push_imu(playback, rig, index);
    const fathom_depth_frame frame = {.struct_size = sizeof frame,
                                      .timestamp_ns = rig->frames[index].timestamp_ns,
                                      .depth = c->pixels,
                                      .confidence = playback_confidence(playback, rig, index),
                                      .width = rig->camera.width,
                                      .height = rig->camera.height};
    fathom_result result = FATHOM_STRUCT(fathom_result);
    const int stepped = fathom_step(playback->library.scan, &frame, &result);
    if (stepped < 0) return cli_error(CLI_FAILED, "frame %d: %s", index, log_reason(&c->log, stepped));
    struct path_point *point = &c->path.points[c->path.count++];
    point->timestamp_ns = frame.timestamp_ns;
    point->state = result.state;
    point->pose = result.pose;
    cli_progress(c->path.count, fathom_state_name(result.state));
    return CLI_DONE;
}

/* Tracks the whole recording. With a rig, the gyroscope helps; not the accelerometer, since with a roughly known
 * mounting gravity would appear as acceleration. */
static int track(struct calibrate *c, const fathom_recording *rig, const char *what) {
    struct playback playback = {0};
    fathom_config config = c->settings.config;
    config.imu = rig != NULL;
    config.imu_translation = false;
    if (!rig) rig = c->recording;
    int status = playback_start(&playback, rig, 0, 1, &c->settings, &config, &c->log);
    c->path.count = 0;
    cli_progress_start(what, rig->frame_count, c->progress);
    for (int i = 0; i < rig->frame_count && !status; i++)
        status = cli_interrupted() ? CLI_INTERRUPTED : take_frame(c, &playback, rig, i);
    cli_progress_end();
    playback_stop(&playback);
    return status;
}

static int tracked(const struct calibrate *c) {
    int count = 0;
    for (int i = 0; i < c->path.count; i++)
        count += c->path.points[i].state == FATHOM_FIRST || c->path.points[i].state == FATHOM_TRACKED;
    return count;
}

static enum calibration_outcome solve(struct calibrate *c) {
    const struct calibration_input input = {.path = &c->path,
                                            .imu = c->recording->imu,
                                            .imu_count = c->recording->imu_count,
                                            .gravity = c->recording->gravity,
                                            .offset_start = c->offset_start,
                                            .offset_range = c->offset_range};
    return calibration_solve(&input, &c->found);
}

/* The recording with the estimated rig in place of its rig.txt's. */
static fathom_recording with_rig(const struct calibrate *c) {
    fathom_recording rig = *c->recording;
    memcpy(rig.imu_to_camera_rotation, c->found.rotation, sizeof rig.imu_to_camera_rotation);
    memset(rig.imu_to_camera_translation, 0, sizeof rig.imu_to_camera_translation);
    if (c->found.lever_observable)
        memcpy(rig.imu_to_camera_translation, c->found.lever, sizeof c->found.lever);
    rig.imu_clock_offset_ns = llround(1e9 * c->found.offset);
    return rig;
}

/* ---- what is said -------------------------------------------------------------------------------------- */

/* Reports why there is no result; returns a CLI_ status. */
static int explain(const struct calibrate *c, enum calibration_outcome outcome) {
    const struct calibration *f = &c->found;
    const double *t = f->turning, *w = f->weak_axis;
    switch (outcome) {
    case CALIBRATION_DONE: return CLI_DONE;
    case CALIBRATION_MEMORY: return cli_error(CLI_FAILED, "out of memory");
    case CALIBRATION_FEW_FRAMES:
        return cli_error(
            CLI_FAILED,
            "%s: %d of %d frames were tracked, and %d stretches of them have IMU samples without a gap; "
            "it takes %d",
            c->folder, tracked(c), c->path.count, f->windows, CALIBRATION_LEAST_WINDOWS);
    case CALIBRATION_LITTLE_TURNING:
        if (f->weak_sigma <= 0)
            return cli_error(
                CLI_FAILED,
                "%s: the camera hardly turns: rms %.1f deg/s about x, %.1f about y, %.1f about z; turn it "
                "about all three, to and fro",
                c->folder, t[0] * DEGREES, t[1] * DEGREES, t[2] * DEGREES);
        return cli_error(
            CLI_FAILED,
            "%s: the mounting's rotation about the camera's axis (%.2f %.2f %.2f) is not observable "
            "(sigma %.1f degrees): turning is rms %.1f deg/s about x, %.1f about y, %.1f about z; turn "
            "about other axes, too",
            c->folder, w[0], w[1], w[2], f->weak_sigma * DEGREES, t[0] * DEGREES, t[1] * DEGREES,
            t[2] * DEGREES);
    case CALIBRATION_DISAGREES:
        return cli_error(
            CLI_FAILED,
            "%s: camera and gyroscope don't turn alike at any clock offset within %.3f +- %.3f s (best "
            "correlation %.2f; %d of %d frames tracked)",
            c->folder, c->offset_start, c->offset_range, f->correlation, tracked(c), c->path.count);
    case CALIBRATION_RANGE:
        return cli_error(CLI_FAILED,
                         "%s: the best clock offset lies at an end of %.3f +- %.3f s; --offset-start and "
                         "--offset-range move the ends",
                         c->folder, c->offset_start, c->offset_range);
    case CALIBRATION_SCALE:
        return cli_error(
            CLI_FAILED, "%s: the camera turns %.4g times what the gyroscope says%s", c->folder, f->gyro_scale,
            fabs(f->gyro_scale * DEGREES - 1) < 0.25 ? ": imu.txt seems to be in degrees a second" : "");
    case CALIBRATION_MIRRORED:
        return cli_error(
            CLI_FAILED,
            "%s: camera and gyroscope turn alike only in a mirror: two axes are swapped, or one has the "
            "wrong sign",
            c->folder);
    }
    return CLI_FAILED;
}

static void rotation_vector(const double rotation[9], double degrees[3]) {
    vector_of_rotation(rotation, degrees);
    for (int i = 0; i < 3; i++) degrees[i] *= DEGREES;
}

static void print_triple(FILE *out, const char *name, const char *unit, const double v[3],
                         const double sigma[3], double factor, int decimals) {
    fprintf(out, "%-26s", name);
    for (int i = 0; i < 3; i++) fprintf(out, " %*.*f", 9, decimals, v[i] * factor);
    fprintf(out, "   +-");
    for (int i = 0; i < 3; i++) fprintf(out, " %.*f", decimals, sigma[i] * factor);
    fprintf(out, "  %s\n", unit);
}

static void print_one(FILE *out, const char *name, const char *unit, double v, double sigma, int decimals) {
    fprintf(out, "%-26s %9.*f   +- %.*f  %s\n", name, decimals, v, decimals, sigma, unit);
}

static void print_table(const struct calibrate *c, FILE *out) {
    const struct calibration *f = &c->found;
    const double *t = f->turning;
    double degrees[3];
    rotation_vector(f->rotation, degrees);
    fprintf(out,
            "tracked %d of %d frames; turning rms %.1f %.1f %.1f deg/s about the camera's x y z; correlation "
            "%.3f\n",
            tracked(c), c->path.count, t[0] * DEGREES, t[1] * DEGREES, t[2] * DEGREES, f->correlation);
    print_triple(out, "imu_to_camera_rotation", "degrees (sigma: about the camera's axes)", degrees,
                 (double[3]){f->rotation_sigma[0] * DEGREES, f->rotation_sigma[1] * DEGREES,
                             f->rotation_sigma[2] * DEGREES},
                 1, 3);
    if (f->square_moved > TELL_MOVED) {
        rotation_vector(f->data_rotation, degrees);
        fprintf(out,
                "    taken as square to within %g degrees; the data alone says %.3f %.3f %.3f   +- %.3f %.3f "
                "%.3f  "
                "degrees\n",
                CALIBRATION_SQUARE_DEG, degrees[0], degrees[1], degrees[2],
                f->data_rotation_sigma[0] * DEGREES, f->data_rotation_sigma[1] * DEGREES,
                f->data_rotation_sigma[2] * DEGREES);
    }
    print_one(out, "imu_clock_offset", "s", f->offset, f->offset_sigma, 5);
    if (f->accelerometer) print_triple(out, "imu_to_camera_translation", "m", f->lever, f->lever_sigma, 1, 4);
    print_triple(out, "gyroscope's bias", "deg/s", f->gyro_bias, f->gyro_bias_sigma, DEGREES, 3);
    print_one(out, "camera / gyroscope turning", "(not written)", f->gyro_scale, f->gyro_scale_sigma, 4);
    if (f->accelerometer)
        print_triple(out, "accelerometer's bias", "m/s^2", f->accel_bias, f->accel_bias_sigma, 1, 3);
    if (!f->offset_observable)
        fprintf(
            out,
            "not observable, left as it was: imu_clock_offset (sigma above %g s: the turning is too even)\n",
            CALIBRATION_OFFSET_SIGMA_S);
    if (!f->accelerometer)
        fprintf(out, "not observable, left as it was: imu_to_camera_translation (no accelerometer)\n");
    else if (!f->lever_observable)
        fprintf(
            out,
            "not observable, left as it was: imu_to_camera_translation (sigma above %g m: it takes faster "
            "turning)\n",
            CALIBRATION_LEVER_SIGMA_M);
}

/* An undetermined axis is determined by rotation about the axes perpendicular to it. */
static void warn_of_doubt(const struct calibrate *c) {
    static const char *const motions[3] = {"nodding (about x)", "panning (about y)", "rolling (about z)"};
    const struct calibration *f = &c->found;
    const double *w = f->data_weak_axis;
    if (f->data_weak_sigma * DEGREES <= WARN_SIGMA_DEG) return;
    char help_by[80] = "";
    for (int i = 0; i < 3; i++) {
        if (w[i] * w[i] > 0.5) continue;
        const size_t used = strlen(help_by);
        snprintf(help_by + used, sizeof help_by - used, "%s%s", used ? ", " : "", motions[i]);
    }
    cli_warning("%s: the data alone leave the mounting open by %.1f degrees (sigma) about the camera's axis "
                "(%.2f %.2f %.2f); brisk motion to and fro would help: %s",
                c->folder, f->data_weak_sigma * DEGREES, w[0], w[1], w[2], help_by);
}

static bool write_rig(const struct calibrate *c) {
    const struct calibration *f = &c->found;
    double v[3];
    rotation_vector(f->rotation, v);
    struct rig_entry entries[] = {
        {.key = "imu_to_camera_rotation"}, {.key = "imu_to_camera_translation"}, {.key = "imu_clock_offset"}};
    snprintf(entries[0].text, sizeof entries[0].text, "%.4f %.4f %.4f # sigma %.4f %.4f %.4f", v[0], v[1],
             v[2], f->rotation_sigma[0] * DEGREES, f->rotation_sigma[1] * DEGREES,
             f->rotation_sigma[2] * DEGREES);
    if (f->lever_observable)
        snprintf(entries[1].text, sizeof entries[1].text, "%.4f %.4f %.4f # sigma %.4f %.4f %.4f",
                 f->lever[0], f->lever[1], f->lever[2], f->lever_sigma[0], f->lever_sigma[1],
                 f->lever_sigma[2]);
    if (f->offset_observable)
        snprintf(entries[2].text, sizeof entries[2].text, "%.6f # sigma %.6f", f->offset, f->offset_sigma);
    return rig_file_update(c->rig, c->output ? c->output : c->rig, entries, 3);
}

/* ---- the command --------------------------------------------------------------------------------------- */

static int calibrate(struct calibrate *c) {
    int status = prepare(c);
    if (!status) playback_choose_voxel(c->recording, &c->settings);
    if (!status) status = track(c, NULL, "without the IMU: frames");
    if (status) return status;
    enum calibration_outcome outcome = solve(c);
    const bool usable =
        outcome == CALIBRATION_DONE || (c->found.weak_sigma > 0 && c->found.weak_sigma < ROUGH_SIGMA);
    if (usable) {
        /* With the rig estimated so far, frames that were lost or wrong without the IMU are tracked, and fast ones
         * better: the clock offset of a fast recording came out 2.1 ms off without this, 0.7 ms with it. */
        if (c->verbose)
            cli_note("%d of %d frames tracked without the IMU, %d stretches left out", tracked(c),
                     c->path.count, c->found.left_out);
        const fathom_recording rig = with_rig(c);
        status = track(c, &rig, "with the IMU: frames");
        if (status) return status;
        outcome = solve(c);
    }
    status = explain(c, outcome);
    if (status) return status;
    const bool to_stdout = c->output && strcmp(c->output, "-") == 0;
    print_table(c, to_stdout ? stderr : stdout);
    warn_of_doubt(c);
    return write_rig(c) ? CLI_DONE : CLI_FAILED;
}

#define AT(field) offsetof(struct calibrate, field)

static const struct option_row own[] = {
    {"--output", "FILE|-", OPTION_TEXT, AT(output),
     .help = "instead of FOLDER/rig.txt, whose other keys are copied; -: stdout"},
    {"--offset-start", "S", OPTION_NUMBER, AT(offset_start), -9e9, 9e9,
     .help = "the clock offset is searched for around this (default 0), seconds"},
    {"--offset-range", "S", OPTION_NUMBER, AT(offset_range), 0.01, 60,
     .help = "and as far as this to both sides (default 0.5)"},
    {"--imu", "FILE", OPTION_TEXT, AT(imu), .help = "overrides imu.txt"},
    {0}};

static const struct option_row said[] = {
    {"--progress", NULL, OPTION_FLAG, AT(progress), .help = "show progress even when stderr is no terminal"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};

static const struct option_group groups[] = {
    {"Calibration", own, 0}, SETTINGS_GROUPS(AT(settings)), {"What is said", said, 0}, {0}};

static int run(const struct command *command, int argc, char **argv) {
    struct calibrate c = {.offset_range = 0.5};
    settings_start(&c.settings);
    int status = options_read(command, &c, argc, argv);
    if (status) return status;
    c.log.verbose = c.verbose;
    cli_catch_interrupt();
    status = calibrate(&c);
    fathom_recording_close(c.recording);
    free(c.rig);
    free(c.pixels);
    free(c.path.points);
    return status;
}

const struct command command_calibrate = {
    .name = "calibrate",
    .summary = "how the IMU sits on the camera, from a recording",
    .about = "Estimates, from a recording folder with imu.txt, the IMU's mounting rotation, the offset of "
             "its clock and, where the motion shows them, its place on the rig; writes them into rig.txt. "
             "What rig.txt says of these is not used. The camera should turn about all its axes, briskly "
             "and to and fro, for ten seconds or more, in front of something it can track.",
    .words = {{"folder", AT(folder)}},
    .groups = groups,
    .later = "--color",
    .output = "A table of values, each with one standard deviation, goes to stdout (with --output - to "
              "stderr). After Ctrl-C rig.txt is untouched.",
    .run = run};
