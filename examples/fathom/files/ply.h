/* Streams triangles into a binary little-endian PLY file with normals, each vertex once. Memory: 1 MB, and
 * 7 to 10 bytes per vertex.
 *
 * Vertices go to FILE.part, faces to FILE.faces.part; at the end the faces are appended, the counts are set
 * in the header and the file is renamed to its place. So FILE is whole or not touched. */
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
    struct corners corners; /* no position is written twice */
    int64_t vertex_count, face_count;
    bool failed; /* and said so */
};

/* Each returns false after saying what went wrong; what was half written is then removed. */
bool ply_open(struct ply *ply, const char *path);

/* Writes what was streamed and closes; must follow ply_open, whatever happened in between. */
bool ply_close(struct ply *ply);

/* Gives up: nothing is written. */
void ply_discard(struct ply *ply);

/* A fathom_triangles; user is the struct ply. Returns nonzero when writing failed, and says so. */
int ply_triangles(void *user, const fathom_vertex *vertices, size_t triangle_count);

/* The surface of a context as such a file; log is the context's. */
bool ply_write_surface(fathom *scan, const char *path, struct cli_log *log);

#endif
