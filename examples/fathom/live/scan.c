/* fathom scan: live sources go through the library as they come. */
#include "fathom/files/block_store.h"
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/live/live_rig.h"
#include "fathom/shell/log.h"
#include "fathom/shell/clock.h"
#include "fathom/files/ply.h"
#include "fathom/shell/settings.h"
#include "fathom/live/scan_report.h"
#include "fathom/files/stats.h"
#include "fathom/files/trajectory.h"

#include <inttypes.h>
#include <signal.h>
#include <stdlib.h>

#define SLICE_MS 100 /* between two looks whether to end */

struct scan {
    struct live_options live;
    struct settings settings;
    const char *trajectory_file, *mesh_file, *stats_file; /* to write, or NULL */
    struct cli_log log;     /* the library's, on this thread */
    struct cli_log rig_log; /* the sources', on theirs */
    struct live_rig rig;
    fathom_memory_plan plan;
    void *memory;
    fathom *context;
    struct block_store dropped;
    struct trajectory trajectory;
    struct stats stats;
    struct scan_report report;
    int64_t end_ns;    /* CLOCK_MONOTONIC */
    int64_t last_ns;   /* stamp of the last frame; INT64_MIN: none */
    bool write_failed; /* some file couldn't be written; the others go on */
};

/* ---- before the first frame ---- */

static int status_of(int error) {
    return error == FATHOM_ERROR_CONFIG || error == FATHOM_ERROR_MEMORY ? CLI_USAGE : CLI_FAILED;
}

static void override_rig(struct settings *settings) {
    fathom_config *config = &settings->config;
    if (settings->depth_scale > 0) config->depth_units_per_metre = (float)settings->depth_scale;
    if (settings->intrinsics[0] > 0) {
        config->depth_camera.fx = settings->intrinsics[0];
        config->depth_camera.fy = settings->intrinsics[1];
        config->depth_camera.cx = settings->intrinsics[2];
        config->depth_camera.cy = settings->intrinsics[3];
    }
}

static int start_library(struct scan *scan) {
    fathom_config *config = &scan->settings.config;
    config->log = log_message;
    config->log_user = &scan->log;
    scan->plan = FATHOM_STRUCT(fathom_memory_plan);
    log_clear(&scan->log);
    int result = fathom_plan_memory(config, &scan->plan, NULL, 0);
    if (result < 0) return cli_error(status_of(result), "%s", log_reason(&scan->log, result));
    const size_t align = FATHOM_ALIGNMENT, size = ((size_t)scan->plan.host_bytes + align - 1) / align * align;
    scan->memory = aligned_alloc(align, size);
    if (!scan->memory) return cli_error(CLI_FAILED, "out of memory: %zu bytes for the library", size);
    result = fathom_init(&scan->context, config, scan->memory, size, NULL, 0);
    if (result < 0) return cli_error(status_of(result), "%s", log_reason(&scan->log, result));
    return CLI_DONE;
}

static int open_files(struct scan *scan) {
    if (scan->mesh_file && !cli_can_write(scan->mesh_file)) return CLI_FAILED;
    if (scan->trajectory_file && !trajectory_open(&scan->trajectory, scan->trajectory_file)) return CLI_FAILED;
    if (scan->stats_file && !stats_open(&scan->stats, scan->stats_file)) return CLI_FAILED;
    if (!block_store_open(&scan->dropped, scan->mesh_file, &scan->settings.config)) return CLI_FAILED;
    if (!scan_report_start(&scan->report, scan->live.json, scan->live.progress))
        return cli_error(CLI_FAILED, "out of memory");
    return CLI_DONE;
}

static void push_samples(void *context, const fathom_imu_sample *samples, int count) {
    for (int i = 0; i < count; i++) fathom_push_imu(context, &samples[i]);
}

/* ---- frames ---- */

static int take_frame(struct scan *scan, const fathom_source_frame *frame) {
    fathom_result result = FATHOM_STRUCT(fathom_result);
    live_rig_push_until(&scan->rig, frame->depth->timestamp_ns);
    const double latency_ms = 1e-6 * (double)(clock_now_ns() - frame->arrival_ns);
    log_clear(&scan->log);
    const int stepped = fathom_step(scan->context, frame->depth, &result);
    if (stepped == FATHOM_ERROR_TIME || stepped == FATHOM_ERROR_SIZE) {
        cli_warning("frame %" PRId64 " ignored: %s", frame->index, log_reason(&scan->log, stepped));
        return CLI_DONE;
    }
    if (stepped < 0)
        return cli_error(CLI_FAILED, "frame %" PRId64 ": %s", frame->index, log_reason(&scan->log, stepped));
    scan->last_ns = frame->depth->timestamp_ns;
    if (!trajectory_add(&scan->trajectory, result.timestamp_ns, &result.pose)) scan->write_failed = true;
    if (!stats_add(&scan->stats, &result)) scan->write_failed = true;
    scan_report_frame(&scan->report, &scan->rig, &result, latency_ms);
    return CLI_DONE;
}

