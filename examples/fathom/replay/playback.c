#include "fathom/replay/playback.h"
#include "fathom/shell/cli.h"

#include <stdlib.h>
#include <sys/stat.h>

int playback_open(fathom_recording **out, const char *folder, const char *imu_file,
                  const struct settings *settings, struct cli_log *log) {
    fathom_recording_options how = {.struct_size = sizeof how, .imu_file = imu_file,
                                    .depth_units_per_metre = settings->depth_scale,
                                    .log = log_message,
                                    .log_user = log};
    const double *k = settings->intrinsics;
    how.camera = (fathom_pinhole){.fx = k[0], .fy = k[1], .cx = k[2], .cy = k[3]};
    struct stat status;
    if (stat(folder, &status) == 0 && S_ISREG(status.st_mode))
        return cli_error(CLI_USAGE, "%s: replaying a log is not yet available, only a recording folder",
                         folder);
    const int result = fathom_recording_open(out, folder, &how);
    if (result)
        return cli_error(result == FATHOM_ERROR_ARGUMENT ? CLI_USAGE : CLI_FAILED, "%s",
                         log_reason(log, result));
    const fathom_recording *recording = *out;
    if (recording->intrinsics_assumed)
        cli_note("%s: no calibration.txt: taking intrinsics %g %g %g %g (the TUM default)", folder,
                 recording->camera.fx, recording->camera.fy, recording->camera.cx,
                 recording->camera.cy);
    if (recording->depth_units_assumed)
        cli_note("%s: no depth_scale in rig.txt: taking %g units a metre (the TUM default)", folder,
                 recording->depth_units_per_metre);
    return CLI_DONE;
}

/* Samples from before the first frame determine the bias and gravity; ten seconds of them are enough. */
static const int64_t lead_in_ns = 10000000000;

static int first_imu(const fathom_recording *recording, int first_frame) {
    int first = 0;
    const int64_t from = recording->frames[first_frame].timestamp_ns - lead_in_ns;
    while (first < recording->imu_count &&
           recording->imu[first].timestamp_ns + recording->imu_clock_offset_ns < from)
        first++;
    return first;
}

/* The number of samples to push before frame 'index': up to one beyond its stamp, for interpolation. later_ns: by which
 * their stamps are later than in the recording. */
static int imu_until(const fathom_recording *recording, int next, int index, int64_t later_ns) {
    const int64_t stamp = recording->frames[index].timestamp_ns - later_ns;
    while (next < recording->imu_count &&
           (next == 0 || recording->imu[next - 1].timestamp_ns + recording->imu_clock_offset_ns <= stamp))
        next++;
    return next;
}

/* A replay pushes everything between two frames at once; the ring must hold that, however long the gap. */
static int imu_capacity(const fathom_recording *recording, int first, int stride) {
    int most = 0, next = first_imu(recording, first);
    for (int i = first; i < recording->frame_count; i += stride) {
        const int until = imu_until(recording, next, i, 0);
        if (until - next > most) most = until - next;
        next = until;
    }
    int capacity = 4096;
    while (capacity < 2 * most) capacity *= 2;
    return capacity;
}

#define NEAR_M 0.5        /* maximum depth of a fifth of a near scene */
#define NEAR_VOXEL 0.003f /* metres; for it */

void playback_choose_voxel(const fathom_recording *recording, struct settings *settings) {
    const size_t count = (size_t)recording->camera.width * (size_t)recording->camera.height;
    uint16_t *pixels = settings->voxel > 0 || settings->preset ? NULL : malloc(count * sizeof *pixels);
    size_t valid = 0, near = 0;
    for (int i = 0; pixels && !valid && i < recording->frame_count; i++)
        for (size_t k = fathom_recording_read_depth(recording, i, pixels) ? count : 0; k < count; k++) {
            valid += pixels[k] != 0 && pixels[k] != 65535;
            near += pixels[k] != 0 && pixels[k] < NEAR_M * recording->depth_units_per_metre;
        }
    free(pixels);
    if (5 * near <= valid) return;
    settings->config.voxel_m = NEAR_VOXEL;
    cli_note("%s: a near scene: voxels of %g m; --voxel sets others", recording->folder, (double)NEAR_VOXEL);
}

int playback_start(struct playback *playback, const fathom_recording *recording, int first, int stride,
                   const struct settings *settings, fathom_config *config, struct cli_log *log) {
    fathom_recording_configure(recording, config);
    const int capacity = imu_capacity(recording, first, stride);
    if (capacity > 4096) config->max_imu_samples = capacity;
    settings_apply_set(settings, config);
    if (recording->confidence) {
        playback->confidence = malloc((size_t)recording->camera.width * (size_t)recording->camera.height);
        if (!playback->confidence) return cli_error(CLI_FAILED, "out of memory");
    }
    const int status = library_start(&playback->library, config, log);
    if (status) return status;
    playback->next_imu = first_imu(recording, first);
    playback->imu_clock_offset_ns = config->imu_clock_offset_ns;
    return CLI_DONE;
}

void playback_push_imu(struct playback *playback, const fathom_recording *recording, int index) {
    fathom_rig rig = FATHOM_STRUCT(fathom_rig);
    fathom_get_rig(playback->library.scan, &rig);
    const int64_t later_ns = rig.imu_clock_offset_ns - playback->imu_clock_offset_ns;
    const int until = imu_until(recording, playback->next_imu, index, later_ns < 0 ? later_ns : 0);
    for (; playback->next_imu < until; playback->next_imu++)
        fathom_push_imu(playback->library.scan, &recording->imu[playback->next_imu]);
}

const uint8_t *playback_confidence(struct playback *playback, const fathom_recording *recording, int index) {
    const bool read =
        playback->confidence && fathom_recording_read_confidence(recording, index, playback->confidence) == FATHOM_OK;
    return read ? playback->confidence : NULL;
}

void playback_stop(struct playback *playback) {
    free(playback->confidence);
    library_stop(&playback->library);
    *playback = (struct playback){0};
}
