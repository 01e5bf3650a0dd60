/* fathom replay: a recording goes through the library as it would have come from the rig. */
#include "fathom/files/block_store.h"
#include "simulate/camera_path.h"
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "fathom/replay/disturb.h"
#include "fathom/replay/evaluate.h"
#include "fathom_drivers.h"
#include "fathom/shell/log.h"
#include "fathom/files/picture.h"
#include "fathom/replay/playback.h"
#include "fathom/files/ply.h"
#include "fathom/replay/replay_options.h"
#include "fathom/files/stats.h"
#include "fathom/files/trajectory.h"

#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

struct replay {
    struct replay_options options;
    struct cli_log log;
    fathom_recording *recording;
    struct disturb disturb;
    struct playback playback;
    struct block_store dropped;
    uint16_t *pixels;
    struct trajectory trajectory;
    struct stats stats;
    struct path path;  /* what the library has answered so far */
    float *ms;         /* and how long each step took */
    int count[4];      /* of frames, by fathom_state */
    int blocks;        /* in use after the last frame */
    bool write_failed; /* some file couldn't be written; the others go on */
};

/* ---- before the first frame ---------------------------------------------------------------------------- */

static int open_recording(struct replay *replay) {
    const struct replay_options *options = &replay->options;
    return playback_open(&replay->recording, options->folder, options->imu, &options->settings, &replay->log);
}

static int start_library(struct replay *replay) {
    const fathom_memory_plan *plan = &replay->playback.plan;
    playback_choose_voxel(replay->recording, &replay->options.settings);
    const int status = playback_start(&replay->playback, replay->recording, (int)replay->options.stride,
                                      &replay->options.settings,
                                      &replay->options.settings.config, &replay->log);
    if (!status && replay->options.verbose)
        cli_note("on %s: %" PRId64 " bytes of host memory, %" PRId64
                 " of the device's, %d blocks, maps of %dx%d",
                 plan->device, plan->host_bytes, plan->device_bytes, plan->blocks, plan->align_width,
                 plan->align_height);
    return status;
}

static int open_files(struct replay *replay) {
    struct replay_options *options = &replay->options;
    if (options->mesh && !cli_can_write(options->mesh)) return CLI_FAILED;
    if (options->picture && !cli_can_write(options->picture)) return CLI_FAILED;
    if (options->trajectory && !trajectory_open(&replay->trajectory, options->trajectory)) return CLI_FAILED;
    if (options->stats && !stats_open(&replay->stats, options->stats)) return CLI_FAILED;
    if (!block_store_open(&replay->dropped, options->mesh, &options->settings.config)) return CLI_FAILED;
    return CLI_DONE;
}

static int allocate(struct replay *replay) {
    const fathom_recording *recording = replay->recording;
    const size_t frames = (size_t)recording->frame_count;
    replay->pixels = malloc((size_t)recording->width * (size_t)recording->height * sizeof *replay->pixels);
    replay->path.points = malloc(frames * sizeof *replay->path.points);
    replay->ms = malloc(frames * sizeof *replay->ms);
    if (!replay->pixels || !replay->path.points || !replay->ms) return cli_error(CLI_FAILED, "out of memory");
    return CLI_DONE;
}

static int prepare_disturbance(struct replay *replay) {
    const struct replay_options *options = &replay->options;
    log_clear(&replay->log);
    const int status = disturb_prepare(&replay->disturb, replay->recording, &options->outages,
                                       &options->walls, &options->cards, replay->pixels);
    if (status && *replay->log.error) cli_error(status, "%s", replay->log.error);
    return status;
}

/* ---- frames -------------------------------------------------------------------------------------------- */

