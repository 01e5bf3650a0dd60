#include "fathom/live/live_options.h"

#include <string.h>

void live_options_start(struct live_options *live) {
    *live = (struct live_options){.speed = 1, .reconnect = true};
}

static bool set_imu(void *into, const char *option, const char *text) {
    (void)option;
    ((struct live_options *)into)->imu = strcmp(text, "none") ? text : "";
    return true;
}

#define AT(field) offsetof(struct live_options, field)

const struct option_row live_options_rig[] = {
    {"--depth", "ADDRESS", OPTION_TEXT, AT(depth),
     .help = "the camera, as fathom devices names it, or a recording folder; the first that can be opened"},
    {"--imu", "ADDRESS|none", OPTION_PARSED, .parse = set_imu,
     .help = "the inertial sensor, the same; a recording folder's own"},
    {"--rig", "FOLDER", OPTION_TEXT, AT(rig),
     .help = "rig.txt (mounting, clock offset) and calibration.txt of the rig"},
    {"--depth-size", "WxH", OPTION_SIZE, AT(size), 8, 16384, .help = "pixels (640x480, or the nearest)"},
    {"--rate", "HZ", OPTION_NUMBER, AT(rate), 0.1, 1000, .help = "frames per second"},
    {"--speed", "X", OPTION_NUMBER, AT(speed), 0, 1000,
     .help = "recordings: 1 as recorded (default), 2 twice as fast; 0 as fast as they are taken, without "
             "losing a frame"},
    {"--duration", "S", OPTION_NUMBER, AT(duration), 0.001, 1e9,
     .help = "ends after that time; Ctrl-C ends it, too"},
    {"--frames", "N", OPTION_WHOLE, AT(frames), 1, 1e9, .help = "ends after that number of frames"},
    {"--reconnect", "on|off", OPTION_SWITCH, AT(reconnect),
     .help = "when unplugged, wait for the device (default on)"},
    {0}};

const struct option_row live_options_said[] = {
    {"--json", NULL, OPTION_FLAG, AT(json),
     .help = "lines of JSON on stdout: scan's for each frame, log's each second, and one at the end"},
    {"--progress", NULL, OPTION_FLAG, AT(progress), .help = "show the state even when stderr is no terminal"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};
