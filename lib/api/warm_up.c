#include "api/warm_up.h"

void warm_up(fathom *f) {
    device *d = &f->device;
    volume *v = &f->volume;
    const pose here = pose_identity();
    const double centre[3] = {0, 0, 1};
    normal_equations e;
    device_clear(d, &f->maps.raw);
    depth_maps_compute(&f->maps, d, 0);
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        depth_maps_pack(&f->maps, d, i, &f->tracker.models.level[i]);
        align_reduce(&f->tracker.aligner, d, &f->maps, i, &here, &f->tracker.models.level[i], &f->maps.camera[i], 0.1, 0.01,
                     centre, &e);
    }
    /* a block in front of the camera */
    volume_request(v, d, &f->maps, &here, false);
    volume_allocate(v, d);
    device_clear(d, &v->blocks);
    volume_clear_blocks(v, d, 0, 1);
    v->count = 1;
    volume_fuse(v, d, &f->maps, &here, false);
    volume_raycast_near(v, d, &f->maps, &here, 0.1f, true, &f->tracker.models.level[FINEST]);
    volume_halve_maps(v, d, f->maps.camera, f->tracker.models.level, 0);
    model_view_cast(&f->tracker.view, d, v, &here);
    model_view_cast_wide(&f->tracker.view, d, v, &here);
    surface_warm_up(&f->surface, d, v);
    device_wait(d);
    volume_clear(v, d);
}
