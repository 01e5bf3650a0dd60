/* fathom simulate: renders a scene along a path into a recording folder. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "fathom/shell/log.h"
#include "fathom_drivers.h"
#include "simulate/imu_model.h"
#include "simulate/simulate_options.h"

#define FAR_M 13.0       /* just below what 16 bits hold */
#define DEPTH_SCALE 5000 /* units per metre: steps of 0.2 mm, 13.1 m at most */

/* ---- The run ---- */

struct run {
    const struct simulate_options *options;
    struct scene scene;
    struct camera_path path;
    struct render_camera camera;
    fathom_sink *sink;
    struct cli_log log;
    char header[1024];
    double start; /* time of the first frame */
    long frames;
    double path_m, turned_deg;
};

static double frame_time(const struct run *run, long frame) {
    /* As depth.txt will say it, so that the pose belongs to the very stamp. */
    return round(1e6 * (run->start + (double)frame / run->options->rate)) * 1e-6;
}

static int prepare_path(struct run *run) {
    const struct simulate_options *o = run->options;
    char error[1024], file[4096];
    if (!o->motion) {
        static const long usual[] = {
            [SCENE_ROOM] = 300, [SCENE_WALL] = 240, [SCENE_DESK] = 200}; /* of 1/30 s */
        camera_path_make(&run->path, &run->scene, o->still, o->speed, o->turn);
        run->frames = o->frames;
        if (!run->frames && o->kind == SCENE_CORRIDOR)
            run->frames = (long)ceil(camera_path_seconds(&run->path) * o->rate);
        else if (!run->frames)
            run->frames =
                lround((double)usual[o->kind] * o->rate / 30.0) + lround(fmax(o->still - 0.5, 0.0) * o->rate);
        if (run->frames > SIMULATE_MOST_FRAMES) run->frames = SIMULATE_MOST_FRAMES;
        return CLI_DONE;
    }
    struct stat a, b;
    if (!stat(o->folder, &a) && !stat(o->motion, &b) && a.st_dev == b.st_dev && a.st_ino == b.st_ino)
        return cli_error(CLI_USAGE, "simulate: --motion and the folder written are the same");
    if (snprintf(file, sizeof file, "%s/groundtruth.txt", o->motion) >= (int)sizeof file)
        return cli_error(CLI_FAILED, "%s: name too long", o->motion);
    if (camera_path_read(&run->path, file, error, sizeof error)) return cli_error(CLI_FAILED, "%s", error);
    run->start = ceil(1e6 * run->path.samples[0].t - 1e-3) * 1e-6;
    const double span = run->path.samples[run->path.count - 1].t - run->start;
    run->frames = (long)fmin(floor(span * o->rate + 1e-6) + 1.0, SIMULATE_MOST_FRAMES);
    if (o->frames && o->frames < run->frames) run->frames = o->frames;
    return CLI_DONE;
}

/* A path that passes through furniture would make nonsense: say so before anything is written. */
static int check_free(const struct run *run) {
    for (long i = 0; i < run->frames; i++) {
        struct camera_pose pose;
        camera_path_pose(&run->path, frame_time(run, i), &pose);
        const double free = scene_distance(&run->scene, pose.position[0], pose.position[1], pose.position[2]);
        if (free < 0.05)
            return cli_error(CLI_FAILED, "the path meets the scene '%s' at %.3f s, x %.2f y %.2f z %.2f",
                             scene_name(run->scene.kind), frame_time(run, i), pose.position[0],
                             pose.position[1], pose.position[2]);
    }
    return CLI_DONE;
}

static void add_motion(struct run *run, const struct camera_pose *before, const struct camera_pose *now) {
    double square = 0.0, trace = 0.0;
    for (int i = 0; i < 3; i++)
        square += (now->position[i] - before->position[i]) * (now->position[i] - before->position[i]);
    for (int i = 0; i < 9; i++) trace += now->rotation[i] * before->rotation[i];
    run->path_m += sqrt(square);
    run->turned_deg += acos(fmin(fmax(0.5 * (trace - 1.0), -1.0), 1.0)) * 57.29577951308232;
}

static void to_units(const float *depth, size_t pixels, uint16_t *units) {
    for (size_t i = 0; i < pixels; i++) {
        const float value = depth[i] * DEPTH_SCALE + 0.5f;
        units[i] = value < 65535.0f ? (uint16_t)value : 0; /* 65535 is invalid, like 0 */
    }
}

/* Of one frame. */
struct picture {
    float *depth, *cosine;
    uint8_t *lost;       /* with blur: 1 where there is no depth */
    uint8_t *confidence; /* NULL: the sensor gives none */
    uint16_t *units;
};

