/* Buffers of the device. Only this module knows whether a buffer lies in the caller's block or on the device. */
#ifndef FATHOM_BUFFER_H
#define FATHOM_BUFFER_H

#include "base/arena.h"
#include "cl/device.h"

/* Its bytes are accessible between device_map and device_unmap. */
typedef struct {
    cl_mem memory;
    void *host; /* where it lies in the block, or NULL */
    size_t size;
} device_buffer;

/* Plans a buffer, and makes it when the device is open: in the arena or on the device. Not cleared. */
void device_buffer_make(device *d, arena *a, size_t size, device_buffer *buffer);
void device_buffer_free(device_buffer *buffer);

/* Waits for the queue, and returns the host's view of the buffer; NULL after an error. */
void *device_map(device *d, device_buffer *buffer, cl_map_flags flags);
void device_unmap(device *d, device_buffer *buffer, void *mapped);

/* Queues filling with zeros. */
void device_clear(device *d, device_buffer *buffer);

#endif
