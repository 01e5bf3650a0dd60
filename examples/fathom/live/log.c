/* fathom log: records live sources into a folder. (shell/log.c is about messages.) */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/live/live_options.h"
#include "fathom/live/live_rig.h"
#include "fathom/shell/log.h"
#include "fathom/shell/clock.h"
#include "fathom/live/rig_watch.h"

#include <inttypes.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#define SLICE_MS 100 /* interval of checks for the end */
/* The disk may pause for as long as these last; then the oldest are dropped. */
#define FRAMES_KEPT 30
#define SAMPLES_KEPT 16384
#define LINE_NS 1000000000 /* between two lines of JSON */

struct logging {
    struct live_options live;
    const char *folder;
    bool force;
    struct cli_log log;
    struct live_rig rig;
    struct rig_watch watch;
    fathom_sink *sink;
    atomic_bool imu_failed; /* writing imu.txt has failed */
    fathom_config config; /* size, intrinsics, depth scale, mounting */
    int64_t end_ns;       /* CLOCK_MONOTONIC */
    int64_t line_ns;      /* when the last line of JSON was printed */
    bool drops_said;
};

/* ---- before the first frame ---- */

/* Clearing the folder must not remove files to be read. */
static bool is_read_from(const struct logging *logging, const char *place) {
    struct stat to, from;
    if (!place || stat(logging->folder, &to)) return false;
    if (strncmp(place, "folder:", 7) == 0) place += 7;
    return stat(place, &from) == 0 && to.st_dev == from.st_dev && to.st_ino == from.st_ino;
}

static void describe(const char *what, fathom_source *source, char *text, size_t room) {
    fathom_source_status status = FATHOM_STRUCT(fathom_source_status);
    fathom_source_get_status(source, &status);
    snprintf(text, room, "; %s: %s%s%s", what, status.name, *status.serial ? ", serial " : "", status.serial);
}

static int open_folder(struct logging *logging) {
    const struct live_options *live = &logging->live;
    char header[640], depth[256], imu[256] = "";
    if (is_read_from(logging, live->depth) || is_read_from(logging, live->imu) ||
        is_read_from(logging, live->rig))
        return cli_error(CLI_USAGE, "%s: can't be read from and recorded into", logging->folder);
    describe("depth", logging->rig.depth, depth, sizeof depth);
    if (logging->rig.imu) describe("IMU", logging->rig.imu, imu, sizeof imu);
    snprintf(header, sizeof header, "fathom log%s%s", depth, imu);
    for (char *c = header; *c; c++)
        if (*c == '\n' || *c == '\r') *c = ' ';
    const fathom_sink_options options = {.struct_size = sizeof options,
                                         .force = logging->force,
                                         .header = header,
                                         .log = log_message,
                                         .log_user = &logging->log};
    const fathom_sink_rig rig = {.struct_size = sizeof rig,
                                 .camera = logging->config.depth_camera,
                                 .depth_units_per_metre = (double)logging->config.depth_units_per_metre,
                                 .lines_of = live_rig_mounting(&logging->rig, live)};
    log_clear(&logging->log);
    int result = fathom_sink_open(&logging->sink, logging->folder, &options);
    if (!result) result = fathom_sink_write_rig(logging->sink, &rig);
    return result ? cli_error(CLI_FAILED, "%s", log_reason(&logging->log, result)) : CLI_DONE;
}

static fathom_sink_status written(const struct logging *logging) {
    fathom_sink_status status = FATHOM_STRUCT(fathom_sink_status);
    fathom_sink_get_status(logging->sink, &status);
    return status;
}

static int64_t bytes_of(const fathom_sink_status *status) {
    return status->frame_bytes + status->imu_bytes;
}

/* ---- what is said ---- */

static int64_t missing(const fathom_source_status *status) {
    return status->lost + status->malformed;
}

