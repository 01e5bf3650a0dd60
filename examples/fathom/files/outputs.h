/* The files that replay and scan both write: line by line during the scan, the mesh at its end. */
#ifndef FATHOM_FILES_OUTPUTS_H
#define FATHOM_FILES_OUTPUTS_H

#include "fathom/files/block_store.h"
#include "fathom/files/stats.h"
#include "fathom/files/trajectory.h"
#include "fathom/shell/log.h"
#include "fathom/shell/options.h"

struct outputs {
    /* from the options; NULL: none */
    const char *trajectory_file, *odometry_file, *mesh_file, *stats_file;
    struct trajectory trajectory, odometry;
    struct stats stats;
    struct block_store dropped;
    bool failed; /* a file couldn't be written, after an error message; the others go on */
};

/* The table of the options, for structs outputs. */
extern const struct option_row outputs_options[];

/* Opens the requested files, and sets config's store of dropped blocks. False after an error message. */
bool outputs_open(struct outputs *outputs, fathom_config *config);

/* Adds a frame. */
void outputs_add(struct outputs *outputs, fathom *scan, const fathom_result *result);

/* Writes the mesh, also of an interrupted scan; log is the context's. */
void outputs_finish(struct outputs *outputs, fathom *scan, struct cli_log *log);

/* After the context is closed. Allowed when nothing is open. */
void outputs_close(struct outputs *outputs);

#endif
