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
        depth_maps_pack(&f->maps, d, i, &f->aligner.model[i]);
        align_reduce(&f->aligner, d, &f->maps, i, &here, &f->aligner.model[i], &f->maps.camera[i], 0.1, 0.01,
                     centre, &e);
    }
    /* a block in front of the camera */
    integrator_request(&f->integrator, d, v, &f->maps, &here, false);
    integrator_allocate(&f->integrator, d, v);
    device_clear(d, &v->pool.keys);
    integrator_clear_blocks(&f->integrator, d, v, 0, 1);
    v->pool.count = 1;
    integrator_fuse(&f->integrator, d, v, &f->maps, &here, false);
    raycast_near(&f->raycaster, d, &f->maps, &here, 0.1f, true, &f->aligner.model[FINEST]);
    raycast_halve(&f->raycaster, d, f->maps.camera, f->aligner.model, 0);
    model_view_cast(&f->view, d, &f->raycaster, &here);
    model_view_cast_wide(&f->view, d, &f->raycaster, &here);
    mesh_warm_up(&f->mesher, d, v);
    device_wait(d);
}