static void print_json_line(struct logging *logging) {
    const fathom_source_status *depth = &logging->watch.depth, *imu = &logging->watch.imu;
    const fathom_sink_status w = written(logging);
    printf("{\"t\":%.9f,\"frames\":%" PRId64 ",\"samples\":%" PRId64 ",\"bytes\":%" PRId64
           ",\"depth\":\"%s\","
           "\"rate_hz\":%.2f,\"frames_dropped\":%" PRId64 ",\"frames_missing\":%" PRId64 ",\"imu\":\"%s\","
           "\"imu_rate_hz\":%.2f,\"samples_dropped\":%" PRId64 ",\"samples_missing\":%" PRId64 "}\n",
           (double)w.last_ns * 1e-9, w.frames, w.samples, bytes_of(&w),
           fathom_source_state_name(depth->state), depth->rate_hz, depth->frames_dropped, missing(depth),
           logging->rig.imu ? fathom_source_state_name(imu->state) : "none", imu->rate_hz,
           imu->samples_dropped, missing(imu));
    fflush(stdout);
}

static void draw_line(const struct logging *logging) {
    const fathom_source_status *depth = &logging->watch.depth, *imu = &logging->watch.imu;
    const fathom_sink_status w = written(logging);
    char line[256], samples[96] = "no IMU";
    if (logging->rig.imu)
        snprintf(samples, sizeof samples, "IMU %s %.0f/s", fathom_source_state_name(imu->state),
                 imu->rate_hz);
    snprintf(line, sizeof line, "%s %.1f/s  %s  %" PRId64 " samples  %.1f MB  %" PRId64 " dropped",
             fathom_source_state_name(depth->state), depth->rate_hz, samples, w.samples,
             1e-6 * (double)bytes_of(&w), depth->frames_dropped + imu->samples_dropped);
    cli_progress((long)w.frames, line);
}

static void say_drops(struct logging *logging) {
    const int64_t drops = logging->watch.depth.frames_dropped + logging->watch.imu.samples_dropped;
    if (drops > 0 && !logging->drops_said)
        cli_warning("%s: writing is too slow: frames or samples are dropped, and counted", logging->folder);
    logging->drops_said = drops > 0;
}

static void report(struct logging *logging) {
    const int64_t now_ns = clock_now_ns();
    rig_watch_glance(&logging->watch, &logging->rig);
    say_drops(logging);
    draw_line(logging);
    if (!logging->live.json || now_ns - logging->line_ns < LINE_NS) return;
    logging->line_ns = now_ns;
    print_json_line(logging);
}

static void report_end(struct logging *logging) {
    const fathom_sink_status w = written(logging);
    cli_progress_end();
    rig_watch_look(&logging->watch, &logging->rig);
    say_drops(logging);
    const fathom_source_status *depth = &logging->watch.depth, *imu = &logging->watch.imu;
    if (missing(depth)) cli_warning("%" PRId64 " frames never came or made no sense", missing(depth));
    if (missing(imu)) cli_warning("%" PRId64 " samples never came or made no sense", missing(imu));
    printf(logging->live.json
               ? "{\"summary\":{\"frames\":%" PRId64 ",\"samples\":%" PRId64 ",\"frames_dropped\":%" PRId64
                 ",\"samples_dropped\":%" PRId64 ",\"bytes\":%" PRId64 ",\"seconds\":%.3f}}\n"
               : "frames=%" PRId64 " samples=%" PRId64 " frames_dropped=%" PRId64 " samples_dropped=%" PRId64
                 " bytes=%" PRId64 " seconds=%.3f\n",
           w.frames, w.samples, depth->frames_dropped, imu->samples_dropped, bytes_of(&w),
           1e-9 * (double)(w.last_ns - w.first_ns));
}

/* ---- frames and samples ---- */

/* A live_rig_take, on the rig's thread. */
static void take_samples(void *user, const fathom_imu_sample *samples, int count) {
    struct logging *logging = user;
    if (!logging->imu_failed && fathom_sink_write_imu(logging->sink, samples, count))
        logging->imu_failed = true;
}

static bool is_over(const struct logging *logging) {
    return cli_interrupted() || clock_now_ns() >= logging->end_ns;
}