static void take_result(struct replay *replay, int index, const fathom_result *result) {
    const int64_t stamp = replay->recording->frames[index].timestamp_ns;
    struct path_point *point = &replay->path.points[replay->path.count];
    replay->ms[replay->path.count++] = result->ms_total;
    replay->count[result->state]++;
    replay->blocks = result->blocks;
    point->timestamp_ns = stamp;
    point->state = result->state;
    point->pose = result->pose;
    if (!trajectory_add(&replay->trajectory, stamp, &result->pose)) replay->write_failed = true;
    if (!stats_add(&replay->stats, result)) replay->write_failed = true;
    if (replay->options.verbose && result->state >= FATHOM_RECKONED)
        cli_note(
            "frame %d (t = %.6f): %s: %s; overlap %.2f, rms %.1f mm, innovation %.1f sigma, agreement %.3f, "
            "see-through %.4f",
            index, (double)stamp * 1e-9, fathom_state_name(result->state),
            fathom_verdict_name(result->verdict),
            (double)result->pairs / (result->overlap_pixels > 0 ? result->overlap_pixels : 1),
            1e3 * (double)result->rms_m, (double)result->innovation_sigmas, (double)result->agreement,
            (double)result->see_through);
}

/* Returns a CLI_ status; after one that isn't CLI_DONE no more frames are to be taken. */
static int take_frame(struct replay *replay, int index) {
    const fathom_recording *recording = replay->recording;
    fathom_result result = FATHOM_STRUCT(fathom_result);
    log_clear(&replay->log);
    if (disturb_replaces(&replay->disturb, index)) {
        if (!disturb_render(&replay->disturb, index, replay->pixels)) return CLI_FAILED;
    } else {
        const int read = fathom_recording_read_depth(recording, index, replay->pixels);
        if (read) return cli_error(CLI_FAILED, "%s", log_reason(&replay->log, read));
    }
    playback_push_imu(&replay->playback, recording, index);
    const fathom_depth_frame frame = {.struct_size = sizeof frame,
                                      .timestamp_ns = recording->frames[index].timestamp_ns,
                                      .depth = replay->pixels,
                                      .width = recording->width,
                                      .height = recording->height};
    const int stepped = fathom_step(replay->playback.scan, &frame, &result);
    if (stepped == FATHOM_ERROR_TIME || stepped == FATHOM_ERROR_SIZE) {
        cli_warning("frame %d ignored: %s", index, log_reason(&replay->log, stepped));
        return CLI_DONE;
    }
    if (stepped < 0) return cli_error(CLI_FAILED, "frame %d: %s", index, log_reason(&replay->log, stepped));
    take_result(replay, index, &result);
    cli_progress(replay->path.count, fathom_state_name(result.state));
    return CLI_DONE;
}

static int take_frames(struct replay *replay) {
    const int stride = (int)replay->options.stride, frames = replay->recording->frame_count;
    int status = CLI_DONE;
    cli_progress_start("frames", (frames + stride - 1) / stride, replay->options.progress);
    for (int i = 0; i < frames && !status && !cli_interrupted(); i += stride) status = take_frame(replay, i);
    cli_progress_end();
    return status;
}

/* ---- after the last frame ------------------------------------------------------------------------------ */

static void say_counters(const struct replay *replay) {
    fathom_counters c = FATHOM_STRUCT(fathom_counters);
    if (fathom_get_counters(replay->playback.scan, &c)) return;
    if (c.imu_overrun)
        cli_warning("%" PRId64 " IMU samples found no room in the ring and were dropped", c.imu_overrun);
    if (c.blocks_refused)
        cli_warning("%" PRId64 " blocks of the surface found no room: raise --memory or --voxel",
                    c.blocks_refused);
    if (replay->options.verbose)
        cli_note("IMU samples: %" PRId64 " taken, %" PRId64 " not finite, %" PRId64 " out of order, %" PRId64
                 " overrun, %" PRId64 " gaps; frames ignored: %" PRId64 "; blocks refused: %" PRId64,
                 c.imu_accepted, c.imu_not_finite, c.imu_out_of_order, c.imu_overrun, c.imu_gaps,
                 c.frames_ignored, c.blocks_refused);
}

