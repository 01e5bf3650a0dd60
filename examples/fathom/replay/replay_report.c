#include "fathom/replay/replay_report.h"
#include "fathom/files/stats.h"
#include "fathom/replay/evaluate.h"
#include "fathom/shell/cli.h"
#include "simulate/camera_path.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

int replay_report_open(struct replay_report *report, int frames) {
    report->path.points = malloc((size_t)frames * sizeof *report->path.points);
    report->ms = malloc((size_t)frames * sizeof *report->ms);
    return report->path.points && report->ms ? CLI_DONE : cli_error(CLI_FAILED, "out of memory");
}

void replay_report_close(struct replay_report *report) {
    free(report->path.points);
    free(report->ms);
}

void replay_report_add(struct replay_report *report, const fathom_result *result) {
    struct path_point *point = &report->path.points[report->path.count];
    report->ms[report->path.count++] = result->ms_total;
    report->count[result->state]++;
    report->blocks = result->blocks;
    point->timestamp_ns = result->timestamp_ns;
    point->state = result->state;
    point->pose = result->pose;
}

void replay_report_explain(int frame, const fathom_result *result) {
    cli_note("frame %d (t = %.6f): %s: %s; overlap %.2f, rms %.1f mm, innovation %.1f sigma, agreement %.3f, "
             "see-through %.4f",
             frame, (double)result->timestamp_ns * 1e-9, fathom_state_name(result->state),
             fathom_verdict_name(result->verdict),
             (double)result->pairs / (result->overlap_pixels > 0 ? result->overlap_pixels : 1),
             1e3 * (double)result->rms_m, (double)result->innovation_sigmas, (double)result->agreement,
             (double)result->see_through);
}

void replay_report_counters(fathom *scan, bool verbose) {
    fathom_counters c = FATHOM_STRUCT(fathom_counters);
    if (fathom_get_counters(scan, &c)) return;
    if (c.imu_overrun)
        cli_warning("%" PRId64 " IMU samples found no room in the ring and were dropped", c.imu_overrun);
    if (c.blocks_refused)
        cli_warning("%" PRId64 " blocks of the surface found no room: raise --memory or --voxel",
                    c.blocks_refused);
    if (verbose)
        cli_note("IMU samples: %" PRId64 " taken, %" PRId64 " not finite, %" PRId64 " out of order, %" PRId64
                 " overrun, %" PRId64 " gaps; frames ignored: %" PRId64 "; blocks refused: %" PRId64,
                 c.imu_accepted, c.imu_not_finite, c.imu_out_of_order, c.imu_overrun, c.imu_gaps,
                 c.frames_ignored, c.blocks_refused);
}

/* In the units of rig.txt. */
void replay_report_rig(fathom *scan) {
    const double degrees = 57.29577951308232;
    double rotation[9], v[3];
    fathom_rig rig = FATHOM_STRUCT(fathom_rig);
    if (fathom_get_rig(scan, &rig)) return;
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

void replay_report_summary(struct replay_report *report, const fathom_recording *recording,
                           const fathom_memory_plan *plan) {
    const int *count = report->count;
    printf("frames=%d tracked=%d reckoned=%d lost=%d", report->path.count,
           count[FATHOM_FIRST] + count[FATHOM_TRACKED], count[FATHOM_RECKONED], count[FATHOM_LOST]);
    print_number("ate_rmse_m", 6, evaluate_ate(recording, &report->path));
    print_number("ms_median", 2, stats_quantile(report->ms, report->path.count, 0.5));
    print_number("ms_p95", 2, stats_quantile(report->ms, report->path.count, 0.95));
    printf(" blocks=%d", report->blocks);
    print_number("arena_mb", 1, (double)(plan->host_bytes + plan->device_bytes) / (1 << 20));
    putchar('\n');
}
