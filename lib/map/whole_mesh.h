/* The mesh of blocks in and out of the pool. Those that were dropped come back from the store, some at a time with their
 * neighbours, into a small volume of its own: the surface that is tracked against stays as it is. */
#ifndef FATHOM_WHOLE_MESH_H
#define FATHOM_WHOLE_MESH_H

#include "map/mesh.h"
#include "map/store.h"

/* Makes that volume where blocks may be dropped. */
void whole_mesh_init(volume *patch, device *d, arena *a, const fathom_config *config);
void whole_mesh_close(volume *patch);

/* Triangles of the dropped blocks (three indices each, count of them), then of the pool's; dropped ones that are in the pool
 * are taken from there, ones that the store hasn't got are left out. Returns the number of triangles, or an error. */
int64_t whole_mesh_extract(volume *patch, volume *pool, mesher *m, device *d, caller_store *s, const int32_t *dropped,
                           size_t count, float min_weight, fathom_triangles triangles, void *user);

#endif
