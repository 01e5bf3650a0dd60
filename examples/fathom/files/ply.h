/* Streams triangles into a binary little-endian PLY file with normals, each vertex once. Memory: 1 MB, and 7 to 10
 * bytes per vertex.
 *
 * Vertices go to FILE.part, faces to FILE.faces.part; at the end the faces are appended, the counts are set in the
 * header, and the file is renamed to FILE, which so is either whole or untouched. */
#ifndef FATHOM_CLI_PLY_H
#define FATHOM_CLI_PLY_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>

#include "fathom.h"
#include "fathom/files/corners.h"
#include "fathom/shell/log.h"

struct ply {
    const char *path;
    char *vertices_path, *faces_path;
    FILE *vertices, *faces;
    struct corners corners; /* of the vertices written so far */
    int64_t vertex_count, face_count;
    bool failed; /* after an error message */
};

/* Each returns false after an error message; incomplete files are then removed. */
bool ply_open(struct ply *ply, const char *path);

/* Completes and closes the file; must follow ply_open, even after errors. */
bool ply_close(struct ply *ply);

/* Gives up and removes the incomplete files. */
void ply_discard(struct ply *ply);

/* A fathom_triangles; user is the struct ply. Returns nonzero after an error message when writing failed. */
int ply_triangles(void *user, const fathom_vertex *vertices, size_t triangle_count);

/* Writes the surface of a context to such a file; log is the context's. */
bool ply_write_surface(fathom *scan, const char *path, struct cli_log *log);

#endif
