/* The command's block store: a file without a name that keeps the blocks which made room. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dirent.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "fathom/files/block_store.h"
#include "synthetic.h"

/* Opens a store for fresh settings with that when_full. */
static bool open_store(struct block_store *store, const char *beside, fathom_config *c, int32_t when_full) {
    fathom_config_init(c);
    c->when_full = when_full;
    return block_store_open(store, beside, c);
}

static fathom_block block_of(int16_t distances[512], uint16_t weights[512], int n) {
    fathom_block b = {.key = {n, -n, 3 * n, 0}, .distances = distances, .weights = weights};
    for (int i = 0; i < 512; i++) {
        distances[i] = (int16_t)(n + i);
        weights[i] = (uint16_t)(n * i);
    }
    return b;
}

static void the_last_copy_comes_back(void **state) {
    (void)state;
    int16_t distances[512];
    uint16_t weights[512];
    struct block_store store;
    fathom_config c;
    assert_true(open_store(&store, NULL, &c, FATHOM_FULL_DROP));
    assert_ptr_equal(c.block_store, &store.calls);
    for (int round = 0; round < 2; round++)
        for (int n = 0; n < 3000; n++) {
            fathom_block b = block_of(distances, weights, n);
            distances[5] = (int16_t)(100 * round + 7);
            assert_int_equal(store.calls.put(&store, &b), 0);
        }
    assert_int_equal(store.count, 3000);
    assert_int_equal(lseek(store.fd, 0, SEEK_END), 3000 * 2048);
    for (int n = 2999; n >= 0; n--) {
        int16_t expected[512];
        uint16_t expected_weights[512];
        fathom_block b = block_of(expected, expected_weights, n);
        b.distances = distances;
        b.weights = weights;
        assert_int_equal(store.calls.get(&store, &b), 1);
        expected[5] = 107;
        assert_memory_equal(distances, expected, sizeof expected);
        assert_memory_equal(weights, expected_weights, sizeof expected_weights);
    }
    fathom_block other = block_of(distances, weights, 3000);
    assert_int_equal(store.calls.get(&store, &other), 0);
    other.key.z = 6;
    other.key.x = 2;
    other.key.y = -2;
    other.key.submap = 1; /* another's */
    assert_int_equal(store.calls.get(&store, &other), 0);
    fathom_block_key key;
    assert_int_equal(store.calls.enumerate(&store, 2999, &key), 1);
    assert_true(key.x == 2999 && key.z == 3 * 2999);
    assert_int_equal(store.calls.enumerate(&store, 3000, &key), 0);
    block_store_close(&store);
}

static int files_in(const char *folder) {
    int count = 0;
    DIR *d = opendir(folder);
    assert_non_null(d);
    for (struct dirent *e; (e = readdir(d));) count += e->d_name[0] != '.';
    closedir(d);
    return count;
}

/* A file that may not grow stands for a full disk: what was kept before stays, the rest is counted. */
static void a_full_disk_loses_only_what_came_after(void **state) {
    (void)state;
    int16_t distances[512];
    uint16_t weights[512];
    struct block_store store;
    char beside[4200];
    fathom_config c;
    snprintf(beside, sizeof beside, "%s/mesh.ply", synthetic_folder("store"));
    assert_true(open_store(&store, beside, &c, FATHOM_FULL_DROP));
    assert_int_equal(files_in(synthetic_folder("store")), 0); /* it has no name */
    struct rlimit before, tight;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    tight = before;
    tight.rlim_cur = 100 * 2048 + 1000;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
    for (int n = 0; n < 150; n++) {
        fathom_block b = block_of(distances, weights, n);
        assert_int_equal(store.calls.put(&store, &b), n < 100 ? 0 : -1);
    }
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(store.count, 100);
    assert_int_equal(store.lost, 50);
    for (int n = 0; n < 150; n++) {
        fathom_block b = block_of(distances, weights, n);
        assert_int_equal(store.calls.get(&store, &b), n < 100);
    }
    assert_int_equal(store.lost, 50);
    assert_int_equal(ftruncate(store.fd, 10 * 2048),
                     0); /* a disk that loses data: told, and nothing made up */
    fathom_block gone = block_of(distances, weights, 20);
    assert_int_equal(store.calls.get(&store, &gone), -1);
    assert_int_equal(store.lost, 51);
    block_store_close(&store);
}

static void a_place_that_cant_be_written_is_known_at_once(void **state) {
    (void)state;
    struct block_store store;
    fathom_config c;
    const char *beside = "/dev/null/mesh.ply"; /* no folder, whatever the machine holds */
    assert_false(open_store(&store, beside, &c, FATHOM_FULL_DROP));
    assert_null(store.path);
    /* where nothing is dropped there is no file */
    assert_true(open_store(&store, beside, &c, FATHOM_FULL_STOP));
    assert_null(c.block_store);
    block_store_close(&store);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_last_copy_comes_back),
        cmocka_unit_test(a_full_disk_loses_only_what_came_after),
        cmocka_unit_test(a_place_that_cant_be_written_is_known_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
