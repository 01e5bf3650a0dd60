/* fathom replay: feeds a recording to the library as the rig would have done. */
#include "fathom/commands.h"
#include "fathom/files/outputs.h"
#include "fathom/files/picture.h"
#include "fathom/replay/disturb.h"
#include "fathom/replay/playback.h"
#include "fathom/replay/replay_options.h"
#include "fathom/replay/replay_report.h"
#include "fathom/shell/cli.h"

#include <inttypes.h>
#include <signal.h>
#include <stdlib.h>

struct replay {
    struct replay_options options;
    struct cli_log log;
    fathom_recording *recording;
    struct disturb disturb;
    struct playback playback;
    uint16_t *pixels; /* of the present frame */
    struct replay_report report;
};

/* ---- before the first frame ---------------------------------------------------------------------------- */

static int open_recording(struct replay *replay) {
    struct replay_options *options = &replay->options;
    int status =
        playback_open(&replay->recording, options->folder, options->imu, &options->settings, &replay->log);
    if (status) return status;
    const fathom_recording *recording = replay->recording;
    replay->pixels =
        malloc((size_t)recording->camera.width * (size_t)recording->camera.height * sizeof *replay->pixels);
    if (!replay->pixels) return cli_error(CLI_FAILED, "out of memory");
    if (options->first >= recording->frame_count)
        return cli_error(CLI_USAGE, "--first: the recording has frames 0 to %d, no %d", recording->frame_count - 1,
                         (int)options->first);
    log_clear(&replay->log);
    status = disturb_prepare(&replay->disturb, recording, &options->outages, &options->walls, &options->cards,
                             replay->pixels);
    if (status && *replay->log.error) cli_error(status, "%s", replay->log.error);
    if (!status) playback_choose_voxel(recording, &options->settings);
    return status;
}

static int open_files(struct replay *replay) {
    struct replay_options *options = &replay->options;
    if (options->picture && !cli_can_write(options->picture)) return CLI_FAILED;
    return outputs_open(&options->outputs, &options->settings.config)
               ? replay_report_open(&replay->report, replay->recording->frame_count)
               : CLI_FAILED;
}

static int start_library(struct replay *replay) {
    const fathom_memory_plan *plan = &replay->playback.library.plan;
    const int status = playback_start(&replay->playback, replay->recording, (int)replay->options.first,
                                      (int)replay->options.stride,
                                      &replay->options.settings,
                                      &replay->options.settings.config, &replay->log);
    if (!status && replay->options.verbose)
        cli_note("on %s: %" PRId64 " bytes of host memory, %" PRId64
                 " of the device's, %d blocks, maps of %dx%d",
                 plan->device, plan->host_bytes, plan->device_bytes, plan->blocks, plan->align_width,
                 plan->align_height);
    return status;
}

/* ---- frames -------------------------------------------------------------------------------------------- */

/* The recording's frame, or that of a covered lens, a wall or a card. */
static int read_depth(struct replay *replay, int index) {
    if (disturb_replaces(&replay->disturb, index))
        return disturb_render(&replay->disturb, index, replay->pixels) ? CLI_DONE : CLI_FAILED;
    const int read = fathom_recording_read_depth(replay->recording, index, replay->pixels);
    return read ? cli_error(CLI_FAILED, "%s", log_reason(&replay->log, read)) : CLI_DONE;
}

/* A step of the library. A refused frame is left out: *taken false. */
static int step(struct replay *replay, int index, fathom_result *result, bool *taken) {
    const fathom_recording *recording = replay->recording;
    const fathom_depth_frame frame = {.struct_size = sizeof frame,
                                      .timestamp_ns = recording->frames[index].timestamp_ns,
                                      .depth = replay->pixels,
                                      .confidence = disturb_replaces(&replay->disturb, index)
                                                        ? NULL
                                                        : playback_confidence(&replay->playback, recording, index),
                                      .width = recording->camera.width,
                                      .height = recording->camera.height};
    const int stepped = fathom_step(replay->playback.library.scan, &frame, result);
    *taken = stepped >= 0;
    if (*taken) return CLI_DONE;
    const char *reason = log_reason(&replay->log, stepped);
    if (stepped != FATHOM_ERROR_TIME && stepped != FATHOM_ERROR_SIZE)
        return cli_error(CLI_FAILED, "frame %d: %s", index, reason);
    cli_warning("frame %d ignored: %s", index, reason);
    return CLI_DONE;
}

