/* The surface's triangles by marching cubes (Lorensen and Cline 1987). */
#ifndef FATHOM_MESH_H
#define FATHOM_MESH_H

#include "map/blocks.h"

#define MESH_BATCH 256       /* blocks whose triangles are counted together */
#define MESH_TRIANGLES 16384 /* triangles in a batch to the callback */

typedef struct {
    device_buffer cases; /* marching cubes' table */
    device_buffer counts, offsets;
    device_buffer vertices; /* 18 floats a triangle */
    cl_kernel count, emit;
} mesher;

void mesher_init(mesher *m, device *d, arena *a);
void mesher_close(mesher *m);

int64_t mesh_extract(mesher *m, device *d, volume *v, float min_weight, fathom_triangles triangles, void *user);

/* Runs both kernels on the first block. */
void mesh_warm_up(mesher *m, device *d, volume *v);

/* Marching cubes' table: for each of 256 cases up to five triangles as edges, then CASE_END; see opencl/mesh.cl. */
void mesh_cases(uint8_t table[256 * CASE_SIZE]);

#endif
