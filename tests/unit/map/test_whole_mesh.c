/* Blocks that made room at the pool's bound are in the mesh: fathom_extract_whole_mesh with the command's block store. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <dirent.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "fathom/files/block_store.h"
#include "context.h"
#include "map/eviction.h"
#include "synthetic.h"

#define FRAMES 150 /* through a room, five seconds */
#define POOL 400   /* blocks; the first frame needs some 270, the whole way some 620 */
#define TRIANGLE (3 * sizeof(fathom_vertex))

static synthetic_frame frames[FRAMES];

static fathom_config settings(int blocks) {
    fathom_config c = synthetic_config(&frames[0]);
    c.voxel_m = 0.04f;
    c.max_blocks = blocks;
    c.when_full = FATHOM_FULL_DROP;
    return c;
}

/* A context that keeps what it drops beside the test program. */
static synthetic_context start_with(struct block_store *store, int blocks, fathom_buffers buffers) {
    char beside[4200];
    fathom_config c = settings(blocks);
    c.buffers = buffers;
    snprintf(beside, sizeof beside, "%s/mesh.ply", synthetic_folder("store"));
    assert_true(block_store_open(store, beside, &c));
    return synthetic_start(&c);
}

static synthetic_context start(struct block_store *store, int blocks) {
    return start_with(store, blocks, FATHOM_BUFFERS_AUTO);
}

static void stop(synthetic_context *s, struct block_store *store) {
    synthetic_stop(s);
    block_store_close(store);
}

static void walk(fathom *scan, int count) {
    for (int i = 0; i < count; i++) {
        fathom_result r = synthetic_step(scan, &frames[i]);
        assert_true(r.state == FATHOM_FIRST || r.state == FATHOM_TRACKED);
    }
}

static synthetic_mesh mesh_of(fathom *scan, const struct block_store *store, float min_weight) {
    synthetic_mesh mesh = {0};
    int64_t n = fathom_extract_whole_mesh(scan, min_weight, store ? store->indices : NULL,
                                          store ? store->count : 0, synthetic_triangles, &mesh);
    assert_true(n >= 0 && (size_t)n * 3 == mesh.count);
    return mesh;
}

static int by_bytes(const void *a, const void *b) {
    return memcmp(a, b, TRIANGLE);
}

static void sort_triangles(synthetic_mesh *mesh) {
    qsort(mesh->vertices, mesh->count / 3, TRIANGLE, by_bytes);
}

/* To an edge or a point. */
static bool shrunk(const fathom_vertex *v) {
    for (int i = 0; i < 3; i++)
        if (memcmp(v[i].position, v[(i + 1) % 3].position, sizeof v->position) == 0) return true;
    return false;
}

static void assert_same_triangles(synthetic_mesh *a, synthetic_mesh *b) {
    sort_triangles(a);
    sort_triangles(b);
    assert_int_equal(a->count, b->count);
    assert_memory_equal(a->vertices, b->vertices, a->count * sizeof *a->vertices);
}

static double area_of(const synthetic_mesh *mesh) {
    double sum = 0;
    for (size_t i = 0; i < mesh->count; i += 3) {
        const float *p = mesh->vertices[i].position, *q = mesh->vertices[i + 1].position,
                    *r = mesh->vertices[i + 2].position;
        double u[3], v[3];
        for (int k = 0; k < 3; k++) {
            u[k] = (double)q[k] - (double)p[k];
            v[k] = (double)r[k] - (double)p[k];
        }
        sum += 0.5 * sqrt(pow(u[1] * v[2] - u[2] * v[1], 2) + pow(u[2] * v[0] - u[0] * v[2], 2) +
                          pow(u[0] * v[1] - u[1] * v[0], 2));
    }
    return sum;
}

/* ---- the same surface, wherever its blocks are --------------------------------------------------------- */