/* While no frames come, the samples that go on must not fill the ring. */
static void keep_reckoning(struct scan *scan) {
    fathom_motion motion = FATHOM_STRUCT(fathom_motion);
    if (scan->last_ns != INT64_MIN)
        fathom_inertial_estimate(scan->context, scan->last_ns, scan->last_ns, &motion);
}

static bool is_over(const struct scan *scan) {
    const long frames = scan->live.frames;
    return cli_interrupted() || clock_now_ns() >= scan->end_ns ||
           (frames && scan->report.frames >= frames);
}

static int take_frames(struct scan *scan) {
    int status = CLI_DONE, waited = FATHOM_OK;
    const double duration = scan->live.duration;
    scan->end_ns = duration > 0 ? clock_now_ns() + (int64_t)(1e9 * duration) : INT64_MAX;
    while (!status && !is_over(scan)) {
        fathom_source_frame frame = FATHOM_STRUCT(fathom_source_frame);
        waited = fathom_source_wait(scan->rig.depth, SLICE_MS);
        rig_watch_glance(&scan->report.watch, &scan->rig);
        if (waited == FATHOM_ERROR_TIMEOUT)
            keep_reckoning(scan);
        else if (waited)
            break;
        while (!status && !waited && !is_over(scan) &&
               fathom_source_read_depth(scan->rig.depth, &frame) == FATHOM_OK)
            status = take_frame(scan, &frame);
    }
    return status ? status : live_rig_end(waited, &scan->rig_log);
}

/* ---- after the last frame ---- */

/* Whatever ended the frames, what was scanned until then is written. */
static void finish(struct scan *scan) {
    if (!trajectory_close(&scan->trajectory)) scan->write_failed = true;
    if (!stats_close(&scan->stats)) scan->write_failed = true;
    if (scan->mesh_file && !ply_write_surface(scan->context, &scan->dropped, scan->mesh_file, &scan->log))
        scan->write_failed = true;
    if (!block_store_report(&scan->dropped, scan->context)) scan->write_failed = true;
    scan_report_end(&scan->report, &scan->rig, &scan->plan);
}

static void clean_up(struct scan *scan) {
    if (scan->trajectory.file) fclose(scan->trajectory.file);
    if (scan->stats.file) fclose(scan->stats.file);
    live_rig_close(&scan->rig);
    fathom_close(scan->context);
    free(scan->memory);
    block_store_close(&scan->dropped);
    scan_report_free(&scan->report);
}

#define AT(field) offsetof(struct scan, field)

static const struct option_row files[] = {
    {"--trajectory", "FILE", OPTION_TEXT, AT(trajectory_file), .help = "TUM lines, one for every frame"},
    {"--mesh", "FILE.ply", OPTION_TEXT, AT(mesh_file), .help = "the surface: binary PLY, metres, with normals"},
    {"--stats", "FILE.csv", OPTION_TEXT, AT(stats_file), .help = "a line per frame"},
    {0}};

static const struct option_group groups[] = {
    {"Rig", live_options_rig, AT(live)},   {"Files written", files, 0}, SETTINGS_GROUPS(AT(settings)),
    {"What is said", live_options_said, AT(live)}, {0}};

static int run(const struct command *command, int argc, char **argv) {
    static struct scan scan;
    live_options_start(&scan.live);
    settings_start(&scan.settings);
    scan.settings.config.fuse_behind = true; /* the sooner the pose is known the better */
    int status = options_read(command, &scan, argc, argv);
    if (status) return status;
    scan.log.verbose = scan.rig_log.verbose = scan.live.verbose;
    scan.last_ns = INT64_MIN;
    cli_catch_interrupt();
    signal(SIGXFSZ, SIG_IGN); /* a file that may not grow is then a failed write, which is told, not a kill */

    fathom_config *config = &scan.settings.config;
    status = live_rig_open(&scan.rig, &scan.live, &scan.rig_log);
    if (!status) status = live_rig_configure(&scan.rig, &scan.live, config, &scan.rig_log);
    if (!status) override_rig(&scan.settings);
    if (!status) settings_apply_set(&scan.settings, config);
    if (!status) status = open_files(&scan);
    if (!status) status = start_library(&scan);
    if (!status)
        status =
            live_rig_start(&scan.rig, config->imu_clock_offset_ns, push_samples, scan.context, &scan.rig_log);
    if (!status) {
        status = take_frames(&scan);
        finish(&scan);
        if (!status && scan.write_failed) status = CLI_FAILED;
        if (!status && cli_interrupted()) status = CLI_INTERRUPTED;
    }
    clean_up(&scan);
    return status;
}

const struct command command_scan = {
    .name = "scan",
    .summary = "track and reconstruct what a live rig sees",
    .about = "Tracks and reconstructs what a depth camera and an inertial sensor give, as it comes.",
    .groups = groups,
    .later = "--log --foxglove --allow-origin --serve --trajectory-final --trajectory-format --report --save-map "
             "--save-every --resume --salvage --strict --flow --color --cache",
    .output = "The last line on stdout: frames= tracked= reckoned= lost= ms_median= ms_p95= latency_ms_median= "
              "latency_ms_p95= frames_dropped= frames_missing= samples= samples_dropped= blocks= arena_mb=\n"
              "latency is from a frame's arrival to its step.",
    .run = run};
