/* The pool's bound with FATHOM_FULL_DROP: the surface goes on growing, what was seen longest ago makes room, a caller that
 * keeps it gets it asked for again, to the last bit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "context.h"
#include "synthetic.h"

#define FRAMES 150 /* through a room, five seconds */
#define POOL 400   /* blocks; the first frame needs some 270, the whole way some 620 */

static synthetic_frame frames[FRAMES];

/* What a logger would keep: dropped blocks, the last of each place. */
typedef struct {
    struct kept {
        fathom_block_key key;
        int16_t distances[512];
        uint16_t weights[512];
    } *blocks;
    int count, capacity, gone, asked, given;
    fathom_block_store calls;
} store;

static struct kept *stored(store *s, const fathom_block *b) {
    for (int i = 0; i < s->count; i++)
        if (memcmp(&s->blocks[i].key, &b->key, sizeof b->key) == 0) return &s->blocks[i];
    return NULL;
}

static int keep(void *user, const fathom_block *b) {
    store *s = user;
    struct kept *k = stored(s, b);
    if (!k) {
        if (s->count == s->capacity) {
            s->capacity = s->capacity ? 2 * s->capacity : 256;
            s->blocks = realloc(s->blocks, (size_t)s->capacity * sizeof *s->blocks);
            assert_non_null(s->blocks);
        }
        k = &s->blocks[s->count++];
    }
    k->key = b->key;
    memcpy(k->distances, b->distances, sizeof k->distances);
    memcpy(k->weights, b->weights, sizeof k->weights);
    assert_true(b->struct_size == sizeof *b && b->voxel_m == 0.04f && b->truncation_m == 0.16f && b->key.submap == 0);
    s->gone++;
    return 0;
}

static int give_back(void *user, const fathom_block *b) {
    store *s = user;
    struct kept *k = stored(s, b);
    s->asked++;
    for (int i = 0; i < 512; i++) assert_true(b->distances[i] == INT16_MIN && b->weights[i] == 0); /* new */
    if (!k) return 0;
    memcpy(b->distances, k->distances, sizeof k->distances);
    memcpy(b->weights, k->weights, sizeof k->weights);
    s->given++;
    return 1;
}

/* Lets a context drop blocks into the store; without get_too they never come back. */
static void keep_in(store *s, fathom_config *c, bool get_too) {
    s->calls = FATHOM_STRUCT(fathom_block_store);
    s->calls.user = s;
    s->calls.put = keep;
    s->calls.get = get_too ? give_back : NULL;
    c->when_full = FATHOM_FULL_DROP;
    c->block_store = &s->calls;
}

static fathom_config small_pool(void) {
    fathom_config c = synthetic_config(&frames[0]);
    c.voxel_m = 0.04f;
    c.max_blocks = POOL;
    return c;
}

/* Steps through frame `i` as the n-th of a walk. */
static fathom_result walk(fathom *scan, int n, int i) {
    static synthetic_frame f;
    f = frames[i];
    f.timestamp_ns = frames[0].timestamp_ns + (int64_t)n * SYNTHETIC_PERIOD_NS;
    fathom_result r = synthetic_step(scan, &f);
    assert_true(r.blocks <= POOL);
    return r;
}

static void without_it_the_surface_stops_growing(void **state) {
    (void)state;
    fathom_config c = small_pool();
    synthetic_context s = synthetic_start(&c);
    bool full = false;
    for (int i = 0; i < FRAMES; i++) full = walk(s.scan, i, i).pool_full || full;
    assert_true(full);
    synthetic_stop(&s);
}