/* In the units of rig.txt. */
static void say_rig(const struct replay *replay) {
    const double degrees = 57.29577951308232;
    double rotation[9], v[3];
    fathom_rig rig = FATHOM_STRUCT(fathom_rig);
    if (!replay->options.settings.config.refine_rig || fathom_get_rig(replay->playback.scan, &rig)) return;
    for (int i = 0; i < 9; i++) rotation[i] = rig.imu_to_camera_rotation[i];
    vector_of_rotation(rotation, v);
    cli_note("refined: imu_to_camera_rotation %.3f %.3f %.3f (+- %.3f %.3f %.3f about the camera's axes), "
             "imu_clock_offset %.5f (+- %.5f), by %d intervals",
             v[0] * degrees, v[1] * degrees, v[2] * degrees, (double)rig.rotation_sigma[0] * degrees,
             (double)rig.rotation_sigma[1] * degrees, (double)rig.rotation_sigma[2] * degrees,
             1e-9 * (double)rig.imu_clock_offset_ns, 1e-9 * (double)rig.clock_sigma_ns, rig.intervals);
}

static void print_number(const char *name, int decimals, double value) {
    if (isnan(value))
        printf(" %s=nan", name); /* printf may say -nan */
    else
        printf(" %s=%.*f", name, decimals, value);
}

static void print_summary(struct replay *replay) {
    const int *count = replay->count;
    printf("frames=%d tracked=%d reckoned=%d lost=%d", replay->path.count,
           count[FATHOM_FIRST] + count[FATHOM_TRACKED], count[FATHOM_RECKONED], count[FATHOM_LOST]);
    print_number("ate_rmse_m", 6, evaluate_ate(replay->recording, &replay->path));
    print_number("ms_median", 2, stats_quantile(replay->ms, replay->path.count, 0.5));
    print_number("ms_p95", 2, stats_quantile(replay->ms, replay->path.count, 0.95));
    printf(" blocks=%d", replay->blocks);
    print_number("arena_mb", 1,
                 (double)(replay->playback.plan.host_bytes + replay->playback.plan.device_bytes) / (1 << 20));
    putchar('\n');
}

/* Whatever ended the frames, what was scanned until then is written. */
static void finish(struct replay *replay) {
    const struct replay_options *options = &replay->options;
    if (!trajectory_close(&replay->trajectory)) replay->write_failed = true;
    if (!stats_close(&replay->stats)) replay->write_failed = true;
    if (options->mesh &&
        !ply_write_surface(replay->playback.scan, &replay->dropped, options->mesh, &replay->log))
        replay->write_failed = true;
    if (options->picture && !picture_write(replay->playback.scan, &replay->path, options->picture))
        replay->write_failed = true;
    if (options->picture && replay->dropped.count)
        cli_note("%s: shows what is in memory, without what made room", options->picture);
    if (!block_store_report(&replay->dropped, replay->playback.scan)) replay->write_failed = true;
    say_counters(replay);
    say_rig(replay);
    print_summary(replay);
}

static void clean_up(struct replay *replay) {
    if (replay->trajectory.file) fclose(replay->trajectory.file);
    if (replay->stats.file) fclose(replay->stats.file);
    playback_stop(&replay->playback);
    block_store_close(&replay->dropped);
    fathom_recording_close(replay->recording);
    free(replay->pixels);
    free(replay->path.points);
    free(replay->ms);
}

static int run(const struct command *command, int argc, char **argv) {
    struct replay replay = {0};
    int status = replay_options_read(&replay.options, command, argc, argv);
    if (status) return status;
    replay.log.verbose = replay.options.verbose;
    cli_catch_interrupt();
    signal(SIGXFSZ, SIG_IGN); /* a file that may not grow is then a failed write, which is told, not a kill */

    status = open_recording(&replay);
    if (!status) status = allocate(&replay);
    if (!status) status = prepare_disturbance(&replay);
    if (!status) status = open_files(&replay);
    if (!status) status = start_library(&replay);
    if (!status) {
        status = take_frames(&replay);
        finish(&replay);
        if (!status && replay.write_failed) status = CLI_FAILED;
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
    .later = "--trajectory-final --trajectory-format --report --json --save-map --save-every --resume --salvage --strict "
             "--flow --color --depth-topic --imu-topic --color-topic --follow --first --cache",
    .output = "The last line on stdout: frames= tracked= reckoned= lost= ate_rmse_m= ms_median= ms_p95= blocks= arena_mb=",
    .run = run};
