/* The PLY writer: each vertex once, however long ago it came; errors leave nothing behind. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "fathom/files/ply.h"
#include "synthetic.h"

static const char *path_of_mesh(void) {
    static char path[4300];
    snprintf(path, sizeof path, "%s/mesh.ply", synthetic_folder("ply"));
    return path;
}

static bool is_there(const char *end) {
    char path[4400];
    snprintf(path, sizeof path, "%s%s", path_of_mesh(), end);
    return access(path, F_OK) == 0;
}

/* ---- a wide strip of squares, row by row: a row's corners come again when the next one is made ------------------- */

#define COLUMNS 300000 /* more than the corners that any window recalls */
#define ROWS 3
#define BATCH 600 /* triangles */

/* Corner (column, row), with -0 for 0 if minus. Heights make all coordinates irregular. */
static fathom_vertex strip_corner(int column, int row, bool minus) {
    const float y = row == 1 ? (minus ? -0.0f : 0.0f) : 0.1f * (float)(row - 1);
    const float x = 0.01f * (float)column;
    return (fathom_vertex){{x, y, sinf(x) + y}, {0, 0, 1}};
}

/* Triangle i of the strip. */
static void strip_triangle(int i, fathom_vertex corners[3]) {
    static const int at[2][3][2] = {{{0, 0}, {1, 0}, {1, 1}}, {{0, 0}, {1, 1}, {0, 1}}};
    const int square = i / 2, column = square % COLUMNS, row = square / COLUMNS;
    for (int k = 0; k < 3; k++)
        corners[k] = strip_corner(column + at[i % 2][k][0], row + at[i % 2][k][1], i % 2);
}

/* Writes triangles from..to-1; between them some that have shrunk to an edge, if shrunk. */
static int write_strip(struct ply *ply, int from, int to, bool shrunk) {
    static fathom_vertex batch[3 * (BATCH + 1)];
    int status = 0;
    for (int i = from; i < to && status == 0; i += BATCH) {
        const int count = to - i < BATCH ? to - i : BATCH;
        for (int k = 0; k < count; k++) strip_triangle(i + k, batch + 3 * k);
        if (shrunk) {
            strip_triangle(i, batch + 3 * count);
            batch[3 * count + i / BATCH % 3] = batch[3 * count + (i / BATCH + 1) % 3];
        }
        status = ply_triangles(ply, batch, (size_t)(count + shrunk));
    }
    return status;
}

typedef struct {
    float (*vertices)[6];
    int32_t (*faces)[3];
    size_t vertex_count, face_count;
} mesh;

static mesh read_mesh(void) {
    char line[256];
    mesh m = {0};
    FILE *f = fopen(path_of_mesh(), "rb");
    assert_non_null(f);
    while (fgets(line, sizeof line, f) && strcmp(line, "end_header\n") != 0) {
        sscanf(line, "element vertex %zu", &m.vertex_count);
        sscanf(line, "element face %zu", &m.face_count);
    }
    m.vertices = malloc((m.vertex_count + 1) * sizeof *m.vertices);
    m.faces = malloc((m.face_count + 1) * sizeof *m.faces);
    assert_true(m.vertices && m.faces);
    assert_int_equal(fread(m.vertices, sizeof *m.vertices, m.vertex_count, f), m.vertex_count);
    for (size_t i = 0; i < m.face_count; i++) {
        assert_int_equal(fgetc(f), 3);
        assert_int_equal(fread(m.faces[i], sizeof m.faces[i], 1, f), 1);
        for (int k = 0; k < 3; k++) assert_in_range(m.faces[i][k], 0, m.vertex_count - 1);
    }
    assert_int_equal(fgetc(f), EOF);
    fclose(f);
    return m;
}

static int by_position(const void *a, const void *b) {
    const float *p = *(const float *const *)a, *q = *(const float *const *)b;
    for (int k = 0; k < 3; k++)
        if (p[k] != q[k]) return p[k] < q[k] ? -1 : 1;
    return 0;
}

