/* fathom simulate: renders a scene along a path into a recording folder. */
#include "fathom/shell/cli.h"

#include <getopt.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "simulate/exposure.h"
#include "fathom/recording_writer.h"
#include "simulate/sensor_noise.h"

#define FRAME_RATE 30.0
#define EXPOSURE_S 0.008 /* in a room without daylight; no one sensor's figure */
#define ROLLING_S 0.010
#define FAR_M 13.0          /* just below what 16 bits hold */
#define MOST_FRAMES 1000000 /* nine hours */

static const char help[] =
    "usage: fathom simulate SCENE FOLDER [options]\n"
    "\n"
    "Renders a scene into a recording FOLDER: depth, IMU samples, calibration and ground truth.\n"
    "SCENE: room (furnished and closed), wall (two seconds of the way see nothing but bare wall),\n"
    "       desk (a desk top, half a metre to 1.2 m away), corridor (of any length)\n"
    "\n"
    "    --seed N               the furniture, the path, the noise (default 1)\n"
    "    --clean                no sensor noise; an ideal IMU unless --imu-grade is given\n"
    "    --motion FOLDER2       along FOLDER2/groundtruth.txt; copies its imu.txt and rig.txt\n"
    "    --frames N             default: room 300, wall 240, desk 200, corridor by its length,\n"
    "                           with --motion as long as it lasts\n"
    "    --size WxH             default 640x480\n"
    "    --length M             the corridor's, 6 to 10000 metres (default 12)\n"
    "    --speed F              times the usual pace of 0.3 to 0.5 m/s and 25 deg/s (default 1)\n"
    "    --turn F               times the usual rate of turning (default: as --speed)\n"
    "    --still S              seconds of standing still at the start (default 0.5)\n"
    "    --blur                 what motion does while a depth picture is taken: a pixel reads the mean of "
    "what\n"
    "                           passes over it, nothing where an edge does, and rows are taken one after\n"
    "                           another; a stamp is the middle of the middle row's exposure\n"
    "    --exposure S           how long a row is exposed, with --blur (default 0.008; 0 to 0.033)\n"
    "    --rolling S            from the first row to the last, with --blur (default 0.01; 0 to 0.033)\n"
    "    --imu-grade NAME       consumer (Bosch BMI270; default), phone, ideal\n"
    "    --imu-rate HZ          samples a second (default 200)\n"
    "    --imu-rotation X,Y,Z   mounting, rotation vector in degrees, v_camera = R v_imu (default "
    "0.8,-1.2,90)\n"
    "    --imu-translation X,Y,Z   the IMU's origin in camera axes, metres (default 0.025,-0.01,0.004)\n"
    "    --imu-clock-offset S   seconds to add to an IMU stamp to get the depth clock (default 0)\n"
    "    --threads N            default: as many as the machine has\n"
    "    --force                writes into a folder that holds other things (a recording there is "
    "replaced)\n"
    "    --progress             shows progress even when stderr is no terminal\n"
    "\n"
    "The last line on stdout is: frames=N path_m=X turned_deg=X folder=FOLDER\n";

struct options {
    const char *folder, *motion;
    enum scene_kind kind;
    const struct imu_grade *grade;
    struct imu_mounting mounting;
    struct exposure exposure;
    double length, speed, turn, still, imu_rate;
    long seed, frames, threads;
    int width, height;
    bool clean, blur, force, progress;
};

/* ---- Options ---- */

enum {
    OPTION_SEED = 256,
    OPTION_CLEAN,
    OPTION_MOTION,
    OPTION_FRAMES,
    OPTION_SIZE,
    OPTION_LENGTH,
    OPTION_SPEED,
    OPTION_TURN,
    OPTION_STILL,
    OPTION_BLUR,
    OPTION_EXPOSURE,
    OPTION_ROLLING,
    OPTION_GRADE,
    OPTION_RATE,
    OPTION_ROTATION,
    OPTION_TRANSLATION,
    OPTION_OFFSET,
    OPTION_THREADS,
    OPTION_FORCE,
    OPTION_PROGRESS,
    OPTION_HELP
};

