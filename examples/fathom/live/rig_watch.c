#include "fathom/live/rig_watch.h"
#include "fathom/shell/cli.h"
#include "fathom/shell/clock.h"

#define LOOK_NS 200000000

static void say_change(const char *what, const fathom_source_status *before,
                       const fathom_source_status *now) {
    if (before->state == now->state || before->state == FATHOM_SOURCE_STOPPED) return;
    if (now->state == FATHOM_SOURCE_RUNNING)
        cli_note("%s: running again", what);
    else if (now->state != FATHOM_SOURCE_STOPPED && now->state != FATHOM_SOURCE_AT_END)
        cli_warning("%s: %s", what, fathom_source_state_name(now->state));
}

void rig_watch_look(struct rig_watch *watch, const struct live_rig *rig) {
    const fathom_source_status depth = watch->depth, imu = watch->imu;
    watch->depth.struct_size = watch->imu.struct_size = sizeof watch->depth;
    fathom_source_get_status(rig->depth, &watch->depth);
    if (rig->imu) fathom_source_get_status(rig->imu, &watch->imu);
    say_change("depth", &depth, &watch->depth);
    say_change("IMU", &imu, &watch->imu);
    if (imu.state != watch->imu.state && watch->imu.state == FATHOM_SOURCE_AT_END &&
        watch->depth.state != FATHOM_SOURCE_AT_END)
        cli_warning("IMU: at its end before the depth, which goes on without");
    watch->looked_ns = clock_now_ns();
}

void rig_watch_glance(struct rig_watch *watch, const struct live_rig *rig) {
    if (clock_now_ns() - watch->looked_ns >= LOOK_NS) rig_watch_look(watch, rig);
}
