/* The surface against the truth: the room is simulated without noise and replayed by the commands themselves, and the
 * mesh that they leave is compared with the scene's signed distance, which is known in closed form: how far its corners
 * are from the true surface, and how much of the true surface it covers. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <ftw.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "simulate/camera_path.h"
#include "fathom/commands.h"
#include "fathom/shell/cli.h"
#include "simulate/scene.h"
#include "fathom_drivers.h"

#define FRAMES "120"
#define EVERY 6 /* frames looked at for completeness: every so many */
#define ROOM_SEED 1 /* fathom simulate's default */
#define NEAREST_M 0.3
#define FARTHEST_M 5.0
#define CELL_M 0.01    /* the true surface is counted in cells of this edge */
#define COVERED_M 0.01 /* a mesh within this covers it */
#define TRIANGLE_CELL                                                                                        \
    0.02 /* edge of the grid that finds triangles: twice COVERED_M, so that eight cells do */

typedef struct {
    char folder[256];
    char summary[512]; /* of the replay */
    fathom_recording *recording;
    struct scene scene;
    double first[16]; /* the first frame's true pose, 3x4: from the mesh's frame to the scene's */
    size_t vertex_count, triangle_count;
    double (*vertices)[3]; /* in the scene's frame */
    int32_t (*triangles)[3];
} surface_test;

/* ---- the commands ------------------------------------------------------------------------------------------------ */

static int remove_one(const char *path, const struct stat *st, int type, struct FTW *walk) {
    (void)st, (void)type, (void)walk;
    return remove(path);
}

/* Runs a command with its stdout in a file, so that it doesn't get among the test's own lines. */
static int run(const struct command *command, char **argv, const char *output) {
    int argc = 0;
    while (argv[argc]) argc++;
    fflush(stdout);
    int kept = dup(STDOUT_FILENO);
    assert_true(kept >= 0);
    assert_non_null(freopen(output, "w", stdout));
    int status = command->run(command, argc, argv);
    fflush(stdout);
    dup2(kept, STDOUT_FILENO);
    close(kept);
    return status;
}

static void last_line(const char *file, char *line, size_t size) {
    FILE *f = fopen(file, "r");
    assert_non_null(f);
    *line = 0;
    while (fgets(line, (int)size, f)) line[strcspn(line, "\n")] = 0;
    fclose(f);
}

static double figure(const char *summary, const char *name) {
    const char *at = strstr(summary, name);
    return at ? strtod(at + strlen(name) + 1, NULL) : NAN;
}

/* ---- the mesh ---------------------------------------------------------------------------------------------------- */

static void transform(const double m[16], const double p[3], double out[3]) {
    for (int i = 0; i < 3; i++)
        out[i] = m[4 * i] * p[0] + m[4 * i + 1] * p[1] + m[4 * i + 2] * p[2] + m[4 * i + 3];
}

/* Reads the PLY that replay writes (docs/FORMATS.md). The tests run on little-endian machines. */
static void read_mesh(surface_test *s, const char *file) {
    char line[256];
    FILE *f = fopen(file, "rb");
    assert_non_null(f);
    while (fgets(line, sizeof line, f) && strcmp(line, "end_header\n") != 0) {
        sscanf(line, "element vertex %zu", &s->vertex_count);
        sscanf(line, "element face %zu", &s->triangle_count);
    }
    assert_true(s->vertex_count > 0 && s->triangle_count > 0);
    s->vertices = malloc(s->vertex_count * sizeof *s->vertices);
    s->triangles = malloc(s->triangle_count * sizeof *s->triangles);
    assert_true(s->vertices && s->triangles);
    for (size_t i = 0; i < s->vertex_count; i++) {
        float v[6];
        assert_int_equal(fread(v, sizeof v, 1, f), 1);
        const double p[3] = {v[0], v[1], v[2]};
        transform(s->first, p, s->vertices[i]);
    }
    for (size_t i = 0; i < s->triangle_count; i++) {
        assert_int_equal(fgetc(f), 3);
        assert_int_equal(fread(s->triangles[i], sizeof s->triangles[i], 1, f), 1);
        for (int k = 0; k < 3; k++) assert_in_range(s->triangles[i][k], 0, s->vertex_count - 1);
    }
    assert_int_equal(fgetc(f), EOF);
    fclose(f);
}