static void keep(struct replay *replay, int index, const fathom_result *result) {
    replay_report_add(&replay->report, result);
    outputs_add(&replay->options.outputs, replay->playback.library.scan, result);
    if (replay->options.verbose && result->state >= FATHOM_RECKONED) replay_report_explain(index, result);
    cli_progress(replay->report.path.count, fathom_state_name(result->state));
}

static int take_frames(struct replay *replay) {
    const int first = (int)replay->options.first, stride = (int)replay->options.stride;
    const int frames = replay->recording->frame_count;
    int status = CLI_DONE;
    cli_progress_start("frames", (frames - first + stride - 1) / stride, replay->options.progress);
    for (int i = first; i < frames && !status && !cli_interrupted(); i += stride) {
        fathom_result result = FATHOM_STRUCT(fathom_result);
        bool taken = false;
        log_clear(&replay->log);
        status = read_depth(replay, i);
        if (status) break;
        playback_push_imu(&replay->playback, replay->recording, i);
        status = step(replay, i, &result, &taken);
        if (taken) keep(replay, i, &result);
    }
    cli_progress_end();
    return status;
}

/* ---- after the last frame ------------------------------------------------------------------------------ */

/* Writes the scan so far, also after an interrupt or an error. */
static void finish(struct replay *replay) {
    const struct replay_options *options = &replay->options;
    struct outputs *outputs = &replay->options.outputs;
    fathom *scan = replay->playback.library.scan;
    outputs_finish(outputs, scan, &replay->log);
    if (options->picture && !picture_write(scan, &replay->report.path, options->picture))
        outputs->failed = true;
    if (options->picture && outputs->dropped.count)
        cli_note("%s: shows what is in memory, without what made room", options->picture);
    replay_report_counters(scan, options->verbose);
    if (options->settings.config.refine_rig) replay_report_rig(scan);
    replay_report_summary(&replay->report, replay->recording, &replay->playback.library.plan);
}

static void clean_up(struct replay *replay) {
    playback_stop(&replay->playback);
    outputs_close(&replay->options.outputs);
    replay_report_close(&replay->report);
    fathom_recording_close(replay->recording);
    free(replay->pixels);
}

static int run(const struct command *command, int argc, char **argv) {
    struct replay replay = {0};
    int status = replay_options_read(&replay.options, command, argc, argv);
    if (status) return status;
    replay.log.verbose = replay.options.verbose;
    cli_catch_interrupt();
    signal(SIGXFSZ, SIG_IGN); /* at the file size limit, writing then fails with a message instead of a kill */

    status = open_recording(&replay);
    if (!status) status = open_files(&replay);
    if (!status) status = start_library(&replay);
    if (!status) {
        status = take_frames(&replay);
        finish(&replay);
        if (!status && replay.options.outputs.failed) status = CLI_FAILED;
        if (!status && cli_interrupted()) status = CLI_INTERRUPTED;
    }
    clean_up(&replay);
    return status;
}

const struct command command_replay = {
    .name = "replay",
    .summary = "track and reconstruct a recording",
    .about = "Tracks and reconstructs a recording folder (TUM RGB-D / ETH3D layout).",
    .words = {{"folder", offsetof(struct replay_options, folder)}},
    .groups = replay_groups,
    .later = "--trajectory-final --trajectory-format --report --json --save-map --save-every --resume "
             "--salvage --strict --flow --color --depth-topic --imu-topic --color-topic --follow --first "
             "--cache",
    .output = "The last line on stdout: frames= tracked= reckoned= lost= ate_rmse_m= ms_median= ms_p95= "
              "blocks= arena_mb=",
    .run = run};
