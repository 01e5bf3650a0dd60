/* fathom replay: a recording goes through the library as it would have come from the rig. */
#include "cli.h"
#include "disturb.h"
#include "evaluate.h"
#include "fathom_drivers.h"
#include "log.h"
#include "picture.h"
#include "ply.h"
#include "replay_options.h"
#include "stats.h"
#include "trajectory.h"

#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>
#include <unistd.h>

struct replay {
    struct replay_options options;
    struct cli_log log;
    fathom_recording *recording;
    struct disturb disturb;
    fathom_memory_plan plan;
    void *memory; /* the library's block */
    fathom *scan;
    uint16_t *pixels;
    struct trajectory trajectory;
    struct stats stats;
    struct path path;  /* what the library has answered so far */
    float *ms;         /* and how long each step took */
    int count[4];      /* of frames, by fathom_state */
    int blocks;        /* in use after the last frame */
    int next_imu;      /* the first sample that hasn't been pushed */
    bool write_failed; /* some file couldn't be written; the others go on */
};

/* Wrong settings are the user's to mend (2); the rest has failed (1). */
static int status_of(int error) {
    return error == FATHOM_ERROR_CONFIG || error == FATHOM_ERROR_MEMORY ? CLI_USAGE : CLI_FAILED;
}

/* ---- before the first frame ---------------------------------------------------------------------------- */

static int open_recording(struct replay *replay) {
    const struct replay_options *options = &replay->options;
    fathom_recording_options how = {.imu_file = options->imu,
                                    .depth_units_per_metre = options->settings.depth_scale,
                                    .log = log_message,
                                    .log_user = &replay->log};
    for (int i = 0; i < 4; i++) how.intrinsics[i] = options->settings.intrinsics[i];
    struct stat status;
    if (stat(options->folder, &status) == 0 && S_ISREG(status.st_mode))
        return cli_error(CLI_USAGE, "%s: replaying a log is not yet available, only a recording folder",
                         options->folder);
    const int result = fathom_recording_open(&replay->recording, options->folder, &how);
    if (result)
        return cli_error(result == FATHOM_ERROR_ARGUMENT ? CLI_USAGE : CLI_FAILED, "%s",
                         log_reason(&replay->log, result));
    const fathom_recording *recording = replay->recording;
    if (recording->intrinsics_assumed)
        cli_note("%s: no calibration.txt: taking intrinsics %g %g %g %g (the TUM default)", options->folder,
                 recording->intrinsics[0], recording->intrinsics[1], recording->intrinsics[2],
                 recording->intrinsics[3]);
    if (recording->depth_units_assumed)
        cli_note("%s: no depth_scale in rig.txt: taking %g units a metre (the TUM default)", options->folder,
                 recording->depth_units_per_metre);
    return CLI_DONE;
}

/* Samples from before the first frame tell the bias and where up is; ten seconds of them are plenty. */
static const int64_t lead_in_ns = 10000000000;

static int first_imu(const fathom_recording *recording) {
    int first = 0;
    const int64_t from = recording->frames[0].timestamp_ns - lead_in_ns;
    while (first < recording->imu_count &&
           recording->imu[first].timestamp_ns + recording->imu_clock_offset_ns < from)
        first++;
    return first;
}

/* How far the samples must be pushed before frame 'index': one beyond its stamp, so that it can be
 * interpolated at. */
static int imu_until(const fathom_recording *recording, int next, int index) {
    const int64_t stamp = recording->frames[index].timestamp_ns;
    while (next < recording->imu_count &&
           (next == 0 || recording->imu[next - 1].timestamp_ns + recording->imu_clock_offset_ns <= stamp))
        next++;
    return next;
}

/* A replay pushes everything between two frames at once; the ring must hold that, however long the gap. */
static int imu_capacity(const fathom_recording *recording, int stride) {
    int most = 0, next = first_imu(recording);
    for (int i = 0; i < recording->frame_count; i += stride) {
        const int until = imu_until(recording, next, i);
        if (until - next > most) most = until - next;
        next = until;
    }
    int capacity = 4096;
    while (capacity < 2 * most) capacity *= 2;
    return capacity;
}

static int start_library(struct replay *replay) {
    fathom_config *config = &replay->options.settings.config;
    fathom_recording_configure(replay->recording, config);
    const int capacity = imu_capacity(replay->recording, replay->options.stride);
    if (capacity > 4096) config->imu_capacity = capacity;
    config->log = log_message;
    config->log_user = &replay->log;
    log_clear(&replay->log);
    int result = fathom_memory_plan_for(config, &replay->plan);
    if (result < 0) return cli_error(status_of(result), "%s", log_reason(&replay->log, result));
    const size_t align = FATHOM_ALIGNMENT,
                 size = ((size_t)replay->plan.host_bytes + align - 1) / align * align;
    replay->memory = aligned_alloc(align, size);
    if (!replay->memory) return cli_error(CLI_FAILED, "out of memory: %zu bytes for the library", size);
    result = fathom_init(&replay->scan, config, replay->memory, size);
    if (result < 0) return cli_error(status_of(result), "%s", log_reason(&replay->log, result));
    if (replay->options.verbose)
        cli_note("on %s: %" PRId64 " bytes of host memory, %" PRId64
                 " of the device's, %d blocks, maps of %dx%d",
                 replay->plan.device, replay->plan.host_bytes, replay->plan.device_bytes, replay->plan.blocks,
                 replay->plan.align_width, replay->plan.align_height);
    replay->next_imu = first_imu(replay->recording);
    return CLI_DONE;
}

