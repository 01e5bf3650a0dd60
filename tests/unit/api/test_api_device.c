/* The public API: the OpenCL device. Kernels that don't build, no platform, the kernel cache, contexts side by side.
 * What depends on the environment runs in a child: this program again, with an argument. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dirent.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "synthetic.h"

#define FRAMES 6
static synthetic_frame frames[FRAMES];
static synthetic_log kept;

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_ROOM, 0, FRAMES, frames);
    return 0;
}

static fathom_config logged(void) {
    fathom_config c = synthetic_config(frames[0].timestamp_ns != 0 ? &frames[0] : NULL); /* none in a child */
    memset(&kept, 0, sizeof kept);
    c.log = synthetic_logger;
    c.log_user = &kept;
    return c;
}

/* ---- failures ----------------------------------------------------------------------------------------------------- */

/* Tries to start, prints what the log got, and ends with the error as its status. */
static int start_and_say(void) {
    fathom_config c = logged();
    c.cache_folder = "";
    int64_t bytes = fathom_memory_required(&c, NULL, 0);
    fathom *scan = (fathom *)&kept;
    int e = (int)bytes;
    if (bytes > 0) {
        void *block = malloc((size_t)bytes);
        e = fathom_init(&scan, &c, block, (size_t)bytes, NULL, 0);
        if (e == FATHOM_OK) {
            fathom_close(scan);
        } else if (scan) {
            printf("the context isn't NULL\n");
        }
        free(block);
    }
    printf("%s\n%s", fathom_error_name(e), kept.text);
    return -e;
}

static void a_kernel_that_does_not_build_shows_its_log(void **state) {
    (void)state;
    static char text[65536];
    int status = synthetic_child("start", "FATHOM_KERNEL_OPTIONS=-DLANES=broken(", text, sizeof text);
    if (status != -FATHOM_ERROR_KERNEL) print_error("status %d: %s\n", status, text);
    assert_int_equal(status, -FATHOM_ERROR_KERNEL);
    assert_non_null(strstr(text, "FATHOM_ERROR_KERNEL"));
    assert_non_null(strstr(text, "didn't build"));
    assert_non_null(strstr(text, "error:")); /* the compiler's own words */
    assert_non_null(strstr(text, ".cl:"));   /* with our file's name and line */
    assert_non_null(strstr(text, "broken")); /* and what was wrong */
    assert_null(strstr(text, "isn't NULL"));

    status = synthetic_child("start", "FATHOM_KERNEL_OPTIONS=-cl-no-such-option", text, sizeof text);
    assert_int_equal(status, -FATHOM_ERROR_KERNEL);
    assert_int_equal(synthetic_child("start", NULL, text, sizeof text), 0); /* without it all is well */
}

static void no_platform_is_a_clear_line(void **state) {
    (void)state;
    static char text[65536];
    char variable[4200];
    snprintf(variable, sizeof variable, "OCL_ICD_VENDORS=%s/", synthetic_folder("no_vendors"));
    int status = synthetic_child("start", variable, text, sizeof text);
    if (status != -FATHOM_ERROR_DEVICE) print_error("status %d: %s\n", status, text);
    assert_int_equal(status, -FATHOM_ERROR_DEVICE);
    const char *line = strstr(text, "no OpenCL platform");
    assert_non_null(line);
    assert_non_null(strstr(line, "install")); /* and says what to do */
    line = strchr(line, '\n');
    assert_true(line && line[1] == 0); /* one line */
}

/* ---- the cache ---------------------------------------------------------------------------------------------------- */

/* Empties a folder; or, with `to`, writes over each file in it. Returns the number of files. */
static int each_file(const char *folder, const char *to, size_t size, long truncate_to) {
    DIR *d = opendir(folder);
    int count = 0;
    assert_non_null(d);
    for (struct dirent *e; (e = readdir(d));) {
        char path[4600];
        struct stat st;
        snprintf(path, sizeof path, "%s/%s", folder, e->d_name);
        if (stat(path, &st) != 0 || !S_ISREG(st.st_mode)) continue;
        count++;
        if (truncate_to >= 0) {
            assert_int_equal(truncate(path, st.st_size * truncate_to / 100), 0);
        } else if (to) {
            FILE *f = fopen(path, "wb");
            assert_non_null(f);
            assert_int_equal(fwrite(to, 1, size, f), size);
            fclose(f);
        } else {
            unlink(path);
        }
    }
    closedir(d);
    return count;
}