static int make(void **state) {
    surface_test *s = calloc(1, sizeof *s);
    const char *temporary = getenv("TMPDIR");
    char recording[300], mesh[300], output[300];
    if (!s) return -1;
    *state = s;
    snprintf(s->folder, sizeof s->folder, "%s/fathom-surface-XXXXXX",
             temporary && *temporary ? temporary : "/tmp");
    if (!mkdtemp(s->folder)) return -1;
    snprintf(recording, sizeof recording, "%s/room", s->folder);
    snprintf(mesh, sizeof mesh, "%s/mesh.ply", s->folder);
    snprintf(output, sizeof output, "%s/output", s->folder);
    char *simulate[] = {"simulate", "room", recording, "--clean", "--frames", FRAMES, NULL};
    if (run(&command_simulate, simulate, output) != CLI_DONE) return -1;
    char *replay[] = {"replay", recording, "--mesh", mesh, NULL};
    if (run(&command_replay, replay, output) != CLI_DONE) return -1;
    last_line(output, s->summary, sizeof s->summary);
    fathom_pose first;
    if (fathom_recording_open(&s->recording, recording, NULL) != FATHOM_OK ||
        fathom_recording_pose_at(s->recording, s->recording->frames[0].timestamp_ns, &first) != FATHOM_OK ||
        !scene_make(&s->scene, SCENE_ROOM, ROOM_SEED, 0))
        return -1;
    fathom_pose_to_matrix(&first, s->first);
    read_mesh(s, mesh);
    return 0;
}

static int discard(void **state) {
    surface_test *s = *state;
    if (!s) return 0;
    fathom_recording_close(s->recording);
    scene_free(&s->scene);
    nftw(s->folder, remove_one, 16, FTW_DEPTH | FTW_PHYS);
    free(s->vertices);
    free(s->triangles);
    free(s);
    return 0;
}

/* By position only. */
static int by_position(const void *a, const void *b) {
    const double *p = *(const double *const *)a, *q = *(const double *const *)b;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k]) return p[k] < q[k] ? -1 : 1;
    return 0;
}

/* No vertex is there twice, no face names one twice. */
static void vertices_are_shared(void **state) {
    const surface_test *s = *state;
    const double **sorted = malloc(s->vertex_count * sizeof *sorted);
    assert_non_null(sorted);
    for (size_t i = 0; i < s->vertex_count; i++) sorted[i] = s->vertices[i];
    qsort(sorted, s->vertex_count, sizeof *sorted, by_position);
    for (size_t i = 1; i < s->vertex_count; i++)
        assert_int_not_equal(by_position(&sorted[i - 1], &sorted[i]), 0);
    free(sorted);
    for (size_t i = 0; i < s->triangle_count; i++)
        for (int k = 0; k < 3; k++) assert_int_not_equal(s->triangles[i][k], s->triangles[i][(k + 1) % 3]);
}

/* ---- is what's there true? --------------------------------------------------------------------------------------- */