/* A place that can't be written to is better known now than after the scan. */
static bool can_write(const char *file) {
    char probe[4096];
    snprintf(probe, sizeof probe, "%s.part", file);
    FILE *opened = fopen(probe, "wb");
    if (!opened) {
        cli_error(CLI_FAILED, "%s: can't be written there (%s.part: %m)", file, file);
        return false;
    }
    fclose(opened);
    unlink(probe);
    return true;
}

static int open_files(struct replay *replay) {
    const struct replay_options *options = &replay->options;
    if (options->mesh && !can_write(options->mesh)) return CLI_FAILED;
    if (options->picture && !can_write(options->picture)) return CLI_FAILED;
    if (options->trajectory && !trajectory_open(&replay->trajectory, options->trajectory)) return CLI_FAILED;
    if (options->stats && !stats_open(&replay->stats, options->stats)) return CLI_FAILED;
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

static void push_imu(struct replay *replay, int index) {
    const int until = imu_until(replay->recording, replay->next_imu, index);
    for (; replay->next_imu < until; replay->next_imu++)
        fathom_push_imu(replay->scan, &replay->recording->imu[replay->next_imu]);
}

static void take_result(struct replay *replay, int index, const fathom_result *result) {
    const int64_t stamp = replay->recording->frames[index].timestamp_ns;
    struct path_point *point = &replay->path.points[replay->path.count];
    replay->ms[replay->path.count++] = result->ms_total;
    replay->count[result->state]++;
    replay->blocks = result->blocks;
    point->timestamp_ns = stamp;
    point->state = result->state;
    for (int i = 0; i < 16; i++) point->pose[i] = result->pose[i];
    if (!trajectory_add(&replay->trajectory, stamp, result->pose)) replay->write_failed = true;
    if (!stats_add(&replay->stats, result)) replay->write_failed = true;
    if (replay->options.verbose && result->state >= FATHOM_RECKONED)
        cli_note("frame %d (t = %.6f): %s: %s", index, (double)stamp * 1e-9, fathom_state_name(result->state),
                 fathom_verdict_name(result->verdict));
}

/* Returns a CLI_ status; after one that isn't CLI_DONE no more frames are to be taken. */
static int take_frame(struct replay *replay, int index) {
    const fathom_recording *recording = replay->recording;
    fathom_result result;
    log_clear(&replay->log);
    if (disturb_replaces(&replay->disturb, index)) {
        if (!disturb_render(&replay->disturb, index, replay->pixels)) return CLI_FAILED;
    } else {
        const int read = fathom_recording_read_depth(recording, index, replay->pixels);
        if (read) return cli_error(CLI_FAILED, "%s", log_reason(&replay->log, read));
    }
    push_imu(replay, index);
    const fathom_depth_frame frame = {recording->frames[index].timestamp_ns, replay->pixels, recording->width,
                                      recording->height};
    const int stepped = fathom_step(replay->scan, &frame, &result);
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
    const int stride = replay->options.stride, frames = replay->recording->frame_count;
    int status = CLI_DONE;
    cli_progress_start("frames", (frames + stride - 1) / stride, replay->options.progress);
    for (int i = 0; i < frames && !status && !cli_interrupted(); i += stride) status = take_frame(replay, i);
    cli_progress_end();
    return status;
}

/* ---- after the last frame ------------------------------------------------------------------------------ */

static bool write_mesh(struct replay *replay) {
    struct ply ply;
    if (!ply_open(&ply, replay->options.mesh)) return false;
    log_clear(&replay->log);
    const int64_t triangles = fathom_extract_mesh(replay->scan, 0, ply_triangles, &ply);
    if (triangles < 0 && !ply.failed)
        cli_error(CLI_FAILED, "%s: %s", replay->options.mesh, log_reason(&replay->log, (int)triangles));
    if (triangles == 0) cli_warning("%s: there is no surface, the mesh is empty", replay->options.mesh);
    if (triangles < 0) {
        ply_discard(&ply);
        return false;
    }
    return ply_close(&ply);
}

static void say_counters(const struct replay *replay) {
    fathom_counters c;
    if (fathom_get_counters(replay->scan, &c)) return;
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
    print_number("arena_mb", 1, (double)(replay->plan.host_bytes + replay->plan.device_bytes) / (1 << 20));
    putchar('\n');
}

/* Whatever ended the frames, what was scanned until then is written. */
static void finish(struct replay *replay) {
    const struct replay_options *options = &replay->options;
    if (!trajectory_close(&replay->trajectory)) replay->write_failed = true;
    if (!stats_close(&replay->stats)) replay->write_failed = true;
    if (options->mesh && !write_mesh(replay)) replay->write_failed = true;
    if (options->picture && !picture_write(replay->scan, &replay->path, options->picture))
        replay->write_failed = true;
    say_counters(replay);
    print_summary(replay);
}

static void clean_up(struct replay *replay) {
    if (replay->trajectory.file) fclose(replay->trajectory.file);
    if (replay->stats.file) fclose(replay->stats.file);
    fathom_close(replay->scan);
    free(replay->memory);
    fathom_recording_close(replay->recording);
    free(replay->pixels);
    free(replay->path.points);
    free(replay->ms);
}

int command_replay(int argc, char **argv) {
    struct replay replay = {0};
    int status = replay_options_read(&replay.options, argc, argv);
    if (status || replay.options.help) return status;
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
