#include "scan_options.h"
#include "cli.h"

#include <stdio.h>
#include <string.h>

static void help(void) {
    printf(
        "usage: fathom scan [options]\n\n"
        "Tracks and reconstructs what a depth camera and an inertial sensor give, as it comes.\n\n"
        "    --depth ADDRESS            the camera, as fathom devices names it, or a recording folder; the\n"
        "                               first that can be opened\n"
        "    --imu ADDRESS|none         the inertial sensor, the same; a recording folder's own\n"
        "    --rig FOLDER               rig.txt (mounting, clock offset) and calibration.txt of the rig\n"
        "    --depth-size WxH           pixels (640x480, or the nearest)\n"
        "    --rate HZ                  frames a second\n"
        "    --speed X                  recordings: 1 as recorded (default), 2 twice as fast; 0 as fast as\n"
        "                               they can be scanned, without losing a frame\n"
        "    --duration S, --frames N   ends after that; Ctrl-C ends it, too\n"
        "    --reconnect on|off         when unplugged, wait for the device (default on)\n"
        "    --trajectory FILE          TUM lines, one for every frame\n"
        "    --mesh FILE.ply            the surface: binary PLY, metres, with normals\n"
        "    --stats FILE.csv           a line a frame\n"
        "    --json                     a line of JSON a frame on stdout, and one at the end\n"
        "%s"
        "    --progress                 show the state even when stderr is no terminal\n"
        "    --verbose                  say more on stderr\n\n"
        "The last line on stdout: frames= tracked= reckoned= lost= ms_median= ms_p95= latency_ms_median=\n"
        "latency_ms_p95= frames_dropped= frames_missing= samples= samples_dropped= blocks= arena_mb=\n"
        "latency is from a frame's arrival to its step.\n"
        "Exit status: 0 done, 1 failed, 2 wrong usage or settings, 130 stopped by Ctrl-C, files whole.\n",
        settings_help);
}

static bool take_text(struct options *options, const char **text) {
    *text = options_value(options);
    if (!*text) return false;
    if (!**text) cli_error(CLI_USAGE, "%s needs a value", options->name);
    return **text;
}

static bool take_number(struct options *options, double low, double high, double *number) {
    const char *text;
    return take_text(options, &text) && cli_parse_double(options->name, text, low, high, number);
}

static bool take_switch(struct options *options, bool *on) {
    const char *text;
    if (!take_text(options, &text)) return false;
    *on = strcmp(text, "on") == 0;
    if (*on || strcmp(text, "off") == 0) return true;
    cli_error(CLI_USAGE, "%s: '%s' is neither on nor off", options->name, text);
    return false;
}

static bool take_imu(struct options *options, const char **imu) {
    if (!take_text(options, imu)) return false;
    if (strcmp(*imu, "none") == 0) *imu = "";
    return true;
}

static bool take_size(struct scan_options *out, struct options *options) {
    const char *text;
    return take_text(options, &text) && parse_size(options->name, text, 8, 16384, &out->width, &out->height);
}

static bool take_frames(struct scan_options *out, struct options *options) {
    const char *text;
    return take_text(options, &text) && cli_parse_long(options->name, text, 1, 1000000000, &out->frames);
}

static bool take_option(struct scan_options *out, struct options *options) {
    const char *name = options->name;
    const int taken = settings_take(&out->settings, options);
    if (taken) return taken > 0;
    if (strcmp(name, "--depth") == 0) return take_text(options, &out->depth);
    if (strcmp(name, "--imu") == 0) return take_imu(options, &out->imu);
    if (strcmp(name, "--rig") == 0) return take_text(options, &out->rig);
    if (strcmp(name, "--trajectory") == 0) return take_text(options, &out->trajectory);
    if (strcmp(name, "--mesh") == 0) return take_text(options, &out->mesh);
    if (strcmp(name, "--stats") == 0) return take_text(options, &out->stats);
    if (strcmp(name, "--depth-size") == 0) return take_size(out, options);
    if (strcmp(name, "--rate") == 0) return take_number(options, 0.1, 1000, &out->rate);
    if (strcmp(name, "--speed") == 0) return take_number(options, 0, 1000, &out->speed);
    if (strcmp(name, "--duration") == 0) return take_number(options, 0.001, 1e9, &out->duration);
    if (strcmp(name, "--frames") == 0) return take_frames(out, options);
    if (strcmp(name, "--reconnect") == 0) return take_switch(options, &out->reconnect);
    if (strcmp(name, "--json") == 0) return out->json = options_flag(options);
    if (strcmp(name, "--progress") == 0) return out->progress = options_flag(options);
    if (strcmp(name, "--verbose") == 0) return out->verbose = options_flag(options);
    cli_error(CLI_USAGE, "scan: unknown option %s; fathom scan --help lists them", name);
    return false;
}

int scan_options_read(struct scan_options *out, int argc, char **argv) {
    struct options options = {.count = argc, .arguments = argv, .at = 1};
    *out = (struct scan_options){.speed = 1, .reconnect = true};
    settings_start(&out->settings);
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
