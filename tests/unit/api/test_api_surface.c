/* The public API: the surface. Its triangles and views against the scene, and a pool that is full. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/render.h"
#include "base/se3.h"
#include "synthetic.h"

#define FRAMES 16
static synthetic_frame frames[FRAMES];
static synthetic_log kept;
static synthetic_context whole; /* has seen all frames */
static struct scene scene;

static fathom_config logged(void) {
    fathom_config c = synthetic_config(&frames[0]);
    memset(&kept, 0, sizeof kept);
    c.log = synthetic_logger;
    c.log_user = &kept;
    return c;
}

static int setup(void **state) {
    (void)state;
    synthetic_render(SCENE_DESK, 0, FRAMES, frames);
    if (!scene_make(&scene, SCENE_DESK, SYNTHETIC_SEED, 10.0)) return -1;
    fathom_config c = logged();
    whole = synthetic_start(&c);
    for (int i = 0; i < FRAMES; i++) synthetic_step(whole.scan, &frames[i]);
    return 0;
}

static int teardown(void **state) {
    (void)state;
    synthetic_stop(&whole);
    scene_free(&scene);
    return 0;
}

/* ---- triangles ---------------------------------------------------------------------------------------------------- */

static synthetic_mesh mesh_of(fathom *scan) {
    synthetic_mesh mesh = {0};
    int64_t n = fathom_extract_mesh(scan, 0, synthetic_triangles, &mesh);
    assert_true(n >= 0 && (size_t)n * 3 == mesh.count);
    return mesh;
}

static double off_surface(const fathom_vertex *v) {
    return fabs(scene_distance(&scene, v->position[0], v->position[1], v->position[2]));
}

static void triangles_lie_on_the_true_surface_and_face_outwards(void **state) {
    (void)state;
    synthetic_mesh m = mesh_of(whole.scan);
    size_t near = 0, close = 0, aligned = 0, wound = 0, solid = 0;
    assert_true(m.count > 3000);
    for (size_t i = 0; i < m.count; i += 3) {
        double a[3], b[3], n[3], area = 0, along = 0;
        for (int k = 0; k < 3; k++) {
            a[k] = m.vertices[i + 1].position[k] - m.vertices[i].position[k];
            b[k] = m.vertices[i + 2].position[k] - m.vertices[i].position[k];
        }
        for (int k = 0; k < 3; k++) {
            n[k] = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
            area += n[k] * n[k];
            along += n[k] * m.vertices[i].normal[k];
        }
        if (area > 1e-14) { /* not a sliver */
            solid++;
            wound += along > 0; /* counter-clockwise seen from outside */
        }
        for (size_t j = i; j < i + 3; j++) {
            const fathom_vertex *v = &m.vertices[j];
            double length = 0, cosine = 0, truth[3];
            for (int k = 0; k < 3; k++) {
                assert_true(isfinite(v->position[k]) && isfinite(v->normal[k]));
                length += (double)v->normal[k] * v->normal[k];
            }
            assert_true(fabs(length - 1) < 1e-3);
            near += off_surface(v) < 0.02; /* a voxel */
            close += off_surface(v) < 0.01;
            scene_normal(&scene, v->position[0], v->position[1], v->position[2], truth);
            for (int k = 0; k < 3; k++) cosine += truth[k] * v->normal[k];
            aligned += cosine > 0.8;
        }
    }
    assert_true(close > 0.85 * (double)m.count && near > 0.92 * (double)m.count);
    assert_true(aligned > 0.7 * (double)m.count); /* round the edges of small things they turn */
    assert_true(wound > 0.97 * (double)solid);
    free(m.vertices);
}

/* A directed edge, by the bits of its ends or by their place to a tenth of a millimetre. */
typedef struct {
    int32_t from[3], to[3];
} edge;

static int compare_edges(const void *a, const void *b) {
    return memcmp(a, b, sizeof(edge));
}

static void corner_of(const fathom_vertex *v, bool bits, int32_t out[3]) {
    for (int k = 0; k < 3; k++) {
        if (bits)
            memcpy(&out[k], &v->position[k], sizeof out[k]);
        else
            out[k] = (int32_t)lround(v->position[k] * 1e4);
    }
}

/* Edges that no neighbour shares the other way round, and, in *twice, ones that go the same way twice. */
static size_t open_edges(const synthetic_mesh *m, bool bits, size_t *twice) {
    edge *edges = malloc(m->count * sizeof *edges);
    size_t open = 0, n = 0;
    assert_non_null(edges);
    for (size_t i = 0; i < m->count; i++) {
        edge e;
        corner_of(&m->vertices[i], bits, e.from);
        corner_of(&m->vertices[i - i % 3 + (i + 1) % 3], bits, e.to);
        if (memcmp(e.from, e.to, sizeof e.from) != 0) edges[n++] = e;
    }
    qsort(edges, n, sizeof *edges, compare_edges);
    *twice = 0;
    for (size_t i = 0; i < n; i++) {
        edge other;
        memcpy(other.from, edges[i].to, sizeof other.from);
        memcpy(other.to, edges[i].from, sizeof other.to);
        open += !bsearch(&other, edges, n, sizeof *edges, compare_edges);
        *twice += i > 0 && compare_edges(&edges[i], &edges[i - 1]) == 0;
    }
    free(edges);
    return open;
}