static int files_in(const char *folder) {
    DIR *d = opendir(folder);
    int count = 0;
    for (struct dirent *e; d && (e = readdir(d));) count += e->d_name[0] != '.';
    if (d) closedir(d);
    return count;
}

/* Starts with a cache folder, steps, and gives the last pose. */
static void run_with_cache(const char *folder, fathom_pose *end) {
    fathom_config c = logged();
    c.cache_folder = folder;
    synthetic_context s = synthetic_start(&c);
    for (int i = 0; i < FRAMES; i++) *end = synthetic_step(s.scan, &frames[i]).pose;
    synthetic_stop(&s);
    assert_int_equal(kept.errors, 0);
}

static void the_second_start_takes_its_kernels_from_the_cache(void **state) {
    (void)state;
    static char folder[4200], text[65536], variable[4300];
    fathom_pose first, second;
    snprintf(folder, sizeof folder, "%s", synthetic_folder("cache_fresh"));
    each_file(folder, NULL, 0, -1);
    run_with_cache(folder, &first);
    assert_int_equal(files_in(folder), 1); /* and nothing half-written beside it */
    run_with_cache(folder, &second);
    assert_int_equal(files_in(folder), 1);
    assert_memory_equal(&first, &second, sizeof first);
    /* a build that can't succeed does no harm: nothing is built any more */
    assert_int_equal(setenv("FATHOM_KERNEL_OPTIONS", "-cl-no-such-option", 1), 0);
    run_with_cache(folder, &second);
    unsetenv("FATHOM_KERNEL_OPTIONS");
    assert_memory_equal(&first, &second, sizeof first);
    /* NULL: in the user's cache */
    snprintf(variable, sizeof variable, "XDG_CACHE_HOME=%s", synthetic_folder("cache_home"));
    each_file(synthetic_folder("cache_home/fathom"), NULL, 0, -1);
    assert_int_equal(synthetic_child("default-cache", variable, text, sizeof text), 0);
    snprintf(folder, sizeof folder, "%s", synthetic_folder("cache_home/fathom"));
    assert_int_equal(files_in(folder), 1);
}

static void a_cache_that_is_broken_is_built_anew(void **state) {
    (void)state;
    static char folder[4200], text[65536];
    static const char rubbish[5000] = "this is no program";
    snprintf(folder, sizeof folder, "%s", synthetic_folder("cache_broken"));
    each_file(folder, NULL, 0, -1);
    fathom_pose first, again;
    run_with_cache(folder, &first);
    for (int kind = 0; kind < 5; kind++) {
        int files = kind == 0   ? each_file(folder, rubbish, sizeof rubbish, -1)
                    : kind == 1 ? each_file(folder, rubbish, 3, -1)
                    : kind == 2 ? each_file(folder, NULL, 0, 0)   /* empty */
                    : kind == 3 ? each_file(folder, NULL, 0, 50)  /* half, as after a full disk */
                                : each_file(folder, NULL, 0, 99); /* nearly all */
        assert_int_equal(files, 1);
        /* in a child: an OpenCL runtime that trips over it must not take this program along */
        int status = synthetic_child("broken-cache", NULL, text, sizeof text);
        if (status != 0) print_error("kind %d, status %d: %s\n", kind, status, text);
        assert_int_equal(status, 0);
        run_with_cache(folder, &again); /* it has been written again, whole */
        assert_memory_equal(&first, &again, sizeof first);
        assert_null(strstr(kept.text, "building anew"));
    }
}

