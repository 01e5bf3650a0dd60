#include "fathom/live/live_options.h"
#include "fathom/shell/cli.h"

#include <string.h>

const char live_options_source_help[] =
    "    --depth ADDRESS            the camera, as fathom devices names it, or a recording folder; the\n"
    "                               first that can be opened\n"
    "    --imu ADDRESS|none         the inertial sensor, the same; a recording folder's own\n"
    "    --rig FOLDER               rig.txt (mounting, clock offset) and calibration.txt of the rig\n"
    "    --depth-size WxH           pixels (640x480, or the nearest)\n"
    "    --rate HZ                  frames a second\n"
    "    --speed X                  recordings: 1 as recorded (default), 2 twice as fast; 0 as fast as\n"
    "                               they are taken, without losing a frame\n"
    "    --duration S, --frames N   ends after that; Ctrl-C ends it, too\n"
    "    --reconnect on|off         when unplugged, wait for the device (default on)\n";

const char live_options_progress_help[] =
    "    --progress                 show the state even when stderr is no terminal\n"
    "    --verbose                  say more on stderr\n";

void live_options_start(struct live_options *live) {
    *live = (struct live_options){.speed = 1, .reconnect = true};
}

bool live_options_text(struct options *options, const char **text) {
    *text = options_value(options);
    if (!*text) return false;
    if (!**text) cli_error(CLI_USAGE, "%s needs a value", options->name);
    return **text;
}

static bool take_number(struct options *options, double low, double high, double *number) {
    const char *text;
    return live_options_text(options, &text) && cli_parse_double(options->name, text, low, high, number);
}

static bool take_switch(struct options *options, bool *on) {
    const char *text;
    if (!live_options_text(options, &text)) return false;
    *on = strcmp(text, "on") == 0;
    if (*on || strcmp(text, "off") == 0) return true;
    cli_error(CLI_USAGE, "%s: '%s' is neither on nor off", options->name, text);
    return false;
}

static bool take_imu(struct options *options, const char **imu) {
    if (!live_options_text(options, imu)) return false;
    if (strcmp(*imu, "none") == 0) *imu = "";
    return true;
}

static bool take_size(struct live_options *live, struct options *options) {
    const char *text;
    return live_options_text(options, &text) &&
           parse_size(options->name, text, 8, 16384, &live->width, &live->height);
}

static bool take_frames(struct live_options *live, struct options *options) {
    const char *text;
    return live_options_text(options, &text) &&
           cli_parse_long(options->name, text, 1, 1000000000, &live->frames);
}

int live_options_take(struct live_options *live, struct options *options) {
    const char *name = options->name;
    bool good = false;
    if (strcmp(name, "--depth") == 0)
        good = live_options_text(options, &live->depth);
    else if (strcmp(name, "--imu") == 0)
        good = take_imu(options, &live->imu);
    else if (strcmp(name, "--rig") == 0)
        good = live_options_text(options, &live->rig);
    else if (strcmp(name, "--depth-size") == 0)
        good = take_size(live, options);
    else if (strcmp(name, "--rate") == 0)
        good = take_number(options, 0.1, 1000, &live->rate);
    else if (strcmp(name, "--speed") == 0)
        good = take_number(options, 0, 1000, &live->speed);
    else if (strcmp(name, "--duration") == 0)
        good = take_number(options, 0.001, 1e9, &live->duration);
    else if (strcmp(name, "--frames") == 0)
        good = take_frames(live, options);
    else if (strcmp(name, "--reconnect") == 0)
        good = take_switch(options, &live->reconnect);
    else if (strcmp(name, "--json") == 0)
        good = live->json = options_flag(options);
    else if (strcmp(name, "--progress") == 0)
        good = live->progress = options_flag(options);
    else if (strcmp(name, "--verbose") == 0)
        good = live->verbose = options_flag(options);
    else
        return 0;
    return good ? 1 : -1;
}
