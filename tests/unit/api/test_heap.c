/* Fixed memory: after fathom_init nothing of the library's own code takes memory from the heap, and the process doesn't
 * grow. The library under test is BUILD/libfathom.so, loaded from beside this program, so that its text is a range of
 * addresses; the heap's entry points are this program's, and count the calls that return into that range. What could go
 * round them (operator new, strdup, fopen: heap calls of another library on its behalf) it must not even import. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dlfcn.h>
#include <link.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "bench/heap_count.h"
#include "base/se3.h"
#include "synthetic.h"

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define SANITIZED 1
#else
#define SANITIZED 0
#endif

#define FRAMES 40

/* ---- the library -------------------------------------------------------------------------------------------------- */

static struct {
    int64_t (*memory_required)(const fathom_config *, char *, size_t);
    int (*init)(fathom **, const fathom_config *, void *, size_t, char *, size_t);
    void (*close)(fathom *);
    int (*reset)(fathom *);
    int (*push_imu)(fathom *, const fathom_imu_sample *);
    int (*step)(fathom *, const fathom_depth_frame *, fathom_result *);
    int (*inertial_estimate)(fathom *, int64_t, int64_t, fathom_motion *);
    int (*cast_view)(fathom *, const fathom_view *, float *, float *);
    int64_t (*extract_mesh)(fathom *, float, fathom_triangles, void *);
    int (*get_counters)(fathom *, fathom_counters *);
} lib;

static char so_path[4200];
static uintptr_t text_low, text_high; /* of the library */

static int find_text(struct dl_phdr_info *info, size_t size, void *data) {
    (void)size;
    uintptr_t inside = (uintptr_t)data;
    for (int i = 0; i < info->dlpi_phnum; i++) {
        const ElfW(Phdr) *p = &info->dlpi_phdr[i];
        uintptr_t low = info->dlpi_addr + p->p_vaddr, high = low + p->p_memsz;
        if (p->p_type == PT_LOAD && (p->p_flags & PF_X) && inside >= low && inside < high) {
            text_low = low;
            text_high = high;
            return 1;
        }
    }
    return 0;
}

static void load(void *handle, const char *name, void *function) {
    void *found = dlsym(handle, name);
    if (!found) fail_msg("%s has no %s", so_path, name);
    memcpy(function, &found, sizeof found); /* ISO C has no cast for it */
}

static synthetic_frame frames[FRAMES];

static int setup(void **state) {
    (void)state;
    ssize_t n = readlink("/proc/self/exe", so_path, 4000);
    if (n <= 0) return -1;
    so_path[n] = 0;
    *strrchr(so_path, '/') = 0;
    strcpy(strrchr(so_path, '/'), "/libfathom.so"); /* BUILD/tests/test_heap: one up */
    void *handle = dlopen(so_path, RTLD_NOW | RTLD_LOCAL);
    if (!handle) {
        print_error("%s\n", dlerror());
        return -1;
    }
    load(handle, "fathom_memory_required", &lib.memory_required);
    load(handle, "fathom_init", &lib.init);
    load(handle, "fathom_close", &lib.close);
    load(handle, "fathom_reset", &lib.reset);
    load(handle, "fathom_push_imu", &lib.push_imu);
    load(handle, "fathom_step", &lib.step);
    load(handle, "fathom_inertial_estimate", &lib.inertial_estimate);
    load(handle, "fathom_cast_view", &lib.cast_view);
    load(handle, "fathom_extract_mesh", &lib.extract_mesh);
    load(handle, "fathom_get_counters", &lib.get_counters);
    uintptr_t step;
    memcpy(&step, &lib.step, sizeof step);
    dl_iterate_phdr(find_text, (void *)step);
    synthetic_render(SCENE_DESK, 0, FRAMES, frames);
    return text_high > text_low ? 0 : -1;
}

/* ---- a run -------------------------------------------------------------------------------------------------------- */

static fathom *scan;
static void *block;
static int64_t stamp;

static void begin(int width) {
    fathom_config c = synthetic_config(NULL);
    c.align_width = width;
    c.align_height = width * SYNTHETIC_HEIGHT / SYNTHETIC_WIDTH;
    int64_t bytes = lib.memory_required(&c, NULL, 0);
    assert_true(bytes > 0);
    block = malloc((size_t)bytes);
    assert_non_null(block);
    memset(block, 0, (size_t)bytes); /* the caller's, and so resident from the start */
    assert_int_equal(lib.init(&scan, &c, block, (size_t)bytes, NULL, 0), FATHOM_OK);
    stamp = 0;
}