static void a_cache_that_cannot_be_written_is_done_without(void **state) {
    (void)state;
    static char folder[4300];
    fathom_pose end;
    run_with_cache("/proc/fathom-cache", &end); /* can't be made */
    assert_true(kept.warnings <= 1);
    assert_non_null(strstr(kept.text, "/proc/fathom-cache"));
    snprintf(folder, sizeof folder, "%s/file", synthetic_folder("cache_file"));
    FILE *f = fopen(folder, "w"); /* not a folder */
    assert_non_null(f);
    fclose(f);
    run_with_cache(folder, &end);
    unlink(folder);
    memset(folder, 'x', sizeof folder - 1); /* a name that is too long */
    folder[0] = '/';
    run_with_cache(folder, &end);
}

/* Makes a folder of exactly `length` characters below another one; `path` has room for it. */
static void long_folder(const char *name, size_t length, char *path) {
    size_t n = (size_t)snprintf(path, length, "%s", synthetic_folder(name));
    assert_true(n + 2 < length);
    while (n < length) { /* no name is longer than 255, and none is empty */
        size_t part = length - n - 1;
        if (part > 200) part = part == 201 ? 150 : 200;
        path[n] = '/';
        memset(path + n + 1, 'f', part);
        n += 1 + part;
        path[n] = 0;
        mkdir(path, 0777);
    }
}

/* The file's name takes 21 characters more, its own until it is whole a point and a process's number, and a path has 4095. */
static void a_cache_path_of_any_length_is_used_whole_or_refused_in_words(void **state) {
    (void)state;
    static char folder[6001], variable[6100], text[65536];
    fathom_pose end;
    static const size_t used[] = {400, 620, 1000, 2047, 4060}, refused[] = {4073, 4075, 4094, 4095, 4096, 6000};
    for (int i = 0; i < 5; i++) {
        long_folder("cache_long", used[i], folder);
        each_file(folder, NULL, 0, -1);
        run_with_cache(folder, &end);
        assert_int_equal(kept.warnings, 0);
        assert_int_equal(each_file(folder, NULL, 0, -1), 1);
    }
    for (int i = 0; i < 6; i++) {
        long_folder("cache_long", refused[i], folder);
        if (refused[i] < 4096) each_file(folder, NULL, 0, -1);
        run_with_cache(folder, &end);
        assert_int_equal(kept.warnings, 1);
        assert_non_null(strstr(kept.text, "too long"));
        assert_int_equal(files_in(folder), 0);
    }
    /* PoCL keeps its own cache in the same place, and ends the program where that is too long */
    assert_int_equal(setenv("POCL_CACHE_DIR", synthetic_folder("cache_pocl"), 1), 0);
    for (int i = 0; i < 3; i++) { /* the user's own: seven characters more */
        const size_t lengths[] = {1000, 4080, 4095};
        long_folder("cache_long_home", lengths[i], folder);
        snprintf(variable, sizeof variable, "XDG_CACHE_HOME=%s", folder);
        assert_int_equal(synthetic_child("default-cache", variable, text, sizeof text), 0);
        assert_true((strstr(text, "too long") != NULL) == (i > 0));
        if (i > 0) continue;
        strcat(folder, "/fathom");
        assert_int_equal(each_file(folder, NULL, 0, -1), 1);
    }
    unsetenv("POCL_CACHE_DIR");
}

/* ---- contexts ----------------------------------------------------------------------------------------------------- */

