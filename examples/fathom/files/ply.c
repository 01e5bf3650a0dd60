#include "fathom/files/ply.h"
#include "fathom/shell/cli.h"

#include <errno.h>
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define FACE_BYTES 13

static bool fail(struct ply *ply, const char *why) {
    if (!ply->failed) cli_error(CLI_FAILED, "%s: %s", ply->path, why);
    ply->failed = true;
    return false;
}

static bool fail_errno(struct ply *ply) {
    return fail(ply, errno ? strerror(errno) : "write error");
}

static void put_u32(unsigned char *out, uint32_t value) {
    for (int i = 0; i < 4; i++) out[i] = (unsigned char)(value >> (8 * i));
}

static void put_float(unsigned char *out, float value) {
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_u32(out, bits);
}

/* The header always has the same length: a comment is padded to make up for the counts' lengths. */
static bool write_header(struct ply *ply) {
    static const char filler[] = "........................................";
    char counts[64];
    const int length =
        snprintf(counts, sizeof counts, "%" PRId64 "%" PRId64, ply->vertex_count, ply->face_count);
    return fprintf(
               ply->vertices,
               "ply\nformat binary_little_endian 1.0\ncomment fathom %s, metres %.*s\nelement vertex %" PRId64
               "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float "
               "ny\n"
               "property float nz\nelement face %" PRId64
               "\nproperty list uchar int vertex_indices\nend_header\n",
               fathom_version(), (int)sizeof filler - 1 - length, filler, ply->vertex_count,
               ply->face_count) > 0;
}

static char *joined(const char *path, const char *end) {
    const size_t size = strlen(path) + strlen(end) + 1;
    char *name = malloc(size);
    if (name) snprintf(name, size, "%s%s", path, end);
    return name;
}

bool ply_open(struct ply *ply, const char *path) {
    *ply = (struct ply){.path = path};
    ply->vertices_path = joined(path, ".part");
    ply->faces_path = joined(path, ".faces.part");
    errno = ENOMEM;
    bool good = ply->vertices_path && ply->faces_path;
    if (good) good = (ply->vertices = fopen(ply->vertices_path, "wb+")) != NULL;
    if (good) good = (ply->faces = fopen(ply->faces_path, "wb+")) != NULL;
    if (good) good = write_header(ply) && corners_open(&ply->corners, ply->vertices, ftell(ply->vertices));
    if (good) return true;
    fail_errno(ply);
    ply_discard(ply);
    return false;
}

static bool same_position(const float a[3], const float b[3]) {
    return a[0] == b[0] && a[1] == b[1] && a[2] == b[2];
}

static bool write_vertex(struct ply *ply, const fathom_vertex *vertex) {
    unsigned char bytes[CORNER_BYTES];
    for (int i = 0; i < 3; i++) {
        put_float(bytes + 4 * i, vertex->position[i]);
        put_float(bytes + 12 + 4 * i, vertex->normal[i]);
    }
    if (ply->vertex_count == INT32_MAX) return fail(ply, "more vertices than a PLY file can number");
    errno = 0;
    if (fwrite(bytes, sizeof bytes, 1, ply->vertices) != 1) return fail_errno(ply);
    ply->vertex_count++;
    return true;
}

/* The vertex's number in the file; writes it if it isn't there yet. */
static bool vertex_index(struct ply *ply, const fathom_vertex *vertex, uint32_t *index) {
    errno = 0;
    const int found = corners_find(&ply->corners, vertex->position, index);
    if (found < 0) return fail_errno(ply);
    if (found > 0) return true;
    *index = (uint32_t)ply->vertex_count;
    if (!write_vertex(ply, vertex)) return false;
    corners_add(&ply->corners, vertex->position, *index);
    return true;
}

int ply_triangles(void *user, const fathom_vertex *vertices, size_t triangle_count) {
    struct ply *ply = user;
    for (size_t i = 0; i < triangle_count && !ply->failed; i++) {
        const fathom_vertex *corner = vertices + 3 * i;
        /* A triangle that has shrunk to an edge is invisible, and other tools reject it. */
        if (same_position(corner[0].position, corner[1].position) ||
            same_position(corner[1].position, corner[2].position) ||
            same_position(corner[2].position, corner[0].position))
            continue;
        unsigned char bytes[FACE_BYTES] = {3};
        for (int k = 0; k < 3; k++) {
            uint32_t index;
            if (!vertex_index(ply, &corner[k], &index)) return FATHOM_ERROR_STOPPED;
            put_u32(bytes + 1 + 4 * k, index);
        }
        errno = 0;
        if (fwrite(bytes, sizeof bytes, 1, ply->faces) != 1)
            fail_errno(ply);
        else
            ply->face_count++;
    }
    return ply->failed ? FATHOM_ERROR_STOPPED : 0;
}

static bool append_faces(struct ply *ply) {
    char buffer[1 << 14];
    size_t length;
    errno = 0;
    if (fflush(ply->faces) || fseek(ply->faces, 0, SEEK_SET)) return fail_errno(ply);
    while ((length = fread(buffer, 1, sizeof buffer, ply->faces)) > 0)
        if (fwrite(buffer, 1, length, ply->vertices) != length) return fail_errno(ply);
    return !ferror(ply->faces) || fail_errno(ply);
}

bool ply_close(struct ply *ply) {
    bool good = !ply->failed && append_faces(ply);
    errno = 0;
    if (good && (fseek(ply->vertices, 0, SEEK_SET) || !write_header(ply) || fflush(ply->vertices)))
        good = fail_errno(ply);
    if (good) {
        FILE *file = ply->vertices;
        ply->vertices = NULL;
        if (fclose(file) || rename(ply->vertices_path, ply->path)) good = fail_errno(ply);
    }
    if (good) {
        free(ply->vertices_path);
        ply->vertices_path = NULL; /* it has been renamed to the file itself */
    }
    ply_discard(ply);
    return good;
}

void ply_discard(struct ply *ply) {
    if (ply->vertices) fclose(ply->vertices);
    if (ply->faces) fclose(ply->faces);
    if (ply->vertices_path) unlink(ply->vertices_path);
    if (ply->faces_path) unlink(ply->faces_path);
    free(ply->vertices_path);
    free(ply->faces_path);
    corners_close(&ply->corners);
    ply->vertices = ply->faces = NULL;
    ply->vertices_path = ply->faces_path = NULL;
}

bool ply_write_surface(fathom *scan, const char *path, struct cli_log *log) {
    struct ply ply;
    if (!ply_open(&ply, path)) return false;
    log_clear(log);
    const int64_t triangles = fathom_extract_mesh(scan, 0, ply_triangles, &ply);
    if (triangles < 0 && !ply.failed) cli_error(CLI_FAILED, "%s: %s", path, log_reason(log, (int)triangles));
    if (triangles == 0) cli_warning("%s: there is no surface, the mesh is empty", path);
    if (triangles < 0) {
        ply_discard(&ply);
        return false;
    }
    return ply_close(&ply);
}