static void shared_corners_are_equal_to_the_last_bit(void **state) {
    (void)state;
    synthetic_mesh m = mesh_of(whole.scan);
    size_t twice, loose_twice;
    size_t open = open_edges(&m, true, &twice), loosely = open_edges(&m, false, &loose_twice);
    assert_true(open < m.count / 8); /* the rim of what was seen */
    assert_true(open <=
                loosely + m.count / 500); /* none of it would close if corners were brought together */
    assert_true(twice <= m.count / 1000);
    free(m.vertices);
}

static void the_callback_can_stop_and_choose(void **state) {
    (void)state;
    synthetic_mesh all = mesh_of(whole.scan), first = {.stop_after = 1}, some = {0}, none = {0};
    assert_true(fathom_extract_mesh(whole.scan, 0, synthetic_triangles, &first) == FATHOM_ERROR_STOPPED);
    assert_int_equal(first.calls, 1);
    assert_memory_equal(first.vertices, all.vertices, first.count * sizeof *first.vertices);
    synthetic_mesh again = mesh_of(whole.scan); /* stopping left nothing behind */
    assert_int_equal(again.count, all.count);
    assert_memory_equal(again.vertices, all.vertices, all.count * sizeof *all.vertices);

    int64_t n = fathom_extract_mesh(whole.scan, 5, synthetic_triangles, &some);
    assert_true(n > 0 && (size_t)n * 3 == some.count && some.count < all.count);
    assert_true(fathom_extract_mesh(whole.scan, 1e6f, synthetic_triangles, &none) == 0);
    assert_int_equal(none.calls, 0);
    assert_true(fathom_extract_mesh(whole.scan, -1, synthetic_triangles, &none) == FATHOM_ERROR_ARGUMENT);
    assert_true(fathom_extract_mesh(whole.scan, NAN, synthetic_triangles, &none) == FATHOM_ERROR_ARGUMENT);
    free(all.vertices);
    free(first.vertices);
    free(again.vertices);
    free(some.vertices);
}

/* ---- views -------------------------------------------------------------------------------------------------------- */

/* A view of the given size from where frame 8 was taken, a little wider or narrower than the camera. */
static fathom_view view_of(int width, int height, double focal) {
    fathom_view v = FATHOM_STRUCT(fathom_view);
    v.camera = (fathom_pinhole){.width = width,
                                .height = height,
                                .fx = focal,
                                .fy = focal,
                                .cx = 0.5 * (width - 1),
                                .cy = 0.5 * (height - 1)};
    v.pose = frames[8].pose;
    return v;
}

static void views_agree_with_the_truth(void **state) {
    (void)state;
    /* of the maps' size, larger, smaller, one row, one pixel: none a multiple of the tile but the first */
    static const int sizes[][2] = {{160, 120}, {333, 211}, {101, 67}, {161, 121}, {200, 1}, {1, 1}, {7, 150}};
    for (size_t s = 0; s < sizeof sizes / sizeof *sizes; s++) {
        const int w = sizes[s][0], h = sizes[s][1];
        const size_t pixels = (size_t)w * (size_t)h;
        fathom_view v = view_of(w, h, w > 160 ? 262.5 : 150);
        float *depth = malloc((pixels + 64) * sizeof *depth),
              *normals = malloc((3 * pixels + 64) * sizeof *normals);
        float *truth = malloc(pixels * sizeof *truth), *alone = malloc(pixels * sizeof *alone);
        assert_true(depth && normals && truth && alone);
        for (int k = 0; k < 64; k++) depth[pixels + (size_t)k] = normals[3 * pixels + (size_t)k] = 1234.5f;
        assert_int_equal(fathom_cast_view(whole.scan, &v, depth, normals), FATHOM_OK);
        assert_int_equal(fathom_cast_view(whole.scan, &v, alone, NULL), FATHOM_OK);
        assert_memory_equal(depth, alone, pixels * sizeof *depth);
        assert_int_equal(fathom_cast_view(whole.scan, &v, NULL, NULL), FATHOM_OK);
        for (int k = 0; k < 64; k++)
            assert_true(depth[pixels + (size_t)k] == 1234.5f && normals[3 * pixels + (size_t)k] == 1234.5f);
        const struct render_camera camera = {w, h, v.camera.fx, v.camera.fy, v.camera.cx, v.camera.cy};
        struct camera_pose at;
        pose from;
        assert_true(pose_take(&v.pose, &from));
        memcpy(at.rotation, from.r, sizeof at.rotation);
        memcpy(at.position, from.t, sizeof at.position);
        assert_true(render_depth(&scene, &camera, &at, 12, 2, truth, NULL));
        size_t seen = 0, good = 0;
        for (size_t i = 0; i < pixels; i++) {
            const float *n = normals + 3 * i;
            assert_true(isfinite(depth[i]) && depth[i] >= 0);
            if (depth[i] == 0) {
                assert_true(n[0] == 0 && n[1] == 0 && n[2] == 0);
                continue;
            }
            const double x = ((double)(i % (size_t)w) - v.camera.cx) / v.camera.fx,
                         y = ((double)(i / (size_t)w) - v.camera.cy) / v.camera.fy;
            assert_true(fabs(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1) < 1e-5);
            assert_true(n[0] * x + n[1] * y + n[2] < 2e-3); /* to the camera, but for rounding */
            seen++;
            good += fabs(depth[i] - truth[i]) < 0.02;
        }
        if (seen <= 0.75 * (double)pixels || good < 0.93 * (double)seen)
            print_error("%dx%d: %zu of %zu seen, %zu good\n", w, h, seen, pixels, good);
        assert_true(seen > 0.75 * (double)pixels);
        assert_true(good >= 0.93 * (double)seen); /* within a voxel, but for the edges of things */
        free(depth);
        free(normals);
        free(truth);
        free(alone);
    }
}

