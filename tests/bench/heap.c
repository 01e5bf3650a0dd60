/* Counts the calls of the heap that fathom_step makes: a replay through libfathom.so, whose code is a range of
 * addresses. Stdout: one JSON object: calls a frame from the library's own code, and from all (the OpenCL runtime's
 * among them). Usage: heap FOLDER [--frames N] [options of fathom replay that are settings: --size, --threads, ...] */
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_replay.h"
#include "fathom/shell/cli.h"
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
        const fathom_depth_frame scan = {.struct_size = sizeof scan,
                                         .timestamp_ns = recording->frames[i].timestamp_ns,
                                         .depth = depth,
                                         .width = recording->camera.width,
                                         .height = recording->camera.height};
        fathom_result r = FATHOM_STRUCT(fathom_result);
        playback_push_imu(playback, recording, i);
        int error = fathom_recording_read_depth(recording, i, depth);
        const long own_before = heap_count_watched(), all_before = heap_count_all();
        if (!error) error = fathom_step(playback->library.scan, &scan, &r);
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
    struct bench_replay bench = {.frames = 40};
    settings_start(&bench.settings);
    int status = bench_replay_open(&bench, "heap", argc, argv);
    if (!status && bench.frames <= FIRST)
        status = cli_error(CLI_USAGE, "heap: takes more than %d frames", FIRST);
    if (!status) status = run(&bench.playback, bench.recording, (int)bench.frames, bench.depth);
    bench_replay_close(&bench);
    return status;
}
