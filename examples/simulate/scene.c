/* Signed distances of the scenes' solids and of their union: see scene.h. */
#include "simulate/scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "simulate/counter_random.h"

static const char *const names[] = {"room", "wall", "desk", "corridor"};

bool scene_kind_of(const char *name, enum scene_kind *kind) {
    for (int i = 0; i < 4; i++) {
        if (strcmp(name, names[i])) continue;
        *kind = (enum scene_kind)i;
        return true;
    }
    return false;
}

const char *scene_name(enum scene_kind kind) {
    return names[kind];
}

double scene_random(const struct scene *scene, uint64_t place, uint64_t index, double low, double high) {
    return low + (high - low) * random_uniform(random_key(scene->seed, place), index);
}

/* ---- Distances ---- */

static double positive(double v) {
    return v > 0.0 ? v : 0.0;
}

/* From the excess over a box's half sizes to the distance: outside by Pythagoras, inside the nearest face. */
static double from_excess2(double u, double v) {
    if (u <= 0.0) return v > u ? v : u;
    if (v <= 0.0) return u;
    return sqrt(u * u + v * v);
}

static double box_distance(const struct solid *s, double x, double y, double z) {
    const double u = fabs(x) - s->a + s->round, v = fabs(y) - s->b + s->round, w = fabs(z) - s->c + s->round;
    const double most = u > v ? (u > w ? u : w) : (v > w ? v : w);
    if (most <= 0.0) return most - s->round;
    const double pu = positive(u), pv = positive(v), pw = positive(w);
    return sqrt(pu * pu + pv * pv + pw * pw) - s->round;
}

/* The distance to a trapezium in the half plane (r, z): to its cap and to its slanted side, whichever is
 * nearer. */
static double cone_distance(const struct solid *s, double x, double y, double z) {
    const double r = sqrt(x * x + y * y);
    const double cap_r = positive(r - (z < 0.0 ? s->a : s->b)), cap_z = fabs(z) - s->c;
    const double side_r = s->b - s->a, side_z = 2.0 * s->c;
    double along = ((r - s->a) * side_r + (z + s->c) * side_z) / (side_r * side_r + side_z * side_z);
    along = along < 0.0 ? 0.0 : (along > 1.0 ? 1.0 : along);
    const double to_r = r - s->a - along * side_r, to_z = z + s->c - along * side_z;
    const double cap = cap_r * cap_r + cap_z * cap_z, side = to_r * to_r + to_z * to_z;
    const bool inside = to_r < 0.0 && cap_z < 0.0;
    const double distance = sqrt(cap < side ? cap : side);
    return inside ? -distance : distance;
}

double solid_distance(const struct solid *s, double x, double y, double z) {
    switch (s->kind) {
    case SOLID_BOX: return box_distance(s, x, y, z);
    case SOLID_SPHERE: return sqrt(x * x + y * y + z * z) - s->a;
    case SOLID_CYLINDER:
        return from_excess2(sqrt(x * x + y * y) - s->a + s->round, fabs(z) - s->c + s->round) - s->round;
    default: return cone_distance(s, x, y, z);
    }
}

static double room_distance(const struct scene *scene, const double p[3]) {
    /* Inside a box the nearest wall; outside (a vertex a little beyond the wall) minus the distance to the
     * box. */
    double nearest = INFINITY, outside = 0.0;
    for (int i = 0; i < 3; i++) {
        const double d = fmin(p[i] - scene->low[i], scene->high[i] - p[i]);
        nearest = fmin(nearest, d);
        if (d < 0.0) outside += d * d;
    }
    return outside > 0.0 ? -sqrt(outside) : nearest;
}

/* The first solid whose low_x is not below x. */
static size_t first_from(const struct scene *scene, double x) {
    size_t low = 0, high = scene->count;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (scene->solids[middle].low_x < x)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

double scene_distance(const struct scene *scene, double x, double y, double z) {
    const double p[3] = {x, y, z};
    double best = room_distance(scene, p);
    /* Only solids within `best` along x can be nearer, which keeps a long corridor cheap. */
    for (size_t i = first_from(scene, x - positive(best) - scene->widest); i < scene->count; i++) {
        const struct solid *s = &scene->solids[i];
        if (s->low_x > x + positive(best)) break;
        const double dx = x - s->centre[0], dy = y - s->centre[1], dz = z - s->centre[2];
        const double reach = s->bound + positive(best);
        if (dx * dx + dy * dy + dz * dz > reach * reach) continue;
        const double *m = s->axes;
        const double d = solid_distance(s, m[0] * dx + m[1] * dy + m[2] * dz,
                                        m[3] * dx + m[4] * dy + m[5] * dz, m[6] * dx + m[7] * dy + m[8] * dz);
        if (d < best) best = d;
    }
    return best;
}

void scene_normal(const struct scene *scene, double x, double y, double z, double normal[3]) {
    const double h = 1e-5;
    normal[0] = scene_distance(scene, x + h, y, z) - scene_distance(scene, x - h, y, z);
    normal[1] = scene_distance(scene, x, y + h, z) - scene_distance(scene, x, y - h, z);
    normal[2] = scene_distance(scene, x, y, z + h) - scene_distance(scene, x, y, z - h);
    const double n = sqrt(normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2]);
    for (int i = 0; i < 3 && n > 0.0; i++) normal[i] /= n;
}