static void views_keep_to_their_range(void **state) {
    (void)state;
    static float depth[SYNTHETIC_PIXELS], whole_range[SYNTHETIC_PIXELS];
    fathom_view v = view_of(SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT, 131.25);
    assert_int_equal(fathom_cast_view(whole.scan, &v, whole_range, NULL), FATHOM_OK);
    v.near_m = 0.4f;
    v.far_m = 0.8f;
    int seen = 0;
    assert_int_equal(fathom_cast_view(whole.scan, &v, depth, NULL), FATHOM_OK);
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) {
        assert_true(depth[i] == 0 || (depth[i] > 0.35f && depth[i] < 0.9f));
        seen += depth[i] > 0;
    }
    assert_true(seen > 100);
    v.near_m = 50; /* beyond the default far end: nothing */
    v.far_m = 0;
    assert_int_equal(fathom_cast_view(whole.scan, &v, depth, NULL), FATHOM_OK);
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) assert_true(depth[i] == 0);
    v = view_of(SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT, 131.25); /* a view from far away has nothing either */
    v.pose.position[0] += 1000;
    assert_int_equal(fathom_cast_view(whole.scan, &v, depth, NULL), FATHOM_OK);
    for (int i = 0; i < SYNTHETIC_PIXELS; i++) assert_true(depth[i] == 0);
}

static void bad_views_are_refused_and_write_nothing(void **state) {
    (void)state;
    static float depth[SYNTHETIC_PIXELS];
    const fathom_view good = view_of(SYNTHETIC_WIDTH, SYNTHETIC_HEIGHT, 131.25);
    fathom_view bad[14];
    int n = 0;
    for (int i = 0; i < 14; i++) bad[i] = good;
    bad[n++].camera.width = 0;
    bad[n++].camera.height = -5;
    bad[n++].camera.width = 16385;
    bad[n++].camera.fx = 0;
    bad[n++].camera.fy = NAN;
    bad[n++].camera.fx = INFINITY;
    bad[n++].camera.cx = NAN;
    bad[n++].camera.cy = INFINITY;
    bad[n++].near_m = -1;
    bad[n++].far_m = NAN;
    bad[n++].pose.position[0] = NAN;
    bad[n++].pose.orientation[1] = 3;
    bad[n++].camera.lens = FATHOM_LENS_FIVE;
    memset(&bad[n++].pose, 0, sizeof good.pose);
    memset(depth, 0x55, sizeof depth);
    for (int i = 0; i < n; i++) {
        kept.errors = 0;
        assert_int_equal(fathom_cast_view(whole.scan, &bad[i], depth, NULL), FATHOM_ERROR_ARGUMENT);
        assert_int_equal(kept.errors, 1);
    }
    for (size_t i = 0; i < sizeof depth; i++) assert_int_equal(((unsigned char *)depth)[i], 0x55);
}

