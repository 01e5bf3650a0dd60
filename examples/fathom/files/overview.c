#include "fathom/files/overview.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "fathom/files/view.h"

/* The surface is sampled by ray-casts from poses along the path, which needs no mesh. */
#define LOOKS 16
#define LOOK_WIDTH 160
#define LOOK_HEIGHT 120
#define SKIP 3 /* pixels between samples */
#define MOST_POINTS (LOOKS * (LOOK_WIDTH / SKIP + 1) * (LOOK_HEIGHT / SKIP + 1))

struct scene {
    float (*points)[3];
    int count;
    float centre[3];
    float forward[3], up[3], right[3]; /* mean orientation of the camera */
    float *depth;                      /* a map of LOOK_WIDTH x LOOK_HEIGHT */
};

static float dot(const float a[3], const float b[3]) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void cross(const float a[3], const float b[3], float out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

/* False, and nothing is changed, for a vector without a direction. */
static bool normalise(float v[3]) {
    const float length = sqrtf(dot(v, v));
    if (!(length > 1e-3f)) return false;
    for (int i = 0; i < 3; i++) v[i] /= length;
    return true;
}

static int compare(const void *a, const void *b) {
    const float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

/* Upwards is against the camera's y axis, forward along its z axis, each averaged over the path. After a full turn
 * there is no average direction: then the first pose's is used. */
static void find_axes(struct scene *scene, const struct path *path) {
    double first[16], m[16];
    if (fathom_pose_to_matrix(&path->points[0].pose, first)) return;
    float up[3] = {0}, forward[3] = {0};
    for (int i = 0; i < path->count; i++)
        for (int k = 0; k < 3 && !fathom_pose_to_matrix(&path->points[i].pose, m); k++) {
            up[k] -= (float)m[4 * k + 1] / (float)path->count;
            forward[k] += (float)m[4 * k + 2] / (float)path->count;
        }
    if (!normalise(up))
        for (int k = 0; k < 3; k++) up[k] = (float)-first[4 * k + 1];
    for (int attempt = 0; attempt < 3; attempt++) {
        const float along = dot(forward, up);
        for (int k = 0; k < 3; k++) forward[k] -= along * up[k];
        if (dot(forward, forward) > 0.01f) break;
        for (int k = 0; k < 3; k++) forward[k] = (float)first[4 * k + (attempt ? 0 : 2)];
    }
    normalise(forward);
    memcpy(scene->up, up, sizeof up);
    memcpy(scene->forward, forward, sizeof forward);
    cross(forward, up, scene->right);
}

static int sample_surface(fathom *context, const struct path *path, struct scene *scene) {
    fathom_view look = view_of(LOOK_WIDTH, LOOK_HEIGHT, 0.7);
    const fathom_pinhole *c = &look.camera;
    for (int i = 0; i < LOOKS; i++) {
        const int at = (int)((int64_t)(path->count - 1) * i / (LOOKS - 1));
        double m[16];
        look.pose = path->points[at].pose;
        int result = fathom_pose_to_matrix(&look.pose, m);
        if (!result) result = fathom_cast_view(context, &look, scene->depth, NULL);
        if (result < 0) return result;
        for (int v = 0; v < LOOK_HEIGHT; v += SKIP)
            for (int u = 0; u < LOOK_WIDTH; u += SKIP) {
                const float z = scene->depth[v * LOOK_WIDTH + u];
                if (!(z > 0)) continue;
                const double x = (u - c->cx) / c->fx * z, y = (v - c->cy) / c->fy * z;
                float *point = scene->points[scene->count++];
                for (int k = 0; k < 3; k++)
                    point[k] = (float)(m[4 * k] * x + m[4 * k + 1] * y + m[4 * k + 2] * z + m[4 * k + 3]);
            }
    }
    return scene->count ? FATHOM_OK : FATHOM_ERROR_NO_DATA;
}

/* The middle between the 5th and 95th percentile along each axis, insensitive to outliers. */
static int find_centre(struct scene *scene) {
    float *sorted = malloc((size_t)scene->count * sizeof *sorted);
    if (!sorted) return FATHOM_ERROR_MEMORY;
    for (int k = 0; k < 3; k++) {
        for (int i = 0; i < scene->count; i++) sorted[i] = scene->points[i][k];
        qsort(sorted, (size_t)scene->count, sizeof *sorted, compare);
        scene->centre[k] = 0.5f * (sorted[scene->count / 20] + sorted[scene->count - 1 - scene->count / 20]);
    }
    free(sorted);
    return FATHOM_OK;
}

/* Looks at the centre from 'distance' away: behind it as the camera was held, turned by azimuth, raised by
 * elevation. */
static void look_from(const struct scene *scene, float azimuth, float elevation, float distance,
                      fathom_view *view) {
    float x[3], y[3], z[3];
    for (int k = 0; k < 3; k++)
        z[k] = cosf(elevation) * (cosf(azimuth) * scene->forward[k] + sinf(azimuth) * scene->right[k]) -
               sinf(elevation) * scene->up[k];
    cross(z, scene->up, x);
    normalise(x);
    cross(z, x, y);
    double m[16] = {0};
    for (int k = 0; k < 3; k++) {
        m[4 * k] = x[k];
        m[4 * k + 1] = y[k];
        m[4 * k + 2] = z[k];
        m[4 * k + 3] = scene->centre[k] - distance * z[k];
    }
    m[15] = 1;
    fathom_pose_from_matrix(m, &view->pose);
}

/* Projects a world point into the view; false when it is behind it or outside. */
static bool project(const fathom_view *view, const float world[3], float margin, float *u, float *v,
                    float *z) {
    float at[3];
    if (!view_project(view, world, at)) return false;
    *u = at[0];
    *v = at[1];
    *z = at[2];
    return *u >= margin && *v >= margin && *u <= (float)view->camera.width - 1 - margin &&
           *v <= (float)view->camera.height - 1 - margin;
}

static void position_of(const struct path_point *point, float out[3]) {
    for (int k = 0; k < 3; k++) out[k] = (float)point->pose.position[k];
}

/* Whether nearly all of the surface and all of the path are in the frame. */
static bool shows_all(const struct scene *scene, const struct path *path, const fathom_view *view) {
    const float margin = 0.04f * (float)view->camera.width;
    float u, v, z;
    int outside = 0;
    for (int i = 0; i < path->count; i++) {
        float position[3];
        position_of(&path->points[i], position);
        if (path->points[i].state != FATHOM_LOST && !project(view, position, margin, &u, &v, &z))
            return false;
    }
    for (int i = 0; i < scene->count; i++) outside += !project(view, scene->points[i], margin, &u, &v, &z);
    return outside * 50 <= scene->count;
}

static float nearest_distance(const struct scene *scene, const struct path *path, float azimuth,
                              float elevation, fathom_view *view) {
    float near = 0.1f, far = 100;
    for (int i = 0; i < 14; i++) {
        const float distance = sqrtf(near * far);
        look_from(scene, azimuth, elevation, distance, view);
        if (shows_all(scene, path, view))
            far = distance;
        else
            near = distance;
    }
    return far;
}

/* The score of a view: unoccluded surface and path, and how well they fill the frame. */
static int score_view(fathom *context, const struct scene *scene, const struct path *path,
                      const fathom_view *view, float *score) {
    fathom_view small = *view;
    fathom_pinhole *c = &small.camera;
    const double scale = (double)LOOK_WIDTH / c->width;
    int seen = 0, asked = 0, way_seen = 0, covered = 0;
    *c = (fathom_pinhole){.width = LOOK_WIDTH,
                          .height = LOOK_HEIGHT,
                          .fx = c->fx * scale,
                          .fy = c->fy * scale,
                          .cx = (c->cx + 0.5) * scale - 0.5,
                          .cy = (c->cy + 0.5) * scale - 0.5};
    const int result = fathom_cast_view(context, &small, scene->depth, NULL);
    if (result < 0) return result;
    for (int i = 0; i < LOOK_WIDTH * LOOK_HEIGHT; i++) covered += scene->depth[i] > 0;
    float u, v, z, position[3];
    for (int i = 0; i < scene->count; i += 4, asked++) {
        if (!project(&small, scene->points[i], 0, &u, &v, &z)) continue;
        const float there = scene->depth[(int)(v + 0.5f) * LOOK_WIDTH + (int)(u + 0.5f)];
        seen += there > 0 && fabsf(there - z) < 0.05f + 0.02f * z;
    }
    for (int i = 0; i < path->count; i++) {
        position_of(&path->points[i], position);
        if (!project(&small, position, 0, &u, &v, &z)) continue;
        const float there = scene->depth[(int)(v + 0.5f) * LOOK_WIDTH + (int)(u + 0.5f)];
        way_seen += !(there > 0) || there > z;
    }
    *score = (float)seen / (float)asked + 0.5f * (float)way_seen / (float)path->count +
             0.5f * (float)covered / (LOOK_WIDTH * LOOK_HEIGHT);
    return FATHOM_OK;
}

static int choose_best(fathom *context, const struct scene *scene, const struct path *path,
                       fathom_view *view) {
    static const float azimuths[] = {0.35f, -0.35f, 0.8f, -0.8f, 0}, elevations[] = {0.5f, 0.25f, 0.8f};
    const size_t rows = sizeof elevations / sizeof *elevations, columns = sizeof azimuths / sizeof *azimuths;
    fathom_view best = *view;
    float best_score = -1;
    for (size_t i = 0; i < rows * columns; i++) {
        const float azimuth = azimuths[i % columns], elevation = elevations[i / columns];
        const float distance = nearest_distance(scene, path, azimuth, elevation, view);
        float radius = 0, score = 0;
        look_from(scene, azimuth, elevation, distance, view);
        for (int k = 0; k < scene->count; k++) {
            float apart[3];
            for (int l = 0; l < 3; l++) apart[l] = scene->points[k][l] - scene->centre[l];
            radius = fmaxf(radius, dot(apart, apart));
        }
        view->near_m = 0.1f;
        view->far_m = distance + sqrtf(radius) + 1;
        const int result = score_view(context, scene, path, view, &score);
        if (result < 0) return result;
        if (score > best_score) {
            best_score = score;
            best = *view;
        }
    }
    *view = best;
    return FATHOM_OK;
}

int overview_choose(fathom *context, const struct path *path, fathom_view *view) {
    if (!path->count) return FATHOM_ERROR_NO_DATA;
    struct scene scene = {.points = malloc(MOST_POINTS * sizeof *scene.points),
                          .depth = malloc(LOOK_WIDTH * LOOK_HEIGHT * sizeof *scene.depth)};
    int result = scene.points && scene.depth ? FATHOM_OK : FATHOM_ERROR_MEMORY;
    if (!result) find_axes(&scene, path);
    if (!result) result = sample_surface(context, path, &scene);
    if (!result) result = find_centre(&scene);
    if (!result) result = choose_best(context, &scene, path, view);
    free(scene.points);
    free(scene.depth);
    return result;
}
