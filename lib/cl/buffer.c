#include "cl/buffer.h"

void device_buffer_make(device *d, arena *a, size_t size, device_buffer *buffer) {
    size = (size + ARENA_ALIGNMENT - 1) / ARENA_ALIGNMENT * ARENA_ALIGNMENT;
    buffer->memory = NULL;
    buffer->size = size;
    buffer->host = NULL;
    if (d->buffers_in_block)
        buffer->host = arena_take(a, size);
    else
        d->device_bytes += size;
    if (!d->context || (d->buffers_in_block && !buffer->host)) return;
    cl_int e;
    cl_mem_flags flags =
        CL_MEM_READ_WRITE | (d->buffers_in_block ? CL_MEM_USE_HOST_PTR : CL_MEM_ALLOC_HOST_PTR);
    buffer->memory = clCreateBuffer(d->context, flags, size, buffer->host, &e);
    if (!buffer->memory) device_failed(d, "making a buffer", e);
}

void device_buffer_free(device_buffer *buffer) {
    if (buffer->memory) clReleaseMemObject(buffer->memory);
    buffer->memory = NULL;
}

void *device_map(device *d, device_buffer *buffer, cl_map_flags flags) {
    if (d->error != FATHOM_OK) return NULL;
    cl_int e;
    void *p =
        clEnqueueMapBuffer(d->queue, buffer->memory, CL_TRUE, flags, 0, buffer->size, 0, NULL, NULL, &e);
    if (!p) device_failed(d, "mapping a buffer", e);
    return p;
}

void device_unmap(device *d, device_buffer *buffer, void *mapped) {
    if (!mapped) return;
    cl_int e = clEnqueueUnmapMemObject(d->queue, buffer->memory, mapped, 0, NULL, NULL);
    if (e != CL_SUCCESS) device_failed(d, "unmapping a buffer", e);
}

void device_clear(device *d, device_buffer *buffer) {
    if (d->error != FATHOM_OK) return;
    cl_int zero = 0;
    cl_int e =
        clEnqueueFillBuffer(d->queue, buffer->memory, &zero, sizeof zero, 0, buffer->size, 0, NULL, NULL);
    if (e != CL_SUCCESS) device_failed(d, "clearing a buffer", e);
}