static int by_size(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static void all_frames_are_tracked(void **state) {
    const surface_test *s = *state;
    assert_int_equal((int)figure(s->summary, "frames"), atoi(FRAMES));
    assert_int_equal((int)figure(s->summary, "tracked"), atoi(FRAMES));
    const double error = figure(s->summary, "ate_rmse_m");
    if (!(error <= 0.002)) fail_msg("%s", s->summary);
}

static void the_mesh_lies_on_the_surface(void **state) {
    const surface_test *s = *state;
    float *error = malloc(s->vertex_count * sizeof *error);
    assert_non_null(error);
    for (size_t i = 0; i < s->vertex_count; i++) {
        const double *p = s->vertices[i];
        error[i] = (float)fabs(scene_distance(&s->scene, p[0], p[1], p[2]));
    }
    qsort(error, s->vertex_count, sizeof *error, by_size);
    const double median = error[s->vertex_count / 2], most = error[s->vertex_count / 20 * 19];
    printf("# %zu corners, from the true surface: median %.2f mm, 95 %% within %.2f mm\n", s->vertex_count,
           1e3 * median, 1e3 * most);
    free(error);
    assert_true(median <= 0.002);
    assert_true(most <= 0.006);
}

/* ---- is what was seen there? ------------------------------------------------------------------------------------- */

static uint64_t cell_key(const int32_t c[3]) {
    const uint64_t offset = 1 << 20, mask = (1 << 21) - 1;
    return (((uint64_t)c[0] + offset) & mask) | (((uint64_t)c[1] + offset) & mask) << 21 |
           (((uint64_t)c[2] + offset) & mask) << 42;
}

/* The place of a key in an open table of a power of two; UINT64_MAX marks a free one. */
static size_t place_of(const uint64_t *keys, size_t size, uint64_t key) {
    size_t h = (size_t)((key * 0x9e3779b97f4a7c15u) >> 20) & (size - 1);
    while (keys[h] != UINT64_MAX && keys[h] != key) h = (h + 1) & (size - 1);
    return h;
}

/* A cell of the true surface: where it was first met, and whether in two frames. */
typedef struct {
    float point[3];
    int frame;
    bool twice;
} seen_cell;

#define SEEN_CELLS ((size_t)1 << 22)

static void see(const surface_test *s, uint64_t *keys, seen_cell *cells) {
    const fathom_recording *r = s->recording;
    uint16_t *depth = malloc((size_t)r->camera.width * (size_t)r->camera.height * sizeof *depth);
    size_t used = 0;
    assert_non_null(depth);
    memset(keys, 0xff, SEEN_CELLS * sizeof *keys);
    for (int frame = 0; frame < r->frame_count; frame += EVERY) {
        fathom_pose pose;
        double m[16];
        assert_int_equal(fathom_recording_read_depth(r, frame, depth), FATHOM_OK);
        assert_int_equal(fathom_recording_pose_at(r, r->frames[frame].timestamp_ns, &pose), FATHOM_OK);
        fathom_pose_to_matrix(&pose, m);
        for (int i = 0; i < r->camera.width * r->camera.height; i++) {
            const double z = depth[i] / r->depth_units_per_metre;
            if (depth[i] == 0 || z < NEAREST_M || z > FARTHEST_M) continue;
            const double camera[3] = {(i % r->camera.width - r->camera.cx) / r->camera.fx * z,
                                      (i / r->camera.width - r->camera.cy) / r->camera.fy * z, z};
            double p[3];
            int32_t c[3];
            transform(m, camera, p);
            for (int k = 0; k < 3; k++) c[k] = (int32_t)floor(p[k] / CELL_M);
            const size_t place = place_of(keys, SEEN_CELLS, cell_key(c));
            if (keys[place] == UINT64_MAX) {
                assert_true(++used < SEEN_CELLS / 4 * 3);
                keys[place] = cell_key(c);
                cells[place] = (seen_cell){{(float)p[0], (float)p[1], (float)p[2]}, frame, false};
            }
            cells[place].twice = cells[place].twice || cells[place].frame != frame;
        }
    }
    free(depth);
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double squared_distance(const double p[3], const double q[3], const double a[3], double t,
                               const double b[3], double u) {
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        const double e = q[i] + t * a[i] + u * b[i] - p[i];
        sum += e * e;
    }
    return sum;
}

/* From a point to a triangle, squared (Ericson 2005, "Real-Time Collision Detection", section 5.1.5). */
static double triangle_distance2(const double p[3], const double a[3], const double b[3], const double c[3]) {
    double ab[3], ac[3], ap[3];
    for (int i = 0; i < 3; i++) {
        ab[i] = b[i] - a[i];
        ac[i] = c[i] - a[i];
        ap[i] = p[i] - a[i];
    }
    const double d1 = dot(ab, ap), d2 = dot(ac, ap);
    const double d3 = d1 - dot(ab, ab), d4 = d2 - dot(ab, ac);
    const double d5 = d1 - dot(ab, ac), d6 = d2 - dot(ac, ac);
    if (d1 <= 0 && d2 <= 0) return squared_distance(p, a, ab, 0, ac, 0);
    if (d3 >= 0 && d4 <= d3) return squared_distance(p, a, ab, 1, ac, 0);
    const double vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return squared_distance(p, a, ab, d1 / (d1 - d3), ac, 0);
    if (d6 >= 0 && d5 <= d6) return squared_distance(p, a, ab, 0, ac, 1);
    const double vb = d5 * d2 - d1 * d6;
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return squared_distance(p, a, ab, 0, ac, d2 / (d2 - d6));
    const double va = d3 * d6 - d5 * d4, from_b = d4 - d3, from_c = d5 - d6;
    if (va <= 0 && from_b >= 0 && from_c >= 0) {
        const double w = from_b / (from_b + from_c);
        return squared_distance(p, a, ab, 1 - w, ac, w);
    }
    const double sum = va + vb + vc;
    return squared_distance(p, a, ab, vb / sum, ac, vc / sum);
}

/* The triangles by the cells that their boxes touch: each cell heads a list. */
typedef struct {
    uint64_t *keys;
    int32_t *heads;
    size_t size, used;
    struct {
        int32_t triangle, next;
    } * entries;
} triangle_grid;

static void grid_make(triangle_grid *g, const surface_test *s) {
    size_t capacity = 8 * s->triangle_count;
    g->size = 1 << 16;
    while (g->size < 2 * s->triangle_count) g->size *= 2;
    g->used = 0;
    g->keys = malloc(g->size * sizeof *g->keys);
    g->heads = malloc(g->size * sizeof *g->heads);
    g->entries = malloc(capacity * sizeof *g->entries);
    assert_true(g->keys && g->heads && g->entries);
    memset(g->keys, 0xff, g->size * sizeof *g->keys);
    for (size_t i = 0; i < s->triangle_count; i++) {
        int32_t low[3], high[3], c[3];
        for (int k = 0; k < 3; k++) {
            const double x = s->vertices[s->triangles[i][0]][k], y = s->vertices[s->triangles[i][1]][k],
                         z = s->vertices[s->triangles[i][2]][k];
            low[k] = (int32_t)floor(fmin(fmin(x, y), z) / TRIANGLE_CELL);
            high[k] = (int32_t)floor(fmax(fmax(x, y), z) / TRIANGLE_CELL);
        }
        for (c[2] = low[2]; c[2] <= high[2]; c[2]++)
            for (c[1] = low[1]; c[1] <= high[1]; c[1]++)
                for (c[0] = low[0]; c[0] <= high[0]; c[0]++) {
                    const size_t place = place_of(g->keys, g->size, cell_key(c));
                    if (g->keys[place] == UINT64_MAX) g->heads[place] = -1;
                    g->keys[place] = cell_key(c);
                    assert_true(g->used < capacity && g->used < INT32_MAX);
                    g->entries[g->used].triangle = (int32_t)i;
                    g->entries[g->used].next = g->heads[place];
                    g->heads[place] = (int32_t)g->used++;
                }
    }
}

static void grid_free(triangle_grid *g) {
    free(g->keys);
    free(g->heads);
    free(g->entries);
}

static bool covered(const triangle_grid *g, const surface_test *s, const double p[3]) {
    int32_t low[3], high[3], c[3];
    for (int k = 0; k < 3; k++) {
        low[k] = (int32_t)floor((p[k] - COVERED_M) / TRIANGLE_CELL);
        high[k] = (int32_t)floor((p[k] + COVERED_M) / TRIANGLE_CELL);
    }
    for (c[2] = low[2]; c[2] <= high[2]; c[2]++)
        for (c[1] = low[1]; c[1] <= high[1]; c[1]++)
            for (c[0] = low[0]; c[0] <= high[0]; c[0]++) {
                const size_t place = place_of(g->keys, g->size, cell_key(c));
                if (g->keys[place] == UINT64_MAX) continue;
                for (int32_t e = g->heads[place]; e >= 0; e = g->entries[e].next) {
                    const int32_t *t = s->triangles[g->entries[e].triangle];
                    if (triangle_distance2(p, s->vertices[t[0]], s->vertices[t[1]], s->vertices[t[2]]) <=
                        COVERED_M * COVERED_M)
                        return true;
                }
            }
    return false;
}

static void what_was_seen_twice_is_in_the_mesh(void **state) {
    const surface_test *s = *state;
    uint64_t *keys = malloc(SEEN_CELLS * sizeof *keys);
    seen_cell *cells = malloc(SEEN_CELLS * sizeof *cells);
    triangle_grid grid;
    assert_true(keys && cells);
    see(s, keys, cells);
    grid_make(&grid, s);
    long seen = 0, there = 0;
    for (size_t i = 0; i < SEEN_CELLS; i++) {
        if (keys[i] == UINT64_MAX || !cells[i].twice) continue;
        const double p[3] = {cells[i].point[0], cells[i].point[1], cells[i].point[2]};
        seen++;
        there += covered(&grid, s, p);
    }
    grid_free(&grid);
    free(keys);
    free(cells);
    printf("# of %ld square centimetres or so seen twice, %.2f %% lie within 1 cm of the mesh\n", seen,
           100.0 * (double)there / (double)seen);
    assert_true(seen > 10000);
    assert_true((double)there >= 0.95 * (double)seen);
}

/* The measure itself: a triangle, and points whose distance from it is known. */
static void the_distance_to_a_triangle_is_right(void **state) {
    (void)state;
    const double a[3] = {0, 0, 0}, b[3] = {4, 0, 0}, c[3] = {0, 4, 0};
    const struct {
        double p[3], distance;
    } cases[] = {{{1, 1, 0}, 0},  {{1, 1, 2}, 2},  {{-3, -4, 0}, 5},     {{7, -4, 0}, 5}, {{-4, 7, 0}, 5},
                 {{2, -3, 0}, 3}, {{-3, 2, 0}, 3}, {{4, 4, 0}, sqrt(8)}, {{2, 2, -1}, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++)
        assert_true(fabs(sqrt(triangle_distance2(cases[i].p, a, b, c)) - cases[i].distance) < 1e-12);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_distance_to_a_triangle_is_right),
        cmocka_unit_test(all_frames_are_tracked),
        cmocka_unit_test(vertices_are_shared),
        cmocka_unit_test(the_mesh_lies_on_the_surface),
        cmocka_unit_test(what_was_seen_twice_is_in_the_mesh),
    };
    return cmocka_run_group_tests(tests, make, discard);
}
