/* What the programs beside make bench share: a recording opened, the library started for it, room for a depth frame.
 * Usage of each: PROGRAM FOLDER [--frames N] [its own options] [the settings of fathom replay]. */
#ifndef FATHOM_BENCH_REPLAY_H
#define FATHOM_BENCH_REPLAY_H

#include "fathom/replay/playback.h"

struct bench_replay {
    const char *folder, *json; /* json: a file to write, or NULL */
    long frames;               /* how many of the recording's */
    struct settings settings;
    struct cli_log log;
    struct playback playback;
    fathom_recording *recording;
    uint16_t *depth; /* room for a frame */
};

/* Reads the arguments; settings and frames have their defaults. Returns a CLI_ status, after saying what was wrong. */
int bench_replay_open(struct bench_replay *bench, const char *name, int argc, char **argv);

/* After bench_replay_open, whatever it returned. */
void bench_replay_close(struct bench_replay *bench);

#endif
