/* Every kernel check on every OpenCL device that is present, in the device's own kernel shape and in the GPU's, with
 * buffers in the caller's memory and in the runtime's; and that nothing depends on the number of threads.
 *
 *     test_kernels             all of it
 *     test_kernels --digest N  prints a digest of what device N finds, and ends (the thread test runs this)
 *
 * FATHOM_CHECK_SIZE=small keeps the pictures small, and leaves the thread test out (tests/e2e/oclgrind.sh). */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "context.h"
#include "map/mesh.h"
#include "kernel_checks_real.h"
#include "selftest/kernel_checks_bench.h"

/* ---- every check, everywhere ---------------------------------------------------------------------------------- */

typedef struct {
    char name[128];     /* of the device */
    char platform[128]; /* both exactly as device_choose looks for them */
    bool alone;         /* the platform's name already picks it */
} place;

typedef struct {
    const char *says;
    fathom_buffers buffers;
    kernel_shape shape;
} variant;

static const variant variants[] = {
    {"own shape, buffers as by default", FATHOM_BUFFERS_AUTO, SHAPE_OWN},
    {"the other width, buffers as by default", FATHOM_BUFFERS_AUTO, SHAPE_OTHER},
    {"GPU's shape, buffers on the device", FATHOM_BUFFERS_DEVICE, SHAPE_GPU},
};

#define VARIANTS 3
#define MOST 8

static place places[MOST];
static int place_count;

static void find_places(void) {
    cl_platform_id platforms[MOST];
    cl_uint count = 0;
    if (clGetPlatformIDs(MOST, platforms, &count) != CL_SUCCESS) return;
    for (cl_uint p = 0; p < count && p < MOST && place_count < MOST; p++) {
        cl_device_id ids[MOST];
        cl_uint devices = 0;
        if (clGetDeviceIDs(platforms[p], CL_DEVICE_TYPE_ALL, MOST, ids, &devices) != CL_SUCCESS) continue;
        for (cl_uint i = 0; i < devices && i < MOST && place_count < MOST; i++) {
            place *at = &places[place_count++];
            clGetPlatformInfo(platforms[p], CL_PLATFORM_NAME, sizeof at->platform - 1, at->platform, NULL);
            clGetDeviceInfo(ids[i], CL_DEVICE_NAME, sizeof at->name - 1, at->name, NULL);
            at->alone = devices == 1;
        }
    }
}

static void to_stderr(void *user, fathom_log_level level, const char *text) {
    (void)user;
    if (level != FATHOM_LOG_INFO) fprintf(stderr, "%s\n", text);
}

/* A device, open in one variant; all its checks share it. */
typedef struct {
    const place *at;
    const variant *how;
    const kernel_check *check;
    char title[256];
} job;

static const kernel_check real_frame = {"all of them, on a real frame", check_real_frame, true};

static bool small;
static device open_device;
static fathom_config open_config;
static const job *opened;

static void close_device(void) {
    if (opened) device_close(&open_device);
    opened = NULL;
}

static void runs_like_the_reference(void **state) {
    job *j = *state;
    if (!opened || opened->at != j->at || opened->how != j->how) {
        close_device();
        fathom_config_init(&open_config);
        open_config.device = j->at->alone ? j->at->platform : j->at->name;
        open_config.buffers = j->how->buffers;
        open_config.log = to_stderr;
        assert_int_equal(kernel_checks_open(&open_device, &open_config, j->how->shape), FATHOM_OK);
        opened = j;
    }
    char why[256] = "";
    fathom_check result = j->check->run(&open_device, small, why, sizeof why);
    if (result == FATHOM_CHECK_SKIPPED) /* cmocka 1.1.5 writes "not ok" for its own skip() */
        snprintf(j->title + strlen(j->title), sizeof j->title - strlen(j->title), " # SKIP %s", why);
    if (result == FATHOM_CHECK_FAILED) fail_msg("%s", why);
}

/* ---- any number of threads ------------------------------------------------------------------------------------ */

static void digest_bytes(uint64_t *h, const void *data, size_t size) { /* FNV-1a */
    for (size_t i = 0; i < size; i++) *h = (*h ^ ((const unsigned char *)data)[i]) * 1099511628211ull;
}

static int digest_triangles(void *h, const fathom_vertex *vertices, size_t count) {
    digest_bytes(h, vertices, count * 3 * sizeof *vertices);
    return 0;
}

/* Some frames of a bent surface seen from a moving camera, through the whole library: alignment sums, block places,
 * voxels, poses and triangles, to the last bit. */
