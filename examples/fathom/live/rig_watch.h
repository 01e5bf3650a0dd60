/* Watches the sources of a live rig, and reports changes of their state. */
#ifndef FATHOM_CLI_RIG_WATCH_H
#define FATHOM_CLI_RIG_WATCH_H

#include "fathom/live/live_rig.h"

/* All zero: not looked at yet. */
struct rig_watch {
    fathom_source_status depth, imu; /* at the last look */
    int64_t looked_ns;               /* when */
};

/* Looks now. */
void rig_watch_look(struct rig_watch *watch, const struct live_rig *rig);

/* Looks if the last look is 0.2 s ago. */
void rig_watch_glance(struct rig_watch *watch, const struct live_rig *rig);

#endif
