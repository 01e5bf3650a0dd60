/* How far dead reckoning strays: a recording is tracked, and every so many frames fathom_inertial_estimate() is asked for the
 * way ahead, which is compared with groundtruth.txt. Stdout: t, horizon (s), path and turn ahead, position error (m), rotation
 * error (deg), one line each.
 * Usage: drift FOLDER [--imu FILE|none] [--translation on|off] [--from S] [--every S]
 * Only the public API is used. Each question is asked in a child process, so that the scan itself never holds a sample of its
 * own future. */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fathom_drivers.h"

static const double horizons[] = {0.1, 0.2, 0.5, 1, 2, 5};
#define HORIZONS ((int)(sizeof horizons / sizeof *horizons))
#define SECOND 1e9
#define DEGREES 57.29577951308232

struct run {
    fathom_recording *recording;
    fathom *scan;
    int next_imu; /* the first sample that hasn't been pushed */
};

static void say(void *user, fathom_log_level level, const char *text) {
    (void)user;
    if (level <= FATHOM_LOG_WARNING) fprintf(stderr, "drift: %s\n", text);
}

static int fail(const char *what, int error) {
    fprintf(stderr, "drift: %s: %s\n", what, fathom_error_name(error));
    return 1;
}

/* One sample beyond the stamp goes along, so that it can be interpolated at. */
static void push_until(struct run *run, int64_t stamp_ns) {
    const fathom_recording *r = run->recording;
    while (
        run->next_imu < r->imu_count &&
        (run->next_imu == 0 || r->imu[run->next_imu - 1].timestamp_ns + r->imu_clock_offset_ns <= stamp_ns))
        fathom_push_imu(run->scan, &r->imu[run->next_imu++]);
}

/* inv(a) b of rigid matrices. */
static void between(const double a[16], const double b[16], double m[16]) {
    memset(m, 0, 16 * sizeof *m);
    m[15] = 1;
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            for (int j = 0; j < 3; j++) m[4 * i + j] += a[4 * k + i] * b[4 * k + j];
            m[4 * i + 3] += a[4 * k + i] * (b[4 * k + 3] - a[4 * k + 3]);
        }
}

static double length_of(const double m[16]) {
    return sqrt(m[3] * m[3] + m[7] * m[7] + m[11] * m[11]);
}

static double degrees_of(const double m[16]) {
    /* from the skew part too: the trace alone can't tell small angles */
    const double x = m[9] - m[6], y = m[2] - m[8], z = m[4] - m[1];
    return DEGREES * atan2(sqrt(x * x + y * y + z * z), m[0] + m[5] + m[10] - 1);
}

/* The questions at one frame, asked in the child. Its own samples go no further than each horizon. */
static void ask(struct run *run, int64_t now_ns) {
    fathom_pose pose;
    double here[16], there[16], truth[16], estimate[16], error[16];
    if (fathom_recording_pose_at(run->recording, now_ns, &pose) != FATHOM_OK) return;
    fathom_pose_to_matrix(&pose, here);
    for (int i = 0; i < HORIZONS; i++) {
        const int64_t then_ns = now_ns + (int64_t)(SECOND * horizons[i]);
        fathom_motion motion = FATHOM_STRUCT(fathom_motion);
        push_until(run, then_ns);
        if (fathom_recording_pose_at(run->recording, then_ns, &pose) != FATHOM_OK) return;
        if (fathom_inertial_estimate(run->scan, now_ns, then_ns, &motion) != FATHOM_OK) return;
        fathom_pose_to_matrix(&pose, there);
        between(here, there, truth);
        fathom_pose_to_matrix(&motion.motion, estimate);
        between(truth, estimate, error);
        printf("%.3f %g %.4f %.2f %.6f %.5f\n", (double)now_ns / SECOND, horizons[i], length_of(truth),
               degrees_of(truth), length_of(error), degrees_of(error));
    }
}

static int ask_aside(struct run *run, int64_t now_ns) {
    fflush(stdout);
    const pid_t child = fork();
    if (child == 0) {
        ask(run, now_ns);
        fflush(stdout);
        _exit(0);
    }
    int status = -1;
    if (child < 0 || waitpid(child, &status, 0) != child || status)
        return fail("asking", FATHOM_ERROR_NO_DATA);
    return 0;
}

/* Tracks the recording; from `from` seconds on asks every `every`, as long as the longest horizon lies within it. */
static int track(struct run *run, double from, double every) {
    const fathom_recording *r = run->recording;
    uint16_t *depth = malloc((size_t)r->camera.width * (size_t)r->camera.height * sizeof *depth);
    const int64_t start = r->frames[0].timestamp_ns, end = r->poses[r->pose_count - 1].timestamp_ns;
    double due = from;
    int failed = depth ? 0 : fail("depth", FATHOM_ERROR_MEMORY);
    for (int i = 0; i < r->frame_count && !failed; i++) {
        const int64_t now = r->frames[i].timestamp_ns;
        fathom_result result = FATHOM_STRUCT(fathom_result);
        if ((double)(end - now) < SECOND * horizons[HORIZONS - 1]) break;
        push_until(run, now);
        int error = fathom_recording_read_depth(r, i, depth);
        const fathom_depth_frame frame = {.struct_size = sizeof frame,
                                          .timestamp_ns = now,
                                          .depth = depth,
                                          .width = r->camera.width,
                                          .height = r->camera.height};
        if (error == FATHOM_OK) error = fathom_step(run->scan, &frame, &result);
        if (error != FATHOM_OK) failed = fail("step", error);
        if (failed || result.state != FATHOM_TRACKED || (double)(now - start) < SECOND * due) continue;
        failed = ask_aside(run, now);
        due += every;
    }
    free(depth);
    return failed;
}

int main(int argc, char **argv) {
    fathom_recording_options options = {.struct_size = sizeof options, .log = say};
    fathom_config config;
    fathom_config_init(&config);
    double from = 10, every = 0.5;
    for (int i = 2; i + 1 < argc; i += 2) {
        if (!strcmp(argv[i], "--imu"))
            options.imu_file = strcmp(argv[i + 1], "none") ? argv[i + 1] : "";
        else if (!strcmp(argv[i], "--translation"))
            config.imu_translation = strcmp(argv[i + 1], "off") != 0;
        else if (!strcmp(argv[i], "--from"))
            from = atof(argv[i + 1]);
        else if (!strcmp(argv[i], "--every"))
            every = atof(argv[i + 1]);
        else
            argc = 0;
    }
    if (argc < 2 || argc % 2) {
        fprintf(stderr,
                "usage: drift FOLDER [--imu FILE|none] [--translation on|off] [--from S] [--every S]\n");
        return 2;
    }
    struct run run = {0};
    int error = fathom_recording_open(&run.recording, argv[1], &options);
    if (error != FATHOM_OK) return fail(argv[1], error);
    if (run.recording->pose_count == 0) return fail("groundtruth.txt", FATHOM_ERROR_NO_DATA);
    fathom_recording_configure(run.recording, &config);
    config.max_imu_samples = 1 << 14; /* the longest horizon's samples at once, at up to 3 kHz */
    config.log = say;
    const int64_t bytes = fathom_memory_required(&config, NULL, 0);
    void *memory = bytes > 0 ? malloc((size_t)bytes) : NULL;
    error = memory ? fathom_init(&run.scan, &config, memory, (size_t)bytes, NULL, 0) : FATHOM_ERROR_MEMORY;
    const int failed = error == FATHOM_OK ? track(&run, from, every) : fail("fathom_init", error);
    fathom_close(run.scan);
    fathom_recording_close(run.recording);
    free(memory);
    return failed;
}