/* A scan with room for everything; then more and more of its blocks are sent out, and each time the mesh is the same. */
static void drop_all_with(fathom_buffers buffers) {
    struct block_store store;
    synthetic_context s = start_with(&store, 3000, buffers);
    walk(s.scan, FRAMES);
    synthetic_mesh before = mesh_of(s.scan, &store, 0), heavy = mesh_of(s.scan, &store, 0.5f);
    assert_int_equal(store.count, 0);
    assert_true(before.count > 20000 && heavy.count < before.count && heavy.count > 1000);
    s.scan->integrator.frames += 100; /* nothing is in view any more */
    while (s.scan->volume.pool.count > 0) {
        int kept = s.scan->volume.pool.count;
        assert_true(eviction_make_room(&s.scan->volume, &s.scan->device, &s.scan->integrator, &s.scan->store, 100) > 0);
        synthetic_mesh pool = mesh_of(s.scan, NULL, 0), whole = mesh_of(s.scan, &store, 0),
                       whole_heavy = mesh_of(s.scan, &store, 0.5f);
        assert_true(s.scan->volume.pool.count < kept && pool.count < whole.count);
        assert_same_triangles(&before, &whole);
        assert_same_triangles(&heavy, &whole_heavy);
        free(pool.vertices);
        free(whole.vertices);
        free(whole_heavy.vertices);
    }
    synthetic_mesh singly = {0}; /* each block with nothing beside it but its neighbours */
    for (size_t i = 0; i < store.count; i++)
        assert_true(fathom_extract_whole_mesh(s.scan, 0, store.indices + 3 * i, 1, synthetic_triangles,
                                              &singly) >= 0);
    assert_same_triangles(&before, &singly);
    free(singly.vertices);
    free(before.vertices);
    free(heavy.vertices);
    stop(&s, &store);
}

static void dropping_takes_no_triangle_and_doubles_none(void **state) {
    (void)state;
    drop_all_with(FATHOM_BUFFERS_HOST);
}

static void nor_where_the_device_has_its_own_buffers(void **state) {
    (void)state;
    drop_all_with(FATHOM_BUFFERS_DEVICE);
}

/* What is asked for in vain is left out; what is in the pool isn't doubled. */
static void a_list_may_name_too_much(void **state) {
    (void)state;
    struct block_store store;
    synthetic_context s = start(&store, 3000);
    walk(s.scan, 20);
    synthetic_mesh plain = mesh_of(s.scan, NULL, 0), whole = {0};
    cl_int4 *blocks = device_map(&s.scan->device, &s.scan->volume.pool.keys, CL_MAP_READ);
    assert_non_null(blocks);
    const int32_t listed[] = {900, 0, 0, blocks[7].x, blocks[7].y, blocks[7].z, -(1 << 27), 1 << 27, 0};
    device_unmap(&s.scan->device, &s.scan->volume.pool.keys, blocks);
    int64_t n = fathom_extract_whole_mesh(s.scan, 0, listed, 3, synthetic_triangles, &whole);
    assert_true(n > 1000 && (size_t)n * 3 == whole.count && whole.count == plain.count);
    assert_memory_equal(whole.vertices, plain.vertices,
                        plain.count * sizeof *plain.vertices); /* in order, too */
    free(plain.vertices);
    free(whole.vertices);
    stop(&s, &store);
}

