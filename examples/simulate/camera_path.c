/* See camera_path.h. The swings are sums of sines whose frequencies have no common measure, so that no view repeats;
 * hand tremor is a few tenths of a millimetre and of a tenth of a degree at 2 to 6 Hz, where physiological tremor and
 * the swing of the arm lie. */
#include "simulate/camera_path.h"

#include <math.h>
#include <string.h>

#include "simulate/counter_random.h"

#define PI 3.14159265358979323846
#define START_S 0.8       /* duration of the change from standing still to full pace */
#define CORRIDOR_PACE 0.4 /* m/s */
#define CORRIDOR_ENDS 1.3 /* metres kept from both ends */
#define WALL_SECONDS 7.4  /* from one side of the bare wall to the other */

/* Path time: 0 while standing still, then a ramp to a slope of 1. The ramp's slope is the smoothest step of
 * degree 7 (6, 15, 10 are those of degree 5), so four derivatives are continuous. */
static double path_time(const struct camera_path *path, double t) {
    const double u = (t - path->still_s) / START_S;
    if (u <= 0.0) return 0.0;
    if (u >= 1.0) return START_S * (u - 0.5);
    /* integral of 35 u^4 - 84 u^5 + 70 u^6 - 20 u^7 */
    return START_S * u * u * u * u * u * (7.0 + u * (-14.0 + u * (10.0 - 2.5 * u)));
}

/* Factor of the tremor: zero while standing still. */
static double tremor_weight(const struct camera_path *path, double t) {
    const double u = (t - path->still_s) / START_S;
    if (u <= 0.0) return 0.0;
    if (u >= 1.0) return 1.0;
    return u * u * u * u * (35.0 + u * (-84.0 + u * (70.0 - 20.0 * u)));
}

static double swing(const struct camera_path *path, int which, double frequency, double time) {
    return sin(frequency * time + path->phase[which]);
}

/* Each scene's path gives a position, and where to look as yaw (about z, 0 along x), pitch (up) and roll. */
struct view {
    double position[3];
    double yaw, pitch, roll;
};

/* Within x -0.4..0.7, y -1.1..0.2, z 1.3..1.95, inside the box that the room leaves free. */
static void room_view(const struct camera_path *p, double s, double r, struct view *v) {
    v->position[0] = 0.15 + 0.38 * swing(p, 0, 0.71, s) + 0.17 * swing(p, 1, 1.37, s);
    v->position[1] = -0.45 + 0.42 * swing(p, 2, 0.59, s) + 0.20 * swing(p, 3, 1.21, s);
    v->position[2] = 1.62 + 0.17 * swing(p, 4, 0.83, s) + 0.10 * swing(p, 5, 1.63, s);
    v->yaw = p->phase[11] + 0.30 * r + 0.30 * swing(p, 6, 0.67, r) + 0.10 * swing(p, 7, 1.73, r);
    v->pitch = -0.08 + 0.26 * swing(p, 8, 0.61, r) + 0.09 * swing(p, 9, 1.49, r);
    v->roll = 0.07 * swing(p, 10, 0.93, r);
}

/* Along the wall and back, facing it. In the middle the view turns less, so that it holds nothing but wall.
 */
static void wall_view(const struct camera_path *p, double s, double r, struct view *v) {
    /* The third harmonic slows it to 0.5 m/s in the middle: two seconds of bare wall, from x = -0.5 to 0.5.
     */
    const double turn = PI * s / WALL_SECONDS, x = -1.6 * cos(turn) - 0.15 * cos(3.0 * turn);
    const double side = x * x / 3.0; /* 0 in the middle, 1 at the ends */
    v->position[0] = x;
    v->position[1] = 0.16 + 0.06 * swing(p, 0, 1.07, s) - 0.10 * side;
    v->position[2] = 1.35 + 0.07 * swing(p, 1, 0.89, s) + 0.03 * swing(p, 2, 1.71, s);
    v->yaw = PI / 2 + 0.035 * swing(p, 3, 1.31, r) + 0.28 * side * swing(p, 4, 1.03, r);
    v->pitch = -0.01 + 0.04 * swing(p, 5, 1.13, r) + 0.22 * side * swing(p, 6, 0.97, r);
    v->roll = 0.05 * swing(p, 7, 0.79, r);
}

