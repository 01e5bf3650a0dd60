/* The surface, as seen and as triangles. */
#include <math.h>
#include <string.h>

#include "api/call.h"
#include "base/sized.h"
#include "map/block_pull.h"

#define VIEW_SIZE_MAX 16384

static int view_check(fathom *f, const fathom_view *v, pose *at) {
    const fathom_pinhole *c = &v->camera;
    if (c->lens != FATHOM_LENS_PINHOLE) return call_refuse(f, "a view's lens must be FATHOM_LENS_PINHOLE");
    bool good = c->width >= 1 && c->width <= VIEW_SIZE_MAX && c->height >= 1 && c->height <= VIEW_SIZE_MAX &&
                c->fx > 0 && c->fy > 0 && isfinite(c->fx) && isfinite(c->fy) && isfinite(c->cx) &&
                isfinite(c->cy) && v->near_m >= 0 && v->far_m >= 0 && pose_take(&v->pose, at);
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

/* ---- triangles --------------------------------------------------------------------------------------------------- */

static int mesh_check(fathom *f, float min_weight) {
    return min_weight >= 0 ? FATHOM_OK : call_refuse(f, "min_weight is %g", (double)min_weight);
}

static int64_t mesh_make(fathom *f, mesh_place *at, int32_t part, float min_weight, int64_t capacity,
                         fathom_triangles triangles, void *user) {
    const whole_mesh w = {.mesher = &f->mesher, .device = &f->device, .pool = &f->volume, .patch = &f->patch,
                          .store = part == FATHOM_MESH_POOL ? NULL : &f->store, .min_weight = min_weight};
    const int64_t count = whole_mesh_pull(&w, at, capacity, triangles, user);
    const int e = call_end(f);
    if (e != FATHOM_OK) return e;
    if (count == FATHOM_ERROR_STOPPED)
        error_text_fail(&f->error, FATHOM_ERROR_STOPPED, FATHOM_LOG_INFO,
                        "the caller's callback stopped the mesh");
    if (count == FATHOM_ERROR_ARGUMENT)
        call_refuse(f, "the block store's list names, at position %lld, a block with an index beyond +-2^27",
                    (long long)at->stored);
    return count;
}

int64_t fathom_extract_mesh(fathom *f, float min_weight, fathom_triangles triangles, void *user) {
    mesh_place at = {0, 0};
    int e = call_begin(f);
    if (e == FATHOM_OK && !triangles) e = call_refuse(f, "triangles is NULL");
    if (e == FATHOM_OK) e = mesh_check(f, min_weight);
    return e == FATHOM_OK ? mesh_make(f, &at, FATHOM_MESH_WHOLE, min_weight, INT64_MAX, triangles, user) : e;
}

static int append(void *user, const fathom_vertex *vertices, size_t triangle_count) {
    fathom_vertex **end = user;
    memcpy(*end, vertices, 3 * triangle_count * sizeof *vertices);
    *end += 3 * triangle_count;
    return 0;
}

static int pull_check(fathom *f, const fathom_mesh_pull *p) {
    if (p->capacity < FATHOM_BLOCK_TRIANGLES)
        return call_refuse(f, "capacity is %d; a piece must have room for a block's %d triangles",
                           p->capacity, FATHOM_BLOCK_TRIANGLES);
    if (!p->vertices) return call_refuse(f, "vertices is NULL");
    if (p->part != FATHOM_MESH_WHOLE && p->part != FATHOM_MESH_POOL)
        return call_refuse(f, "part is %d", p->part);
    if (p->next_stored < 0 || p->next_made < 0)
        return call_refuse(f, "next_stored or next_made is negative: zeros begin a pull");
    return mesh_check(f, p->min_weight);
}

int64_t fathom_pull_mesh(fathom *f, fathom_mesh_pull *given) {
    fathom_mesh_pull pull = FATHOM_STRUCT(fathom_mesh_pull);
    int e = call_begin(f);
    if (e == FATHOM_OK) e = call_take(f, &pull, sizeof pull, given, "fathom_mesh_pull");
    if (e == FATHOM_OK) e = pull_check(f, &pull);
    if (e != FATHOM_OK) return e;
    mesh_place at = {pull.next_stored, pull.next_made};
    fathom_vertex *end = pull.vertices;
    const int64_t count = mesh_make(f, &at, pull.part, pull.min_weight, pull.capacity, append, &end);
    if (count <= 0) at = (mesh_place){0, 0};
    pull.next_stored = at.stored;
    pull.next_made = at.born;
    sized_out(given, sized_of(given), &pull, sizeof pull);
    return count;
}

/* ---- blocks ------------------------------------------------------------------------------------------------------ */

static int blocks_check(fathom *f, const fathom_block_pull *p) {
    if (p->capacity < 1) return call_refuse(f, "a capacity of %d blocks", p->capacity);
    if (!p->keys) return call_refuse(f, "keys is NULL");
    return p->since >= 0 && p->next >= 0 ? FATHOM_OK
                                         : call_refuse(f, "since or next is negative: zeros begin a pull");
}

int32_t fathom_pull_blocks(fathom *f, fathom_block_pull *given) {
    fathom_block_pull pull = FATHOM_STRUCT(fathom_block_pull);
    int e = call_begin(f);
    if (e == FATHOM_OK) e = call_take(f, &pull, sizeof pull, given, "fathom_block_pull");
    if (e == FATHOM_OK) e = blocks_check(f, &pull);
    if (e != FATHOM_OK) return e;
    const int32_t count = block_pull(&f->volume, &f->integrator, &f->device, &pull);
    e = call_end(f);
    if (e == FATHOM_OK) sized_out(given, sized_of(given), &pull, sizeof pull);
    return e == FATHOM_OK ? count : e;
}