static void nonsense_is_refused_and_stopping_leaves_nothing_behind(void **state) {
    (void)state;
    const int32_t listed[] = {900, 0, 0}, far[] = {0, 0, (1 << 27) + 1};
    struct block_store store;
    synthetic_mesh mesh = {0}, first = {.stop_after = 1};
    synthetic_context s = start(&store, 3000);
    walk(s.scan, 20);
    const int64_t refused = FATHOM_ERROR_ARGUMENT;
    assert_int_equal(fathom_extract_whole_mesh(NULL, 0, listed, 1, synthetic_triangles, &mesh), refused);
    assert_int_equal(fathom_extract_whole_mesh(s.scan, 0, NULL, 1, synthetic_triangles, &mesh), refused);
    assert_int_equal(fathom_extract_whole_mesh(s.scan, 0, listed, 1, NULL, &mesh), refused);
    assert_int_equal(fathom_extract_whole_mesh(s.scan, NAN, listed, 1, synthetic_triangles, &mesh), refused);
    assert_int_equal(fathom_extract_whole_mesh(s.scan, 0, far, 1, synthetic_triangles, &mesh), refused);
    assert_int_equal(mesh.count, 0);
    assert_int_equal(fathom_extract_whole_mesh(s.scan, 0, listed, 1, synthetic_triangles, &first),
                     FATHOM_ERROR_STOPPED);
    assert_int_equal(first.calls, 1);
    for (int i = 20; i < 30; i++) assert_int_equal(synthetic_step(s.scan, &frames[i]).state, FATHOM_TRACKED);
    free(first.vertices);
    stop(&s, &store);

    fathom_config c = settings(3000);
    c.when_full = FATHOM_FULL_STOP; /* nothing is ever dropped */
    s = synthetic_start(&c);
    assert_int_equal(fathom_extract_whole_mesh(s.scan, 0, listed, 1, synthetic_triangles, &mesh), refused);
    assert_int_equal(fathom_extract_whole_mesh(s.scan, 0, NULL, 0, synthetic_triangles, &mesh), 0);
    synthetic_stop(&s);
}

/* ---- a pool that is too small -------------------------------------------------------------------------- */

static void a_small_pool_gives_the_mesh_of_a_large_one(void **state) {
    (void)state;
    struct block_store large_store, small_store;
    synthetic_context large = start(&large_store, 3000), small = start(&small_store, POOL);
    walk(large.scan, FRAMES);
    walk(small.scan, FRAMES / 2);
    synthetic_mesh midway = mesh_of(small.scan, &small_store, 0); /* the scan goes on after it */
    for (int i = FRAMES / 2; i < FRAMES; i++) synthetic_step(small.scan, &frames[i]);
    synthetic_mesh all = mesh_of(large.scan, &large_store, 0), whole = mesh_of(small.scan, &small_store, 0),
                   pool = mesh_of(small.scan, NULL, 0);
    assert_int_equal(large_store.count, 0);
    assert_true(small_store.count > POOL / 3 && small.scan->volume.pool.count <= POOL);
    double share = area_of(&whole) / area_of(&all), triangles = (double)whole.count / (double)all.count;
    print_message("area %.2f m2: small pool with the store %.4f of it, %.4f of the triangles; without %.3f\n",
                  area_of(&all), share, triangles, area_of(&pool) / area_of(&all));
    assert_true(fabs(share - 1) < 0.01 && fabs(triangles - 1) < 0.01);
    assert_true(area_of(&pool) < 0.8 * area_of(&all));
    assert_true(midway.count > 0 && midway.count < whole.count);
    free(midway.vertices);
    free(all.vertices);
    free(whole.vertices);
    free(pool.vertices);
    stop(&large, &large_store);
    stop(&small, &small_store);
}

/* There, back and there again: blocks come back, are dropped again, and none is in the mesh twice. */
static void blocks_that_return_are_in_the_mesh_once(void **state) {
    (void)state;
    struct block_store store;
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    synthetic_context s = start(&store, POOL);
    for (int i = 0; i < 3 * FRAMES - 2; i++) {
        static synthetic_frame f;
        const int at = i % (2 * FRAMES - 2);
        f = frames[at < FRAMES ? at : 2 * FRAMES - 2 - at];
        f.timestamp_ns = frames[0].timestamp_ns + (int64_t)i * SYNTHETIC_PERIOD_NS;
        synthetic_step(s.scan, &f);
    }
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_true(counters.blocks_restored > POOL / 3);
    assert_true(counters.blocks_dropped > (int64_t)store.count); /* some went twice, to the same place */
    assert_true(block_store_report(&store, s.scan));
    synthetic_mesh whole = mesh_of(s.scan, &store, 0);
    sort_triangles(&whole);
    for (size_t i = 3; i < whole.count; i += 3)
        assert_true(shrunk(&whole.vertices[i]) ||
                    memcmp(&whole.vertices[i], &whole.vertices[i - 3], TRIANGLE) != 0);
    free(whole.vertices);
    stop(&s, &store);
}

