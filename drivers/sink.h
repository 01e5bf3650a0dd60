/* What a sink is made of, whatever it writes. */
#ifndef FATHOM_SINK_H
#define FATHOM_SINK_H

#include <pthread.h>

#include "fathom_drivers.h"

/* What an open sink does; fathom_sink_* calls these after checking arguments. Each returns FATHOM_OK, or an error after
 * sink_fail. Structs are whole: what the caller's lacked has its default. */
typedef struct {
    int (*write_rig)(fathom_sink *sink, const fathom_sink_rig *rig);
    int (*write_depth)(fathom_sink *sink, const fathom_depth_frame *frame);
    int (*write_image)(fathom_sink *sink, const fathom_image *image);
    int (*write_imu)(fathom_sink *sink, const fathom_imu_sample *samples, int count);
    int (*copy_imu)(fathom_sink *sink, const char *folder);
    int (*write_pose)(fathom_sink *sink, int64_t timestamp_ns, const fathom_pose *pose);
    int (*flush)(fathom_sink *sink);
    void (*close)(fathom_sink *sink); /* writes what waits; then frees what is its own, but not the sink */
} sink_operations;

/* Each sink's own structure begins with this. */
struct fathom_sink {
    const sink_operations *does;
    fathom_sink_options options;
    pthread_mutex_t lock; /* of what follows */
    fathom_sink_status status;
    int error; /* the first that any call returned */
    char text[1200];
};

/* Keeps the first error's text and logs each; returns code. Any thread. */
int sink_fail(fathom_sink *sink, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* A recording folder. On an error *sink is NULL, and the log was told. */
int folder_sink_open(fathom_sink **sink, const char *path, const fathom_sink_options *options);

#endif