static void end(void) {
    lib.close(scan);
    free(block);
}

/* The frame of step i: the walk goes to and fro. */
static const synthetic_frame *frame_of(int i) {
    int k = i % (2 * FRAMES - 2);
    return &frames[k < FRAMES ? k : 2 * FRAMES - 2 - k];
}

/* Step i with its samples; every 50th frame is blank. */
static fathom_result walk(int i) {
    static const synthetic_frame blank;
    const synthetic_frame *f = frame_of(i), *before = frame_of(i > 0 ? i - 1 : 0);
    fathom_depth_frame frame = synthetic_depth(stamp += SYNTHETIC_PERIOD_NS, i % 50 == 49 ? blank.depth : f->depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
    fathom_result r = FATHOM_STRUCT(fathom_result);
    pose from, to;
    double turn[3];
    assert_true(pose_take(&before->pose, &from) && pose_take(&f->pose, &to));
    from = pose_between(&from, &to);
    so3_log(from.r, turn);
    for (int j = 6; j >= 0; j--) { /* turning as the frames do; a shaking hand, never still */
        fathom_imu_sample s = {stamp - j * 4800000, {0}, {j % 2 ? 0.6f : -0.6f, -9.8f, 0}};
        for (int k = 0; k < 3; k++) s.gyro[k] = (float)(turn[k] / (1e-9 * SYNTHETIC_PERIOD_NS));
        lib.push_imu(scan, &s);
    }
    assert_int_equal(lib.step(scan, &frame, &r), FATHOM_OK);
    return r;
}

static int no_triangles(void *user, const fathom_vertex *vertices, size_t count) {
    (void)user;
    (void)vertices;
    (void)count;
    return 0;
}

/* ---- tests -------------------------------------------------------------------------------------------------------- */

static __attribute__((noinline)) void *takes_memory(size_t size) {
    void *volatile p = malloc(size);
    *(volatile char *)p = 1;
    return p;
}

static void the_counter_counts(void **state) {
    (void)state;
    uintptr_t helper;
    void *(*function)(size_t) = takes_memory;
    memcpy(&helper, &function, sizeof helper);
    heap_count_watch(helper, helper + 64); /* the helper's own code */
    const long watched = heap_count_watched(), all = heap_count_all();
    void *p = takes_memory(100);
    assert_int_equal(heap_count_watched() - watched, 1);
    free(p); /* from elsewhere */
    assert_int_equal(heap_count_watched() - watched, 1);
    assert_true(heap_count_all() - all >= 2);
    heap_count_watch(text_low, text_high);
    p = takes_memory(100);
    free(p);
    assert_int_equal(heap_count_watched() - watched, 1); /* not the library's */
}

static void two_hundred_steps_make_no_call_to_the_heap(void **state) {
    (void)state;
    int tracked = 0;
    fathom_motion motion = FATHOM_STRUCT(fathom_motion);
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    static float depth[100 * 80], normals[3 * 100 * 80];
    fathom_view view = FATHOM_STRUCT(fathom_view);
    view.camera = (fathom_pinhole){.width = 100, .height = 80, .fx = 80, .fy = 80, .cx = 50, .cy = 40};
    view.pose.orientation[3] = 1;
    begin(SYNTHETIC_WIDTH);
    heap_count_watch(text_low, text_high);
    const long watched = heap_count_watched(), every = heap_count_all();
    for (int i = 0; i < 200; i++) {
        fathom_result r = walk(i);
        tracked += r.state <= FATHOM_TRACKED;
        assert_int_equal(lib.inertial_estimate(scan, stamp - 10000000, stamp, &motion), FATHOM_OK);
        if (i % 40 != 39) continue; /* nor what else can be called between steps */
        assert_int_equal(lib.get_counters(scan, &counters), FATHOM_OK);
        assert_int_equal(lib.cast_view(scan, &view, depth, normals), FATHOM_OK);
        assert_true(lib.extract_mesh(scan, 0, no_triangles, NULL) > 0);
        if (i == 119) assert_int_equal(lib.reset(scan), FATHOM_OK);
    }
    const long own = heap_count_watched() - watched, all = heap_count_all() - every;
    end();
    print_message("%ld calls of the heap by libfathom, %ld by all, %d of 200 tracked\n", own, all, tracked);
    assert_int_equal(own, 0);
    assert_true(all > 0); /* the OpenCL runtime's: the counter was in place */
    assert_true(tracked >= 190);
}

static long status_kb(const char *format) {
    char line[200];
    long kb = -1;
    FILE *f = fopen("/proc/self/status", "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f))
        if (sscanf(line, format, &kb) == 1) break;
    fclose(f);
    return kb;
}

static void two_thousand_steps_do_not_grow_the_process(void **state) {
    (void)state;
    /* PoCL compiles a kernel for its work-group's size when it is first launched and keeps that on disk. A process that
     * has to do it grows by some 13 MB of the compiler's; so one before this one does. */
    char text[4096];
    assert_int_equal(synthetic_child("warm", NULL, text, sizeof text), 0);
    begin(32);
    const char *peak = "VmHWM: %ld", *resident = "VmRSS: %ld";
    long start = status_kb(peak), early = 0;
    assert_true(start > 0);
    for (int i = 0; i < 2000; i++) {
        walk(i);
        if (i == 199) early = status_kb(resident);
    }
    long after = status_kb(peak), late = status_kb(resident);
    end();
    print_message(
        "VmHWM grew by %.2f MB from init (%.1f MB) to step 2000, VmRSS by %.2f MB from step 200 (%.1f MB)\n",
        (double)(after - start) / 1024, (double)start / 1024, (double)(late - early) / 1024,
        (double)early / 1024);
    assert_true(after - start <= 10 * 1024);
    assert_true(early > 0 &&
                late - early <= 10 * 1024); /* building the kernels may have raised the peak before */
}

/* fathom_selftest takes from the heap, and says so; all other objects of the library are looked at. */
static void the_library_imports_nothing_that_takes_memory(void **state) {
    (void)state;
    char command[4300], symbol[512];
    int symbols = 0;
    /* not free: Eigen imports it, for memory that a 6x6 system never takes */
    static const char *const taking[] = {
        "malloc",   "calloc",    "realloc", "reallocarray", "posix_memalign", "aligned_alloc",
        "memalign", "valloc",    "pvalloc", "strdup",       "__strdup",       "strndup",
        "asprintf", "vasprintf", "getline", "getdelim",     "fopen",          "fdopen",
        "fopen64",  "opendir",   "qsort",   "setenv",       "putenv",         "open_memstream"};
    snprintf(command, sizeof command, "find '%.*s/lib' -name '*.o' ! -path '*/selftest/*' -exec nm --undefined-only {} +",
             (int)(strrchr(so_path, '/') - so_path), so_path);
    FILE *p = popen(command, "r");
    assert_non_null(p);
    while (fscanf(p, "%511s", symbol) == 1) {
        char *at = strchr(symbol, '@');
        if (at) *at = 0;
        symbols++;
        bool bad = strncmp(symbol, "_Znw", 4) == 0 || strncmp(symbol, "_Zna", 4) == 0 ||
                   strncmp(symbol, "_Zdl", 4) == 0;
        for (size_t i = 0; i < sizeof taking / sizeof *taking; i++)
            bad = bad || strcmp(symbol, taking[i]) == 0;
        if (bad) print_error("%s imports %s\n", so_path, symbol);
        assert_false(bad);
    }
    assert_int_equal(pclose(p), 0);
    assert_true(symbols > 20); /* and it was read */
}

/* cmocka 1.1 writes a skipped test as "not ok ... # SKIP" and without a reason: written here instead. */
static void say_skipped(int number, const char *name, const char *reason) {
    printf("ok %d - %s # SKIP %s\n", number, name, reason);
}

static void a_few_steps(void **state) {
    (void)state;
    begin(32);
    for (int i = 0; i < 60; i++) walk(i);
    end();
}

int main(int argc, char **argv) {
    const struct CMUnitTest warm[] = {cmocka_unit_test(a_few_steps)};
    if (argc == 2 && strcmp(argv[1], "warm") == 0) return cmocka_run_group_tests(warm, setup, NULL);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_thousand_steps_do_not_grow_the_process), /* first, in a fresh process */
        cmocka_unit_test(the_counter_counts),
        cmocka_unit_test(two_hundred_steps_make_no_call_to_the_heap),
    };
    const struct CMUnitTest imports[] = {cmocka_unit_test(the_library_imports_nothing_that_takes_memory)};
    if (SANITIZED) {
        for (int i = 0; i < 3; i++)
            say_skipped(i + 1, tests[i].name, "the sanitizer has the heap for itself");
        say_skipped(4, imports[0].name, "a sanitizer's build imports its runtime");
        return 0;
    }
    int failed = cmocka_run_group_tests(tests, setup, NULL);
    if (system("nm --version >/dev/null 2>&1") == 0)
        return failed + cmocka_run_group_tests(imports, setup, NULL);
    say_skipped(4, imports[0].name, "nm is missing");
    return failed;
}