static void the_way_goes_on_and_back(void **state) {
    (void)state;
    store kept = {0};
    fathom_config c = small_pool();
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    keep_in(&kept, &c, true);
    synthetic_context s = synthetic_start(&c);
    int dropped = 0, restored = 0, n = 0;
    for (int i = 0; i < FRAMES; i++) {
        fathom_result r = walk(s.scan, n++, i);
        assert_int_equal(r.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
        assert_true(!r.pool_full);
        assert_true(synthetic_distance(r.pose, frames[i].pose) < 0.06);
        dropped += r.blocks_dropped;
        restored += r.blocks_restored;
    }
    assert_true(dropped > POOL / 3 && restored < dropped / 4);
    for (int i = FRAMES - 2; i >= 0; i--) { /* backwards, where everything was seen before */
        fathom_result r = walk(s.scan, n++, i);
        assert_int_equal(r.state, FATHOM_TRACKED);
        assert_true(!r.pool_full);
        dropped += r.blocks_dropped;
        restored += r.blocks_restored;
        if (i == 0) assert_true(synthetic_distance(r.pose, frames[0].pose) < 0.06);
    }
    assert_true(restored > POOL / 3);
    assert_int_equal(kept.gone, dropped);
    assert_int_equal(kept.given, restored);
    assert_true(kept.asked > kept.given);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_int_equal(counters.blocks_dropped, dropped);
    assert_int_equal(counters.blocks_restored, restored);
    assert_int_equal(counters.blocks_refused, 0);
    free(kept.blocks);
    synthetic_stop(&s);
}

static void nobody_keeps_them_and_the_scan_goes_on(void **state) {
    (void)state;
    fathom_config c = small_pool();
    c.when_full = FATHOM_FULL_DROP;
    synthetic_context s = synthetic_start(&c);
    for (int i = 0; i < FRAMES; i++) {
        fathom_result r = walk(s.scan, i, i);
        assert_true(r.state == FATHOM_FIRST || r.state == FATHOM_TRACKED);
        assert_true(!r.pool_full && r.blocks_restored == 0);
    }
    synthetic_mesh mesh = {0};
    assert_true(fathom_extract_mesh(s.scan, 0, synthetic_triangles, &mesh) > 1000);
    free(mesh.vertices);
    synthetic_stop(&s);
}

/* Less than one view needs: nothing makes room, and the pool is said to be full. */
static void a_pool_smaller_than_a_view_is_said_to_be_full(void **state) {
    (void)state;
    store kept = {0};
    fathom_config c = small_pool();
    c.max_blocks = 64;
    keep_in(&kept, &c, false);
    synthetic_context s = synthetic_start(&c);
    int dropped = 0;
    for (int i = 0; i < 8; i++) {
        fathom_result r = walk(s.scan, i, 0);
        assert_true(r.pool_full && r.blocks == 64);
        dropped += r.blocks_dropped;
    }
    assert_true(dropped <= 8); /* a few that no pixel reached */
    assert_int_equal(kept.gone, dropped);
    synthetic_stop(&s);
}

/* ---- bookkeeping, exactly ---- */

static void fuse_frame(fathom *f, int i, fathom_result *r) {
    pose at;
    assert_true(pose_take(&frames[i].pose, &at));
    depth_maps_make(&f->maps, &f->device, frames[i].depth, 2 * SYNTHETIC_WIDTH, 0);
    fuse(&f->fusing, &at, r);
    device_wait(&f->device);
}

/* Does a point of the frame's surface lie in the block? */
static bool holds_a_point(const fathom_block_key *key, const fathom_config *c, int i) {
    const int32_t index[3] = {key->x, key->y, key->z};
    pose at;
    assert_true(pose_take(&frames[i].pose, &at));
    for (int k = 0; k < SYNTHETIC_PIXELS; k++) {
        const double z = frames[i].depth[k] / (double)SYNTHETIC_UNITS;
        const double p[3] = {(k % SYNTHETIC_WIDTH - c->depth_camera.cx) / c->depth_camera.fx * z,
                             (k / SYNTHETIC_WIDTH - c->depth_camera.cy) / c->depth_camera.fy * z, z};
        bool inside = z > 0;
        for (int a = 0; a < 3 && inside; a++) {
            const double *r = at.r + 3 * a, w = r[0] * p[0] + r[1] * p[1] + r[2] * p[2] + at.t[a];
            inside = (int)floor(w / (8 * (double)c->voxel_m)) == index[a];
        }
        if (inside) return true;
    }
    return false;
}

/* The way until room is needed, and then at once back to where it began: what was seen longest ago is in view again. */
static void what_a_returning_camera_sees_stays(void **state) {
    (void)state;
    store kept = {0};
    fathom_config c = small_pool();
    keep_in(&kept, &c, false);
    synthetic_context s = synthetic_start(&c);
    int returns = 0;
    for (int i = 0; i < FRAMES; i++) {
        fathom_result r = {0};
        fuse_frame(s.scan, i, &r);
        if (r.blocks_dropped == 0) continue;
        const int before = kept.count, back = i / 2;
        fathom_result there = {0};
        fuse_frame(s.scan, back, &there);
        returns += there.blocks_dropped > 0;
        for (int k = before; k < kept.count; k++) assert_false(holds_a_point(&kept.blocks[k].key, &c, back));
    }
    print_message("%d returns for which blocks made room\n", returns);
    assert_true(returns >= 3);
    free(kept.blocks);
    synthetic_stop(&s);
}

/* Blocks in a row, block k last seen in frame 10 (k % 5). */
static void when_a_block_was_seen_moves_with_it(void **state) {
    (void)state;
    fathom_config c = small_pool();
    c.when_full = FATHOM_FULL_DROP;
    synthetic_context s = synthetic_start(&c);
    volume *v = &s.scan->volume;
    integrator *g = &s.scan->integrator;
    volume_view view;
    assert_true(volume_map(v, &s.scan->device, CL_MAP_READ | CL_MAP_WRITE, false, &view));
    for (int k = 0; k < POOL; k++) volume_add(v, &view, &(cl_int4){{k, -k, 2 * k, 0}}, 10 * (k % 5));
    volume_unmap(v, &s.scan->device, &view);
    g->frames = 60;
    g->settled = g->settling = 300;
    assert_int_equal(eviction_make_room(v, &s.scan->device, g, &s.scan->store, POOL / 5), POOL / 5);
    assert_int_equal(v->pool.count, POOL - POOL / 5);
    assert_int_equal(g->settled, 0); /* places have new owners: none counts as settled */
    assert_int_equal(g->settling, v->pool.count);
    assert_true(volume_map(v, &s.scan->device, CL_MAP_READ, false, &view));
    for (int k = 0, place = 0; k < POOL; k++) {
        const cl_int4 key = {{k, -k, 2 * k, 0}};
        assert_int_equal(volume_place(&view, &key), k % 5 ? place : -1);
        if (k % 5 == 0) continue;
        assert_memory_equal(&view.keys[place], &key, sizeof key);
        assert_int_equal(view.seen[place++], 10 * (k % 5));
    }
    volume_unmap(v, &s.scan->device, &view);
    synthetic_stop(&s);
}

static void a_new_block_was_seen_now(void **state) {
    (void)state;
    fathom_config c = small_pool();
    synthetic_context s = synthetic_start(&c);
    fathom *f = s.scan;
    pose at;
    volume_view view;
    assert_true(pose_take(&frames[0].pose, &at));
    assert_true(volume_map(&f->volume, &f->device, CL_MAP_WRITE, false, &view));
    for (int i = 0; i < POOL; i++) view.seen[i] = -7;
    volume_unmap(&f->volume, &f->device, &view);
    f->integrator.frames = 41; /* the next is number 42 */
    depth_maps_make(&f->maps, &f->device, frames[0].depth, 2 * SYNTHETIC_WIDTH, 0);
    assert_true(integrator_request(&f->integrator, &f->device, &f->volume, &f->maps, &at, false) > 100);
    assert_int_equal(integrator_allocate(&f->integrator, &f->device, &f->volume), 0);
    assert_true(volume_map(&f->volume, &f->device, CL_MAP_READ, false, &view));
    for (int i = 0; i < f->volume.pool.count; i++) assert_int_equal(view.seen[i], 42);
    volume_unmap(&f->volume, &f->device, &view);
    synthetic_stop(&s);
}

/* Whatever was there before. */
static void a_block_that_is_made_new_holds_nothing(void **state) {
    (void)state;
    int16_t distances[BLOCK_VOXELS];
    uint16_t weights[BLOCK_VOXELS];
    const fathom_block block = {.struct_size = sizeof block, .distances = distances, .weights = weights};
    memset(distances, 0x5a, sizeof distances);
    memset(weights, 0x5a, sizeof weights);
    volume_make_new(&block);
    for (int i = 0; i < BLOCK_VOXELS; i++) assert_true(distances[i] == NEVER_SEEN && weights[i] == 0);
}

static void a_pool_that_has_room_again_is_not_full(void **state) {
    (void)state;
    fathom_config c = small_pool();
    c.max_blocks = 64;
    synthetic_context s = synthetic_start(&c);
    fathom_result r = {0};
    fuse_frame(s.scan, 0, &r);
    assert_true(r.pool_full);
    s.scan->volume.pool.count = 0;
    volume_clear(&s.scan->volume, &s.scan->device);
    static synthetic_frame empty;
    empty = frames[0];
    memset(empty.depth, 0, sizeof empty.depth);
    pose at;
    assert_true(pose_take(&empty.pose, &at));
    depth_maps_make(&s.scan->maps, &s.scan->device, empty.depth, 2 * SYNTHETIC_WIDTH, 0);
    fuse(&s.scan->fusing, &at, &r);
    assert_false(r.pool_full);
    synthetic_stop(&s);
}

/* Where maps are small the view that relocalisation casts, half a width more on each side, has more tiles than the maps. */
static void every_view_that_is_cast_finds_room_for_its_tiles(void **state) {
    (void)state;
    static const int widths[] = {32, 40, 80, 160};
    for (size_t i = 0; i < sizeof widths / sizeof *widths; i++) {
        fathom_config c = small_pool();
        c.max_align_width = widths[i];
        synthetic_context s = synthetic_start(&c);
        const fathom *f = s.scan;
        const kernel_camera *cast[] = {&f->maps.camera[FINEST], &f->tracker.view.same, &f->tracker.view.wide};
        for (int k = 0; k < 3; k++) {
            const size_t bytes = 8 * (size_t)kernel_tiles(cast[k]);
            if (bytes > f->raycaster.ranges.size || kernel_tiles(cast[k]) > f->raycaster.tiles)
                fail_msg("maps %d wide: view %d has %d tiles, there is room for %d", f->maps.camera[FINEST].width, k,
                         kernel_tiles(cast[k]), f->raycaster.tiles);
        }
        synthetic_stop(&s);
    }
}

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_ROOM, 0, FRAMES, frames);
    return 0;
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_it_the_surface_stops_growing),
        cmocka_unit_test(the_way_goes_on_and_back),
        cmocka_unit_test(nobody_keeps_them_and_the_scan_goes_on),
        cmocka_unit_test(a_pool_smaller_than_a_view_is_said_to_be_full),
        cmocka_unit_test(what_a_returning_camera_sees_stays),
        cmocka_unit_test(when_a_block_was_seen_moves_with_it),
        cmocka_unit_test(a_new_block_was_seen_now),
        cmocka_unit_test(a_block_that_is_made_new_holds_nothing),
        cmocka_unit_test(a_pool_that_has_room_again_is_not_full),
        cmocka_unit_test(every_view_that_is_cast_finds_room_for_its_tiles),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
