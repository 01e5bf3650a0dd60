/* Ray marching of the scenes' signed distances, made fast by two facts.
 *
 * A tile of pixels sees few solids. A cone about the tile's rays is marched first (cone marching, after Fulcrum 2012),
 * in three sizes of tile: it gives the free distance before the tile and the solids that the cone meets at all. A ray
 * in the cone can hit no other solid, so the others needn't be tested.
 *
 * The solids are convex, hence the distance f along a ray is a convex function, and the secant through two points
 * before the first zero never passes it: z + f / -slope is a step as safe as sphere tracing's (Hart 1996) f / |d|, and
 * converges superlinearly even at grazing angles. A secant that no longer falls proves a miss. So each solid is marched
 * by itself, and the closed box around everything is left in closed form.
 *
 * Under a rolling shutter every row has a pose of its own. The rays of a tile then start at several points and turn
 * with their rows: its cone is widened by both, and still holds them. */
#include "simulate/render.h"

#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define HIT_M 1e-6 /* a distance that counts as touching */
#define LEVELS 3
static const int tile_sizes[LEVELS] = {64, 16, 8};

/* A solid, relative to the frame's eye. */
struct seen_solid {
    const struct solid *solid;
    double origin[3]; /* the eye in the solid's axes */
    double offset[3]; /* the solid's centre, from the eye, world axes */
};

struct frame {
    const struct scene *scene;
    const struct render_camera *camera;
    const struct camera_pose *rows; /* one for each row, or one for all: row_step 0 */
    int row_step;
    const double *eye; /* the middle row's position, to which the others are relative */
    double far_m;
    float *depth, *cosine;
    struct seen_solid *solids;
    int count;
    int tiles_x, tiles;
    atomic_int next;
};

/* Around the rays of a tile, from the frame's eye. */
struct cone {
    double axis[3]; /* unit */
    double spread;  /* tangent of the half angle */
    double slack;   /* the rays' origins lie this near to the eye */
    double reach;   /* along the axis, to the farthest point of interest */
};

struct worker {
    struct frame *frame;
    int *lists[LEVELS + 1]; /* indices of solids, narrowed level by level */
    pthread_t thread;
    bool started;
};

static const struct camera_pose *pose_of(const struct frame *frame, int row) {
    return &frame->rows[(size_t)row * (size_t)frame->row_step];
}

static void ray_of(const struct frame *frame, const struct camera_pose *pose, double u, double v,
                   double d[3]) {
    const double x = (u - frame->camera->cx) / frame->camera->fx,
                 y = (v - frame->camera->cy) / frame->camera->fy;
    const double *r = pose->rotation;
    for (int i = 0; i < 3; i++) d[i] = r[3 * i] * x + r[3 * i + 1] * y + r[3 * i + 2];
}