/* Asking for views and triangles between steps changes no pose. */
static void looking_does_not_disturb(void **state) {
    (void)state;
    static float depth[200 * 100], normals[3 * 200 * 100];
    for (int against = 0; against < 2; against++) {
        fathom_config c = logged();
        c.against = against ? FATHOM_AGAINST_PREVIOUS : FATHOM_AGAINST_MODEL;
        synthetic_context a = synthetic_start(&c), b = synthetic_start(&c);
        for (int i = 0; i < 6; i++) {
            fathom_result one = synthetic_step(a.scan, &frames[i]), two = synthetic_step(b.scan, &frames[i]);
            assert_memory_equal(&one.pose, &two.pose, sizeof one.pose);
            fathom_view v = view_of(200, 100, 150);
            assert_int_equal(fathom_cast_view(a.scan, &v, depth, normals), FATHOM_OK);
            synthetic_mesh m = mesh_of(a.scan);
            free(m.vertices);
        }
        synthetic_stop(&a);
        synthetic_stop(&b);
    }
}

/* ---- a full pool -------------------------------------------------------------------------------------------------- */

static void a_full_pool_is_said_and_tracking_goes_on(void **state) {
    (void)state;
    fathom_config c = logged();
    fathom_counters counters = FATHOM_STRUCT(fathom_counters);
    c.max_blocks = 64;
    c.voxel_m = 0.04f;
    synthetic_context s = synthetic_start(&c);
    for (int i = 0; i < FRAMES; i++) {
        fathom_result r = synthetic_step(s.scan, &frames[i]);
        assert_int_equal(r.state, i == 0 ? FATHOM_FIRST : FATHOM_TRACKED);
        assert_true(r.fused && r.pool_full && r.blocks == 64);
        assert_true(synthetic_distance(r.pose, frames[i].pose) < 0.02);
    }
    synthetic_mesh end = mesh_of(s.scan);
    size_t near = 0;
    for (size_t i = 0; i < end.count; i++) near += off_surface(&end.vertices[i]) < 0.04;
    assert_true(end.count > 500 && near > 0.9 * (double)end.count);
    free(end.vertices);
    assert_int_equal(fathom_get_counters(s.scan, &counters), FATHOM_OK);
    assert_true(counters.blocks_refused > 0);
    assert_int_equal(kept.errors, 0);
    assert_int_equal(kept.warnings, 1); /* said once */
    assert_non_null(strstr(kept.text, "pool is full"));
    synthetic_stop(&s);
}

/* The places of a triangle's corners. */
typedef struct {
    float corners[3][3];
} triangle;

static int compare_triangles(const void *a, const void *b) {
    return memcmp(a, b, sizeof(triangle));
}

static triangle *sorted_triangles(const synthetic_mesh *m) {
    triangle *t = calloc(m->count / 3, sizeof *t);
    assert_non_null(t);
    for (size_t i = 0; i < m->count; i++)
        memcpy(t[i / 3].corners[i % 3], m->vertices[i].position, sizeof t->corners[0]);
    qsort(t, m->count / 3, sizeof *t, compare_triangles);
    return t;
}

/* Poses from frame to frame don't depend on the surface, so a small pool and a large one fuse the same: what the small
 * one has must be a part of what the large one has, to the last bit, however many blocks it had to refuse. */
static void a_full_pool_harms_nothing_that_was_fused(void **state) {
    (void)state;
    fathom_config c = logged();
    c.against = FATHOM_AGAINST_PREVIOUS;
    c.voxel_m = 0.04f;
    synthetic_context large = synthetic_start(&c);
    c.max_blocks = 64;
    synthetic_context small = synthetic_start(&c);
    for (int i = 0; i < FRAMES; i++) {
        fathom_result a = synthetic_step(large.scan, &frames[i]), b = synthetic_step(small.scan, &frames[i]);
        assert_memory_equal(&a.pose, &b.pose, sizeof a.pose);
        assert_true(b.pool_full && !a.pool_full);
    }
    synthetic_mesh all = mesh_of(large.scan), part = mesh_of(small.scan);
    triangle *of_all = sorted_triangles(&all), *of_part = sorted_triangles(&part);
    assert_true(part.count > 500 && part.count < all.count);
    for (size_t i = 0; i < part.count / 3; i++)
        assert_non_null(bsearch(&of_part[i], of_all, all.count / 3, sizeof *of_all, compare_triangles));
    free(of_all);
    free(of_part);
    free(all.vertices);
    free(part.vertices);
    synthetic_stop(&large);
    synthetic_stop(&small);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(triangles_lie_on_the_true_surface_and_face_outwards),
        cmocka_unit_test(shared_corners_are_equal_to_the_last_bit),
        cmocka_unit_test(the_callback_can_stop_and_choose),
        cmocka_unit_test(views_agree_with_the_truth),
        cmocka_unit_test(views_keep_to_their_range),
        cmocka_unit_test(bad_views_are_refused_and_write_nothing),
        cmocka_unit_test(looking_does_not_disturb),
        cmocka_unit_test(a_full_pool_is_said_and_tracking_goes_on),
        cmocka_unit_test(a_full_pool_harms_nothing_that_was_fused),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
