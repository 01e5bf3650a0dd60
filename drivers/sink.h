/* The common parts of all sinks. */
#ifndef FATHOM_SINK_H
#define FATHOM_SINK_H

#include <pthread.h>

#include "fathom_drivers.h"

/* Operations of an open sink; fathom_sink_* calls these after checking arguments. Each returns FATHOM_OK, or an error
 * after sink_fail. Structs are whole: fields that the caller's lacked have their defaults. */
typedef struct {
    int (*write_rig)(fathom_sink *sink, const fathom_sink_rig *rig);
    int (*write_depth)(fathom_sink *sink, const fathom_depth_frame *frame);
    int (*write_image)(fathom_sink *sink, const fathom_image *image);
    int (*write_imu)(fathom_sink *sink, const fathom_imu_sample *samples, int count);
    int (*copy_imu)(fathom_sink *sink, const char *folder);
    int (*write_pose)(fathom_sink *sink, int64_t timestamp_ns, const fathom_pose *pose);
    int (*flush)(fathom_sink *sink);
    void (*close)(fathom_sink *sink); /* writes waiting data; then frees all that it owns, but not the sink */
} sink_operations;

/* Each sink's own structure begins with this. */
struct fathom_sink {
    const sink_operations *does;
    fathom_sink_options options;
    pthread_mutex_t lock; /* of the fields below */
    fathom_sink_status status;
    int error; /* the first error of any call */
    char text[1200];
};

/* Keeps the first error's text and logs each; returns code. Any thread. */
int sink_fail(fathom_sink *sink, int code, const char *format, ...) __attribute__((format(printf, 3, 4)));

/* A recording folder. On an error *sink is NULL, and the log has the reason. */
int folder_sink_open(fathom_sink **sink, const char *path, const fathom_sink_options *options);

#endif