static void contexts_side_by_side_are_as_one_after_another(void **state) {
    (void)state;
    fathom_config near = logged(), far = near;
    far.voxel_m = 0.03f; /* another scan: other settings, frames the other way round */
    far.max_blocks = 3000;
    far.first_pose = frames[FRAMES - 1].pose;
    fathom_result alone[2][FRAMES];
    synthetic_frame back[FRAMES];
    for (int i = 0; i < FRAMES; i++) {
        back[i] = frames[FRAMES - 1 - i];
        back[i].timestamp_ns = frames[i].timestamp_ns;
    }
    synthetic_context a = synthetic_start(&near);
    for (int i = 0; i < FRAMES; i++) alone[0][i] = synthetic_step(a.scan, &frames[i]);
    synthetic_stop(&a);
    synthetic_context b = synthetic_start(&far);
    for (int i = 0; i < FRAMES; i++) alone[1][i] = synthetic_step(b.scan, &back[i]);
    synthetic_stop(&b);
    a = synthetic_start(&near);
    b = synthetic_start(&far);
    for (int i = 0; i < FRAMES; i++) {
        fathom_result one = synthetic_step(a.scan, &frames[i]), two = synthetic_step(b.scan, &back[i]);
        assert_int_equal(one.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
        assert_int_equal(two.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
        assert_memory_equal(&one.pose, &alone[0][i].pose, sizeof one.pose);
        assert_memory_equal(&two.pose, &alone[1][i].pose, sizeof two.pose);
        assert_memory_equal(one.pose_covariance, alone[0][i].pose_covariance, sizeof one.pose_covariance);
        assert_int_equal(two.blocks, alone[1][i].blocks);
        if (i == 2) assert_int_equal(fathom_pause(b.scan, false), FATHOM_OK);
    }
    synthetic_stop(&a); /* one may go while the other stays */
    assert_int_equal(fathom_reset(b.scan), FATHOM_OK);
    assert_int_equal(synthetic_step(b.scan, &back[0]).state, FATHOM_FIRST);
    synthetic_stop(&b);
}

typedef struct {
    fathom *scan;
    fathom_pose end;
    int failed;
} stepper;

static void *step_all(void *argument) {
    stepper *s = argument;
    for (int i = 0; i < FRAMES; i++) {
        fathom_depth_frame frame =
            synthetic_depth(frames[i].timestamp_ns, frames[i].depth, SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT);
        fathom_result r = FATHOM_STRUCT(fathom_result);
        s->failed |= fathom_step(s->scan, &frame, &r) != FATHOM_OK;
        s->end = r.pose;
    }
    return NULL;
}

static void contexts_step_on_threads_of_their_own(void **state) {
    (void)state;
    fathom_config c = synthetic_config(&frames[0]);
    synthetic_context a = synthetic_start(&c), b = synthetic_start(&c);
    stepper one = {.scan = a.scan}, two = {.scan = b.scan};
    pthread_t first, second;
    assert_int_equal(pthread_create(&first, NULL, step_all, &one), 0);
    assert_int_equal(pthread_create(&second, NULL, step_all, &two), 0);
    pthread_join(first, NULL);
    pthread_join(second, NULL);
    assert_int_equal(one.failed + two.failed, 0);
    assert_memory_equal(&one.end, &two.end, sizeof one.end);
    assert_true(synthetic_distance(one.end, frames[FRAMES - 1].pose) < 0.005);
    synthetic_stop(&a);
    synthetic_stop(&b);
}

static int start_with(const char *cache, const char *wanted) {
    fathom_config c = logged();
    c.cache_folder = cache ? synthetic_folder(cache) : NULL;
    int64_t bytes = fathom_memory_required(&c, NULL, 0);
    void *block = malloc((size_t)bytes);
    fathom *scan = NULL;
    int e = bytes > 0 ? fathom_init(&scan, &c, block, (size_t)bytes, NULL, 0) : (int)bytes;
    printf("%s\n%s", fathom_error_name(e), kept.text);
    bool said = !wanted || strstr(kept.text, wanted);
    if (e == FATHOM_OK) fathom_close(scan);
    free(block);
    return e != FATHOM_OK ? -e : !said;
}

int main(int argc, char **argv) {
    if (argc == 2 && strcmp(argv[1], "start") == 0) return start_and_say();
    if (argc == 2 && strcmp(argv[1], "default-cache") == 0) return start_with(NULL, NULL);
    if (argc == 2 && strcmp(argv[1], "broken-cache") == 0) return start_with("cache_broken", "building anew");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_kernel_that_does_not_build_shows_its_log),
        cmocka_unit_test(no_platform_is_a_clear_line),
        cmocka_unit_test(the_second_start_takes_its_kernels_from_the_cache),
        cmocka_unit_test(a_cache_that_is_broken_is_built_anew),
        cmocka_unit_test(a_cache_that_cannot_be_written_is_done_without),
        cmocka_unit_test(a_cache_path_of_any_length_is_used_whole_or_refused_in_words),
        cmocka_unit_test(contexts_side_by_side_are_as_one_after_another),
        cmocka_unit_test(contexts_step_on_threads_of_their_own),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