/* An arc over the desk, looking at a point that wanders over its top. */
static void desk_view(const struct camera_path *p, double s, double r, struct view *v) {
    const double around = 0.62 * swing(p, 0, 0.61, s) + 0.12 * swing(p, 1, 1.33, s);
    const double far = 0.68 + 0.09 * swing(p, 2, 0.83, s);
    v->position[0] = far * sin(around);
    v->position[1] = -far * cos(around) + 0.02 * swing(p, 3, 1.51, s);
    v->position[2] = 1.24 + 0.10 * swing(p, 4, 0.71, s) + 0.04 * swing(p, 5, 1.57, s);
    const double to[3] = {0.20 * swing(p, 6, 0.93, r) - v->position[0],
                          0.05 + 0.10 * swing(p, 7, 1.19, r) - v->position[1],
                          0.84 + 0.04 * swing(p, 8, 1.41, r) - v->position[2]};
    v->yaw = atan2(to[1], to[0]);
    v->pitch = atan2(to[2], hypot(to[0], to[1]));
    v->roll = 0.12 * swing(p, 9, 1.01, r);
}

/* From one end of the corridor to the other, where it stops. */
static void corridor_view(const struct camera_path *p, double s, double r, struct view *v) {
    const double way = p->length - 2.0 * CORRIDOR_ENDS, pace = CORRIDOR_PACE;
    /* Stops softly: way - soft log(1 + exp((way - walked) / soft)) is smooth and stays below way. */
    const double soft = 0.15, left = way - pace * s;
    const double walked = left > 20.0 * soft ? pace * s : way - soft * log1p(exp(left / soft));
    v->position[0] = CORRIDOR_ENDS + walked;
    v->position[1] = 0.16 * swing(p, 0, 0.53, s) + 0.05 * swing(p, 1, 1.27, s);
    v->position[2] = 1.38 + 0.05 * swing(p, 2, 0.77, s) + 0.02 * swing(p, 3, 1.69, s);
    v->yaw = 0.46 * swing(p, 4, 0.73, r) + 0.12 * swing(p, 5, 1.61, r);
    v->pitch = -0.10 + 0.16 * swing(p, 6, 0.67, r) + 0.06 * swing(p, 7, 1.43, r);
    v->roll = 0.06 * swing(p, 8, 0.91, r);
}

void camera_path_make(struct camera_path *path, const struct scene *scene, double still_s, double speed,
                      double turn) {
    memset(path, 0, sizeof *path);
    path->kind = scene->kind;
    path->length = scene->length;
    path->still_s = still_s;
    path->speed = speed;
    path->turn = turn;
    for (int i = 0; i < 12; i++) path->phase[i] = scene_random(scene, 500, (uint64_t)i, 0.0, 2.0 * PI);
}

double camera_path_seconds(const struct camera_path *path) {
    double s = 10.0;
    if (path->kind == SCENE_CORRIDOR) s = (path->length - 2.0 * CORRIDOR_ENDS) / CORRIDOR_PACE;
    if (path->kind == SCENE_WALL) s = WALL_SECONDS;
    return path->still_s + START_S / 2 + s / path->speed;
}

