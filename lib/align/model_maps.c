#include "align/model_maps.h"

#include <string.h>

#define PAIRS_LEFT 0.9 /* fraction of the pairs that new maps had */
/* fraction of max_condition: beyond it the pose depends on pairs at the rim, which change first */
#define CONDITION_PART 0.5

void model_maps_init(model_maps *m, device *d, arena *a, const fathom_config *config,
                     const depth_maps *maps) {
    memset(m, 0, sizeof *m);
    m->config = config;
    for (int i = 0; i < FATHOM_LEVELS; i++) {
        size_t pixels = (size_t)maps->camera[i].width * (size_t)maps->camera[i].height;
        device_buffer_make(d, a, pixels * sizeof(cl_uint2), &m->level[i]);
    }
    m->seen_from = pose_identity();
    model_maps_forget(m);
}

void model_maps_close(model_maps *m) {
    for (int i = 0; i < FATHOM_LEVELS; i++) device_buffer_free(&m->level[i]);
}

void model_maps_forget(model_maps *m) {
    m->coarsest = FATHOM_LEVELS;
    m->fresh = false;
}

bool model_maps_hold(const model_maps *m, const pose *from, int coarsest) {
    pose way = pose_between(&m->seen_from, from);
    return m->coarsest <= coarsest && pose_distance(&way) < m->config->max_model_reuse_m &&
           pose_angle(&way) < m->config->max_model_reuse_rad;
}

void model_maps_renew(model_maps *m, const pose *from, int coarsest) {
    m->seen_from = *from;
    m->coarsest = coarsest;
    m->fresh = true;
}

void model_maps_take_frame(model_maps *m, device *d, depth_maps *maps, const pose *at) {
    for (int i = 0; i < FATHOM_LEVELS; i++) depth_maps_pack(maps, d, i, &m->level[i]);
    m->seen_from = *at;
}

void model_maps_used(model_maps *m, int pairs, double condition) {
    if (m->fresh) m->pairs = pairs;
    m->fresh = false;
    if (pairs < PAIRS_LEFT * m->pairs || condition > CONDITION_PART * m->config->max_condition)
        model_maps_forget(m);
}
