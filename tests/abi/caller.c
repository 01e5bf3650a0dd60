/* A caller built against another header than the library's: -DHEADER='"fathom_shorter.h"' or the longer one, with -DLONGER.
 * Every struct lies before bytes that the library may neither read nor write. Exits 0 when all is well. */
#include <stdio.h>
#include <stdlib.h>

#include HEADER

#include <string.h>

#define WIDTH 64
#define HEIGHT 48
#define GUARD 64
#define POISON 0xa5

static uint16_t depth[WIDTH * HEIGHT];
static int failed, put_calls;

#define CHECK(good)                                                                                          \
    do {                                                                                                     \
        if (!(good)) {                                                                                       \
            printf("%d: %s\n", __LINE__, #good);                                                             \
            failed++;                                                                                        \
        }                                                                                                    \
    } while (0)

/* A struct with the caller's size and poison behind it. */
#define GUARDED(type)                                                                                        \
    struct {                                                                                                 \
        type s;                                                                                              \
        unsigned char behind[GUARD];                                                                         \
    }
#define PREPARE(g)                                                                                           \
    (memset(&(g), POISON, sizeof(g)), memset(&(g).s, 0, sizeof(g).s),                                        \
     (void)((g).s.struct_size = (uint32_t)sizeof(g).s))
#define CHECK_GUARD(g)                                                                                       \
    do {                                                                                                     \
        for (int i_ = 0; i_ < GUARD; i_++) CHECK((g).behind[i_] == POISON);                                  \
        CHECK((g).s.struct_size == sizeof(g).s);                                                             \
    } while (0)
#ifdef LONGER
#define CHECK_REST(g) CHECK((g).s.later[0] == 0 && (g).s.later[3] == 0) /* zeroed by an older library */
#else
#define CHECK_REST(g) (void)0
#endif

/* The library's block may be shorter than this header's, or longer. */
static int put(void *user, const fathom_block *block) {
    put_calls += *(int *)user == 7 && block->struct_size >= 40 && block->key.submap == 0 && block->voxel_m > 0;
    return 0;
}

int main(void) {
    GUARDED(fathom_config) c;
    memset(&c, POISON, sizeof c);
    CHECK(fathom_config_init(&c.s) == FATHOM_OK);
    CHECK_GUARD(c);
    CHECK_REST(c);
    CHECK(c.s.voxel_m > 0.0099f && c.s.voxel_m < 0.0101f && c.s.imu);
    CHECK(fathom_config_preset(&c.s, FATHOM_PRESET_TINY) == FATHOM_OK);
    CHECK_GUARD(c);
    c.s.depth_camera.width = WIDTH;
    c.s.depth_camera.height = HEIGHT;
    c.s.depth_camera.fx = c.s.depth_camera.fy = 55;
    c.s.depth_camera.cx = 31.5;
    c.s.depth_camera.cy = 23.5;
    c.s.voxel_m = 0.04f;
    c.s.max_memory_bytes = 32 << 20;
    c.s.imu = false;
    int user = 7;
    GUARDED(fathom_block_store) store;
    PREPARE(store);
    store.s.user = &user;
    store.s.put = put;
    c.s.when_full = FATHOM_FULL_DROP;
    c.s.block_store = &store.s;

    char why[256];
    GUARDED(fathom_memory_plan) plan;
    PREPARE(plan);
    CHECK(fathom_plan_memory(&c.s, &plan.s, why, sizeof why) == FATHOM_OK);
    CHECK_GUARD(plan);
    CHECK_REST(plan);
    CHECK(plan.s.align_width == WIDTH && plan.s.blocks > 64);
    c.s.voxel_m = -1; /* refused with words, and without calling what lies behind the caller's struct */
    CHECK(fathom_memory_required(&c.s, why, sizeof why) == FATHOM_ERROR_CONFIG && strstr(why, "voxel_m"));
    c.s.voxel_m = 0.04f;
#ifdef LONGER
    c.s.later[2] = 1; /* a setting that this library doesn't know */
    CHECK(fathom_memory_required(&c.s, why, sizeof why) == FATHOM_ERROR_CONFIG && *why);
    c.s.later[2] = 0;
#endif
    fathom *scan = NULL;
    void *block = malloc((size_t)plan.s.host_bytes);
    CHECK(fathom_init(&scan, &c.s, block, (size_t)plan.s.host_bytes, why, sizeof why) == FATHOM_OK);
    if (!scan) return 1;

    for (int i = 0; i < WIDTH * HEIGHT; i++) {
        double u = (i % WIDTH - 31.5) / 55, v = (i / WIDTH - 23.5) / 55;
        double bump = u * u + v * v < 0.04 ? 0.3 - 6 * (u * u + v * v) : 0;
        depth[i] = (uint16_t)(1000 * (1.4 + 0.2 * u - 0.3 * v + (u > 0.35 ? -0.3 : 0) - bump));
    }
    GUARDED(fathom_depth_frame) frame;
    GUARDED(fathom_result) result;
    PREPARE(frame);
    frame.s.width = WIDTH;
    frame.s.height = HEIGHT;
    frame.s.depth = depth;
    for (int i = 1; i <= 3; i++) {
        frame.s.timestamp_ns = i * 33333333;
        PREPARE(result);
        CHECK(fathom_step(scan, &frame.s, &result.s) == FATHOM_OK);
        CHECK_GUARD(result);
        CHECK_REST(result);
        CHECK(result.s.state == (i == 1 ? FATHOM_FIRST : FATHOM_TRACKED) && result.s.timestamp_ns == i * 33333333);
    }
#ifdef LONGER
    frame.s.timestamp_ns++;
    frame.s.later[0] = 1;
    CHECK(fathom_step(scan, &frame.s, &result.s) == FATHOM_ERROR_ARGUMENT && *fathom_last_error(scan));
    frame.s.later[0] = 0;
#endif
    /* only the size of the first counts: they lie side by side */
    fathom_result *results = malloc(3 * sizeof *results + GUARD);
    memset(results, POISON, 3 * sizeof *results + GUARD);
    results->struct_size = sizeof *results;
    CHECK(fathom_get_recent(scan, results, 3) == 3);
    for (int i = 0; i < 3; i++) CHECK(results[i].timestamp_ns == (i + 1) * 33333333 && results[i].struct_size == sizeof *results);
    for (int i = 0; i < GUARD; i++) CHECK(((unsigned char *)(results + 3))[i] == POISON);
    free(results);

    GUARDED(fathom_counters) counters;
    GUARDED(fathom_rig) rig;
    GUARDED(fathom_motion) motion;
    GUARDED(fathom_view) view;
    static float seen[WIDTH * HEIGHT];
    PREPARE(counters);
    PREPARE(rig);
    PREPARE(motion);
    PREPARE(view);
    CHECK(fathom_get_counters(scan, &counters.s) == FATHOM_OK);
    CHECK(fathom_get_rig(scan, &rig.s) == FATHOM_OK && rig.s.imu_to_camera_rotation[0] == 1);
    CHECK(fathom_inertial_estimate(scan, 33333333, 66666666, &motion.s) == FATHOM_OK);
    view.s.camera = c.s.depth_camera;
    view.s.pose = result.s.pose;
    CHECK(fathom_cast_view(scan, &view.s, seen, NULL) == FATHOM_OK && seen[WIDTH * HEIGHT / 2 + WIDTH / 2] > 0);
    CHECK_GUARD(counters);
    CHECK_GUARD(rig);
    CHECK_GUARD(motion);
    CHECK_GUARD(view);
    CHECK_REST(counters);
    CHECK_REST(rig);
    CHECK_REST(motion);
    GUARDED(fathom_mesh_pull) mesh;
    GUARDED(fathom_block_pull) blocks;
    PREPARE(mesh);
    PREPARE(blocks);
    mesh.s.capacity = FATHOM_BLOCK_TRIANGLES;
    mesh.s.vertices = malloc(3 * FATHOM_BLOCK_TRIANGLES * sizeof *mesh.s.vertices);
    blocks.s.capacity = 16;
    blocks.s.keys = malloc(16 * sizeof *blocks.s.keys);
    int64_t triangles = 0, count, pieces = 0;
    while ((count = fathom_pull_mesh(scan, &mesh.s)) > 0) {
        CHECK_GUARD(mesh);
        CHECK_REST(mesh);
        triangles += count;
        pieces++;
    }
    CHECK(count == 0 && pieces > 1 && triangles > 1000);
    for (pieces = 0; (count = fathom_pull_blocks(scan, &blocks.s)) > 0; pieces++) {
        CHECK_GUARD(blocks);
        CHECK_REST(blocks);
    }
    CHECK(count == 0 && pieces > 1 && blocks.s.since == blocks.s.generation && blocks.s.since > 0);
    free(mesh.s.vertices);
    free(blocks.s.keys);
    CHECK_GUARD(store);
    fathom_close(scan);
    free(block);
    /* a pool that is too small for a turn to another surface hands blocks over */
    c.s.max_blocks = 64;
    CHECK(fathom_plan_memory(&c.s, &plan.s, why, sizeof why) == FATHOM_OK);
    block = malloc((size_t)plan.s.host_bytes);
    CHECK(fathom_init(&scan, &c.s, block, (size_t)plan.s.host_bytes, why, sizeof why) == FATHOM_OK);
    if (!scan) return 1;
    for (int i = 1; i <= 6; i++) {
        frame.s.timestamp_ns = i * 33333333;
        CHECK(fathom_step(scan, &frame.s, &result.s) == FATHOM_OK);
    }
    CHECK(fathom_get_counters(scan, &counters.s) == FATHOM_OK && counters.s.blocks_dropped == put_calls);
    fathom_close(scan);
    free(block);
    return failed > 0;
}
