/* What the machine allows, and how far above it each kernel is. Frames of a recording go through the library's step;
 * each kernel that it launches is timed by the device's own clock (OpenCL profiling), and what it must at least move
 * and do is counted from the data. The limit is the longer of: its bytes at the bandwidth of streams, its operations at
 * the rate of fused multiply-adds. Every other frame each launch finds the caches flushed ("cold"). Usage: limit FOLDER
 * [--frames N] [--json FILE] [options of fathom replay that are settings: --size, --threads, ...] */
#include <dlfcn.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "bench/bench_replay.h"
#include "fathom/shell/cli.h"
#include "machine_limit.h"
#include "stage_work.h"

#define FIRST 10   /* frames that don't count: caches, a model that is still empty */
#define KERNELS 32 /* most of them */
#define SAMPLES 4096
#define REPEATS 5 /* launches of the reduction in a row; the best one is "warm" */

enum { AS_IT_COMES, COLD, WARM, WAYS };

typedef struct {
    char name[96]; /* and the size of its level, but for the finest */
    int launches;
    int timed[WAYS];
    float ms[WAYS][SAMPLES];
    int counted;
    stage_work work; /* summed over `counted` launches */
} kernel_times;

static struct {
    fathom *f; /* NULL: launches aren't looked at */
    bool counts, cold;
    machine_limit machine;
    work_state work;
    kernel_times kernels[KERNELS];
    kernel_times *cast; /* a ray-cast whose work is still to be counted */
    stage_work cast_work;
    int frames;
} watch;

typedef cl_int (*enqueue_function)(cl_command_queue, cl_kernel, cl_uint, const size_t *, const size_t *,
                                   const size_t *, cl_uint, const cl_event *, cl_event *);

static double event_ms(cl_event event) {
    cl_ulong start = 0, end = 0;
    clWaitForEvents(1, &event);
    clGetEventProfilingInfo(event, CL_PROFILING_COMMAND_START, sizeof start, &start, NULL);
    clGetEventProfilingInfo(event, CL_PROFILING_COMMAND_END, sizeof end, &end, NULL);
    clReleaseEvent(event);
    return 1e-6 * ((double)end - (double)start);
}

static kernel_times *times_of(const char *name) {
    for (int i = 0; i < KERNELS; i++) {
        kernel_times *k = &watch.kernels[i];
        if (!k->name[0]) snprintf(k->name, sizeof k->name, "%s", name);
        if (!strcmp(k->name, name)) return k;
    }
    fprintf(stderr, "limit: more than %d kernels\n", KERNELS);
    exit(1);
}

static void keep(kernel_times *k, int way, double ms) {
    if (k->timed[way] < SAMPLES) k->ms[way][k->timed[way]++] = (float)ms;
}

static void count(kernel_times *k, const stage_work *work) {
    k->counted++;
    k->work.read += work->read;
    k->work.written += work->written;
    k->work.operations += work->operations;
}

static bool is_cast(const char *name) {
    return !strcmp(name, "raycast") || !strcmp(name, "raycast_near");
}

/* A launch of the library's: waits before and after it. */
static cl_int watched(enqueue_function next, cl_command_queue queue, cl_kernel kernel, cl_uint dimensions,
                      const size_t *global, const size_t *local) {
    fathom *f = watch.f;
    char name[64] = "";
    cl_event event;
    stage_work work;
    const size_t rows = dimensions > 1 ? global[1] : 1;
    clGetKernelInfo(kernel, CL_KERNEL_FUNCTION_NAME, sizeof name - 1, name, NULL);
    const bool reduction = !strcmp(name, "align_reduce");
    char label[96];
    const int level = work_level(f, name, rows);
    snprintf(label, sizeof label, "%s", name);
    if (level < FINEST)
        snprintf(label, sizeof label, "%s %dx%d", name, f->maps.camera[level].width,
                 f->maps.camera[level].height);
    watch.f = NULL; /* what is launched from here on is our own */
    clFinish(queue);
    if (watch.cast) { /* by now the library has kept where it cast from */
        char cast[64] = "";
        sscanf(watch.cast->name, "%63s", cast);
        if (work_of_cast(&watch.work, f, cast, name, &watch.cast_work)) count(watch.cast, &watch.cast_work);
        if (strcmp(name, "halve_map")) watch.cast = NULL; /* coarser maps come between */
    }
    if (!strcmp(name, "fuse_blocks")) work_before_fusion(&watch.work, f);
    if (watch.cold) machine_limit_evict(&watch.machine, &f->device);
    cl_int e = next(queue, kernel, dimensions, NULL, global, local, 0, NULL, &event);
    kernel_times *k = times_of(label);
    if (e == CL_SUCCESS) {
        double ms = event_ms(event);
        if (watch.counts) keep(k, watch.cold ? COLD : AS_IT_COMES, ms);
        if (watch.counts) k->launches++;
    }
    double warm = INFINITY;
    for (int i = 0; reduction && i < REPEATS && e == CL_SUCCESS; i++) {
        e = next(queue, kernel, dimensions, NULL, global, local, 0, NULL, &event);
        if (e == CL_SUCCESS) warm = fmin(warm, event_ms(event));
    }
    if (reduction && watch.counts) keep(k, WARM, warm);
    if (e == CL_SUCCESS && watch.counts) {
        if (!work_of(&watch.work, f, name, global[0], rows, &work))
            fprintf(stderr, "limit: stage_work.c doesn't know %s\n", name);
        else if (!is_cast(name))
            count(k, &work);
        else {
            watch.cast = k;
            watch.cast_work = work;
        }
    }
    watch.f = f;
    return e;
}

