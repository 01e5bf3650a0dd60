#include "fathom/replay/replay_options.h"
#include "fathom/shell/cli.h"

#include <string.h>

static bool set_imu(void *into, const char *option, const char *text) {
    (void)option;
    ((struct replay_options *)into)->imu = strcmp(text, "none") ? text : "";
    return true;
}

#define AT(field) offsetof(struct replay_options, field)

static const struct option_row picture[] = {
    {"--picture", "FILE.png", OPTION_TEXT, AT(picture),
     .help = "the surface, shaded, with the trajectory in it: blue tracked, orange reckoned, red lost"},
    {0}};

static const struct option_row input[] = {
    {"--imu", "FILE|none", OPTION_PARSED, .parse = set_imu, .help = "overrides imu.txt"},
    {"--stride", "N", OPTION_WHOLE, AT(stride), 1, 1e6, .help = "takes every Nth frame"},
    {"--first", "N", OPTION_WHOLE, AT(first), 0, 1e9, .help = "starts at frame N (0: the first)"},
    {"--outage", "A:B[,A:B]", OPTION_RANGES, AT(outages),
     .help = "frames A..B-1 of the recording arrive blank"},
    {"--wall", "A:B[,A:B]", OPTION_RANGES, AT(walls),
     .help = "frames A..B-1 see a flat wall that stands still in the world"},
    {"--card", "A:B[,A:B]", OPTION_RANGES, AT(cards),
     .help = "frames A..B-1 see a flat card fixed to the camera"},
    {0}};

static const struct option_row said[] = {
    {"--progress", NULL, OPTION_FLAG, AT(progress), .help = "show progress even when stderr is no terminal"},
    {"--verbose", NULL, OPTION_FLAG, AT(verbose), .help = "say more on stderr"},
    {0}};

const struct option_group replay_groups[] = {{"Files written", outputs_options, AT(outputs)},
                                             {NULL, picture, 0},
                                             {"Recording", input, 0},
                                             SETTINGS_GROUPS(AT(settings)),
                                             {"What is said", said, 0},
                                             {0}};

int replay_options_read(struct replay_options *options, const struct command *command, int argc,
                        char **argv) {
    *options = (struct replay_options){.stride = 1};
    settings_start(&options->settings);
    const int status = options_read(command, options, argc, argv);
    options->settings.config.imu = !(options->imu && !*options->imu);
    return status;
}
