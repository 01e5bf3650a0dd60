/* The report of `fathom replay` on a scan: frames that weren't tracked, counters, the summary. */
#ifndef FATHOM_REPLAY_REPORT_H
#define FATHOM_REPLAY_REPORT_H

#include "fathom_drivers.h"
#include "fathom/replay/path.h"
#include "fathom/shell/library.h"

struct replay_report {
    struct path path; /* the results so far */
    float *ms;        /* duration of each step */
    int count[4];     /* of frames, by fathom_state */
    int blocks;       /* in use after the last frame */
};

/* Room for that number of frames. Returns a CLI_ status. */
int replay_report_open(struct replay_report *report, int frames);
void replay_report_close(struct replay_report *report);

void replay_report_add(struct replay_report *report, const fathom_result *result);

/* Writes a line to stderr for a frame that wasn't tracked. */
void replay_report_explain(int frame, const fathom_result *result);

/* Warnings from the counters, and with `verbose` all counters; with refine_rig the refined rig. */
void replay_report_counters(fathom *scan, bool verbose);
void replay_report_rig(fathom *scan);

/* The last line on stdout. */
void replay_report_summary(struct replay_report *report, const fathom_recording *recording,
                           const fathom_memory_plan *plan);

#endif
