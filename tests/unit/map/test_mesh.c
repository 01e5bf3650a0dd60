/* Marching cubes: the table (mesh_cases), the two kernels and their batches make closed, consistently turned
 * surfaces. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "map/mesh.h"
#include "selftest/kernel_checks_bench.h"

/* ---- a volume of the library, filled by hand -------------------------------------------------------------------- */

#define BLOCKS 3000
#define ARENA_BYTES ((size_t)64 << 20)

typedef struct {
    fathom_config config;
    device d;
    void *memory;
    volume v;
    mesher m;
    bench_volume filled;
    fathom_vertex *vertices; /* three a triangle */
    size_t triangles, room;
} scene;

static int open_scene(void **state) {
    scene *s = bench_alloc(sizeof *s);
    fathom_config_init(&s->config);
    if (kernel_checks_open(&s->d, &s->config, SHAPE_OWN) != FATHOM_OK) return -1;
    if (posix_memalign(&s->memory, ARENA_ALIGNMENT, ARENA_BYTES)) return -1;
    arena a = {s->memory, ARENA_BYTES, 0};
    s->config.voxel_m = 0.02f;
    mesher_init(&s->m, &s->d, &a);
    volume_init(&s->v, &s->d, &a, &s->config, BLOCKS);
    bench_volume_make(&s->filled, BLOCKS, 0.02f, 0.08f);
    *state = s;
    return s->d.error == FATHOM_OK && a.used <= a.size ? 0 : -1;
}

static int close_scene(void **state) {
    scene *s = *state;
    volume_close(&s->v);
    mesher_close(&s->m);
    device_close(&s->d);
    bench_volume_free(&s->filled);
    free(s->vertices);
    free(s->memory);
    free(s);
    return 0;
}

static void copy_in(scene *s, device_buffer *buffer, const void *from, size_t size) {
    assert_true(size <= buffer->size);
    void *p = device_map(&s->d, buffer, CL_MAP_WRITE);
    assert_non_null(p);
    memcpy(p, from, size);
    device_unmap(&s->d, buffer, p);
}

static int take(void *user, const fathom_vertex *vertices, size_t count) {
    scene *s = user;
    if (s->triangles + count > s->room) {
        s->room = 2 * (s->triangles + count);
        s->vertices = realloc(s->vertices, s->room * 3 * sizeof *s->vertices);
        assert_non_null(s->vertices);
    }
    memcpy(s->vertices + 3 * s->triangles, vertices, count * 3 * sizeof *vertices);
    s->triangles += count;
    return 0;
}

/* The triangles of what has been filled in, as far as it has the weight. */
static void extract_from(scene *s, float min_weight) {
    s->v.pool.count = s->filled.count;
    s->v.surface = s->filled.surface;
    copy_in(s, &s->v.pool.keys, s->filled.blocks, (size_t)s->v.pool.count * sizeof(cl_int4));
    copy_in(s, &s->v.table.entries, s->filled.table, TABLE_BYTES(s->filled.entries));
    copy_in(s, &s->v.pool.voxels, s->filled.voxels, (size_t)s->v.pool.count * BLOCK_BYTES);
    s->triangles = 0;
    mesh_walk walk;
    int count, all = 0;
    mesh_walk_start(&walk, &s->v, min_weight, 0);
    while ((count = mesh_walk_next(&walk, &s->m, &s->d, MESH_TRIANGLES, take, s)) > 0) all += count;
    assert_int_equal(count, 0);
    assert_int_equal(walk.next, s->v.pool.count);
    assert_int_equal(all, s->triangles);
}

static void extract(scene *s) {
    extract_from(s, 0);
}

/* ---- its topology ------------------------------------------------------------------------------------------------ */

typedef struct {
    uint32_t low, high; /* numbers of its corners */
    int way;            /* +1: from low to high in its triangle */
} edge;