static const struct option long_options[] = {
    {"seed", required_argument, NULL, OPTION_SEED},
    {"clean", no_argument, NULL, OPTION_CLEAN},
    {"motion", required_argument, NULL, OPTION_MOTION},
    {"frames", required_argument, NULL, OPTION_FRAMES},
    {"size", required_argument, NULL, OPTION_SIZE},
    {"length", required_argument, NULL, OPTION_LENGTH},
    {"speed", required_argument, NULL, OPTION_SPEED},
    {"turn", required_argument, NULL, OPTION_TURN},
    {"still", required_argument, NULL, OPTION_STILL},
    {"blur", no_argument, NULL, OPTION_BLUR},
    {"exposure", required_argument, NULL, OPTION_EXPOSURE},
    {"rolling", required_argument, NULL, OPTION_ROLLING},
    {"imu-grade", required_argument, NULL, OPTION_GRADE},
    {"imu-rate", required_argument, NULL, OPTION_RATE},
    {"imu-rotation", required_argument, NULL, OPTION_ROTATION},
    {"imu-translation", required_argument, NULL, OPTION_TRANSLATION},
    {"imu-clock-offset", required_argument, NULL, OPTION_OFFSET},
    {"threads", required_argument, NULL, OPTION_THREADS},
    {"force", no_argument, NULL, OPTION_FORCE},
    {"progress", no_argument, NULL, OPTION_PROGRESS},
    {"help", no_argument, NULL, OPTION_HELP},
    {NULL, 0, NULL, 0},
};

static bool parse_triple(const char *option, const char *text, double low, double high, double value[3]) {
    char copy[256], *part = copy;
    if (snprintf(copy, sizeof copy, "%s", text) >= (int)sizeof copy) part = NULL;
    for (int i = 0; i < 3; i++) {
        char *number = part ? strsep(&part, ",") : NULL;
        if (!number || (i == 2 && part)) {
            cli_error(CLI_USAGE, "%s: '%s' is not three numbers with commas between", option, text);
            return false;
        }
        if (!cli_parse_double(option, number, low, high, &value[i])) return false;
    }
    return true;
}

static bool parse_size(const char *text, int *width, int *height) {
    int used = 0;
    if (sscanf(text, "%dx%d%n", width, height, &used) == 2 && !text[used] && *width >= 16 && *height >= 16 &&
        *width <= 4096 && *height <= 4096)
        return true;
    cli_error(CLI_USAGE, "--size: '%s' is not WxH with both from 16 to 4096", text);
    return false;
}

static bool parse_grade(const char *text, const struct imu_grade **grade) {
    *grade = imu_grade_of(text);
    if (!*grade) cli_error(CLI_USAGE, "--imu-grade: '%s' is none of consumer, phone, ideal", text);
    return *grade != NULL;
}

static bool take_option(struct options *o, int option) {
    switch (option) {
    case OPTION_SEED: return cli_parse_long("--seed", optarg, 0, 1000000000L, &o->seed);
    case OPTION_CLEAN: return o->clean = true;
    case OPTION_MOTION: o->motion = optarg; return true;
    case OPTION_FRAMES: return cli_parse_long("--frames", optarg, 1, MOST_FRAMES, &o->frames);
    case OPTION_SIZE: return parse_size(optarg, &o->width, &o->height);
    case OPTION_LENGTH: return cli_parse_double("--length", optarg, 6.0, 10000.0, &o->length);
    case OPTION_SPEED: return cli_parse_double("--speed", optarg, 0.01, 20.0, &o->speed);
    case OPTION_TURN: return cli_parse_double("--turn", optarg, 0.0, 40.0, &o->turn);
    case OPTION_STILL: return cli_parse_double("--still", optarg, 0.0, 3600.0, &o->still);
    case OPTION_BLUR: return o->blur = true;
    case OPTION_EXPOSURE: return cli_parse_double("--exposure", optarg, 0.0, 0.033, &o->exposure.exposure_s);
    case OPTION_ROLLING: return cli_parse_double("--rolling", optarg, 0.0, 0.033, &o->exposure.rolling_s);
    case OPTION_GRADE: return parse_grade(optarg, &o->grade);
    case OPTION_RATE: return cli_parse_double("--imu-rate", optarg, 10.0, 8000.0, &o->imu_rate);
    case OPTION_ROTATION:
        return parse_triple("--imu-rotation", optarg, -360.0, 360.0, o->mounting.rotation_deg);
    case OPTION_TRANSLATION:
        return parse_triple("--imu-translation", optarg, -10.0, 10.0, o->mounting.translation);
    case OPTION_OFFSET:
        return cli_parse_double("--imu-clock-offset", optarg, -10.0, 10.0, &o->mounting.clock_offset);
    case OPTION_THREADS: return cli_parse_long("--threads", optarg, 1, 1024, &o->threads);
    case OPTION_FORCE: return o->force = true;
    case OPTION_PROGRESS: return o->progress = true;
    default: return false;
    }
}

