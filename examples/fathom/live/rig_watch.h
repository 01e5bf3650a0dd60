/* Watches the sources of a live rig, and says what changes with them. */
#ifndef FATHOM_CLI_RIG_WATCH_H
#define FATHOM_CLI_RIG_WATCH_H

#include "fathom/live/live_rig.h"

/* All zero: nothing was seen yet. */
struct rig_watch {
    fathom_source_status depth, imu; /* as last seen */
    int64_t looked_ns;               /* when */
};

/* Looks now. */
void rig_watch_look(struct rig_watch *watch, const struct live_rig *rig);

/* Looks when the last time is 0.2 s ago. */
void rig_watch_glance(struct rig_watch *watch, const struct live_rig *rig);

#endif
