/* From a depth frame to the maps that alignment and fusion work on (Newcombe et al. 2011, Section 3.1). */
#ifndef FATHOM_DEPTH_MAPS_H
#define FATHOM_DEPTH_MAPS_H

#include "cl/buffer.h"
#include "cl/kernel_types.h"
#include "cl/launch.h"

#define FINEST (FATHOM_LEVELS - 1) /* level 0 is the coarsest */

typedef struct {
    kernel_camera camera[FATHOM_LEVELS]; /* the ideal pinhole of each level */
    kernel_depth_source source;
    kernel_noise noise;
    int min_confidence;
    device_buffer raw;                  /* the frame as received */
    device_buffer depth[FATHOM_LEVELS]; /* metric, for alignment and fusion */
    /* the finest depth smoothed, for its normals and, where it is rough, for fusion: alignment with smoothed depth drifts
     * (docs/DESIGN.md) */
    device_buffer smooth;
    float raw_m;  /* up to this depth raw depth is fused */
    float once_m; /* from this depth on it is smoothed twice, over twice as far the second time */
    device_buffer normals[FATHOM_LEVELS]; /* four planes: normal and confidence */
    cl_kernel convert, smoothing, halve, normal, pack;
} depth_maps;

/* Sets the noise, and with it the range: what is noisier than the surface is thick fills the pool and says nothing. */
void depth_maps_set_noise(depth_maps *m, const fathom_config *config, const kernel_noise *noise);

/* The size and intrinsics of the finest maps for the settings. FATHOM_OK or FATHOM_ERROR_CONFIG. */
int depth_maps_camera(const fathom_config *config, kernel_camera *camera);

/* Plans buffers (and makes them and the kernels when the device is open). */
void depth_maps_init(depth_maps *m, device *d, arena *a, const fathom_config *config);
void depth_maps_close(depth_maps *m);

/* Is pixel x of row y sure enough to be looked at? */
static inline bool depth_maps_sure(const depth_maps *m, const fathom_depth_frame *frame, int x, int y) {
    return !frame->confidence || frame->confidence[y * frame->confidence_stride_bytes + x] >= m->min_confidence;
}

/* Queues all maps of a frame (a checked one: its strides are set), down to the coarsest level wanted. */
void depth_maps_take(depth_maps *m, device *d, const fathom_depth_frame *frame, int coarsest);

/* The same of depth alone, whose rows lie stride_bytes apart. */
void depth_maps_make(depth_maps *m, device *d, const uint16_t *depth, size_t stride_bytes, int coarsest);

/* The same for the last frame that was copied. */
void depth_maps_compute(depth_maps *m, device *d, int coarsest);

/* Queues a level of the frame's maps in the form of a model map. */
void depth_maps_pack(depth_maps *m, device *d, int level, device_buffer *packed);

#endif
