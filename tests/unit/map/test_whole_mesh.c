/* The mesh holds the blocks that made room at the pool's bound, with the command's block store; the mesh and the blocks can
 * be pulled in pieces. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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

static synthetic_mesh mesh_of(fathom *scan, float min_weight) {
    synthetic_mesh mesh = {0};
    int64_t n = fathom_extract_mesh(scan, min_weight, synthetic_triangles, &mesh);
    assert_true(n >= 0 && (size_t)n * 3 == mesh.count);
    return mesh;
}

/* The same by pieces of at most `capacity` triangles; *pieces: how many they were. */
static synthetic_mesh pull_mesh(fathom *scan, int32_t part, float min_weight, int capacity, int *pieces) {
    synthetic_mesh mesh = {0};
    fathom_mesh_pull pull = FATHOM_STRUCT(fathom_mesh_pull);
    pull.capacity = capacity;
    pull.vertices = malloc((size_t)capacity * TRIANGLE + 1);
    assert_non_null(pull.vertices);
    unsigned char *behind = (unsigned char *)(pull.vertices + 3 * capacity);
    pull.min_weight = min_weight;
    pull.part = part;
    *behind = 0xa5;
    int64_t n;
    for (*pieces = 0; (n = fathom_pull_mesh(scan, &pull)) > 0; ++*pieces) {
        assert_true(n <= capacity && *behind == 0xa5);
        synthetic_triangles(&mesh, pull.vertices, (size_t)n);
    }
    assert_int_equal(n, 0);
    assert_true(pull.next_stored == 0 && pull.next_made == 0); /* ready for the next */
    free(pull.vertices);
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

static void free_all(synthetic_mesh *meshes, size_t count) {
    for (size_t i = 0; i < count; i++) free(meshes[i].vertices);
}

/* A scan with room for everything; then more and more of its blocks are sent out, and each time the mesh is the same. */
static void drop_all_with(fathom_buffers buffers) {
    struct block_store store;
    synthetic_context s = start_with(&store, 3000, buffers);
    int pieces;
    walk(s.scan, FRAMES);
    synthetic_mesh before = mesh_of(s.scan, 0), heavy = mesh_of(s.scan, 0.5f);
    assert_int_equal(store.count, 0);
    assert_true(before.count > 20000 && heavy.count < before.count && heavy.count > 1000);
    s.scan->integrator.frames += 100; /* nothing is in view any more */
    while (s.scan->volume.pool.count > 0) {
        int kept = s.scan->volume.pool.count;
        assert_true(eviction_make_room(&s.scan->volume, &s.scan->device, &s.scan->integrator, &s.scan->store, 100) > 0);
        synthetic_mesh m[] = {pull_mesh(s.scan, FATHOM_MESH_POOL, 0, 100000, &pieces), mesh_of(s.scan, 0),
                              mesh_of(s.scan, 0.5f)};
        assert_true(s.scan->volume.pool.count < kept && m[0].count < m[1].count);
        assert_same_triangles(&before, &m[1]);
        assert_same_triangles(&heavy, &m[2]);
        free_all(m, 3);
    }
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

/* ---- in pieces ------------------------------------------------------------------------------------------ */

/* Triangle by triangle, in order, however small the pieces; with some of the blocks in the store, too. */
static void the_pieces_of_a_mesh_are_the_mesh(void **state) {
    (void)state;
    struct block_store store;
    synthetic_context s = start(&store, 3000);
    walk(s.scan, FRAMES);
    for (int round = 0; round < 2; round++) {
        int small, medium, large, pool;
        synthetic_mesh m[] = {mesh_of(s.scan, 0),
                              pull_mesh(s.scan, FATHOM_MESH_WHOLE, 0, FATHOM_BLOCK_TRIANGLES, &small),
                              pull_mesh(s.scan, FATHOM_MESH_WHOLE, 0, 10000, &medium),
                              pull_mesh(s.scan, FATHOM_MESH_WHOLE, 0, 1000000, &large),
                              pull_mesh(s.scan, FATHOM_MESH_POOL, 0, 10000, &pool),
                              mesh_of(s.scan, 0.5f), pull_mesh(s.scan, FATHOM_MESH_WHOLE, 0.5f, 3000, &pool)};
        assert_true(small > medium && medium > 1 && large == 1);
        for (int i = 1; i < 4; i++) {
            assert_int_equal(m[i].count, m[0].count);
            assert_memory_equal(m[i].vertices, m[0].vertices, m[0].count * sizeof *m[0].vertices);
        }
        assert_true(round == 0 ? m[4].count == m[0].count : m[4].count < m[0].count && m[4].count > 0);
        assert_true(m[5].count > 0 && m[5].count < m[0].count && m[6].count == m[5].count);
        assert_memory_equal(m[6].vertices, m[5].vertices, m[5].count * sizeof *m[5].vertices);
        free_all(m, 7);
        s.scan->integrator.frames += 100;
        assert_true(eviction_make_room(&s.scan->volume, &s.scan->device, &s.scan->integrator, &s.scan->store, 300) > 0);
    }
    stop(&s, &store);
}

/* Places are closed up between two pieces: what was left of the pool comes once, nothing that came comes again. */
static void a_pull_goes_on_after_blocks_were_dropped(void **state) {
    (void)state;
    struct block_store store;
    synthetic_context s = start(&store, 3000);
    walk(s.scan, FRAMES);
    static fathom_block_key keys[3000];
    fathom_block_pull pull = FATHOM_STRUCT(fathom_block_pull);
    pull.keys = keys;
    pull.capacity = 200;
    assert_int_equal(fathom_pull_blocks(s.scan, &pull), 200);
    s.scan->integrator.frames += 100;
    assert_int_equal(eviction_make_room(&s.scan->volume, &s.scan->device, &s.scan->integrator, &s.scan->store, 250), 250);
    int count = 200, n;
    while (pull.keys = keys + count, (n = fathom_pull_blocks(s.scan, &pull)) > 0) count += n;
    assert_int_equal(n, 0);
    for (int i = 0; i < count; i++)
        for (int j = 0; j < i; j++) assert_true(memcmp(&keys[i], &keys[j], sizeof *keys) != 0);
    int in_pool = 0;
    volume_view view;
    assert_true(volume_map(&s.scan->volume, &s.scan->device, CL_MAP_READ, false, &view));
    for (int i = 200; i < count; i++) {
        const cl_int4 key = {{keys[i].x, keys[i].y, keys[i].z, keys[i].submap}};
        assert_true(volume_place(&view, &key) >= 0);
    }
    for (int i = 0; i < count; i++) {
        const cl_int4 key = {{keys[i].x, keys[i].y, keys[i].z, keys[i].submap}};
        in_pool += volume_place(&view, &key) >= 0;
    }
    volume_unmap(&s.scan->volume, &s.scan->device, &view);
    assert_int_equal(in_pool, s.scan->volume.pool.count); /* all that is there came */
    stop(&s, &store);
}

/* ---- blocks, and what has changed ------------------------------------------------------------------------- */

typedef struct {
    fathom_block_key keys[3000];
    int16_t distances[3000][FATHOM_BLOCK_VOXELS];
    uint16_t weights[3000][FATHOM_BLOCK_VOXELS];
    int count;
} copies;

/* Takes what a pull brings into the copies, new keys at the end. Returns how many came. */
static int pull_into(copies *c, fathom *scan, fathom_block_pull *pull, int piece) {
    static fathom_block_key keys[100];
    static int16_t distances[100][FATHOM_BLOCK_VOXELS];
    static uint16_t weights[100][FATHOM_BLOCK_VOXELS];
    int all = 0, n;
    pull->keys = keys;
    pull->distances = distances[0];
    pull->weights = weights[0];
    pull->capacity = piece;
    while ((n = fathom_pull_blocks(scan, pull)) > 0) {
        assert_true(n <= piece);
        all += n;
        for (int i = 0; i < n; i++) {
            int at = 0;
            while (at < c->count && memcmp(&c->keys[at], &keys[i], sizeof *keys) != 0) at++;
            if (at == c->count) c->keys[c->count++] = keys[i];
            memcpy(c->distances[at], distances[i], sizeof *distances);
            memcpy(c->weights[at], weights[i], sizeof *weights);
        }
    }
    assert_int_equal(n, 0);
    return all;
}

static void assert_copies_of_the_pool(const copies *c, fathom *scan) {
    volume_view view;
    assert_int_equal(c->count, scan->volume.pool.count);
    assert_true(volume_map(&scan->volume, &scan->device, CL_MAP_READ, true, &view));
    for (int i = 0; i < c->count; i++) {
        const cl_int4 key = {{c->keys[i].x, c->keys[i].y, c->keys[i].z, c->keys[i].submap}};
        const int place = volume_place(&view, &key);
        assert_true(place >= 0);
        assert_memory_equal(c->distances[i], view.voxels + DISTANCES_OF(place), sizeof *c->distances);
        assert_memory_equal(c->weights[i], view.voxels + WEIGHTS_OF(place), sizeof *c->weights);
    }
    volume_unmap(&scan->volume, &scan->device, &view);
}

/* Copies that take every change, and only changes, stay the pool's own to the bit: after each frame, and with frames
 * between the pieces. */
static void blocks_that_changed_come_again_and_others_do_not(void **state) {
    (void)state;
    static copies c;
    struct block_store store;
    synthetic_context s = start(&store, 3000);
    fathom_block_pull pull = FATHOM_STRUCT(fathom_block_pull);
    c.count = 0;
    assert_int_equal(pull_into(&c, s.scan, &pull, 7), 0); /* nothing yet */
    int came = 0, there = 0;
    for (int i = 0; i < 60; i++) {
        synthetic_step(s.scan, &frames[i]);
        came += pull_into(&c, s.scan, &pull, 100);
        there += s.scan->volume.pool.count;
        assert_copies_of_the_pool(&c, s.scan);
        assert_int_equal(pull_into(&c, s.scan, &pull, 100), 0); /* nothing has happened since */
    }
    assert_true(came < there * 9 / 10);
    for (int i = 60; i < FRAMES; i++) { /* a piece a frame */
        synthetic_step(s.scan, &frames[i]);
        pull.capacity = 50;
        assert_true(fathom_pull_blocks(s.scan, &pull) >= 0);
    }
    pull.since = 0;
    pull.next = 0;
    c.count = 0;
    assert_int_equal(pull_into(&c, s.scan, &pull, 100), s.scan->volume.pool.count);
    assert_copies_of_the_pool(&c, s.scan);
    assert_int_equal(fathom_reset(s.scan), FATHOM_OK);
    assert_int_equal(pull_into(&c, s.scan, &pull, 100), 0);
    frames[0].timestamp_ns += 1000000000000;
    synthetic_step(s.scan, &frames[0]);
    frames[0].timestamp_ns -= 1000000000000;
    c.count = 0;
    assert_int_equal(pull_into(&c, s.scan, &pull, 100), s.scan->volume.pool.count); /* all are new */
    stop(&s, &store);
}

/* A block that comes back from the store has changed for who looks at the pool. */
static void a_block_that_returns_has_changed(void **state) {
    (void)state;
    static copies c;
    struct block_store store;
    synthetic_context s = start(&store, POOL);
    fathom_block_pull pull = FATHOM_STRUCT(fathom_block_pull);
    int restored = 0;
    for (int i = 0; i < 2 * FRAMES - 1; i++) {
        static synthetic_frame f;
        f = frames[i < FRAMES ? i : 2 * FRAMES - 2 - i];
        f.timestamp_ns = frames[0].timestamp_ns + (int64_t)i * SYNTHETIC_PERIOD_NS;
        restored += synthetic_step(s.scan, &f).blocks_restored;
        pull_into(&c, s.scan, &pull, 100);
        volume_view view; /* forget what was dropped */
        assert_true(volume_map(&s.scan->volume, &s.scan->device, CL_MAP_READ, false, &view));
        for (int k = 0; k < c.count;) {
            const cl_int4 key = {{c.keys[k].x, c.keys[k].y, c.keys[k].z, c.keys[k].submap}};
            if (volume_place(&view, &key) >= 0) {
                k++;
                continue;
            }
            c.count--;
            c.keys[k] = c.keys[c.count];
            memcpy(c.distances[k], c.distances[c.count], sizeof *c.distances);
            memcpy(c.weights[k], c.weights[c.count], sizeof *c.weights);
        }
        volume_unmap(&s.scan->volume, &s.scan->device, &view);
        assert_copies_of_the_pool(&c, s.scan);
    }
    assert_true(restored > 20);
    stop(&s, &store);
}

/* ---- stores that fail, and nonsense ------------------------------------------------------------------------ */

/* A store of one's own around the command's: a list with what it hasn't got, and calls that fail. */
typedef struct {
    struct block_store *inner;
    fathom_block_key extra[3];
    int extras, puts_fail, gets_fail;
} odd_store;

static int odd_put(void *user, const fathom_block *block) {
    odd_store *o = user;
    return o->puts_fail ? -1 : o->inner->calls.put(o->inner, block);
}

static int odd_get(void *user, const fathom_block *block) {
    odd_store *o = user;
    if (!o->gets_fail) return o->inner->calls.get(o->inner, block);
    memset(block->distances, 0, 2 * FATHOM_BLOCK_VOXELS); /* half of it, before it fails */
    return -1;
}

static int odd_list(void *user, int64_t position, fathom_block_key *key) {
    odd_store *o = user;
    if (position >= o->extras) return o->inner->calls.enumerate(o->inner, position - o->extras, key);
    *key = o->extra[position];
    return 1;
}

static synthetic_context start_odd(odd_store *o, struct block_store *inner, int blocks) {
    char beside[4200];
    fathom_config c = settings(blocks);
    snprintf(beside, sizeof beside, "%s/mesh.ply", synthetic_folder("store"));
    assert_true(block_store_open(inner, beside, &c));
    *o = (odd_store){.inner = inner};
    const fathom_block_store calls = {
        .struct_size = sizeof calls, .user = o, .put = odd_put, .get = odd_get, .enumerate = odd_list};
    c.block_store = &calls; /* copied by fathom_init */
    return synthetic_start(&c);
}

/* What is asked for in vain is left out; what is in the pool isn't doubled; another submap's blocks aren't this one's. */
static void a_list_may_name_too_much(void **state) {
    (void)state;
    struct block_store inner;
    odd_store o;
    synthetic_context s = start_odd(&o, &inner, 3000);
    walk(s.scan, 20);
    synthetic_mesh plain = mesh_of(s.scan, 0);
    fathom_block_pull pull = FATHOM_STRUCT(fathom_block_pull);
    fathom_block_key keys[8];
    pull.keys = keys;
    pull.capacity = 8;
    assert_int_equal(fathom_pull_blocks(s.scan, &pull), 8);
    o.extra[0] = (fathom_block_key){900, 0, 0, 0};
    o.extra[1] = keys[7];
    o.extra[2] = (fathom_block_key){-(1 << 27), 1 << 27, 0, 1};
    o.extras = 3;
    synthetic_mesh whole = mesh_of(s.scan, 0);
    assert_int_equal(whole.count, plain.count);
    assert_memory_equal(whole.vertices, plain.vertices, plain.count * sizeof *plain.vertices); /* in order, too */
    free(plain.vertices);
    free(whole.vertices);
    stop(&s, &inner);
}

static void a_list_that_names_what_cant_be_is_refused(void **state) {
    (void)state;
    struct block_store inner;
    odd_store o;
    synthetic_mesh mesh = {0};
    synthetic_context s = start_odd(&o, &inner, 3000);
    walk(s.scan, 3);
    const fathom_block_key beyond[] = {{0, 0, (1 << 27) + 1, 0}, {-(1 << 27) - 1, 0, 0, 0}, {0, INT32_MAX, 0, 0}};
    for (int i = 0; i < 3; i++) {
        o.extra[0] = (fathom_block_key){900, 0, 0, 0};
        o.extra[1] = beyond[i];
        o.extras = 2;
        assert_int_equal(fathom_extract_mesh(s.scan, 0, synthetic_triangles, &mesh), FATHOM_ERROR_ARGUMENT);
        assert_non_null(strstr(fathom_last_error(s.scan), "position 1"));
    }
    free(mesh.vertices);
    stop(&s, &inner);
}

/* What can't be kept or read back is counted, leaves a hole, and never half a block. */
static void what_a_store_loses_is_counted(void **state) {
    (void)state;
    struct block_store inner;
    odd_store o;
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    synthetic_context s = start_odd(&o, &inner, 900); /* a sixteenth of which goes at a time */
    walk(s.scan, 60);
    s.scan->integrator.frames += 100;
    o.puts_fail = 1;
    const int first = eviction_make_room(&s.scan->volume, &s.scan->device, &s.scan->integrator, &s.scan->store, 60);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_true(counters.blocks_lost == first && counters.blocks_dropped == first && inner.count == 0);
    o.puts_fail = 0;
    eviction_make_room(&s.scan->volume, &s.scan->device, &s.scan->integrator, &s.scan->store, 60);
    assert_true(inner.count > 0);
    int pieces;
    synthetic_mesh pool = pull_mesh(s.scan, FATHOM_MESH_POOL, 0, 100000, &pieces);
    o.gets_fail = 1;
    synthetic_mesh whole = mesh_of(s.scan, 0);
    assert_true(pool.count > 1000);
    assert_same_triangles(&pool, &whole); /* a half-filled block would add some */
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_true(counters.blocks_lost > first);
    free(pool.vertices);
    free(whole.vertices);
    stop(&s, &inner);
}

/* ---- the patch --------------------------------------------------------------------------------------------- */

#define APART 40 /* blocks between one that is alone and the next */

/* A store of blocks that are alone, and then of one whose neighbours are all there. */
typedef struct {
    const volume *patch;
    int alone;          /* of them */
    int most, together; /* places of the patch that were written to; blocks that came about the last one */
} made_store;

static int made_get(void *user, const fathom_block *block) {
    made_store *m = user;
    const fathom_block_key *k = &block->key;
    const ptrdiff_t place = (block->distances - (int16_t *)m->patch->pool.voxels.host) / BLOCK_SHORTS;
    assert_true(place >= 0 && place < m->patch->pool.capacity); /* or it lies in the next buffer */
    if (k->x >= 0 ? k->x % APART != 0 || k->y != 0 || k->z != 0 : k->x > -100) return 0;
    memset(block->distances, 1, FATHOM_BLOCK_VOXELS * sizeof *block->distances);
    memset(block->weights, 1, FATHOM_BLOCK_VOXELS * sizeof *block->weights);
    m->together += k->x < -100;
    if (place + 1 > m->most) m->most = (int)place + 1;
    return 1;
}

static int made_list(void *user, int64_t position, fathom_block_key *key) {
    const made_store *m = user;
    *key = (fathom_block_key){.x = position < m->alone ? APART * (int)position : -200};
    return position <= m->alone;
}

/* A block comes with up to nineteen others. However many places are taken before it, none is written beyond the last. */
static void the_patch_keeps_to_its_places(void **state) {
    (void)state;
    made_store m = {0};
    fathom_config c = settings(3000);
    synthetic_mesh mesh = {0};
    const fathom_block_store calls = {.struct_size = sizeof calls, .user = &m, .get = made_get, .enumerate = made_list};
    c.buffers = FATHOM_BUFFERS_HOST;
    c.block_store = &calls;
    synthetic_context s = synthetic_start(&c);
    m.patch = &s.scan->patch;
    const int places = m.patch->pool.capacity;
    for (m.alone = places - 32; m.alone <= places + 2; m.alone++) {
        m.together = 0;
        assert_int_equal(fathom_extract_mesh(s.scan, 0, synthetic_triangles, &mesh), 0);
        assert_int_equal(m.together, 20);
    }
    assert_int_equal(m.most, places); /* they are all used */
    synthetic_stop(&s);
}

static void stopping_leaves_nothing_behind(void **state) {
    (void)state;
    struct block_store inner;
    odd_store o;
    synthetic_mesh first = {.stop_after = 1};
    synthetic_context s = start_odd(&o, &inner, 3000);
    walk(s.scan, 20);
    o.extra[0] = (fathom_block_key){900, 0, 0, 0};
    o.extras = 1;
    assert_int_equal(fathom_extract_mesh(s.scan, 0, synthetic_triangles, &first), FATHOM_ERROR_STOPPED);
    assert_int_equal(first.calls, 1);
    for (int i = 20; i < 30; i++) assert_int_equal(synthetic_step(s.scan, &frames[i]).state, FATHOM_TRACKED);
    free(first.vertices);
    stop(&s, &inner);
}

/* Each call of a store may be missing. */
static void a_store_may_do_without_any_of_its_calls(void **state) {
    (void)state;
    for (int missing = 0; missing < 4; missing++) {
        struct block_store inner;
        char beside[4200];
        fathom_config c = settings(POOL);
        snprintf(beside, sizeof beside, "%s/mesh.ply", synthetic_folder("store"));
        assert_true(block_store_open(&inner, beside, &c));
        if (missing == 0) inner.calls.put = NULL;
        if (missing == 1) inner.calls.get = NULL;
        if (missing == 2) inner.calls.enumerate = NULL;
        if (missing == 3) c.block_store = NULL;
        synthetic_context s = synthetic_start(&c);
        for (int i = 0; i < FRAMES; i++) {
            fathom_result r = synthetic_step(s.scan, &frames[i]);
            assert_true(r.state == FATHOM_FIRST || r.state == FATHOM_TRACKED);
        }
        int pieces;
        synthetic_mesh pool = pull_mesh(s.scan, FATHOM_MESH_POOL, 0, 100000, &pieces), whole = mesh_of(s.scan, 0);
        assert_true(pool.count > 0 && whole.count == pool.count);
        free(pool.vertices);
        free(whole.vertices);
        stop(&s, &inner);
    }
}

static void nonsense_is_refused(void **state) {
    (void)state;
    struct block_store store;
    static fathom_vertex vertices[3 * FATHOM_BLOCK_TRIANGLES];
    fathom_block_key keys[1];
    synthetic_mesh mesh = {0};
    synthetic_context s = start(&store, 3000);
    walk(s.scan, 3);
    const int64_t refused = FATHOM_ERROR_ARGUMENT;
    assert_int_equal(fathom_extract_mesh(s.scan, NAN, synthetic_triangles, &mesh), refused);

    const fathom_mesh_pull good = {.struct_size = sizeof good, .capacity = FATHOM_BLOCK_TRIANGLES, .vertices = vertices};
    fathom_mesh_pull pulls[] = {good, good, good, good, good, good, good};
    pulls[0].capacity--;
    pulls[1].vertices = NULL;
    pulls[2].part = 2;
    pulls[3].min_weight = NAN;
    pulls[4].next_made = -1;
    pulls[5].next_stored = -1;
    pulls[6].struct_size = 0;
    for (int i = 0; i < 7; i++) assert_int_equal(fathom_pull_mesh(s.scan, &pulls[i]), refused);
    assert_int_equal(fathom_pull_mesh(s.scan, NULL), refused);
    assert_int_equal(fathom_pull_mesh(NULL, &pulls[0]), refused);

    const fathom_block_pull fine = {.struct_size = sizeof fine, .capacity = 1, .keys = keys};
    fathom_block_pull blocks[] = {fine, fine, fine, fine, fine};
    blocks[0].capacity = 0;
    blocks[1].keys = NULL;
    blocks[2].since = -1;
    blocks[3].next = -1;
    blocks[4].struct_size = 3;
    for (int i = 0; i < 5; i++) assert_int_equal(fathom_pull_blocks(s.scan, &blocks[i]), refused);
    assert_int_equal(fathom_pull_blocks(s.scan, NULL), refused);
    stop(&s, &store);

    fathom_config c = settings(3000);
    fathom_block_store calls = {.struct_size = 0};
    char why[256];
    c.block_store = &calls;
    assert_int_equal(fathom_memory_required(&c, why, sizeof why), FATHOM_ERROR_CONFIG);
    assert_non_null(strstr(why, "block_store"));
}

/* ---- a pool that is too small -------------------------------------------------------------------------- */

static void a_small_pool_gives_the_mesh_of_a_large_one(void **state) {
    (void)state;
    struct block_store large_store, small_store;
    synthetic_context large = start(&large_store, 3000), small = start(&small_store, POOL);
    walk(large.scan, FRAMES);
    walk(small.scan, FRAMES / 2);
    synthetic_mesh midway = mesh_of(small.scan, 0); /* the scan goes on after it */
    for (int i = FRAMES / 2; i < FRAMES; i++) synthetic_step(small.scan, &frames[i]);
    int pieces;
    synthetic_mesh all = mesh_of(large.scan, 0), whole = mesh_of(small.scan, 0),
                   pool = pull_mesh(small.scan, FATHOM_MESH_POOL, 0, 100000, &pieces);
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
    synthetic_mesh whole = mesh_of(s.scan, 0);
    sort_triangles(&whole);
    for (size_t i = 3; i < whole.count; i += 3)
        assert_true(shrunk(&whole.vertices[i]) ||
                    memcmp(&whole.vertices[i], &whole.vertices[i - 3], TRIANGLE) != 0);
    free(whole.vertices);
    stop(&s, &store);
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
        cmocka_unit_test(the_pieces_of_a_mesh_are_the_mesh),
        cmocka_unit_test(a_pull_goes_on_after_blocks_were_dropped),
        cmocka_unit_test(blocks_that_changed_come_again_and_others_do_not),
        cmocka_unit_test(a_block_that_returns_has_changed),
        cmocka_unit_test(a_list_may_name_too_much),
        cmocka_unit_test(a_list_that_names_what_cant_be_is_refused),
        cmocka_unit_test(what_a_store_loses_is_counted),
        cmocka_unit_test(the_patch_keeps_to_its_places),
        cmocka_unit_test(stopping_leaves_nothing_behind),
        cmocka_unit_test(a_store_may_do_without_any_of_its_calls),
        cmocka_unit_test(nonsense_is_refused),
        cmocka_unit_test(a_small_pool_gives_the_mesh_of_a_large_one),
        cmocka_unit_test(blocks_that_return_are_in_the_mesh_once),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
