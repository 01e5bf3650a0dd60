#include "fathom/replay/replay_options.h"
#include "fathom/shell/cli.h"

#include <stdio.h>
#include <string.h>

static void help(void) {
    printf(
        "usage: fathom replay FOLDER [options]\n\n"
        "Tracks and reconstructs a recording folder (TUM RGB-D / ETH3D layout).\n\n"
        "    --trajectory FILE          TUM lines, one for every frame taken, dead-reckoned ones included\n"
        "    --mesh FILE.ply            the surface: binary PLY, metres, with normals\n"
        "    --stats FILE.csv           a line a frame\n"
        "    --picture FILE.png         the surface, shaded, with the trajectory in it: blue tracked,\n"
        "                               orange reckoned, red lost\n"
        "    --imu FILE|none            overrides imu.txt\n"
        "    --stride N                 takes every Nth frame\n"
        "    --outage A:B[,A:B]         frames A..B-1 of the recording arrive blank\n"
        "    --wall A:B[,A:B]           frames A..B-1 see a flat wall that stands still in the world\n"
        "    --card A:B[,A:B]           frames A..B-1 see a flat card fixed to the camera\n"
        "%s"
        "    --progress                 show progress even when stderr is no terminal\n"
        "    --verbose                  say more on stderr\n\n"
        "The last line on stdout: frames= tracked= reckoned= lost= ate_rmse_m= ms_median= ms_p95=\n"
        "blocks= arena_mb=\n"
        "Exit status: 0 done, 1 failed, 2 wrong usage or settings, 130 stopped by Ctrl-C, files whole.\n",
        settings_help);
}

/* The present option's value into *text, once only. */
static bool take_text(struct options *options, const char **text) {
    const char *value = options_value(options);
    if (!value) return false;
    if (!*value) {
        cli_error(CLI_USAGE, "%s needs a value", options->name);
        return false;
    }
    *text = value;
    return true;
}

static bool take_ranges(struct options *options, struct frame_ranges *ranges) {
    const char *value = options_value(options);
    return value && parse_ranges(options->name, value, ranges);
}

static bool take_option(struct replay_options *out, struct options *options) {
    static const char *const later[] = {"--report", "--save-map", "--resume"};
    const char *name = options->name;
    for (size_t i = 0; i < sizeof later / sizeof *later; i++)
        if (strcmp(name, later[i]) == 0) {
            cli_error(CLI_USAGE, "%s: not yet available", name);
            return false;
        }
    const int taken = settings_take(&out->settings, options);
    if (taken) return taken > 0;
    if (strcmp(name, "--trajectory") == 0) return take_text(options, &out->trajectory);
    if (strcmp(name, "--mesh") == 0) return take_text(options, &out->mesh);
    if (strcmp(name, "--stats") == 0) return take_text(options, &out->stats);
    if (strcmp(name, "--picture") == 0) return take_text(options, &out->picture);
    if (strcmp(name, "--outage") == 0) return take_ranges(options, &out->outages);
    if (strcmp(name, "--wall") == 0) return take_ranges(options, &out->walls);
    if (strcmp(name, "--card") == 0) return take_ranges(options, &out->cards);
    if (strcmp(name, "--imu") == 0) {
        if (!take_text(options, &out->imu)) return false;
        if (strcmp(out->imu, "none") == 0) out->imu = "";
        return true;
    }
    if (strcmp(name, "--stride") == 0) {
        long stride = 0;
        const char *value = options_value(options);
        if (!value || !cli_parse_long(name, value, 1, 1000000, &stride)) return false;
        out->stride = (int)stride;
        return true;
    }
    if (strcmp(name, "--progress") == 0) return out->progress = options_flag(options);
    if (strcmp(name, "--verbose") == 0) return out->verbose = options_flag(options);
    cli_error(CLI_USAGE, "replay: unknown option %s; fathom replay --help lists them", name);
    return false;
}

int replay_options_read(struct replay_options *out, int argc, char **argv) {
    struct options options = {.count = argc, .arguments = argv, .at = 1};
    *out = (struct replay_options){.stride = 1};
    settings_start(&out->settings);
    while (options_next(&options)) {
        if (strcmp(options.name, "--help") == 0 || strcmp(options.name, "-h") == 0) {
            help();
            out->help = true;
            return CLI_DONE;
        }
        if (options.name[0]) {
            if (!take_option(out, &options)) return CLI_USAGE;
        } else if (out->folder) {
            return cli_error(CLI_USAGE, "replay: more than one folder: %s and %s", out->folder,
                             options.value);
        } else {
            out->folder = options.value;
        }
    }
    if (!out->folder) return cli_error(CLI_USAGE, "replay: no folder given; fathom replay --help says how");
    out->settings.config.imu = !(out->imu && !*out->imu);
    return CLI_DONE;
}
