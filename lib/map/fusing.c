#include "map/fusing.h"

#include "base/stamps.h"

#define CALM_M 0.03 /* the camera's motion between fused frames */
#define CALM_RAD 0.04

void fusing_init(fusing *f, device *d, const fathom_config *config, depth_maps *maps, volume *v,
                 integrator *g, caller_store *s) {
    *f = (fusing){config, d, maps, v, g, s, pose_identity()};
}

bool fusing_is_calm(const fusing *f, const pose *at) {
    pose way = pose_between(&f->last, at);
    return f->volume->pool.count > 0 && pose_distance(&way) < CALM_M && pose_angle(&way) < CALM_RAD;
}

void fuse(fusing *f, const pose *at, fathom_result *r) {
    const fathom_config *c = f->config;
    volume *v = f->volume;
    integrator *g = f->integrator;
    caller_store *s = f->store;
    double start = now_ms();
    bool calm = fusing_is_calm(f, at);
    int64_t dropped = s->put, restored = s->restored;
    f->last = *at;
    int wanted = integrator_request(g, f->device, v, f->maps, at, calm);
    if (wanted > 0) {
        bool drop = c->when_full == FATHOM_FULL_DROP;
        if (drop && v->pool.count + wanted > v->pool.capacity) {
            integrator_mark_seen(g, f->device, v, f->maps, at);
            eviction_make_room(v, f->device, g, s, wanted);
        }
        int first = integrator_allocate(g, f->device, v);
        if (drop) eviction_restore(v, f->device, s, first);
    }
    integrator_fuse(g, f->device, v, f->maps, at, calm);
    if (c->fuse_behind)
        device_flush(f->device);
    else
        device_wait(f->device);
    r->fused = true;
    r->pool_full = g->full;
    r->blocks_dropped = (int)(s->put - dropped);
    r->blocks_restored = (int)(s->restored - restored);
    r->ms_fuse = (float)(now_ms() - start);
}
