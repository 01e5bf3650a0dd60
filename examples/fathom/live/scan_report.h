/* The output of a live scan: the line on the terminal, JSON lines, the summary. */
#ifndef FATHOM_CLI_SCAN_REPORT_H
#define FATHOM_CLI_SCAN_REPORT_H

#include "fathom/live/rig_watch.h"

#define SCAN_REPORT_FRAMES 65536 /* number of latest frames for the quantiles */

struct scan_report {
    bool json;
    int64_t frames;
    int64_t count[4]; /* by fathom_state */
    int blocks;
    float *ms, *latency_ms; /* rings */
    struct rig_watch watch;
};

/* False without memory. */
bool scan_report_start(struct scan_report *report, bool json, bool progress);
void scan_report_free(struct scan_report *report);

/* Takes the result of a step; latency_ms: from the frame's arrival to it. */
void scan_report_frame(struct scan_report *report, const struct live_rig *rig, const fathom_result *result,
                       double latency_ms);

/* The last line on stdout. */
void scan_report_end(struct scan_report *report, const struct live_rig *rig, const fathom_memory_plan *plan);

#endif