static int print_digest(const char *name) {
    enum { WIDTH = 160, HEIGHT = 120 };
    static uint16_t frame[WIDTH * HEIGHT];
    fathom_config c;
    fathom_config_init(&c);
    c.depth_camera.width = WIDTH;
    c.depth_camera.height = HEIGHT;
    c.depth_camera.fx = c.depth_camera.fy = 131;
    c.depth_camera.cx = 79.5f;
    c.depth_camera.cy = 59.5f;
    c.voxel_m = 0.02f;
    c.max_blocks = 4000;
    c.device = name;
    c.imu = false;
    c.log = to_stderr;
    int64_t size = fathom_memory_required(&c, NULL, 0);
    fathom *f = NULL;
    void *memory = size > 0 ? malloc((size_t)size) : NULL;
    if (!memory || fathom_init(&f, &c, memory, (size_t)size, NULL, 0) != FATHOM_OK) return 1;
    uint64_t h = 14695981039346656037ull;
    int tracked = 0;
    for (int i = 0; i < 6; i++) {
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            double u = (k % WIDTH - 79.5) / 131 + 0.004 * i, v = (k / WIDTH - 59.5) / 131;
            double bump = u * u + v * v < 0.04 ? 0.3 - 6 * (u * u + v * v) : 0;
            frame[k] = (uint16_t)(1000 * (1.4 + 0.2 * u - 0.3 * v + (u > 0.35 ? -0.3 : 0) - bump) +
                                  (k * 7919u >> 4) % 3);
        }
        fathom_depth_frame scan = {.struct_size = sizeof scan,
                                   .timestamp_ns = 33333333 * (int64_t)(i + 1),
                                   .depth = frame,
                                   .width = WIDTH,
                                   .height = HEIGHT};
        fathom_result r = FATHOM_STRUCT(fathom_result);
        if (fathom_step(f, &scan, &r) != FATHOM_OK) return 1;
        tracked += r.state == FATHOM_TRACKED || r.state == FATHOM_FIRST;
        digest_bytes(&h, &r.pose, sizeof r.pose);
        digest_bytes(&h, r.pose_covariance, sizeof r.pose_covariance);
        digest_bytes(&h, r.singular_values, sizeof r.singular_values);
        void *sums = device_map(&f->device, &f->tracker.aligner.sums, CL_MAP_READ);
        if (i > 0 && sums) digest_bytes(&h, sums, (size_t)HEIGHT * SUMS * 4);
        device_unmap(&f->device, &f->tracker.aligner.sums, sums);
        void *blocks = device_map(&f->device, &f->volume.pool.keys, CL_MAP_READ);
        if (blocks) digest_bytes(&h, blocks, (size_t)f->volume.pool.count * sizeof(cl_int4));
        device_unmap(&f->device, &f->volume.pool.keys, blocks);
        void *voxels = device_map(&f->device, &f->volume.pool.voxels, CL_MAP_READ);
        if (voxels) digest_bytes(&h, voxels, (size_t)f->volume.pool.count * BLOCK_BYTES);
        device_unmap(&f->device, &f->volume.pool.voxels, voxels);
    }
    int64_t triangles = fathom_extract_mesh(f, 0, digest_triangles, &h);
    printf("%016llx tracked %d, blocks %d, triangles %lld\n", (unsigned long long)h, tracked, f->volume.pool.count,
           (long long)triangles);
    fathom_close(f);
    free(memory);
    return tracked == 6 && triangles > 1000 ? 0 : 1;
}

/* Runs this program again with --digest and so many threads (PoCL takes them from its environment before its first call;
 * others count the processors they may use). */
static void digest_with(int number, int threads, char *line, int size) {
    char self[512], command[700];
    ssize_t n = readlink("/proc/self/exe", self, sizeof self - 1);
    assert_true(n > 0);
    self[n] = 0;
    snprintf(command, sizeof command, "POCL_MAX_PTHREAD_COUNT=%d '%s' --digest %d %d", threads, self, number,
             threads);
    FILE *pipe = popen(command, "r");
    assert_non_null(pipe);
    *line = 0;
    char *got = fgets(line, size, pipe);
    assert_int_equal(pclose(pipe), 0);
    assert_non_null(got);
}

static void threads_change_nothing(void **state) {
    char one[128], two[128], again[128];
    int number = (int)(*(place *const *)state - places);
    digest_with(number, 1, one, sizeof one);
    digest_with(number, 2, two, sizeof two);
    digest_with(number, 2, again, sizeof again);
    print_message("# %s", one);
    assert_string_equal(one, two);
    assert_string_equal(one, again);
}

static int digest_main(int number, int threads) {
    if (threads == 1) {
        cpu_set_t one;
        CPU_ZERO(&one);
        CPU_SET(sched_getcpu(), &one);
        sched_setaffinity(0, sizeof one, &one);
    }
    find_places();
    if (number >= place_count) return 1;
    return print_digest(places[number].alone ? places[number].platform : places[number].name);
}

/* ---- main ------------------------------------------------------------------------------------------------------- */

static void there_is_a_device(void **state) {
    (void)state;
    assert_int_not_equal(place_count, 0);
}

int main(int argc, char **argv) {
    if (argc == 4 && strcmp(argv[1], "--digest") == 0) return digest_main(atoi(argv[2]), atoi(argv[3]));
    const char *asked = getenv("FATHOM_CHECK_SIZE");
    small = asked && strcmp(asked, "small") == 0;
    find_places();
    int count = 0;
    size_t most = (size_t)(1 + place_count * (1 + VARIANTS * (kernel_check_count + 1)));
    struct CMUnitTest *tests = bench_alloc(most * sizeof *tests);
    job *jobs = bench_alloc(most * sizeof *jobs);
    tests[count++] = (struct CMUnitTest){"there is an OpenCL device", there_is_a_device, NULL, NULL, NULL};
    for (int p = 0; p < place_count; p++) {
        for (int v = 0; v < VARIANTS; v++)
            for (int k = 0; k <= kernel_check_count; k++) {
                const kernel_check *check = k < kernel_check_count ? &kernel_checks[k] : &real_frame;
                if (variants[v].shape == SHAPE_OTHER && !check->wide) continue;
                job *j = &jobs[count];
                *j = (job){&places[p], &variants[v], check, ""};
                snprintf(j->title, sizeof j->title, "%s (%s; %.60s)", j->check->name, j->how->says,
                         j->at->platform);
                tests[count++] = (struct CMUnitTest){j->title, runs_like_the_reference, NULL, NULL, j};
            }
        if (small) continue;
        snprintf(jobs[count].title, sizeof jobs->title, "one thread or two: the same bits (%.60s)",
                 places[p].platform);
        tests[count] = (struct CMUnitTest){jobs[count].title, threads_change_nothing, NULL, NULL, &places[p]};
        count++;
    }
    int failed = _cmocka_run_group_tests("kernels", tests, (size_t)count, NULL, NULL);
    close_device();
    free(tests);
    free(jobs);
    return failed;
}
