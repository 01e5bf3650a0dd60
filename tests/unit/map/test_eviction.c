/* The pool's bound with FATHOM_FULL_DROP: the surface goes on growing, what was seen longest ago makes room, a caller that
 * keeps it gets it asked for again, to the last bit. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <stdlib.h>
#include <string.h>

#include "synthetic.h"

#define FRAMES 150 /* through a room, five seconds */
#define POOL 400   /* blocks; the first frame needs some 270, the whole way some 620 */

static synthetic_frame frames[FRAMES];

/* What a logger would keep: dropped blocks, the last of each place. */
typedef struct {
    struct kept {
        int32_t index[3];
        int16_t distances[512];
        uint16_t weights[512];
    } *blocks;
    int count, capacity, gone, asked, given;
} store;

static struct kept *stored(store *s, const fathom_block *b) {
    for (int i = 0; i < s->count; i++)
        if (memcmp(s->blocks[i].index, b->index, sizeof b->index) == 0) return &s->blocks[i];
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
    memcpy(k->index, b->index, sizeof k->index);
    memcpy(k->distances, b->distances, sizeof k->distances);
    memcpy(k->weights, b->weights, sizeof k->weights);
    assert_true(b->voxel_m == 0.04f && b->truncation_m == 0.16f);
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
    c.when_full = FATHOM_FULL_DROP;
    c.block_out = keep;
    c.block_in = give_back;
    c.block_user = &kept;
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

/* Less than one view needs: nothing that is in view goes, and the pool is said to be full. */
static void what_is_in_view_stays(void **state) {
    (void)state;
    store kept = {0};
    fathom_config c = small_pool();
    c.max_blocks = 64;
    c.when_full = FATHOM_FULL_DROP;
    c.block_out = keep;
    c.block_user = &kept;
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
        cmocka_unit_test(what_is_in_view_stays),
    };
    return cmocka_run_group_tests(tests, setup, NULL);
}