static void no_vertex_is_written_twice(void **state) {
    (void)state;
    struct ply ply;
    const int triangles = 2 * ROWS * COLUMNS;
    assert_true(ply_open(&ply, path_of_mesh()));
    assert_int_equal(write_strip(&ply, 0, triangles, true), 0);
    assert_true(ply_close(&ply));
    mesh m = read_mesh();
    assert_int_equal(m.vertex_count, (size_t)(ROWS + 1) * (COLUMNS + 1));
    assert_int_equal(m.face_count, (size_t)triangles);
    const float **sorted = malloc(m.vertex_count * sizeof *sorted);
    assert_non_null(sorted);
    for (size_t i = 0; i < m.vertex_count; i++) sorted[i] = m.vertices[i];
    qsort(sorted, m.vertex_count, sizeof *sorted, by_position);
    for (size_t i = 1; i < m.vertex_count; i++)
        if (by_position(&sorted[i - 1], &sorted[i]) == 0)
            fail_msg("two vertices at %g %g", sorted[i][0], sorted[i][1]);
    free(sorted);
    for (int i = 0; i < triangles; i++) { /* each face is the triangle that was given */
        fathom_vertex corners[3];
        strip_triangle(i, corners);
        for (int k = 0; k < 3; k++)
            for (int a = 0; a < 3; a++)
                if (m.vertices[m.faces[i][k]][a] != corners[k].position[a] ||
                    m.vertices[m.faces[i][k]][3 + a] != corners[k].normal[a])
                    fail_msg("triangle %d, corner %d", i, k);
    }
    free(m.vertices);
    free(m.faces);
    assert_false(is_there(".part") || is_there(".faces.part"));
    unlink(path_of_mesh());
}

static void an_empty_mesh_is_a_file_too(void **state) {
    (void)state;
    struct ply ply;
    assert_true(ply_open(&ply, path_of_mesh()));
    assert_true(ply_close(&ply));
    mesh m = read_mesh();
    assert_int_equal(m.vertex_count, 0);
    assert_int_equal(m.face_count, 0);
    free(m.vertices);
    free(m.faces);
    unlink(path_of_mesh());
}

/* ---- errors ------------------------------------------------------------------------------------------------------ */

static void nothing_is_left(void) {
    assert_false(is_there("") || is_there(".part") || is_there(".faces.part"));
}

/* Files that may not grow stand for a full disk. */
static void a_full_disk_leaves_nothing(void **state) {
    (void)state;
    struct rlimit before, tight;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    tight = before;
    signal(SIGXFSZ, SIG_IGN);
    static const rlim_t sizes[] = {3000, 2000000, 3000000}; /* in vertices, when they are read back, in faces */
    for (int i = 0; i < 3; i++) {
        struct ply ply;
        tight.rlim_cur = sizes[i];
        assert_true(ply_open(&ply, path_of_mesh()));
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &tight), 0);
        const int status = write_strip(&ply, 0, 200000, false);
        const bool closed = ply_close(&ply);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
        assert_false(closed);
        assert_true(status == 0 || status == FATHOM_ERROR_STOPPED);
        nothing_is_left();
    }
}

/* Vertices that can't be read back can't be told from new ones. */
static void a_disk_that_loses_vertices_is_an_error(void **state) {
    (void)state;
    struct ply ply;
    assert_true(ply_open(&ply, path_of_mesh()));
    assert_int_equal(write_strip(&ply, 0, 2 * COLUMNS, false), 0);
    assert_int_equal(fflush(ply.vertices), 0);
    assert_int_equal(truncate(ply.vertices_path, 10000), 0);
    assert_int_equal(write_strip(&ply, 2 * COLUMNS, 4 * COLUMNS, false), FATHOM_ERROR_STOPPED);
    assert_true(ply.failed);
    assert_false(ply_close(&ply));
    nothing_is_left();
}

static void a_place_that_cant_be_written_is_an_error(void **state) {
    (void)state;
    struct ply ply;
    assert_false(ply_open(&ply, "/nonexistent/mesh.ply"));
    assert_true(ply.failed);
}

int main(void) {
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_vertex_is_written_twice),
        cmocka_unit_test(an_empty_mesh_is_a_file_too),
        cmocka_unit_test(a_full_disk_leaves_nothing),
        cmocka_unit_test(a_disk_that_loses_vertices_is_an_error),
        cmocka_unit_test(a_place_that_cant_be_written_is_an_error),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
