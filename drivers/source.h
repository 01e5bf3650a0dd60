/* The interface of drivers, and their common parts. */
#ifndef FATHOM_SOURCE_H
#define FATHOM_SOURCE_H

#include "fathom_drivers.h"

/* A driver: a row in the table of source.c. */
typedef struct {
    const char *name;
    /* Calls found for each device, or once with kinds 0 for what is missing. Returns the number of devices, or an
     * error. */
    int (*enumerate)(fathom_source_found found, void *user, fathom_log log, void *log_user);
    /* address: the uri after "name:". options: checked, and without zeros in kinds and capacities. */
    int (*open)(fathom_source **source, const char *address, const fathom_source_options *options);
} source_driver;

/* Operations of an open source; fathom_source_* calls these after checking arguments and whether the source is started:
 * start is called on stopped sources only. */
typedef struct {
    int (*start)(fathom_source *source);
    void (*stop)(fathom_source *source);
    int (*wait)(fathom_source *source, int timeout_ms);
    void (*cancel)(fathom_source *source);
    int (*read_depth)(fathom_source *source, fathom_source_frame *frame); /* NULL: no depth */
    int (*read_imu)(fathom_source *source, fathom_imu_sample *samples, int capacity); /* NULL: none */
    int (*status)(fathom_source *source, fathom_source_status *status);
    void (*configure)(fathom_source *source, fathom_config *config); /* NULL: from status alone */
    void (*close)(fathom_source *source);
} source_operations;

/* Each driver's own structure begins with this. */
struct fathom_source {
    const source_operations *does;
    fathom_source_options options;
    bool started; /* between fathom_source_start and _stop; source.c's */
};

extern const source_driver folder_driver, openni2_driver, hid_driver, usb_driver, iio_driver, udp_driver;

#endif