static void synthetic_pose(const struct camera_path *path, double t, struct camera_pose *pose) {
    struct view v = {.yaw = 0.0};
    /* The factors bring each scene to a hand-held pace: some 0.3 m/s and 25 degrees/s at the faster places.
     */
    static const double pace[] = {
        [SCENE_ROOM] = 1.0, [SCENE_WALL] = 1.0, [SCENE_DESK] = 1.6, [SCENE_CORRIDOR] = 1.0};
    static const double swing_pace[] = {1.2, 1.7, 1.6, 1.6};
    const double time = path_time(path, t);
    const double s = pace[path->kind] * path->speed * time, r = swing_pace[path->kind] * path->turn * time;
    switch (path->kind) {
    case SCENE_ROOM: room_view(path, s, r, &v); break;
    case SCENE_WALL: wall_view(path, s, r, &v); break;
    case SCENE_DESK: desk_view(path, s, r, &v); break;
    case SCENE_CORRIDOR: corridor_view(path, s, r, &v); break;
    }
    const double w = tremor_weight(path, t);
    for (int i = 0; i < 3; i++)
        v.position[i] +=
            w * (3e-4 * sin((13.1 + 2.3 * i) * t + path->phase[i]) + 1e-4 * sin((31.7 - 3.1 * i) * t));
    v.yaw += w * (1.2e-3 * sin(17.3 * t + path->phase[3]) + 3e-4 * sin(35.9 * t));
    v.pitch += w * (1.2e-3 * sin(15.1 * t + path->phase[4]) + 3e-4 * sin(33.7 * t));
    v.roll += w * 1.0e-3 * sin(14.3 * t + path->phase[5]);

    const double cy = cos(v.yaw), sy = sin(v.yaw), cp = cos(v.pitch), sp = sin(v.pitch);
    const double cr = cos(v.roll), sr = sin(v.roll);
    const double forward[3] = {cy * cp, sy * cp, sp}, right[3] = {sy, -cy, 0.0};
    const double down[3] = {forward[1] * right[2] - forward[2] * right[1],
                            forward[2] * right[0] - forward[0] * right[2],
                            forward[0] * right[1] - forward[1] * right[0]};
    for (int i = 0; i < 3; i++) {
        pose->rotation[3 * i] = cr * right[i] + sr * down[i];
        pose->rotation[3 * i + 1] = cr * down[i] - sr * right[i];
        pose->rotation[3 * i + 2] = forward[i];
        pose->position[i] = v.position[i];
    }
}

/* ---- A measured path ---- */

static void matrix_of(const double q[4], double m[9]) {
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double rows[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - z * w),     2 * (x * z + y * w),
                            2 * (x * y + z * w),     1 - 2 * (x * x + z * z), 2 * (y * z - x * w),
                            2 * (x * z - y * w),     2 * (y * z + x * w),     1 - 2 * (x * x + y * y)};
    memcpy(m, rows, sizeof rows);
}

static void slerp(const double a[4], const double b[4], double u, double q[4]) {
    double cosine = 0.0, norm = 0.0;
    for (int i = 0; i < 4; i++) cosine += a[i] * b[i];
    const double angle = acos(fmin(cosine, 1.0));
    const double sine = sin(angle);
    const double wa = sine > 1e-6 ? sin((1.0 - u) * angle) / sine : 1.0 - u;
    const double wb = sine > 1e-6 ? sin(u * angle) / sine : u;
    for (int i = 0; i < 4; i++) {
        q[i] = wa * a[i] + wb * b[i];
        norm += q[i] * q[i];
    }
    norm = sqrt(norm);
    for (int i = 0; i < 4; i++) q[i] /= norm;
}

static void measured_pose(const struct camera_path *path, double t, struct camera_pose *pose) {
    size_t low = 0, high = path->count - 1;
    while (high - low > 1) {
        const size_t middle = (low + high) / 2;
        if (path->samples[middle].t <= t)
            low = middle;
        else
            high = middle;
    }
    const struct path_sample *a = &path->samples[low], *b = &path->samples[high];
    const double u = fmin(fmax((t - a->t) / (b->t - a->t), 0.0), 1.0);
    double q[4];
    slerp(a->quaternion, b->quaternion, u, q);
    matrix_of(q, pose->rotation);
    for (int i = 0; i < 3; i++) pose->position[i] = a->position[i] + u * (b->position[i] - a->position[i]);
}

