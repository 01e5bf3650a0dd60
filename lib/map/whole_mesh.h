/* The mesh of blocks in and out of the pool. The store's blocks are read back in groups, with their neighbours, into a
 * separate small volume: the surface that tracking uses doesn't change. */
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

/* The position of a pull: the next one in the store's list, and the next birth in the pool. Zeros begin. */
typedef struct {
    int64_t stored, born;
} mesh_place;

/* Makes the patch where blocks may be dropped. */
void whole_mesh_init(volume *patch, device *d, arena *a, const fathom_config *config);
void whole_mesh_close(volume *patch);

/* Passes the triangles of whole blocks from a place on to the callback, up to `capacity` (a block has a maximum of
 * CASE_TRIANGLES * BLOCK_VOXELS): first the store's blocks that aren't in the pool, then the pool's. Advances the
 * place. Returns the number of triangles (0: the end), or an error: FATHOM_ERROR_ARGUMENT where the store names a block
 * beyond what can be counted. */
int64_t whole_mesh_pull(const whole_mesh *w, mesh_place *at, int64_t capacity, fathom_triangles triangles,
                        void *user);

#endif