static int by_position(const void *a, const void *b) {
    return memcmp((*(const fathom_vertex *const *)a)->position, (*(const fathom_vertex *const *)b)->position,
                  12);
}

static int by_corners(const void *a, const void *b) {
    const edge *p = a, *q = b;
    if (p->low != q->low) return p->low < q->low ? -1 : 1;
    return p->high < q->high ? -1 : p->high > q->high;
}

typedef struct {
    long corners, edges, triangles;
    long odd;      /* edges that aren't passed once each way */
    long unclosed; /* edges not passed as often one way as the other: a hole, or a triangle turned over */
    long shrunk;     /* triangles of which two corners are one */
    long coincident; /* triangles with the same three corners as another one */
} topology;

typedef struct {
    uint32_t corner[3]; /* numbers, ascending */
} face;

static face face_of(const uint32_t corner[3]) {
    face f = {{corner[0], corner[1], corner[2]}};
    for (int i = 0; i < 3; i++) {
        uint32_t *pair = &f.corner[i % 2], low = pair[0] < pair[1] ? pair[0] : pair[1];
        pair[1] = pair[0] ^ pair[1] ^ low;
        pair[0] = low;
    }
    return f;
}

static int by_face(const void *a, const void *b) {
    const face *p = a, *q = b;
    for (int i = 0; i < 3; i++)
        if (p->corner[i] != q->corner[i]) return p->corner[i] < q->corner[i] ? -1 : 1;
    return 0;
}

static topology topology_of(const scene *s) {
    size_t n = 3 * s->triangles;
    topology t = {.triangles = (long)s->triangles};
    const fathom_vertex **sorted = bench_alloc(n * sizeof *sorted);
    uint32_t *number = bench_alloc(n * sizeof *number);
    edge *edges = bench_alloc(n * sizeof *edges);
    for (size_t i = 0; i < n; i++) sorted[i] = &s->vertices[i];
    qsort(sorted, n, sizeof *sorted, by_position);
    for (size_t i = 0; i < n; i++) { /* corners are one when their positions are equal to the bit */
        if (i == 0 || by_position(&sorted[i], &sorted[i - 1])) t.corners++;
        number[sorted[i] - s->vertices] = (uint32_t)t.corners;
    }
    for (size_t i = 0; i < n; i++) {
        uint32_t a = number[i], b = number[i % 3 == 2 ? i - 2 : i + 1];
        edges[i] = (edge){a < b ? a : b, a < b ? b : a, a < b ? 1 : -1};
    }
    qsort(edges, n, sizeof *edges, by_corners);
    for (size_t i = 0, end; i < n; i = end) {
        int sum = 0;
        for (end = i; end < n && by_corners(&edges[i], &edges[end]) == 0; end++) sum += edges[end].way;
        t.edges++;
        t.unclosed += sum != 0;
        t.odd += sum != 0 || end - i != 2;
    }
    face *faces = bench_alloc(s->triangles * sizeof *faces);
    for (size_t i = 0; i < s->triangles; i++) {
        faces[i] = face_of(number + 3 * i);
        t.shrunk += faces[i].corner[0] == faces[i].corner[1] || faces[i].corner[1] == faces[i].corner[2];
    }
    qsort(faces, s->triangles, sizeof *faces, by_face);
    for (size_t i = 1; i < s->triangles; i++) t.coincident += by_face(&faces[i], &faces[i - 1]) == 0;
    free(faces);
    free(sorted);
    free(number);
    free(edges);
    return t;
}

/* ---- shapes ------------------------------------------------------------------------------------------------------ */

/* Off the voxels' grid, so that no voxel lies on the surface to the last bit: there corners of several edges would fall
 * on one point. */
static double sphere(const double p[3]) {
    double x = p[0] - 0.0137, y = p[1] + 0.0213, z = p[2] - 0.0071;
    return sqrt(x * x + y * y + z * z) - 0.4031;
}

