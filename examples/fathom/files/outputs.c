#include "fathom/files/outputs.h"
#include "fathom/files/ply.h"
#include "fathom/shell/cli.h"

#define AT(field) offsetof(struct outputs, field)

const struct option_row outputs_options[] = {
    {"--trajectory", "FILE", OPTION_TEXT, AT(trajectory_file),
     .help = "TUM lines, one for every frame taken, dead-reckoned ones included"},
    {"--odometry", "FILE", OPTION_TEXT, AT(odometry_file),
     .help = "TUM lines of the pose that never jumps: without the corrections on being found again"},
    {"--mesh", "FILE.ply", OPTION_TEXT, AT(mesh_file),
     .help = "the surface: binary PLY, metres, with normals"},
    {"--stats", "FILE.csv", OPTION_TEXT, AT(stats_file), .help = "a line per frame"},
    {0}};

bool outputs_open(struct outputs *outputs, fathom_config *config) {
    if (outputs->mesh_file && !cli_can_write(outputs->mesh_file)) return false;
    if (outputs->trajectory_file && !trajectory_open(&outputs->trajectory, outputs->trajectory_file))
        return false;
    if (outputs->odometry_file && !trajectory_open(&outputs->odometry, outputs->odometry_file)) return false;
    if (outputs->stats_file && !stats_open(&outputs->stats, outputs->stats_file)) return false;
    return block_store_open(&outputs->dropped, outputs->mesh_file, config);
}

void outputs_add(struct outputs *outputs, fathom *scan, const fathom_result *result) {
    fathom_span span = FATHOM_STRUCT(fathom_span);
    if (outputs->stats_file) fathom_get_span(scan, &span);
    if (!trajectory_add(&outputs->trajectory, result->timestamp_ns, &result->pose)) outputs->failed = true;
    if (!trajectory_add(&outputs->odometry, result->timestamp_ns, &result->odometry)) outputs->failed = true;
    if (!stats_add(&outputs->stats, result, &span)) outputs->failed = true;
}

void outputs_finish(struct outputs *outputs, fathom *scan, struct cli_log *log) {
    if (!trajectory_close(&outputs->trajectory)) outputs->failed = true;
    if (!trajectory_close(&outputs->odometry)) outputs->failed = true;
    if (!stats_close(&outputs->stats)) outputs->failed = true;
    if (outputs->mesh_file && !ply_write_surface(scan, outputs->mesh_file, log))
        outputs->failed = true;
    if (!block_store_report(&outputs->dropped, scan)) outputs->failed = true;
}

void outputs_close(struct outputs *outputs) {
    trajectory_close(&outputs->trajectory);
    trajectory_close(&outputs->odometry);
    stats_close(&outputs->stats);
    block_store_close(&outputs->dropped);
}
