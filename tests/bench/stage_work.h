/* The bytes and operations that a kernel must at least move and do for the frame at hand, counted from the data. */
#ifndef FATHOM_BENCH_STAGE_WORK_H
#define FATHOM_BENCH_STAGE_WORK_H

#include "context.h"

/* Operations are those of one lane of the vector unit; a fused multiply-add is one. */
typedef struct {
    double read, written, operations;
} stage_work;

/* What a frame's launches need to know of each other. */
typedef struct {
    uint8_t *voxels; /* a copy of the pool from before fusion */
    size_t voxel_bytes;
    uint8_t *lines;      /* a bit for each 64 bytes of the pool */
    double fused_blocks; /* of the last fusion */
    double ranges;       /* tiles of the ray-cast that judges */
} work_state;

bool work_start(work_state *w, const fathom *f);
void work_stop(work_state *w);

/* Before fuse_blocks: keeps the pool. */
void work_before_fusion(work_state *w, fathom *f);

/* The work of a launch that has ended; false for kernels that aren't known. columns, rows: its global size. */
bool work_of(work_state *w, fathom *f, const char *kernel, size_t columns, size_t rows, stage_work *work);

/* What a ray-cast's work lacks until it is known where it was cast from: by then `kernel` is about to be launched. False
 * when that doesn't follow upon such a cast. */
bool work_of_cast(work_state *w, fathom *f, const char *cast, const char *kernel, stage_work *work);

/* The level that a kernel of maps works on, the finest for others. */
int work_level(const fathom *f, const char *kernel, size_t rows);

#endif