static double torus(const double p[3]) {
    double x = p[0] - 0.0137, y = 0.8 * p[1] + 0.6 * p[2] + 0.0213, z = -0.6 * p[1] + 0.8 * p[2] - 0.0071;
    double ring = sqrt(x * x + y * y) - 0.4031;
    return sqrt(ring * ring + z * z) - 0.1517;
}

static void gradient(bench_shape shape, const float p[3], double g[3]) {
    double length = 0;
    for (int i = 0; i < 3; i++) {
        double a[3] = {p[0], p[1], p[2]}, b[3] = {p[0], p[1], p[2]};
        a[i] += 1e-4;
        b[i] -= 1e-4;
        g[i] = shape(a) - shape(b);
        length += g[i] * g[i];
    }
    for (int i = 0; i < 3; i++) g[i] /= sqrt(length);
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void check_shape(scene *s, bench_shape shape, long euler) {
    const double low[3] = {-0.8, -0.8, -0.8}, high[3] = {0.8, 0.8, 0.8};
    bench_volume_fill(&s->filled, shape, low, high);
    extract(s);
    topology t = topology_of(s);
    assert_true(t.triangles > 5000); /* several batches of blocks */
    assert_int_equal(t.odd, 0);
    assert_int_equal(t.shrunk, 0);
    assert_int_equal(t.coincident, 0);
    assert_int_equal(t.corners - t.edges + t.triangles, euler);
    for (size_t i = 0; i < s->triangles; i++) {
        const fathom_vertex *v = &s->vertices[3 * i];
        double a[3], b[3], out[3];
        for (int k = 0; k < 3; k++) {
            a[k] = (double)v[1].position[k] - v[0].position[k];
            b[k] = (double)v[2].position[k] - v[0].position[k];
        }
        double cross[3] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
        gradient(shape, v[0].position, out);
        double area2 = sqrt(dot(cross, cross));
        /* counter-clockwise seen from outside; slivers have no direction to speak of */
        if (area2 > 1e-6) assert_true(dot(cross, out) > 0.5 * area2);
        for (int k = 0; k < 3; k++) {
            double n[3] = {v[k].normal[0], v[k].normal[1], v[k].normal[2]};
            double p[3] = {v[k].position[0], v[k].position[1], v[k].position[2]};
            gradient(shape, v[k].position, out);
            assert_true(fabs(dot(n, n) - 1) < 1e-5);
            assert_true(dot(n, out) >
                        0.98); /* outwards: differences over two voxels of 20 on the smaller radius */
            /* on the surface: a straight line between voxels against a radius of 0.15: 0.02^2 / 8 / 0.15 */
            assert_true(fabs(shape(p)) < 5e-4);
        }
    }
}

static void a_sphere_is_closed(void **state) {
    check_shape(*state, sphere, 2);
}

static void a_torus_is_closed(void **state) {
    check_shape(*state, torus, 0);
}

/* ---- the least weight -------------------------------------------------------------------------------------------- */

static void weigh(scene *s, int weight) {
    for (int i = 0; i < s->filled.count * BLOCK_VOXELS; i++)
        s->filled.voxels[i / BLOCK_VOXELS * 2 * BLOCK_VOXELS + BLOCK_VOXELS + i % BLOCK_VOXELS] =
            (int16_t)weight;
}

/* Weights are stored in 64ths: a voxel counts from exactly min_weight on, and one 64th less is as never seen. */
static void a_voxel_counts_from_the_least_weight_on(void **state) {
    static const int stored[] = {1, 2, 3, 63, 64, 65, 6400, 65535};
    const double low[3] = {-0.3, -0.3, -0.3}, high[3] = {0.3, 0.3, 0.3};
    scene *s = *state;
    bench_volume_fill(&s->filled, sphere, low, high);
    extract(s);
    const size_t all = s->triangles;
    assert_true(all > 500);
    for (int i = 0; i < 8; i++) {
        weigh(s, stored[i]);
        for (int asked = stored[i] - 1; asked <= stored[i] + 1; asked++) {
            extract_from(s, (float)asked / WEIGHT_ONE);
            assert_int_equal(s->triangles, asked > stored[i] ? 0 : all);
        }
        extract_from(s, 1e-6f); /* less than any that is stored */
        assert_int_equal(s->triangles, all);
    }
}

/* What has too little weight makes the same mesh as what was never seen, normals at its rim too. */
static void too_light_is_as_never_seen(void **state) {
    const double low[3] = {-0.6, -0.6, -0.6}, high[3] = {0.6, 0.6, 0.6};
    scene *s = *state;
    bench_volume_fill(&s->filled, sphere, low, high);
    for (int i = 0; i < s->filled.count * BLOCK_VOXELS; i++) {
        const cl_int4 *b = &s->filled.blocks[i / BLOCK_VOXELS];
        const int x = b->x * BLOCK_EDGE + i % 8, y = b->y * BLOCK_EDGE + i / 8 % 8;
        s->filled.voxels[i / BLOCK_VOXELS * 2 * BLOCK_VOXELS + BLOCK_VOXELS + i % BLOCK_VOXELS] =
            (int16_t)(x + 2 * y < 5 ? 128 : 127);
    }
    extract_from(s, 2);
    const size_t light = s->triangles;
    fathom_vertex *vertices = bench_alloc(3 * light * sizeof *vertices);
    memcpy(vertices, s->vertices, 3 * light * sizeof *vertices);
    for (int i = 0; i < s->filled.count * BLOCK_VOXELS; i++) {
        int16_t *data = s->filled.voxels + i / BLOCK_VOXELS * 2 * BLOCK_VOXELS + i % BLOCK_VOXELS;
        if (data[BLOCK_VOXELS] == 127) *data = NEVER_SEEN;
    }
    extract(s);
    assert_true(light > 1000);
    assert_int_equal(s->triangles, light);
    assert_memory_equal(s->vertices, vertices, 3 * light * sizeof *vertices);
    free(vertices);
}

/* ---- random volumes ---------------------------------------------------------------------------------------------- */

#define SIDE 6 /* blocks across a random volume */

/* Any distances: d, -d or, if zeros, 0, with d from low to high, from voxel `first` on in each axis; outside all
 * around. */
static void fill_at_random(scene *s, bench *b, int first, int low, int high, bool zeros) {
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) {
        const int block[3] = {i % SIDE, i / SIDE % SIDE, i / SIDE / SIDE};
        int16_t *data =
            s->filled.voxels + (size_t)bench_volume_add(&s->filled, first / 8 + block[0],
                                                        first / 8 + block[1], first / 8 + block[2]) *
                                   2 * BLOCK_VOXELS;
        for (int k = 0; k < BLOCK_VOXELS; k++) {
            const int at[3] = {k % 8, k / 8 % 8, k / 64};
            bool rim = false;
            for (int a = 0; a < 3; a++) {
                const int whole = block[a] * 8 + at[a];
                rim = rim || whole == 0 || whole == SIDE * 8 - 1;
            }
            const int d = bench_random_int(b, low, high), way = bench_random_int(b, zeros ? 0 : 1, 2);
            data[k] = (int16_t)(rim || way == 1 ? d : way == 2 ? -d : 0);
            data[BLOCK_VOXELS + k] = 64;
        }
    }
}