/* In place of the loader's: the library's launches come here. */
__attribute__((visibility("default"))) cl_int
clEnqueueNDRangeKernel(cl_command_queue queue, cl_kernel kernel, cl_uint dimensions, const size_t *offset,
                       const size_t *global, const size_t *local, cl_uint waits, const cl_event *wait_list,
                       cl_event *event) {
    static enqueue_function next;
    if (!next) {
        void *found = dlsym(RTLD_NEXT, "clEnqueueNDRangeKernel");
        memcpy(&next, &found, sizeof found); /* ISO C has no cast for it */
    }
    if (!watch.f) return next(queue, kernel, dimensions, offset, global, local, waits, wait_list, event);
    return watched(next, queue, kernel, dimensions, global, local);
}

static int ascending(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static double median(kernel_times *k, int way) {
    if (!k->timed[way]) return NAN;
    qsort(k->ms[way], (size_t)k->timed[way], sizeof(float), ascending);
    return k->ms[way][k->timed[way] / 2];
}

/* Milliseconds at the machine's limit, a launch. */
static void limit_ms(const kernel_times *k, double *moving, double *doing) {
    const machine_limit *m = &watch.machine;
    const double n = k->counted > 0 ? k->counted : 1;
    *moving = 1e3 * (k->work.read / m->read + k->work.written / m->write) / n;
    *doing = 1e3 * k->work.operations / fmax(m->fma8, m->fma16) / n;
}

static void print_cell(double value, const char *format) {
    if (isfinite(value))
        printf(format, value);
    else
        printf(" %8s", "-");
}

static void print_table(void) {
    const machine_limit *m = &watch.machine;
    printf("bandwidth: read %.1f, write %.1f, copy %.1f GB/s; fused multiply-adds: float8 %.0f, float16 %.0f "
           "G/s; "
           "an empty kernel and a wait %.1f us, one of twenty queued %.1f us\n\n",
           1e-9 * m->read, 1e-9 * m->write, 1e-9 * m->copy, 1e-9 * m->fma8, 1e-9 * m->fma16,
           1e3 * m->launch_ms, 1e3 * m->queued_ms);
    printf("%-22s %8s %8s %8s %8s %8s %-9s %8s %8s %8s %8s\n", "kernel", "a frame", "MB", "M ops", "ms moved",
           "ms done", "bound by", "in step", "times", "cold", "times");
    for (int i = 0; i < KERNELS && watch.kernels[i].name[0]; i++) {
        kernel_times *k = &watch.kernels[i];
        double moving, doing;
        if (!k->launches) continue;
        limit_ms(k, &moving, &doing);
        const double n = k->counted, limit = k->counted ? fmax(moving, doing) : NAN;
        printf("%-22s %8.2f", k->name, (double)k->launches / watch.frames);
        print_cell(1e-6 * (k->work.read + k->work.written) / n, " %8.3f");
        print_cell(1e-6 * k->work.operations / n, " %8.2f");
        print_cell(k->counted ? moving : NAN, " %8.3f");
        print_cell(k->counted ? doing : NAN, " %8.3f");
        printf(" %-9s", !k->counted ? "-" : moving > doing ? "bandwidth" : "operations");
        print_cell(median(k, AS_IT_COMES), " %8.3f");
        print_cell(median(k, AS_IT_COMES) / limit, " %8.1f");
        print_cell(median(k, COLD), " %8.3f");
        print_cell(median(k, COLD) / limit, " %8.1f");
        putchar('\n');
        if (k->timed[WARM])
            printf("%-22s %64s warm %.3f ms: %.1f times its operations\n", "", "", median(k, WARM),
                   median(k, WARM) / doing);
    }
}

static void json_number(FILE *file, const char *name, double value, const char *end) {
    if (isfinite(value))
        fprintf(file, "\"%s\": %.6g%s", name, value, end);
    else
        fprintf(file, "\"%s\": null%s", name, end);
}

static bool write_json(const char *path) {
    const machine_limit *m = &watch.machine;
    FILE *file = fopen(path, "w");
    if (!file) return false;
    fprintf(file, "{\"machine\": {");
    json_number(file, "read_gb_s", 1e-9 * m->read, ", ");
    json_number(file, "write_gb_s", 1e-9 * m->write, ", ");
    json_number(file, "copy_gb_s", 1e-9 * m->copy, ", ");
    json_number(file, "fma8_g_s", 1e-9 * m->fma8, ", ");
    json_number(file, "fma16_g_s", 1e-9 * m->fma16, ", ");
    json_number(file, "launch_ms", m->launch_ms, ", ");
    json_number(file, "queued_ms", m->queued_ms, "},\n \"kernels\": [");
    for (int i = 0, first = 1; i < KERNELS && watch.kernels[i].name[0]; i++) {
        kernel_times *k = &watch.kernels[i];
        double moving, doing;
        if (!k->launches) continue;
        limit_ms(k, &moving, &doing);
        const double n = k->counted, nothing = k->counted ? 0 : NAN;
        fprintf(file, "%s\n  {\"kernel\": \"%s\", ", first ? "" : ",", k->name);
        json_number(file, "launches_a_frame", (double)k->launches / watch.frames, ", ");
        json_number(file, "bytes", (k->work.read + k->work.written) / n, ", ");
        json_number(file, "operations", k->work.operations / n, ", ");
        json_number(file, "ms_moved", moving + nothing, ", ");
        json_number(file, "ms_done", doing + nothing, ", ");
        json_number(file, "ms_in_step", median(k, AS_IT_COMES), ", ");
        json_number(file, "ms_cold", median(k, COLD), ", ");
        json_number(file, "ms_warm", median(k, WARM), "}");
        first = 0;
    }
    fprintf(file, "\n ]}\n");
    return fclose(file) == 0;
}

static int run(struct playback *playback, const fathom_recording *recording, int frames, uint16_t *depth) {
    fathom *f = playback->library.scan;
    cl_int e;
    cl_command_queue plain = f->device.queue;
    int error = machine_limit_measure(&watch.machine, &f->device);
    if (error || !work_start(&watch.work, f))
        return cli_error(CLI_FAILED, "limit: the machine can't be measured");
    f->device.queue = clCreateCommandQueue(f->device.context, f->device.id, CL_QUEUE_PROFILING_ENABLE, &e);
    if (!f->device.queue) return cli_error(CLI_FAILED, "limit: no queue with profiling (code %d)", e);
    clReleaseCommandQueue(plain);
    for (int i = 0; !error && i < frames && i < recording->frame_count; i++) {
        const fathom_depth_frame scan = {.struct_size = sizeof scan,
                                         .timestamp_ns = recording->frames[i].timestamp_ns,
                                         .depth = depth,
                                         .width = recording->camera.width,
                                         .height = recording->camera.height};
        fathom_result r = FATHOM_STRUCT(fathom_result);
        playback_push_imu(playback, recording, i);
        error = fathom_recording_read_depth(recording, i, depth);
        watch.counts = i >= FIRST;
        watch.cold = i % 2;
        watch.frames += watch.counts;
        watch.f = f;
        if (!error) error = fathom_step(f, &scan, &r);
        watch.f = NULL;
        watch.cast = NULL;
        if (error) cli_error(CLI_FAILED, "limit: frame %d: %s", i, fathom_error_name(error));
    }
    work_stop(&watch.work);
    machine_limit_close(&watch.machine);
    return error ? CLI_FAILED : CLI_DONE;
}

int main(int argc, char **argv) {
    struct bench_replay bench = {.frames = 60};
    settings_start(&bench.settings);
    bench.settings.config.voxel_m = 0.01f;
    int status = bench_replay_open(&bench, "limit", argc, argv);
    if (!status && bench.frames < FIRST + 4)
        status = cli_error(CLI_USAGE, "limit: takes %d frames or more", FIRST + 4);
    if (!status) status = run(&bench.playback, bench.recording, (int)bench.frames, bench.depth);
    bench_replay_close(&bench);
    if (status) return status;
    print_table();
    if (bench.json && !write_json(bench.json))
        return cli_error(CLI_FAILED, "limit: %s can't be written", bench.json);
    return CLI_DONE;
}
