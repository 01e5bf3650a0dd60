/* fathom scan: feeds live sources to the library. */
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/library.h"
#include "fathom/files/outputs.h"
#include "fathom/live/live_rig.h"
#include "fathom/shell/clock.h"
#include "fathom/shell/settings.h"
#include "fathom/live/scan_report.h"

#include <inttypes.h>
#include <signal.h>
#include <stdlib.h>

#define SLICE_MS 100 /* interval of checks for the end */

struct scan {
    struct live_options live;
    struct settings settings;
    struct outputs outputs;
    struct cli_log log;     /* the library's, on this thread */
    struct cli_log rig_log; /* the sources', on theirs */
    struct live_rig rig;
    struct library library;
    struct scan_report report;
    int64_t end_ns;  /* CLOCK_MONOTONIC */
    int64_t last_ns; /* stamp of the last frame; INT64_MIN: none */
};

/* ---- before the first frame ---- */

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

static void push_samples(void *context, const fathom_imu_sample *samples, int count) {
    for (int i = 0; i < count; i++) fathom_push_imu(context, &samples[i]);
}

/* ---- frames ---- */

static int take_frame(struct scan *scan, const fathom_source_frame *frame) {
    fathom_result result = FATHOM_STRUCT(fathom_result);
    live_rig_push_until(&scan->rig, frame->depth->timestamp_ns);
    const double latency_ms = 1e-6 * (double)(clock_now_ns() - frame->arrival_ns);
    log_clear(&scan->log);
    const int stepped = fathom_step(scan->library.scan, frame->depth, &result);
    if (stepped == FATHOM_ERROR_TIME || stepped == FATHOM_ERROR_SIZE) {
        cli_warning("frame %" PRId64 " ignored: %s", frame->index, log_reason(&scan->log, stepped));
        return CLI_DONE;
    }
    if (stepped < 0)
        return cli_error(CLI_FAILED, "frame %" PRId64 ": %s", frame->index, log_reason(&scan->log, stepped));
    scan->last_ns = frame->depth->timestamp_ns;
    outputs_add(&scan->outputs, scan->library.scan, &result);
    scan_report_frame(&scan->report, &scan->rig, &result, latency_ms);
    return CLI_DONE;
}

/* Without frames, arriving samples must not fill the ring. */
static void keep_reckoning(struct scan *scan) {
    fathom_motion motion = FATHOM_STRUCT(fathom_motion);
    if (scan->last_ns != INT64_MIN)
        fathom_inertial_estimate(scan->library.scan, scan->last_ns, scan->last_ns, &motion);
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

static void clean_up(struct scan *scan) {
    live_rig_close(&scan->rig);
    library_stop(&scan->library);
    outputs_close(&scan->outputs);
    scan_report_free(&scan->report);
}

#define AT(field) offsetof(struct scan, field)

static const struct option_group groups[] = {{"Rig", live_options_rig, AT(live)},
                                             {"Files written", outputs_options, AT(outputs)},
                                             SETTINGS_GROUPS(AT(settings)),
                                             {"What is said", live_options_said, AT(live)},
                                             {0}};

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
    signal(SIGXFSZ, SIG_IGN); /* at the file size limit, writing then fails with a message instead of a kill */

    fathom_config *config = &scan.settings.config;
    status = live_rig_open(&scan.rig, &scan.live, &scan.rig_log);
    if (!status) status = live_rig_configure(&scan.rig, &scan.live, config, &scan.rig_log);
    if (!status) override_rig(&scan.settings);
    if (!status) settings_apply_set(&scan.settings, config);
    if (!status && !outputs_open(&scan.outputs, config)) status = CLI_FAILED;
    if (!status && !scan_report_start(&scan.report, scan.live.json, scan.live.progress))
        status = cli_error(CLI_FAILED, "out of memory");
    if (!status) status = library_start(&scan.library, config, &scan.log);
    if (!status)
        status = live_rig_start(&scan.rig, config->imu_clock_offset_ns, push_samples, scan.library.scan,
                                &scan.rig_log);
    if (!status) {
        status = take_frames(&scan);
        outputs_finish(&scan.outputs, scan.library.scan, &scan.log);
        scan_report_end(&scan.report, &scan.rig, &scan.library.plan);
        if (!status && scan.outputs.failed) status = CLI_FAILED;
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
    .later =
        "--log --foxglove --allow-origin --serve --trajectory-final --trajectory-format --report --save-map "
        "--save-every --resume --salvage --strict --flow --color --cache",
    .output =
        "The last line on stdout: frames= tracked= reckoned= lost= ms_median= ms_p95= latency_ms_median= "
        "latency_ms_p95= frames_dropped= frames_missing= samples= samples_dropped= blocks= arena_mb=\n"
        "latency is from a frame's arrival to its step.",
    .run = run};
