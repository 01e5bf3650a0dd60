/* The mesh of blocks in and out of the pool. Those that the store keeps come back from it, some at a time with their
 * neighbours, into a small volume of its own: the surface that is tracked against stays as it is. */
#ifndef FATHOM_WHOLE_MESH_H
#define FATHOM_WHOLE_MESH_H

#include "map/mesh.h"
#include "map/store.h"

typedef struct {
    mesher *mesher;
    device *device;
    volume *pool, *patch;
    caller_store *store; /* NULL: the pool's blocks only */
    float min_weight;
} whole_mesh;

/* Where a pull stands: the next position in the store's list, the next birth in the pool. Zeros begin. */
typedef struct {
    int64_t stored, born;
} mesh_place;

/* Makes the patch where blocks may be dropped. */
void whole_mesh_init(volume *patch, device *d, arena *a, const fathom_config *config);
void whole_mesh_close(volume *patch);

/* Hands over the triangles of whole blocks from a place on, at most `capacity` (a block has CASE_TRIANGLES *
 * BLOCK_VOXELS at most): first the store's blocks that aren't in the pool, then the pool's. Moves the place on. Returns
 * the number of triangles (0: the end), or an error: FATHOM_ERROR_ARGUMENT where the store names a block beyond what
 * can be counted. */
int64_t whole_mesh_pull(const whole_mesh *w, mesh_place *at, int64_t capacity, fathom_triangles triangles,
                        void *user);

#endif
