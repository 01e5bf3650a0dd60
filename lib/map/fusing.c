#include "map/fusing.h"

#include "base/stamps.h"
#include "map/eviction.h"

#define CALM_M 0.03 /* the camera's way from one fused frame to the next */
#define CALM_RAD 0.04

void fusing_init(fusing *f, device *d, const fathom_config *config, depth_maps *maps, volume *v) {
    *f = (fusing){config, d, maps, v, pose_identity()};
}

bool fusing_is_calm(const fusing *f, const pose *at) {
    pose way = pose_between(&f->last, at);
    return f->volume->count > 0 && pose_distance(&way) < CALM_M && pose_angle(&way) < CALM_RAD;
}

void fuse(fusing *f, const pose *at, fathom_result *r) {
    const fathom_config *c = f->config;
    volume *v = f->volume;
    double start = now_ms();
    bool calm = fusing_is_calm(f, at);
    int64_t dropped = v->dropped, restored = v->restored;
    f->last = *at;
    int wanted = volume_request(v, f->device, f->maps, at, calm);
    if (wanted > 0) {
        bool drop = c->when_full == FATHOM_FULL_DROP;
        if (drop && v->count + wanted > v->capacity) eviction_make_room(v, f->device, c, wanted);
        int first = volume_allocate(v, f->device);
        if (drop) eviction_restore(v, f->device, c, first);
    }
    volume_fuse(v, f->device, f->maps, at, calm);
    if (c->fuse_behind)
        device_flush(f->device);
    else
        device_wait(f->device);
    r->fused = true;
    r->pool_full = v->full;
    r->blocks_dropped = (int)(v->dropped - dropped);
    r->blocks_restored = (int)(v->restored - restored);
    r->ms_fuse = (float)(now_ms() - start);
}