void camera_path_pose(const struct camera_path *path, double t, struct camera_pose *pose) {
    if (path->samples)
        measured_pose(path, t, pose);
    else
        synthetic_pose(path, t, pose);
}

/* ---- Derivatives ----
 * Fourth-order central differences. With steps of 1 ms the truncation on tremor of 6 Hz stays below 1e-7
 * m/s^2 and rounding below 1e-8. */

#define STEP_S 1e-3

static void turned(const double a[9], const double b[9], double vector[3]) {
    double m[9];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) m[3 * i + j] = a[i] * b[j] + a[3 + i] * b[3 + j] + a[6 + i] * b[6 + j];
    vector_of_rotation(m, vector);
}

void camera_path_rate(const struct camera_path *path, double t, double rate[3]) {
    /* log(R(t)^T R(t + h)) is odd in h up to terms of h^2 that cancel in the difference of + and -. */
    struct camera_pose here, there;
    double vector[4][3];
    const double steps[4] = {-2, -1, 1, 2};
    camera_path_pose(path, t, &here);
    for (int i = 0; i < 4; i++) {
        camera_path_pose(path, t + steps[i] * STEP_S, &there);
        turned(here.rotation, there.rotation, vector[i]);
    }
    for (int i = 0; i < 3; i++)
        rate[i] = (vector[0][i] - 8.0 * vector[1][i] + 8.0 * vector[2][i] - vector[3][i]) / (12.0 * STEP_S);
}

void camera_path_acceleration(const struct camera_path *path, double t, const double lever[3],
                              double acceleration[3]) {
    static const double weights[5] = {-1, 16, -30, 16, -1};
    struct camera_pose pose;
    for (int i = 0; i < 3; i++) acceleration[i] = 0.0;
    for (int k = 0; k < 5; k++) {
        camera_path_pose(path, t + (k - 2) * STEP_S, &pose);
        for (int i = 0; i < 3; i++) {
            const double *row = &pose.rotation[3 * i];
            const double point = pose.position[i] + row[0] * lever[0] + row[1] * lever[1] + row[2] * lever[2];
            acceleration[i] += weights[k] * point / (12.0 * STEP_S * STEP_S);
        }
    }
}

/* ---- Rotations ---- */

void quaternion_of(const double m[9], double q[4]) {
    /* Divides by the largest of the four squares, for precision near half turns. */
    const double squares[4] = {1 + m[0] - m[4] - m[8], 1 - m[0] + m[4] - m[8], 1 - m[0] - m[4] + m[8],
                               1 + m[0] + m[4] + m[8]};
    int largest = 0;
    for (int i = 1; i < 4; i++)
        if (squares[i] > squares[largest]) largest = i;
    const double products[4][4] = {{squares[0], m[1] + m[3], m[2] + m[6], m[7] - m[5]},
                                   {m[1] + m[3], squares[1], m[5] + m[7], m[2] - m[6]},
                                   {m[2] + m[6], m[5] + m[7], squares[2], m[3] - m[1]},
                                   {m[7] - m[5], m[2] - m[6], m[3] - m[1], squares[3]}};
    double norm = 0.0;
    for (int i = 0; i < 4; i++) norm += products[largest][i] * products[largest][i];
    norm = sqrt(norm) * (products[largest][3] < 0.0 ? -1.0 : 1.0);
    for (int i = 0; i < 4; i++) q[i] = products[largest][i] / norm;
}

void rotation_of_vector(const double v[3], double m[9]) {
    const double angle = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    const double s = angle > 1e-12 ? sin(angle / 2) / angle : 0.5;
    const double q[4] = {s * v[0], s * v[1], s * v[2], cos(angle / 2)};
    matrix_of(q, m);
}

void vector_of_rotation(const double m[9], double v[3]) {
    double q[4];
    quaternion_of(m, q);
    const double sine = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2]);
    const double scale = sine > 1e-12 ? 2.0 * atan2(sine, q[3]) / sine : 2.0;
    for (int i = 0; i < 3; i++) v[i] = scale * q[i];
}