/* False when there are enough, or writing has failed. */
static bool take_frame(struct logging *logging, const fathom_source_frame *frame) {
    const long frames = logging->live.frames;
    if (fathom_sink_write_depth(logging->sink, frame->depth)) return false;
    if (logging->rig.unpaced) live_rig_push_until(&logging->rig, frame->depth->timestamp_ns);
    report(logging);
    return !logging->imu_failed && !(frames && written(logging).frames >= frames);
}

static int take_frames(struct logging *logging) {
    const double duration = logging->live.duration;
    fathom_source *depth = logging->rig.depth;
    fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
    int waited = FATHOM_OK;
    bool more = true;
    logging->end_ns = duration > 0 ? clock_now_ns() + (int64_t)(1e9 * duration) : INT64_MAX;
    while (more && !is_over(logging)) {
        waited = fathom_source_wait(depth, SLICE_MS);
        if (waited && waited != FATHOM_ERROR_TIMEOUT) break;
        report(logging);
        while (more && !is_over(logging) && fathom_source_read_depth(depth, &frame) == FATHOM_OK)
            more = take_frame(logging, &frame);
        if (logging->imu_failed) more = false;
    }
    /* Data that has arrived until now is still written. */
    fathom_source_stop(depth);
    while (more && fathom_source_read_depth(depth, &frame) == FATHOM_OK) more = take_frame(logging, &frame);
    const fathom_sink_status w = written(logging);
    if (w.frames) live_rig_settle(&logging->rig, w.last_ns);
    return live_rig_end(waited, &logging->log);
}

#define AT(field) offsetof(struct logging, field)

static const struct option_row own[] = {
    {"--force", NULL, OPTION_FLAG, AT(force),
     .help = "record into a folder that isn't empty; a recording in it is removed"},
    {0}};

static const struct option_group groups[] = {{"Rig", live_options_rig, AT(live)},
                                             {"Recording", own, 0},
                                             {"What is said", live_options_said, AT(live)},
                                             {0}};

static int run(const struct command *command, int argc, char **argv) {
    static struct logging logging;
    live_options_start(&logging.live);
    logging.live.frame_capacity = FRAMES_KEPT;
    logging.live.imu_capacity = SAMPLES_KEPT;
    int status = options_read(command, &logging, argc, argv);
    if (status) return status;
    logging.log.verbose = logging.live.verbose;
    fathom_config_init(&logging.config);
    cli_catch_interrupt();
    signal(SIGXFSZ, SIG_IGN); /* at the file size limit, writing then fails with a message instead of a kill */

    status = live_rig_open(&logging.rig, &logging.live, &logging.log);
    if (!status) status = live_rig_configure(&logging.rig, &logging.live, &logging.config, &logging.log);
    if (!status) status = open_folder(&logging);
    cli_progress_start("frames", 0, logging.live.progress);
    if (!status)
        status = live_rig_start(&logging.rig, logging.config.imu_clock_offset_ns, take_samples, &logging,
                                &logging.log);
    if (!status) {
        status = take_frames(&logging);
        live_rig_stop(&logging.rig);
        fathom_sink_flush(logging.sink);
        report_end(&logging);
        const int result = fathom_sink_close(logging.sink);
        if (result) status = cli_error(CLI_FAILED, "%s", log_reason(&logging.log, result));
        if (!status && cli_interrupted()) status = CLI_INTERRUPTED;
    } else {
        fathom_sink_close(logging.sink);
    }
    live_rig_close(&logging.rig);
    return status;
}

const struct command command_log = {
    .name = "log",
    .summary = "record what a live rig gives, for a replay",
    .about = "Records what a depth camera and an inertial sensor give into a recording folder (depth.txt, "
             "depth/*.png, imu.txt, calibration.txt, rig.txt), for fathom replay.",
    .words = {{"folder", AT(folder)}},
    .groups = groups,
    .output = "The last line on stdout: frames= samples= frames_dropped= samples_dropped= bytes= seconds=\n"
              "dropped: because the disk was too slow; seconds: from the first to the last frame.",
    .run = run};
