/* Times fusion alone: the first frames of a recording go into the surface at the poses of groundtruth.txt, every block
 * of every frame. Stdout: one JSON object, milliseconds frame by frame: maps, allocate, fuse. Usage: fusion FOLDER
 * [--frames N] [options of fathom replay that are settings: --size, --voxel, --threads, ...] Works on the library's
 * insides: fathom_step fuses at its own poses, and not every block each time. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "bench/bench_replay.h"
#include "fathom/shell/cli.h"
#include "context.h"

enum { MAPS, ALLOCATE, FUSE, STAGES };

static double now_ms(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static bool pose_at(const fathom_recording *recording, int64_t stamp_ns, pose *at) {
    fathom_pose p;
    if (fathom_recording_pose_at(recording, stamp_ns, &p) != FATHOM_OK) return false;
    return pose_take(&p, at);
}

static void fuse_frame(fathom *f, const uint16_t *depth, const pose *at, double ms[STAGES]) {
    double start = now_ms();
    depth_maps_make(&f->maps, &f->device, depth, 2 * (size_t)f->config.depth_camera.width, FINEST);
    device_wait(&f->device);
    double made = now_ms();
    if (integrator_request(&f->integrator, &f->device, &f->volume, &f->maps, at, false) > 0)
        integrator_allocate(&f->integrator, &f->device, &f->volume);
    device_wait(&f->device);
    double allocated = now_ms();
    integrator_fuse(&f->integrator, &f->device, &f->volume, &f->maps, at, false);
    device_wait(&f->device);
    ms[MAPS] = made - start;
    ms[ALLOCATE] = allocated - made;
    ms[FUSE] = now_ms() - allocated;
}

static void print(const char *name, double (*ms)[STAGES], int stage, int frames) {
    printf("\"%s\": [", name);
    for (int i = 0; i < frames; i++) printf("%s%.4f", i ? ", " : "", ms[i][stage]);
    printf("], ");
}

static int run(fathom *f, const fathom_recording *recording, int frames, uint16_t *depth,
               double (*ms)[STAGES]) {
    int done = 0;
    for (int i = 0; i < frames; i++) {
        pose at;
        if (!pose_at(recording, recording->frames[i].timestamp_ns, &at)) continue;
        const int error = fathom_recording_read_depth(recording, i, depth);
        if (error) return cli_error(CLI_FAILED, "fusion: frame %d: %s", i, fathom_error_name(error));
        fuse_frame(f, depth, &at, ms[done++]);
    }
    if (f->device.error) return cli_error(CLI_FAILED, "fusion: the device failed");
    if (!done) return cli_error(CLI_FAILED, "fusion: %s: no poses", recording->folder);
    putchar('{');
    print("maps", ms, MAPS, done);
    print("allocate", ms, ALLOCATE, done);
    print("fuse", ms, FUSE, done);
    printf("\"frames\": %d, \"blocks\": %d, \"full\": %s, \"arena_mb\": %.1f}\n", done, f->volume.pool.count,
           f->integrator.refused ? "true" : "false", (double)f->arena_bytes / (1 << 20));
    return CLI_DONE;
}

int main(int argc, char **argv) {
    struct bench_replay bench = {.frames = 100000};
    settings_start(&bench.settings);
    int status = bench_replay_open(&bench, "fusion", argc, argv);
    double(*ms)[STAGES] = status ? NULL : malloc((size_t)bench.frames * sizeof *ms);
    if (!status)
        status = ms ? run(bench.playback.library.scan, bench.recording, (int)bench.frames, bench.depth, ms)
                    : CLI_FAILED;
    free(ms);
    bench_replay_close(&bench);
    return status;
}