/* ---- the file ------------------------------------------------------------------------------------------ */

static fathom_block block_of(int16_t distances[512], uint16_t weights[512], int n) {
    fathom_block b = {.index = {n, -n, 3 * n}, .distances = distances, .weights = weights};
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
    fathom_config c = settings(POOL);
    assert_true(block_store_open(&store, NULL, &c));
    for (int round = 0; round < 2; round++)
        for (int n = 0; n < 3000; n++) {
            fathom_block b = block_of(distances, weights, n);
            distances[5] = (int16_t)(100 * round + 7);
            c.block_out(c.block_user, &b);
        }
    assert_int_equal(store.count, 3000);
    assert_int_equal(lseek(store.fd, 0, SEEK_END), 3000 * 2048);
    for (int n = 2999; n >= 0; n--) {
        int16_t expected[512];
        uint16_t expected_weights[512];
        fathom_block b = block_of(expected, expected_weights, n);
        b.distances = distances;
        b.weights = weights;
        assert_int_equal(c.block_in(c.block_user, &b), 1);
        expected[5] = 107;
        assert_memory_equal(distances, expected, sizeof expected);
        assert_memory_equal(weights, expected_weights, sizeof expected_weights);
    }
    fathom_block other = block_of(distances, weights, 3000);
    assert_int_equal(c.block_in(c.block_user, &other), 0);
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
    synthetic_context s = start(&store, POOL);
    assert_int_equal(files_in(synthetic_folder("store")), 0); /* it has no name */
    struct rlimit before, tight;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    tight = before;
    tight.rlim_cur = 100 * 2048 + 1000;
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
    for (int n = 0; n < 150; n++) {
        fathom_block b = block_of(distances, weights, n);
        s.scan->config.block_out(&store, &b);
    }
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_int_equal(store.count, 100);
    assert_int_equal(store.lost, 50);
    assert_false(block_store_report(&store, s.scan));
    for (int n = 0; n < 150; n++) {
        fathom_block b = block_of(distances, weights, n);
        assert_int_equal(s.scan->config.block_in(&store, &b), n < 100);
    }
    assert_int_equal(store.lost, 50);
    assert_int_equal(ftruncate(store.fd, 10 * 2048),
                     0); /* a disk that loses data: told, and nothing made up */
    fathom_block gone = block_of(distances, weights, 20);
    assert_int_equal(s.scan->config.block_in(&store, &gone), 0);
    assert_int_equal(store.lost, 51);
    assert_true(distances[5] == INT16_MIN && weights[5] == 0);
    stop(&s, &store);
}

static void a_place_that_cant_be_written_is_known_at_once(void **state) {
    (void)state;
    struct block_store store;
    fathom_config c = settings(POOL), none = synthetic_config(&frames[0]);
    assert_false(block_store_open(&store, "/nonexistent/mesh.ply", &c));
    assert_null(store.path);
    assert_true(block_store_open(&store, "/nonexistent/mesh.ply",
                                 &none)); /* where nothing is dropped there is no file */
    assert_null(none.block_out);
    block_store_close(&store);
}

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_ROOM, 0, FRAMES, frames);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dropping_takes_no_triangle_and_doubles_none),
        cmocka_unit_test(nor_where_the_device_has_its_own_buffers),
        cmocka_unit_test(a_list_may_name_too_much),
        cmocka_unit_test(nonsense_is_refused_and_stopping_leaves_nothing_behind),
        cmocka_unit_test(a_small_pool_gives_the_mesh_of_a_large_one),
        cmocka_unit_test(blocks_that_return_are_in_the_mesh_once),
        cmocka_unit_test(the_last_copy_comes_back),
        cmocka_unit_test(a_full_disk_loses_only_what_came_after),
        cmocka_unit_test(a_place_that_cant_be_written_is_known_at_once),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