/* Every case of the table, and its neighbours, without a hole. */
static void a_random_volume_has_no_holes(void **state) {
    scene *s = *state;
    bench b = {.random = 7};
    bool used[256] = {false};
    fill_at_random(s, &b, -24, 3000, 30000, false);
    ref_volume reference;
    ref_volume_open(&reference, s->filled.blocks, s->filled.count, s->filled.voxels, &s->filled.surface);
    for (int z = -24; z < 23; z++)
        for (int y = -24; y < 23; y++)
            for (int x = -24; x < 23; x++) {
                int kind = 0;
                for (int k = 0; k < 8; k++)
                    kind |= (ref_volume_voxel(&reference, x + (k & 1), y + (k >> 1 & 1), z + (k >> 2)) <= 0)
                            << k;
                used[kind] = true;
            }
    ref_volume_close(&reference);
    for (int i = 0; i < 256; i++) assert_true(used[i]);
    extract(s);
    topology t = topology_of(s);
    assert_true(t.triangles > 100000);
    assert_int_equal(t.unclosed, 0);
    assert_int_equal(t.shrunk, 0);
    assert_int_equal(t.coincident, 0);
}

/* Distances of 0, and ones that are nothing beside their neighbours, near the world's origin and far from it. */
static void corners_do_not_fall_together(void **state) {
    scene *s = *state;
    static const int first[] = {-24, 16000, -16000};
    for (int i = 0; i < 3; i++) {
        bench b = {.random = 11};
        s->filled.count = 0;
        memset(s->filled.table, 0xff, TABLE_BYTES(s->filled.entries));
        fill_at_random(s, &b, first[i], 1, i == 0 ? 2 : 30000, true);
        extract(s);
        topology t = topology_of(s);
        assert_true(t.triangles > 100000);
        assert_int_equal(t.unclosed, 0);
        assert_int_equal(t.shrunk, 0);
        assert_int_equal(t.coincident, 0);
    }
}