/* CLI_DONE with *helped set when there is nothing left to do. */
static int parse_options(int argc, char **argv, struct options *o, bool *helped) {
    *o = (struct options){
        .length = 12.0,
        .speed = 1.0,
        .turn = -1.0,
        .still = 0.5,
        .imu_rate = 200.0,
        .exposure = {-1.0, -1.0},
        .seed = 1,
        .width = 640,
        .height = 480,
        .threads = sysconf(_SC_NPROCESSORS_ONLN),
        .mounting = {.rotation_deg = {0.8, -1.2, 90.0}, .translation = {0.025, -0.010, 0.004}}};
    if (o->threads < 1) o->threads = 1;
    optind = 0; /* begin anew, whoever used getopt before */
    opterr = 0;
    for (int option; (option = getopt_long(argc, argv, ":h", long_options, NULL)) != -1;) {
        if (option == OPTION_HELP || option == 'h') {
            fputs(help, stdout);
            *helped = true;
            return CLI_DONE;
        }
        if (option == ':') return cli_error(CLI_USAGE, "simulate: %s needs a value", argv[optind - 1]);
        if (option == '?')
            return cli_error(CLI_USAGE, "simulate: option '%s' isn't understood", argv[optind - 1]);
        if (!take_option(o, option)) return CLI_USAGE;
    }
    if (argc - optind != 2)
        return cli_error(CLI_USAGE, "simulate: give a scene and a folder; --help says more");
    if (!scene_kind_of(argv[optind], &o->kind))
        return cli_error(CLI_USAGE, "simulate: no scene '%s'; there are room, wall, desk, corridor",
                         argv[optind]);
    o->folder = argv[optind + 1];
    if (!*o->folder) return cli_error(CLI_USAGE, "simulate: the folder has no name");
    if (o->turn < 0.0) o->turn = o->speed;
    if (!o->blur && (o->exposure.exposure_s >= 0.0 || o->exposure.rolling_s >= 0.0))
        return cli_error(CLI_USAGE, "simulate: --exposure and --rolling go with --blur");
    if (o->exposure.exposure_s < 0.0) o->exposure.exposure_s = EXPOSURE_S;
    if (o->exposure.rolling_s < 0.0) o->exposure.rolling_s = ROLLING_S;
    if (!o->grade) o->grade = imu_grade_of(o->clean ? "ideal" : "consumer");
    return CLI_DONE;
}

/* ---- The run ---- */

struct run {
    const struct options *options;
    struct scene scene;
    struct camera_path path;
    struct render_camera camera;
    struct recording_writer writer;
    char header[1024];
    double start; /* time of the first frame */
    long frames;
    double path_m, turned_deg;
};

/* A 640x480 Kinect's, scaled; a pixel's centre has whole coordinates, so its edges lie at halves. */
static struct render_camera camera_of(int width, int height) {
    const double x = width / 640.0, y = height / 480.0;
    return (struct render_camera){width, height, 585.0 * x, 585.0 * y, 320.5 * x - 0.5, 240.5 * y - 0.5};
}

static double frame_time(const struct run *run, long frame) {
    /* As depth.txt will say it, so that the pose belongs to the very stamp. */
    return round(1e6 * (run->start + (double)frame / FRAME_RATE)) * 1e-6;
}

static int prepare_path(struct run *run) {
    const struct options *o = run->options;
    char error[1024], file[4096];
    if (!o->motion) {
        static const long usual[] = {[SCENE_ROOM] = 300, [SCENE_WALL] = 240, [SCENE_DESK] = 200};
        camera_path_make(&run->path, &run->scene, o->still, o->speed, o->turn);
        run->frames = o->frames;
        if (!run->frames && o->kind == SCENE_CORRIDOR)
            run->frames = (long)ceil(camera_path_seconds(&run->path) * FRAME_RATE);
        else if (!run->frames)
            run->frames = usual[o->kind] + lround(fmax(o->still - 0.5, 0.0) * FRAME_RATE);
        if (run->frames > MOST_FRAMES) run->frames = MOST_FRAMES;
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
    run->frames = (long)fmin(floor(span * FRAME_RATE + 1e-6) + 1.0, MOST_FRAMES);
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
        const float value = depth[i] * RECORDING_DEPTH_SCALE + 0.5f;
        units[i] = value < 65535.0f ? (uint16_t)value : 0; /* 65535 is invalid, like 0 */
    }
}

/* Of one frame. */
struct picture {
    float *depth, *cosine;
    uint8_t *lost; /* with blur: 1 where there is no depth */
    uint16_t *units;
};

/* The frame at t as the sensor measures it; false when out of memory. */
static bool take_picture(const struct run *run, long frame, double t, const struct camera_pose *pose,
                         const struct picture *p) {
    const struct options *o = run->options;
    const size_t pixels = (size_t)o->width * (size_t)o->height;
    float *cosine = o->clean ? NULL : p->cosine;
    const int threads = (int)o->threads;
    const bool rendered =
        o->blur ? exposure_render(&o->exposure, &run->scene, &run->camera, &run->path, t, FAR_M, threads,
                                  !o->clean, p->depth, cosine, p->lost)
                : render_depth(&run->scene, &run->camera, pose, FAR_M, threads, p->depth, cosine);
    if (!rendered) return false;
    if (!o->clean && !sensor_measure(p->depth, cosine, o->width, o->height, o->width / 640.0,
                                     (uint64_t)o->seed, (uint64_t)frame))
        return false;
    for (size_t i = 0; o->blur && i < pixels; i++)
        if (p->lost[i]) p->depth[i] = 0.0f;
    to_units(p->depth, pixels, p->units);
    return true;
}

