/* The surface, as seen and as triangles. */
#include <math.h>

#include "api/call.h"

#define VIEW_SIZE_MAX 16384

static int view_check(fathom *f, const fathom_view *v, pose *at) {
    const fathom_pinhole *c = &v->camera;
    if (c->lens != FATHOM_LENS_PINHOLE) return call_refuse(f, "a view's lens must be FATHOM_LENS_PINHOLE");
    bool good = c->width >= 1 && c->width <= VIEW_SIZE_MAX && c->height >= 1 && c->height <= VIEW_SIZE_MAX && c->fx > 0 &&
                c->fy > 0 && isfinite(c->fx) && isfinite(c->fy) && isfinite(c->cx) && isfinite(c->cy) &&
                v->near_m >= 0 && v->far_m >= 0 && pose_take(&v->pose, at);
    return good ? FATHOM_OK : call_refuse(f, "the view's size, intrinsics, range or pose is not valid");
}

int fathom_cast_view(fathom *f, const fathom_view *given, float *depth, float *normals) {
    pose at;
    fathom_view view = FATHOM_STRUCT(fathom_view);
    int e = call_begin(f);
    if (e == FATHOM_OK) e = call_take(f, &view, sizeof view, given, "fathom_view");
    if (e == FATHOM_OK) e = view_check(f, &view, &at);
    if (e != FATHOM_OK) return e;
    view_render(&f->viewer, &f->device, &f->raycaster, &view, &at, depth, normals);
    return call_end(f);
}

static int mesh_check(fathom *f, float min_weight, fathom_triangles triangles) {
    int e = call_begin(f);
    if (e != FATHOM_OK) return e;
    if (!triangles) return call_refuse(f, "triangles is NULL");
    return min_weight >= 0 ? FATHOM_OK : call_refuse(f, "min_weight is %g", (double)min_weight);
}

static int64_t mesh_end(fathom *f, int64_t count) {
    const int e = call_end(f);
    if (e != FATHOM_OK) return e;
    if (count == FATHOM_ERROR_STOPPED)
        error_text_fail(&f->error, FATHOM_ERROR_STOPPED, FATHOM_LOG_INFO, "the caller's callback stopped the mesh");
    return count;
}

int64_t fathom_extract_mesh(fathom *f, float min_weight, fathom_triangles triangles, void *user) {
    int e = mesh_check(f, min_weight, triangles);
    if (e != FATHOM_OK) return e;
    return mesh_end(f, mesh_extract(&f->mesher, &f->device, &f->volume, min_weight, triangles, user));
}

int64_t fathom_extract_whole_mesh(fathom *f, float min_weight, const int32_t *dropped, size_t count,
                                  fathom_triangles triangles, void *user) {
    const int32_t index_max = 1 << 27; /* voxels are counted in 32 bits */
    if (count == 0) return fathom_extract_mesh(f, min_weight, triangles, user);
    int e = mesh_check(f, min_weight, triangles);
    if (e != FATHOM_OK) return e;
    if (!dropped) return call_refuse(f, "dropped is NULL");
    if (f->patch.pool.capacity == 0 || !f->config.block_in)
        return call_refuse(f, "a mesh of dropped blocks needs FATHOM_FULL_DROP and block_in");
    for (size_t i = 0; i < 3 * count; i++)
        if (dropped[i] < -index_max || dropped[i] > index_max)
            return call_refuse(f, "dropped block %zu has an index beyond +-2^27", i / 3);
    return mesh_end(f, whole_mesh_extract(&f->patch, &f->volume, &f->mesher, &f->device, &f->store, dropped, count,
                                          min_weight, triangles, user));
}
