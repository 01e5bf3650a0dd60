/* The files of a scan that replay and scan both write: line by line while it runs, the mesh at its end. */
#ifndef FATHOM_FILES_OUTPUTS_H
#define FATHOM_FILES_OUTPUTS_H

#include "fathom/files/block_store.h"
#include "fathom/files/stats.h"
#include "fathom/files/trajectory.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

struct outputs {
    /* as the options have them; NULL: not wanted */
    const char *trajectory_file, *odometry_file, *mesh_file, *stats_file;
    struct trajectory trajectory, odometry;
    struct stats stats;
    struct block_store dropped;
    bool failed; /* some file couldn't be written, and that was said; the others go on */
};

/* The table of the options, for structs outputs. */
extern const struct option_row outputs_options[];

/* Opens what is wanted, and lets config keep dropped blocks. False after saying what went wrong. */
bool outputs_open(struct outputs *outputs, fathom_config *config);

/* A frame more. */
void outputs_add(struct outputs *outputs, const fathom_result *result);

/* Whatever ended the frames, what was scanned until then is written; log is the context's. */
void outputs_finish(struct outputs *outputs, fathom *scan, struct cli_log *log);

/* After the context is closed. Nothing need have been opened. */
void outputs_close(struct outputs *outputs);

#endif
