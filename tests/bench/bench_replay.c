#include "bench/bench_replay.h"
#include "fathom/shell/cli.h"

#include <stdlib.h>

#define AT(field) offsetof(struct bench_replay, field)

static const struct option_row own[] = {
    {"--frames", "N", OPTION_WHOLE, AT(frames), 1, 100000, .help = "frames of the recording"},
    {"--json", "FILE", OPTION_TEXT, AT(json), .help = "figures as JSON, where the program has them"},
    {0}};

static const struct option_group groups[] = {{"Measurement", own, 0}, SETTINGS_GROUPS(AT(settings)), {0}};

int bench_replay_open(struct bench_replay *bench, const char *name, int argc, char **argv) {
    const struct command command = {.name = name,
                                    .about = "A program of make bench.",
                                    .words = {{"folder", AT(folder)}},
                                    .groups = groups};
    int status = options_read(&command, bench, argc, argv);
    if (!status)
        status = playback_open(&bench->recording, bench->folder, NULL, &bench->settings, &bench->log);
    if (!status)
        status = playback_start(&bench->playback, bench->recording, 0, 1, &bench->settings,
                                &bench->settings.config, &bench->log);
    if (status) return status;
    if (bench->frames > bench->recording->frame_count) bench->frames = bench->recording->frame_count;
    bench->depth = malloc((size_t)bench->recording->camera.width * (size_t)bench->recording->camera.height *
                          sizeof *bench->depth);
    return bench->depth ? CLI_DONE : cli_error(CLI_FAILED, "%s: out of memory", name);
}

void bench_replay_close(struct bench_replay *bench) {
    free(bench->depth);
    playback_stop(&bench->playback);
    fathom_recording_close(bench->recording);
}