/* Each case by itself: triangles use only crossed edges, each crossed edge once or more, and at most five triangles. */
static void the_table_uses_the_crossed_edges(void **state) {
    (void)state;
    uint8_t cases[256 * 16];
    mesh_cases(cases);
    for (int kind = 0; kind < 256; kind++) {
        const uint8_t *row = cases + 16 * kind;
        unsigned crossed = 0, used = 0;
        for (int axis = 0; axis < 3; axis++)
            for (int rest = 0; rest < 4; rest++) {
                int low = axis == 0   ? rest << 1
                          : axis == 1 ? (rest & 1) | (rest & 2) << 1
                                      : rest,
                    high = low | 1 << axis;
                if ((kind >> low & 1) != (kind >> high & 1)) crossed |= 1u << (4 * axis + rest);
            }
        int n = 0;
        while (n < 16 && row[n] != 255) used |= 1u << row[n++];
        assert_int_equal(used, crossed);
        assert_int_equal(n % 3, 0);
        assert_true(n <= 15);
        for (int j = n; j < 16; j++) assert_int_equal(row[j], 255);
    }
}

/* A triangle within a face of its cube would lie back to back with one of the next cube. */
static void no_triangle_lies_within_a_face_of_its_cube(void **state) {
    (void)state;
    static const uint8_t ends[12][2] = EDGE_ENDS;
    static uint8_t table[256 * CASE_SIZE];
    mesh_cases(table);
    for (int i = 0; i < 256 * CASE_SIZE; i += i % CASE_SIZE == 12 ? 4 : 3)
        for (int axis = 0; axis < 3 && table[i] != CASE_END; axis++) {
            int high = 0, low = 0; /* edges on the two faces across the axis */
            for (int k = i; k < i + 3; k++) {
                const int a = ends[table[k]][0] >> axis & 1, b = ends[table[k]][1] >> axis & 1;
                high += a && b;
                low += !a && !b;
            }
            if (high == 3 || low == 3) fail_msg("case %d, triangle %d", i / CASE_SIZE, i % CASE_SIZE / 3);
        }
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_triangle_lies_within_a_face_of_its_cube),
        cmocka_unit_test(the_table_uses_the_crossed_edges),
        cmocka_unit_test_setup_teardown(a_sphere_is_closed, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(a_torus_is_closed, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(a_voxel_counts_from_the_least_weight_on, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(too_light_is_as_never_seen, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(a_random_volume_has_no_holes, open_scene, close_scene),
        cmocka_unit_test_setup_teardown(corners_do_not_fall_together, open_scene, close_scene),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
