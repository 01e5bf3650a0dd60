#include "fathom/live/scan_report.h"
#include "fathom/shell/cli.h"
#include "fathom/files/stats.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

bool scan_report_start(struct scan_report *report, bool json, bool progress) {
    *report = (struct scan_report){.json = json};
    report->ms = calloc(SCAN_REPORT_FRAMES, sizeof *report->ms);
    report->latency_ms = calloc(SCAN_REPORT_FRAMES, sizeof *report->latency_ms);
    cli_progress_start("frames", 0, progress);
    return report->ms && report->latency_ms;
}

void scan_report_free(struct scan_report *report) {
    free(report->ms);
    free(report->latency_ms);
    report->ms = report->latency_ms = NULL;
}

/* ---- frames ---- */

static void draw_line(const struct scan_report *report, const struct live_rig *rig,
                      const fathom_result *result) {
    char line[256], imu[64] = "no IMU";
    if (rig->imu)
        snprintf(imu, sizeof imu, "IMU %s %.0f/s %s", fathom_source_state_name(report->watch.imu.state),
                 report->watch.imu.rate_hz, fathom_imu_health_name(result->gyro_health));
    snprintf(line, sizeof line,
             "%s  x %.2f y %.2f z %.2f m  %.1f/s  %.0f ms  %" PRId64 " dropped  %d blocks  %s",
             fathom_state_name(result->state), result->pose.position[0], result->pose.position[1],
             result->pose.position[2], report->watch.depth.rate_hz, (double)result->ms_total,
             report->watch.depth.frames_dropped + report->watch.depth.lost, result->blocks, imu);
    cli_progress((long)report->frames, line);
}

static void print_json(const struct scan_report *report, const struct live_rig *rig,
                       const fathom_result *result, double latency_ms) {
    const double *p = result->pose.position, *q = result->pose.orientation;
    printf("{\"t\":%.9f,\"state\":\"%s\",\"verdict\":\"%s\",\"position\":[%.6f,%.6f,%.6f],"
           "\"quaternion\":[%.7f,%.7f,%.7f,%.7f],\"pairs\":%d,\"rms_m\":%.6f,\"blocks\":%d,\"ms\":%.2f,"
           "\"latency_ms\":%.2f,\"depth\":\"%s\",\"rate_hz\":%.2f,\"dropped\":%" PRId64
           ",\"missing\":%" PRId64 ",\"imu\":\"%s\",\"imu_health\":\"%s\"}\n",
           (double)result->timestamp_ns * 1e-9, fathom_state_name(result->state),
           fathom_verdict_name(result->verdict), p[0], p[1], p[2], q[0], q[1], q[2], q[3], result->pairs,
           (double)result->rms_m, result->blocks, (double)result->ms_total, latency_ms,
           fathom_source_state_name(report->watch.depth.state), report->watch.depth.rate_hz,
           report->watch.depth.frames_dropped, report->watch.depth.lost,
           rig->imu ? fathom_source_state_name(report->watch.imu.state) : "none",
           fathom_imu_health_name(result->gyro_health));
    fflush(stdout);
}

void scan_report_frame(struct scan_report *report, const struct live_rig *rig, const fathom_result *result,
                       double latency_ms) {
    report->ms[report->frames % SCAN_REPORT_FRAMES] = result->ms_total;
    report->latency_ms[report->frames % SCAN_REPORT_FRAMES] = (float)latency_ms;
    report->frames++;
    report->count[result->state]++;
    report->blocks = result->blocks;
    draw_line(report, rig, result);
    if (report->json) print_json(report, rig, result, latency_ms);
}

/* ---- the end ---- */

struct figure {
    const char *name;
    double value; /* NAN: none */
    int decimals;
};

static void print_figure(const struct figure *figure, bool json, bool first) {
    printf(json ? "%s\"%s\":" : "%s%s=", first ? "" : json ? "," : " ", figure->name);
    if (isnan(figure->value))
        printf(json ? "null" : "nan");
    else
        printf("%.*f", figure->decimals, figure->value);
}

void scan_report_end(struct scan_report *report, const struct live_rig *rig, const fathom_memory_plan *plan) {
    cli_progress_end();
    rig_watch_look(&report->watch, rig);
    const int kept = report->frames < SCAN_REPORT_FRAMES ? (int)report->frames : SCAN_REPORT_FRAMES;
    const fathom_source_status *depth = &report->watch.depth, *imu = &report->watch.imu;
    const int64_t *count = report->count;
    const struct figure figures[] = {
        {"frames", (double)report->frames, 0},
        {"tracked", (double)(count[FATHOM_FIRST] + count[FATHOM_TRACKED]), 0},
        {"reckoned", (double)count[FATHOM_RECKONED], 0},
        {"lost", (double)count[FATHOM_LOST], 0},
        {"ms_median", stats_quantile(report->ms, kept, 0.5), 2},
        {"ms_p95", stats_quantile(report->ms, kept, 0.95), 2},
        {"latency_ms_median", stats_quantile(report->latency_ms, kept, 0.5), 2},
        {"latency_ms_p95", stats_quantile(report->latency_ms, kept, 0.95), 2},
        {"frames_dropped", (double)depth->frames_dropped, 0},
        {"frames_missing", (double)(depth->lost + depth->malformed), 0},
        {"samples", (double)rig->samples, 0},
        {"samples_dropped", (double)imu->samples_dropped, 0},
        {"blocks", report->blocks, 0},
        {"arena_mb", (double)(plan->host_bytes + plan->device_bytes) / (1 << 20), 1},
    };
    if (report->json) printf("{\"summary\":{");
    for (size_t i = 0; i < sizeof figures / sizeof *figures; i++)
        print_figure(&figures[i], report->json, i == 0);
    printf(report->json ? "}}\n" : "\n");
}
