/* Counts the calls of the heap that fathom_step makes: a replay through libfathom.so, whose code is a range of addresses.
 * Stdout: one JSON object: calls a frame from the library's own code, and from all (the OpenCL runtime's among them).
 * Usage: heap FOLDER [--frames N] [options of fathom replay that are settings: --size, --threads, ...] */
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fathom/shell/cli.h"
#include "fathom/replay/playback.h"
#include "bench/heap_count.h"

#define FIRST 10 /* frames that don't count */

/* Watches the code of the object that has the address. */
static int watch_object_of(struct dl_phdr_info *info, size_t size, void *data) {
    (void)size;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *p = &info->dlpi_phdr[i];
        const uintptr_t low = info->dlpi_addr + p->p_vaddr, high = low + p->p_memsz;
        if (p->p_type != PT_LOAD || !(p->p_flags & PF_X) || (uintptr_t)data < low || (uintptr_t)data >= high)
            continue;
        heap_count_watch(low, high);
        return strstr(info->dlpi_name, "libfathom") ? 1 : -1;
    }
    return 0;
}

static int run(struct playback *playback, const fathom_recording *recording, int frames, uint16_t *depth) {
    int (*step)(fathom *, const fathom_depth_frame *, fathom_result *) = fathom_step;
    void *address;
    long own = 0, all = 0;
    memcpy(&address, &step, sizeof address); /* ISO C has no cast for it */
    if (dl_iterate_phdr(watch_object_of, address) != 1)
        return cli_error(CLI_FAILED, "heap: the library isn't an object of its own");
    for (int i = 0; i < frames; i++) {
        const fathom_depth_frame scan = {recording->frames[i].timestamp_ns, depth, recording->width,
                                         recording->height};
        fathom_result r;
        playback_push_imu(playback, recording, i);
        int error = fathom_recording_read_depth(recording, i, depth);
        const long own_before = heap_count_watched(), all_before = heap_count_all();
        if (!error) error = fathom_step(playback->scan, &scan, &r);
        if (error) return cli_error(CLI_FAILED, "heap: frame %d: %s", i, fathom_error_name(error));
        if (i < FIRST) continue;
        own += heap_count_watched() - own_before;
        all += heap_count_all() - all_before;
    }
    const double counted = frames - FIRST;
    printf("{\"frames\": %.0f, \"own\": %g, \"all\": %g}\n", counted, (double)own / counted,
           (double)all / counted);
    return CLI_DONE;
}

int main(int argc, char **argv) {
    struct cli_log log = {0};
    struct settings settings;
    struct playback playback = {0};
    fathom_recording *recording = NULL;
    struct options options = {.count = argc, .arguments = argv, .at = 1};
    const char *folder = NULL;
    long frames = 40;
    settings_start(&settings);
    while (options_next(&options)) {
        const int taken = settings_take(&settings, &options);
        if (taken > 0) continue;
        const char *value = taken ? NULL : options.name[0] ? options_value(&options) : options.value;
        if (!value) return CLI_USAGE;
        if (!options.name[0])
            folder = value;
        else if (strcmp(options.name, "--frames"))
            return cli_error(CLI_USAGE, "heap: wrong option %s", options.name);
        else if (!cli_parse_long(options.name, value, FIRST + 1, 100000, &frames))
            return CLI_USAGE;
    }
    if (!folder) return cli_error(CLI_USAGE, "usage: heap FOLDER [--frames N] [settings]");
    int status = playback_open(&recording, folder, NULL, &settings, &log);
    if (!status) status = playback_start(&playback, recording, 1, &settings.config, &log);
    if (!status) {
        if (frames > recording->frame_count) frames = recording->frame_count;
        uint16_t *depth = malloc((size_t)recording->width * (size_t)recording->height * sizeof *depth);
        status = depth && frames > FIRST ? run(&playback, recording, (int)frames, depth) : CLI_FAILED;
        free(depth);
    }
    playback_stop(&playback);
    fathom_recording_close(recording);
    return status;
}
