/* Blocks of voxels in a fixed pool, found by a hash of their keys (Niessner et al. 2013). The voxel, the key and the
 * hash are described in opencl/layout.h. */
#ifndef FATHOM_BLOCKS_H
#define FATHOM_BLOCKS_H

#include "cl/buffer.h"
#include "cl/kernel_types.h"
#include "cl/launch.h"

/* The pool's places: 0..count-1 are in use, in the order in which their blocks were made. */
typedef struct {
    int capacity, count;
    device_buffer voxels; /* BLOCK_BYTES per place */
    device_buffer keys;   /* an int4 per place: x, y, z, submap */
    device_buffer seen;   /* an int per place: the last frame that had the block in view */
    int64_t *births;      /* a rising number per place; kept when places are closed up */
    int64_t born;         /* number of blocks ever made */
} block_pool;

typedef struct {
    device_buffer entries; /* TABLE_BYTES */
    cl_uint mask;          /* entries - 1 */
} block_table;

/* A truncated signed distance (Curless and Levoy 1996) in blocks. */
typedef struct {
    block_pool pool;
    block_table table;
    kernel_surface surface;
} volume;

/* Maximum bytes per block of a pool, its share of the table included. */
size_t volume_block_cost(void);

/* Plans the buffers for that number of blocks (and makes them when the device is open). */
void volume_init(volume *v, device *d, arena *a, const fathom_config *config, int blocks);
void volume_close(volume *v);

/* Forgets all blocks. */
void volume_clear(volume *v, device *d);

/* The host's view of a pool and its table between volume_map and volume_unmap. */
typedef struct {
    cl_short *voxels; /* or NULL */
    cl_int4 *keys;
    cl_int *seen;
    cl_int4 *entries;
    cl_int *places; /* of the entries; -1: free */
    cl_uint mask;
} volume_view;

/* Waits for the device. voxels: maps them too (a device may have to copy them). False after an error; volume_unmap
 * follows in any case. */
bool volume_map(volume *v, device *d, cl_map_flags flags, bool voxels, volume_view *view);
void volume_unmap(volume *v, device *d, volume_view *view);

/* The entry of a block in the table, or the free one where it belongs. */
cl_uint volume_entry(const volume_view *view, const cl_int4 *key);

/* A block's place, or -1. */
int volume_place(const volume_view *view, const cl_int4 *key);

/* Gives a new block the next place; there must be one, and the block must not be there yet. Its voxels stay as they
 * were. */
int volume_add(volume *v, volume_view *view, const cl_int4 *key, int seen);

/* Fills the table from the keys of the places in use. */
void volume_rehash(volume *v, volume_view *view);

/* The first place whose block was made as number `birth` or later. */
int volume_born_since(const volume *v, int64_t birth);

/* A block in the public form, with its voxels at `voxels`. */
fathom_block volume_block(const volume *v, const cl_int4 *key, cl_short *voxels);

/* Sets a block's voxels to never seen. */
void volume_make_new(const fathom_block *block);

#endif