/* The frame at t as the sensor measures it; false when out of memory. */
static bool take_picture(const struct run *run, long frame, double t, const struct camera_pose *pose,
                         const struct picture *p) {
    const struct simulate_options *o = run->options;
    const size_t pixels = (size_t)o->size.width * (size_t)o->size.height;
    float *cosine = o->clean ? NULL : p->cosine;
    const int threads = (int)o->threads;
    const bool rendered =
        o->blur ? exposure_render(&o->exposure, &run->scene, &run->camera, &run->path, t, FAR_M, threads,
                                  o->sensor->has_shadow && !o->clean, p->depth, cosine, p->lost)
                : render_depth(&run->scene, &run->camera, pose, FAR_M, threads, p->depth, cosine);
    if (!rendered) return false;
    const struct sensor_frame measured = {.camera = &run->camera,
                                          .depth = p->depth,
                                          .cosine = cosine,
                                          .confidence = p->confidence,
                                          .seed = (uint64_t)o->seed,
                                          .number = frame,
                                          .seconds = t - run->start};
    if (!o->clean && !o->sensor->measure(&measured)) return false;
    for (size_t i = 0; o->blur && i < pixels; i++) {
        if (!p->lost[i]) continue;
        p->depth[i] = 0.0f;
        if (p->confidence) p->confidence[i] = 0;
    }
    to_units(p->depth, pixels, p->units);
    return true;
}

/* With the error's text, where there is one. */
static int status_of(const struct run *run, int result) {
    return result ? cli_error(CLI_FAILED, "%s", log_reason(&run->log, result)) : CLI_DONE;
}

/* To the nanosecond, for values of whole microseconds. */
static int64_t to_ns(double seconds) {
    return llround(seconds * 1e9);
}

/* The pose first: a frame that depth.txt names then has it, whenever the writing stops. */
static int write_frame(struct run *run, double t, const struct picture *picture,
                       const struct camera_pose *at) {
    fathom_pose pose;
    const fathom_depth_frame frame = {.struct_size = sizeof frame,
                                      .width = run->camera.width,
                                      .height = run->camera.height,
                                      .timestamp_ns = to_ns(t),
                                      .depth = picture->units,
                                      .confidence = picture->confidence};
    memcpy(pose.position, at->position, sizeof pose.position);
    quaternion_of(at->rotation, pose.orientation);
    const int result = fathom_sink_write_pose(run->sink, frame.timestamp_ns, &pose);
    return result ? result : fathom_sink_write_depth(run->sink, &frame);
}

static int render_frames(struct run *run, const struct picture *picture, long *done) {
    struct camera_pose pose, before = {.rotation = {0}};
    for (*done = 0; *done < run->frames; ++*done) {
        if (cli_interrupted()) return CLI_INTERRUPTED;
        const double t = frame_time(run, *done);
        camera_path_pose(&run->path, t, &pose);
        if (!take_picture(run, *done, t, &pose, picture))
            return cli_error(CLI_FAILED, "simulate: out of memory");
        const int result = write_frame(run, t, picture, &pose);
        if (result) return status_of(run, result);
        if (*done) add_motion(run, &before, &pose);
        before = pose;
        cli_progress(*done + 1, NULL);
    }
    return CLI_DONE;
}

/* As text of that many decimals would give it back: what a recording of such a sensor holds. */
static float rounded(double value, double decimals) {
    return (float)(round(value * decimals) / decimals);
}

static int write_samples(struct run *run) {
    const struct simulate_options *o = run->options;
    struct imu_model imu;
    imu_model_make(&imu, o->grade, &o->mounting, o->imu_rate, (uint64_t)o->seed);
    /* A little beyond the last frame, so that an estimate up to it can be interpolated. */
    const double until = frame_time(run, run->frames - 1) + fmax(0.05, 2.0 / o->imu_rate);
    const double count = floor(until * o->imu_rate) + 1.0;
    int result = FATHOM_OK;
    for (double i = 0; i < count && !result; i++) {
        struct imu_sample s;
        fathom_imu_sample sample;
        imu_model_next(&imu, &run->path, &s);
        sample.timestamp_ns = to_ns(s.stamp);
        for (int k = 0; k < 3; k++) {
            sample.gyro[k] = rounded(s.gyro[k], 1e9);
            sample.accel[k] = rounded(s.accel[k], 1e8);
        }
        result = fathom_sink_write_imu(run->sink, &sample, 1);
    }
    return result ? result : fathom_sink_flush(run->sink);
}

/* All but the frames. */
static int write_rest(struct run *run) {
    const struct simulate_options *o = run->options;
    const struct render_camera *c = &run->camera;
    const struct imu_mounting *m = &o->mounting;
    fathom_sink_rig rig = {
        .struct_size = sizeof rig,
        .has_imu = !o->motion,
        .camera =
            {.width = c->width, .height = c->height, .fx = c->fx, .fy = c->fy, .cx = c->cx, .cy = c->cy},
        .depth_units_per_metre = DEPTH_SCALE,
        .imu_clock_offset_ns = to_ns(m->clock_offset),
        .gravity = STANDARD_GRAVITY,
        .lines_of = o->motion,
        .min_confidence = o->clean ? 0 : o->sensor->min_confidence};
    memcpy(rig.imu_to_camera_rotation_deg, m->rotation_deg, sizeof m->rotation_deg);
    memcpy(rig.imu_to_camera_translation_m, m->translation, sizeof m->translation);
    int result = fathom_sink_write_rig(run->sink, &rig);
    if (!result) result = o->motion ? fathom_sink_copy_imu(run->sink, o->motion) : write_samples(run);
    return status_of(run, result);
}