static int render_frames(struct run *run, const struct picture *picture, long *done) {
    struct camera_pose pose, before = {.rotation = {0}};
    for (*done = 0; *done < run->frames; ++*done) {
        if (cli_interrupted()) return CLI_INTERRUPTED;
        const double t = frame_time(run, *done);
        camera_path_pose(&run->path, t, &pose);
        if (!take_picture(run, *done, t, &pose, picture))
            return cli_error(CLI_FAILED, "simulate: out of memory");
        if (recording_frame(&run->writer, t, picture->units, &run->camera, &pose))
            return cli_error(CLI_FAILED, "%s", run->writer.error);
        if (*done) add_motion(run, &before, &pose);
        before = pose;
        cli_progress(*done + 1, NULL);
    }
    return CLI_DONE;
}

static int write_rest(struct run *run) {
    const struct options *o = run->options;
    struct recording_writer *w = &run->writer;
    const struct render_camera *c = &run->camera;
    if (recording_calibration(w, (const double[]){c->fx, c->fy, c->cx, c->cy}, 4))
        return cli_error(CLI_FAILED, "%s", w->error);
    if (o->motion) return recording_copy_imu(w, o->motion) ? cli_error(CLI_FAILED, "%s", w->error) : CLI_DONE;
    struct imu_model imu;
    imu_model_make(&imu, o->grade, &o->mounting, o->imu_rate, (uint64_t)o->seed);
    /* A little beyond the last frame, so that an estimate up to it can be interpolated. */
    const double until = frame_time(run, run->frames - 1) + fmax(0.05, 2.0 / o->imu_rate);
    return recording_imu(w, &imu, &run->path, until, run->header) ? cli_error(CLI_FAILED, "%s", w->error)
                                                                  : CLI_DONE;
}

static int write_recording(struct run *run) {
    const struct options *o = run->options;
    if (recording_open(&run->writer, o->folder, o->force, run->header)) {
        const int status = cli_error(CLI_FAILED, "%s", run->writer.error);
        recording_close(&run->writer);
        return status;
    }
    const size_t pixels = (size_t)o->width * (size_t)o->height;
    float *depth = malloc(2 * pixels * sizeof *depth);
    uint16_t *units = malloc(pixels * sizeof *units);
    uint8_t *lost = malloc(pixels);
    const struct picture picture = {depth, depth + pixels, lost, units};
    long done = 0;
    int status = depth && units && lost ? write_rest(run) : cli_error(CLI_FAILED, "simulate: out of memory");
    if (status == CLI_DONE) {
        cli_progress_start("simulate", run->frames, o->progress);
        status = render_frames(run, &picture, &done);
        cli_progress_end();
    }
    if (recording_close(&run->writer) && (status == CLI_DONE || status == CLI_INTERRUPTED))
        status = cli_error(CLI_FAILED, "%s", run->writer.error);
    free(depth);
    free(units);
    free(lost);
    if (status == CLI_DONE || status == CLI_INTERRUPTED)
        printf("frames=%ld path_m=%.3f turned_deg=%.1f folder=%s\n", done, run->path_m, run->turned_deg,
               o->folder);
    return status;
}

int command_simulate(int argc, char **argv) {
    struct options options;
    bool helped = false;
    struct run run = {.options = &options};
    size_t used =
        (size_t)snprintf(run.header, sizeof run.header, "fathom"); /* before getopt sorts the arguments */
    for (int i = 0; i < argc && used < sizeof run.header; i++)
        used += (size_t)snprintf(run.header + used, sizeof run.header - used, " %s", argv[i]);
    for (char *c = run.header; *c; c++)
        if (*c == '\n' || *c == '\r') *c = ' ';

    int status = parse_options(argc, argv, &options, &helped);
    if (status != CLI_DONE || helped) return status;
    used = strlen(run.header);
    snprintf(run.header + used, sizeof run.header - used, " (scene %s, seed %ld%s)", scene_name(options.kind),
             options.seed, options.clean ? ", clean" : "");
    if (!scene_make(&run.scene, options.kind, (uint64_t)options.seed, options.length))
        return cli_error(CLI_FAILED, "simulate: out of memory");
    run.camera = camera_of(options.width, options.height);
    cli_catch_interrupt();
    status = prepare_path(&run);
    if (status == CLI_DONE) status = check_free(&run);
    if (status == CLI_DONE) status = write_recording(&run);
    camera_path_free(&run.path);
    scene_free(&run.scene);
    return status;
}