static double dot(const double a[3], const double b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* A ray in a solid's axes. */
struct local_ray {
    const struct solid *solid;
    double origin[3], d[3];
};

static double along_ray(const struct local_ray *ray, double z) {
    return solid_distance(ray->solid, ray->origin[0] + ray->d[0] * z, ray->origin[1] + ray->d[1] * z,
                          ray->origin[2] + ray->d[2] * z);
}

static void to_solid_axes(const struct solid *solid, const double v[3], double out[3]) {
    for (int i = 0; i < 3; i++) out[i] = dot(&solid->axes[3 * i], v);
}

/* ---- One pixel ---- */

/* Where the ray leaves the box around the scene; the wall's axis into *axis. */
static double leave_box(const struct frame *frame, const double from[3], const double d[3], int *axis) {
    double nearest = INFINITY;
    for (int i = 0; i < 3; i++) {
        if (d[i] == 0.0) continue;
        const double wall = d[i] > 0.0 ? frame->scene->high[i] : frame->scene->low[i];
        const double z = (wall - from[i]) / d[i];
        if (z < nearest) {
            nearest = z;
            *axis = i;
        }
    }
    return nearest;
}

/* The ray's first touch of its solid in [z, end), or end. */
static double first_touch(const struct local_ray *ray, double length, double z, double end) {
    double f = along_ray(ray, z), step = f / length;
    for (int i = 0; i < 256 && f > HIT_M; i++) {
        z += step;
        if (z >= end) return end;
        const double next = along_ray(ray, z);
        if (next >= f) return end; /* convex and no longer falling */
        step *= next / (f - next);
        f = next;
    }
    return z < end ? z : end;
}

/* The ray along d in the axes of a solid; its origin lies `shift` from the eye. */
static struct local_ray ray_in(const struct seen_solid *s, const double shift[3], const double d[3]) {
    struct local_ray ray = {.solid = s->solid};
    double moved[3];
    to_solid_axes(s->solid, d, ray.d);
    to_solid_axes(s->solid, shift, moved);
    for (int i = 0; i < 3; i++) ray.origin[i] = s->origin[i] + moved[i];
    return ray;
}

/* The rays are marched from where the tile's cone begins: `from` along its axis, less the slack. */
static void shade(const struct frame *frame, int x, int y, const int *list, int count, double from,
                  const struct cone *cone) {
    const struct camera_pose *pose = pose_of(frame, y);
    double d[3], shift[3];
    int wall = 0;
    struct local_ray hit = {.solid = NULL};
    ray_of(frame, pose, x, y, d);
    for (int i = 0; i < 3; i++) shift[i] = pose->position[i] - frame->eye[i];
    const double length = sqrt(dot(d, d)), start = fmax(from - cone->slack, 0.0) / dot(d, cone->axis);
    double z = leave_box(frame, pose->position, d, &wall);
    for (int i = 0; i < count; i++) {
        const struct local_ray ray = ray_in(&frame->solids[list[i]], shift, d);
        const double touch = first_touch(&ray, length, start, z);
        if (touch >= z) continue;
        z = touch;
        hit = ray;
    }
    const size_t pixel = (size_t)y * (size_t)frame->camera->width + (size_t)x;
    const bool seen = z > 0.0 && z <= frame->far_m;
    frame->depth[pixel] = seen ? (float)z : 0.0f;
    if (!frame->cosine) return;
    const double h = 1e-4; /* the distance's slope along the ray is -cos(angle) |d| */
    const double cosine =
        hit.solid ? (along_ray(&hit, z - h) - along_ray(&hit, z)) / (h * length) : fabs(d[wall]) / length;
    frame->cosine[pixel] = seen ? (float)cosine : 0.0f;
}

/* ---- Tiles ---- */

/* Angle between two rotations, radians. */
static double angle_between(const double a[9], const double b[9]) {
    double square = 0.0; /* |A - B|^2 = 8 sin^2(angle / 2): exact for small angles, too */
    for (int i = 0; i < 9; i++) square += (a[i] - b[i]) * (a[i] - b[i]);
    return 2.0 * asin(fmin(sqrt(square / 8.0), 1.0));
}

static struct cone cone_of(const struct frame *frame, int x0, int y0, int x1, int y1) {
    struct cone cone = {.spread = 0.0};
    const struct camera_pose *middle = pose_of(frame, (y0 + y1) / 2);
    double d[3], turn = 0.0;
    ray_of(frame, middle, 0.5 * (x0 + x1), 0.5 * (y0 + y1), cone.axis);
    const double length = sqrt(dot(cone.axis, cone.axis));
    for (int i = 0; i < 3; i++) cone.axis[i] /= length;
    for (int y = y0; y <= y1 && frame->row_step; y++) {
        const struct camera_pose *pose = pose_of(frame, y);
        for (int i = 0; i < 3; i++) d[i] = pose->position[i] - frame->eye[i];
        cone.slack = fmax(cone.slack, sqrt(dot(d, d)));
        turn = fmax(turn, angle_between(middle->rotation, pose->rotation));
    }
    for (int corner = 0; corner < 4; corner++) {
        ray_of(frame, middle, corner & 1 ? x1 : x0, corner & 2 ? y1 : y0, d);
        const double forward = dot(d, cone.axis), square = dot(d, d) - forward * forward;
        cone.spread = fmax(cone.spread, sqrt(fmax(square, 0.0)) / forward);
        cone.reach = fmax(cone.reach, sqrt(dot(d, d)) * frame->far_m);
    }
    if (turn > 0.0) cone.spread = tan(fmin(atan(cone.spread) + turn, 1.5));
    cone.spread += 1e-6; /* rounding */
    return cone;
}

/* Keeps the solids whose bounding sphere the cone meets. */
static int meets_cone(const struct frame *frame, const struct cone *cone, const int *from, int count,
                      int *list) {
    const double stretch = sqrt(1.0 + cone->spread * cone->spread);
    int kept = 0;
    for (int i = 0; i < count; i++) {
        const struct seen_solid *s = &frame->solids[from[i]];
        const double forward = dot(s->offset, cone->axis), bound = s->solid->bound;
        if (forward < -bound - cone->slack || forward > cone->reach + bound) continue;
        const double aside = sqrt(fmax(dot(s->offset, s->offset) - forward * forward, 0.0));
        if (aside - cone->spread * forward <= (bound + cone->slack) * stretch) list[kept++] = from[i];
    }
    return kept;
}

/* Distance of the point at s on the axis to the nearest face of the box, negative outside. */
static double box_room(const struct frame *frame, const struct cone *cone, double s) {
    double nearest = INFINITY;
    for (int i = 0; i < 3; i++) {
        const double p = frame->eye[i] + cone->axis[i] * s;
        nearest = fmin(nearest, fmin(p - frame->scene->low[i], frame->scene->high[i] - p));
    }
    return nearest;
}

/* Marches the cone from `from`: sorts the solids that it meets to the front of the list, returns how many,
 * and sets *start to where on the axis the first of them may begin. */
static int march_cone(const struct frame *frame, const struct cone *cone, double from, int *list, int count,
                      double *start) {
    static const double nowhere[3] = {0.0, 0.0, 0.0};
    int kept = 0;
    *start = -1.0;
    for (double s = from; s < cone->reach;) {
        const double radius = cone->spread * s + cone->slack, slab = fmax(2.0 * radius, 0.02);
        const double middle = s + 0.5 * slab;
        const double wide = cone->spread * (s + slab) + cone->slack,
                     ball = sqrt(0.25 * slab * slab + wide * wide);
        double nearest = INFINITY;
        bool blocked = false;
        for (int i = 0; i < count; i++) {
            const struct seen_solid *seen = &frame->solids[list[i]];
            const struct local_ray ray = ray_in(seen, nowhere, cone->axis);
            const double distance = along_ray(&ray, middle);
            blocked |= distance < -ball;
            if (distance <= ball && i >= kept) {
                const int swap = list[kept]; /* already tested in this round, or the same one */
                list[kept++] = list[i];
                list[i] = swap;
            }
            nearest = fmin(nearest, distance);
        }
        if (nearest <= ball && *start < 0.0) *start = s;
        if (blocked || box_room(frame, cone, s) < -radius - 1e-9) break;
        /* From the slab's middle: what lies within `nearest` of it is free, the cone's section at its far end
         * too. */
        const double jump = middle + (nearest - cone->slack - cone->spread * middle) / (1.0 + cone->spread);
        s = fmax(s + slab, fmin(jump, cone->reach));
    }
    return kept;
}

static void tile(const struct worker *worker, int level, int x0, int y0, const int *from, int count,
                 double start) {
    const struct frame *frame = worker->frame;
    const int size = tile_sizes[level];
    const int x1 = x0 + size < frame->camera->width ? x0 + size : frame->camera->width;
    const int y1 = y0 + size < frame->camera->height ? y0 + size : frame->camera->height;
    int *list = worker->lists[level];
    const struct cone cone = cone_of(frame, x0, y0, x1 - 1, y1 - 1);
    /* Measured along another axis than the parent's. */
    double begin = fmax(start - cone.slack, 0.0) / sqrt(1.0 + cone.spread * cone.spread);
    int kept = meets_cone(frame, &cone, from, count, list);
    kept = march_cone(frame, &cone, begin, list, kept, &begin);
    if (begin < 0.0) begin = 0.0;
    if (level + 1 < LEVELS) {
        const int step = tile_sizes[level + 1];
        for (int y = y0; y < y1; y += step)
            for (int x = x0; x < x1; x += step) tile(worker, level + 1, x, y, list, kept, begin);
        return;
    }
    for (int y = y0; y < y1; y++)
        for (int x = x0; x < x1; x++) shade(frame, x, y, list, kept, begin, &cone);
}

static void *work(void *argument) {
    const struct worker *worker = argument;
    struct frame *frame = worker->frame;
    for (int i; (i = atomic_fetch_add(&frame->next, 1)) < frame->tiles;)
        tile(worker, 0, i % frame->tiles_x * tile_sizes[0], i / frame->tiles_x * tile_sizes[0],
             worker->lists[LEVELS], frame->count, 0.0);
    return NULL;
}

/* ---- The frame ---- */

/* Lists the solids within reach; false when out of memory. */
static bool look_at_solids(struct frame *frame) {
    const struct scene *scene = frame->scene;
    const double slant = hypot((frame->camera->width + fabs(frame->camera->cx)) / frame->camera->fx,
                               (frame->camera->height + fabs(frame->camera->cy)) / frame->camera->fy);
    const double reach = frame->far_m * hypot(1.0, slant);
    frame->solids = malloc((scene->count + 1) * sizeof *frame->solids);
    if (!frame->solids) return false;
    for (size_t i = 0; i < scene->count; i++) {
        struct seen_solid seen = {.solid = &scene->solids[i]};
        double back[3];
        for (int k = 0; k < 3; k++) {
            seen.offset[k] = seen.solid->centre[k] - frame->eye[k];
            back[k] = -seen.offset[k];
        }
        if (dot(seen.offset, seen.offset) > (reach + seen.solid->bound) * (reach + seen.solid->bound))
            continue;
        to_solid_axes(seen.solid, back, seen.origin);
        frame->solids[frame->count++] = seen;
    }
    return true;
}

static bool make_lists(struct worker *worker, int count) {
    for (int level = 0; level <= LEVELS; level++) {
        worker->lists[level] = malloc((size_t)(count + 1) * sizeof(int));
        if (!worker->lists[level]) return false;
    }
    for (int i = 0; i < count; i++) worker->lists[LEVELS][i] = i;
    return true;
}

static bool render(const struct scene *scene, const struct render_camera *camera,
                   const struct camera_pose *rows, int row_step, double far_m, int threads, float *depth,
                   float *cosine) {
    struct frame frame = {.scene = scene,
                          .camera = camera,
                          .rows = rows,
                          .row_step = row_step,
                          .far_m = far_m,
                          .depth = depth,
                          .cosine = cosine};
    frame.eye = pose_of(&frame, camera->height / 2)->position;
    frame.tiles_x = (camera->width + tile_sizes[0] - 1) / tile_sizes[0];
    frame.tiles = frame.tiles_x * ((camera->height + tile_sizes[0] - 1) / tile_sizes[0]);
    atomic_init(&frame.next, 0);
    if (threads > frame.tiles) threads = frame.tiles;
    struct worker *workers = calloc((size_t)threads, sizeof *workers);
    bool whole = workers && look_at_solids(&frame);
    for (int i = 0; whole && i < threads; i++) {
        workers[i].frame = &frame;
        whole = make_lists(&workers[i], frame.count);
    }
    if (whole) {
        /* A thread that can't be created is no failure: this one does the work. */
        for (int i = 1; i < threads; i++)
            workers[i].started = !pthread_create(&workers[i].thread, NULL, work, &workers[i]);
        work(&workers[0]);
        for (int i = 1; i < threads; i++)
            if (workers[i].started) pthread_join(workers[i].thread, NULL);
    }
    for (int i = 0; workers && i < threads; i++)
        for (int level = 0; level <= LEVELS; level++) free(workers[i].lists[level]);
    free(workers);
    free(frame.solids);
    return whole;
}

bool render_depth(const struct scene *scene, const struct render_camera *camera,
                  const struct camera_pose *pose, double far_m, int threads, float *depth, float *cosine) {
    return render(scene, camera, pose, 0, far_m, threads, depth, cosine);
}

bool render_rolling(const struct scene *scene, const struct render_camera *camera,
                    const struct camera_pose *rows, double far_m, int threads, float *depth, float *cosine) {
    return render(scene, camera, rows, 1, far_m, threads, depth, cosine);
}