/* depth.txt of a simulation says so in its first line; one that is in the way may go. */
static bool was_simulated(const char *folder) {
    char path[4096], line[256] = "";
    FILE *file =
        snprintf(path, sizeof path, "%s/depth.txt", folder) < (int)sizeof path ? fopen(path, "r") : NULL;
    if (!file) return false;
    const bool read = fgets(line, sizeof line, file) != NULL;
    fclose(file);
    return read && !strncmp(line, "# fathom simulate", 17);
}

static int open_sink(struct run *run) {
    const struct simulate_options *o = run->options;
    const fathom_sink_options options = {.struct_size = sizeof options,
                                         .force = o->force || was_simulated(o->folder),
                                         .header = run->header,
                                         .log = log_message,
                                         .log_user = &run->log};
    return status_of(run, fathom_sink_open(&run->sink, o->folder, &options));
}

static int write_recording(struct run *run) {
    const struct simulate_options *o = run->options;
    if (open_sink(run)) return CLI_FAILED;
    const size_t pixels = (size_t)o->size.width * (size_t)o->size.height;
    float *depth = malloc(2 * pixels * sizeof *depth);
    uint16_t *units = malloc(pixels * sizeof *units);
    uint8_t *lost = malloc(2 * pixels);
    const bool sure = !o->clean && o->sensor->min_confidence > 0;
    const struct picture picture = {depth, depth + pixels, lost, sure ? lost + pixels : NULL, units};
    long done = 0;
    int status = depth && units && lost ? write_rest(run) : cli_error(CLI_FAILED, "simulate: out of memory");
    if (status == CLI_DONE) {
        cli_progress_start("simulate", run->frames, o->progress);
        status = render_frames(run, &picture, &done);
        cli_progress_end();
    }
    const int closed = fathom_sink_close(run->sink);
    if (closed && (status == CLI_DONE || status == CLI_INTERRUPTED)) status = status_of(run, closed);
    free(depth);
    free(units);
    free(lost);
    if (status == CLI_DONE || status == CLI_INTERRUPTED)
        printf("frames=%ld path_m=%.3f turned_deg=%.1f folder=%s\n", done, run->path_m, run->turned_deg,
               o->folder);
    return status;
}

/* The command as it was given, for the comments at the top of the files. */
static void make_header(struct run *run, int argc, char **argv) {
    size_t used = (size_t)snprintf(run->header, sizeof run->header, "fathom");
    for (int i = 0; i < argc && used < sizeof run->header; i++)
        used += (size_t)snprintf(run->header + used, sizeof run->header - used, " %s", argv[i]);
    for (char *c = run->header; *c; c++)
        if (*c == '\n' || *c == '\r') *c = ' ';
    used = strlen(run->header);
    snprintf(run->header + used, sizeof run->header - used, " (scene %s, seed %ld%s)",
             scene_name(run->options->kind), run->options->seed, run->options->clean ? ", clean" : "");
    used = strlen(run->header);
    if (!run->options->motion)
        snprintf(run->header + used, sizeof run->header - used, "\nIMU: %s (%s), %g samples a second",
                 run->options->grade->name, run->options->grade->part, run->options->imu_rate);
}

static int simulate(const struct command *command, int argc, char **argv) {
    struct simulate_options options;
    struct run run = {.options = &options};
    int status = simulate_options_read(&options, command, argc, argv);
    if (status) return status;
    make_header(&run, argc, argv);
    if (!scene_make(&run.scene, options.kind, (uint64_t)options.seed, options.length))
        return cli_error(CLI_FAILED, "simulate: out of memory");
    run.camera = sensor_camera(options.sensor, options.size.width, options.size.height);
    cli_catch_interrupt();
    status = prepare_path(&run);
    if (status == CLI_DONE) status = check_free(&run);
    if (status == CLI_DONE) status = write_recording(&run);
    camera_path_free(&run.path);
    scene_free(&run.scene);
    return status;
}

const struct command command_simulate = {
    .name = "simulate",
    .summary = "render a scene into a recording, with its ground truth",
    .about = "Renders a scene into a recording FOLDER: depth, IMU samples, calibration and ground truth. "
             "SCENE: room (furnished and closed), wall (two seconds of the way see nothing but bare wall), "
             "desk (a desk top, half a metre to 1.2 m away), corridor (of any length)",
    .words = {{"scene", offsetof(struct simulate_options, scene)},
              {"folder", offsetof(struct simulate_options, folder)}},
    .groups = simulate_groups,
    .later = "--imu-error --texture",
    .output = "The last line on stdout is: frames=N path_m=X turned_deg=X folder=FOLDER",
    .run = simulate};