/* ---- Building ---- */

static void add(struct scene *scene, struct solid s) {
    if (scene->count == scene->capacity) {
        const size_t capacity = scene->capacity ? 2 * scene->capacity : 256;
        struct solid *grown = realloc(scene->solids, capacity * sizeof *grown);
        if (!grown) {
            scene->failed = true;
            return;
        }
        scene->solids = grown;
        scene->capacity = capacity;
    }
    const double wide = s.kind == SOLID_BOX ? hypot(s.a, s.b) : (s.kind == SOLID_CONE ? fmax(s.a, s.b) : s.a);
    s.bound = s.kind == SOLID_SPHERE ? s.a : hypot(wide, s.c);
    double reach = s.bound;
    if (s.kind == SOLID_BOX) /* half the extent of a turned box along the world's x */
        reach = fabs(s.axes[0]) * s.a + fabs(s.axes[3]) * s.b + fabs(s.axes[6]) * s.c;
    s.low_x = s.centre[0] - reach;
    s.high_x = s.centre[0] + reach;
    scene->widest = fmax(scene->widest, 2.0 * reach);
    scene->solids[scene->count++] = s;
}

void scene_tilted_box(struct scene *scene, double x, double y, double z, double size_x, double size_y,
                      double size_z, double yaw, double pitch, double roll, double round) {
    const double cy = cos(yaw), sy = sin(yaw), cp = cos(pitch), sp = sin(pitch), cr = cos(roll),
                 sr = sin(roll);
    struct solid s = {.kind = SOLID_BOX,
                      .a = size_x / 2,
                      .b = size_y / 2,
                      .c = size_z / 2,
                      .round = fmin(round, 0.499 * fmin(size_x, fmin(size_y, size_z))),
                      .centre = {x, y, z},
                      /* transpose of Rz(yaw) Ry(pitch) Rx(roll) */
                      .axes = {cy * cp, sy * cp, -sp, cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr,
                               cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr}};
    add(scene, s);
}

void scene_box(struct scene *scene, double x, double y, double z, double size_x, double size_y, double size_z,
               double yaw, double round) {
    scene_tilted_box(scene, x, y, z, size_x, size_y, size_z, yaw, 0.0, 0.0, round);
}

void scene_sphere(struct scene *scene, double x, double y, double z, double radius) {
    const struct solid s = {
        .kind = SOLID_SPHERE, .a = radius, .centre = {x, y, z}, .axes = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    add(scene, s);
}

void scene_cylinder(struct scene *scene, double x, double y, double z, double radius, double length, int axis,
                    double round) {
    static const double turned[3][9] = {
        {0, 1, 0, 0, 0, 1, 1, 0, 0}, {0, 0, 1, 1, 0, 0, 0, 1, 0}, {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    struct solid s = {.kind = SOLID_CYLINDER,
                      .a = radius,
                      .c = length / 2,
                      .round = fmin(round, 0.499 * fmin(2 * radius, length)),
                      .centre = {x, y, z}};
    memcpy(s.axes, turned[axis], sizeof s.axes);
    add(scene, s);
}

void scene_cone(struct scene *scene, double x, double y, double z, double low_radius, double high_radius,
                double height) {
    const struct solid s = {.kind = SOLID_CONE,
                            .a = low_radius,
                            .b = high_radius,
                            .c = height / 2,
                            .centre = {x, y, z},
                            .axes = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    add(scene, s);
}

static int by_low_x(const void *a, const void *b) {
    const struct solid *p = a, *q = b;
    if (p->low_x != q->low_x) return p->low_x < q->low_x ? -1 : 1;
    return memcmp(p->centre, q->centre, sizeof p->centre); /* any fixed order */
}

static void set_room(struct scene *scene, const double low[3], const double high[3]) {
    memcpy(scene->low, low, sizeof scene->low);
    memcpy(scene->high, high, sizeof scene->high);
}

bool scene_make(struct scene *scene, enum scene_kind kind, uint64_t seed, double length) {
    memset(scene, 0, sizeof *scene);
    scene->kind = kind;
    scene->seed = seed;
    switch (kind) {
    case SCENE_ROOM:
        set_room(scene, (double[]){-2.4, -2.7, 0.0}, (double[]){2.7, 1.8, 2.8});
        scene_furnish_room(scene);
        break;
    case SCENE_WALL:
        set_room(scene, (double[]){-3.6, -2.0, 0.0}, (double[]){3.6, SCENE_WALL_Y, 2.6});
        scene_furnish_wall(scene);
        break;
    case SCENE_DESK:
        set_room(scene, (double[]){-2.0, -1.8, 0.0}, (double[]){2.0, 1.3, 2.5});
        scene_furnish_desk(scene);
        break;
    case SCENE_CORRIDOR:
        scene->length = length;
        set_room(scene, (double[]){0.0, -1.0, 0.0}, (double[]){length, 1.0, 2.5});
        scene_furnish_corridor(scene);
        break;
    }
    if (scene->failed) {
        scene_free(scene);
        return false;
    }
    if (scene->count) qsort(scene->solids, scene->count, sizeof *scene->solids, by_low_x);
    return true;
}

void scene_free(struct scene *scene) {
    free(scene->solids);
    memset(scene, 0, sizeof *scene);
}
