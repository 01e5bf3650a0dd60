#include "api/warm_up.h"

void warm_up(fathom *f) {
    device *d = &f->device;
    volume *v = &f->volume;
    integrator *g = &f->integrator;
    raycaster *r = &f->raycaster;
    const pose here = pose_identity();
    const double centre[3] = {0, 0, 1};
    normal_equations e;
    device_clear(d, &f->maps.raw);
    depth_maps_compute(&f->maps, d, 0);
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        depth_maps_pack(&f->maps, d, i, &f->tracker.models.level[i]);
        align_reduce(&f->tracker.aligner, d, &f->maps, i, &here, &f->tracker.models.level[i],
                     &f->maps.camera[i], 0.1, 0.01, centre, &e);
    }
    /* a block in front of the camera */
    integrator_request(g, d, v, &f->maps, &here, false);
    integrator_allocate(g, d, v);
    device_clear(d, &v->pool.keys);
    integrator_clear_blocks(g, d, v, 0, 1);
    v->pool.count = 1;
    integrator_mark_seen(g, d, v, &f->maps, &here);
    integrator_fuse(g, d, v, &f->maps, &here, false);
    raycast_near(r, d, &f->maps, &here, 0.1f, true, &f->tracker.models.level[FINEST]);
    raycast_halve(r, d, f->maps.camera, f->tracker.models.level, 0);
    model_view_cast(&f->tracker.view, d, r, &here);
    model_view_cast_wide(&f->tracker.view, d, r, &here);
    mesh_warm_up(&f->mesher, d, v);
    device_wait(d);
}
