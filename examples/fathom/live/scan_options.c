#include "fathom/live/scan_options.h"
#include "fathom/shell/cli.h"

#include <stdio.h>
#include <string.h>

static void help(void) {
    printf("usage: fathom scan [options]\n\n"
           "Tracks and reconstructs what a depth camera and an inertial sensor give, as it comes.\n\n"
           "%s"
           "    --trajectory FILE          TUM lines, one for every frame\n"
           "    --mesh FILE.ply            the surface: binary PLY, metres, with normals\n"
           "    --stats FILE.csv           a line a frame\n"
           "    --json                     a line of JSON a frame on stdout, and one at the end\n"
           "%s%s\n"
           "The last line on stdout: frames= tracked= reckoned= lost= ms_median= ms_p95= latency_ms_median=\n"
           "latency_ms_p95= frames_dropped= frames_missing= samples= samples_dropped= blocks= arena_mb=\n"
           "latency is from a frame's arrival to its step.\n"
           "Exit status: 0 done, 1 failed, 2 wrong usage or settings, 130 stopped by Ctrl-C, files whole.\n",
           live_options_source_help, settings_help, live_options_progress_help);
}

static bool take_option(struct scan_options *out, struct options *options) {
    const char *name = options->name;
    int taken = settings_take(&out->settings, options);
    if (!taken) taken = live_options_take(&out->live, options);
    if (taken) return taken > 0;
    if (strcmp(name, "--trajectory") == 0) return live_options_text(options, &out->trajectory);
    if (strcmp(name, "--mesh") == 0) return live_options_text(options, &out->mesh);
    if (strcmp(name, "--stats") == 0) return live_options_text(options, &out->stats);
    cli_error(CLI_USAGE, "scan: unknown option %s; fathom scan --help lists them", name);
    return false;
}

int scan_options_read(struct scan_options *out, int argc, char **argv) {
    struct options options = {.count = argc, .arguments = argv, .at = 1};
    *out = (struct scan_options){0};
    live_options_start(&out->live);
    settings_start(&out->settings);
    out->settings.config.fuse_behind = true; /* the sooner the pose is known the better */
    while (options_next(&options)) {
        if (strcmp(options.name, "--help") == 0 || strcmp(options.name, "-h") == 0) {
            help();
            out->help = true;
            return CLI_DONE;
        }
        if (!options.name[0])
            return cli_error(CLI_USAGE, "scan: takes no %s; a source is given by --depth or --imu",
                             options.value);
        if (!take_option(out, &options)) return CLI_USAGE;
    }
    return CLI_DONE;
}
