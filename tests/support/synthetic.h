/* What the tests of the whole library share: small rendered frames with their true poses, samples of an IMU on the
 * same path, a context in a block of the heap, a log that is kept. */
#ifndef SYNTHETIC_H
#define SYNTHETIC_H

#include "simulate/scene.h"
#include "fathom.h"

#define SYNTHETIC_WIDTH 160
#define SYNTHETIC_HEIGHT 120
#define SYNTHETIC_PIXELS (SYNTHETIC_WIDTH * SYNTHETIC_HEIGHT)
#define SYNTHETIC_PERIOD_NS 33333333
#define SYNTHETIC_UNITS 5000 /* a metre */
#define SYNTHETIC_SEED 5     /* of the scenes */

typedef struct {
    int64_t timestamp_ns;
    fathom_pose pose; /* the truth, camera to world */
    uint16_t depth[SYNTHETIC_PIXELS];
} synthetic_frame;

/* Renders frames 0..count-1 of a walk through a scene without noise. The camera stands still for the first still_s
 * seconds. Ends the program when it can't. */
void synthetic_render(enum scene_kind kind, double still_s, int count, synthetic_frame *frames);

/* The IMU's samples at `rate` on the same walk, from 0.2 s before the first frame to the last one; at most `most`.
 * Returns how many. grade as in imu_grade_of. */
int synthetic_imu(enum scene_kind kind, double still_s, int frames, const char *grade, double rate, int most,
                  fathom_imu_sample *samples);

/* Settings for these frames: 2 cm voxels, 6000 blocks, the first pose the true one of `first`, a kernel cache beside
 * the test program, no log. */
fathom_config synthetic_config(const synthetic_frame *first);

/* A folder beside the test program, which is made; static storage. */
const char *synthetic_folder(const char *name);

/* A context in a new block; both are given back by synthetic_stop. Fails the test when it can't. */
typedef struct {
    fathom *scan;
    void *block;
    size_t bytes;
} synthetic_context;
synthetic_context synthetic_start(const fathom_config *config);
void synthetic_stop(synthetic_context *context);

/* A frame as fathom_step takes it. */
fathom_depth_frame synthetic_depth(int64_t timestamp_ns, const uint16_t *depth, int width, int height);

/* One step; fails the test unless it returns FATHOM_OK and the result is in order (synthetic_check_result). */
fathom_result synthetic_step(fathom *scan, const synthetic_frame *frame);

/* A step with a frame of zeros. */
fathom_result synthetic_blank(fathom *scan, int64_t timestamp_ns);

/* Fails the test unless every figure is finite (the condition may be infinite), the pose is rigid and the covariance
 * is symmetric and positive semidefinite. */
void synthetic_check_result(const fathom_result *result);

/* Between two poses, metres and radians. */
double synthetic_distance(fathom_pose a, fathom_pose b);
double synthetic_angle(fathom_pose a, fathom_pose b);

/* A log for fathom_config.log. */
typedef struct {
    char text[32768];
    size_t used;
    int errors, warnings, infos;
} synthetic_log;
void synthetic_logger(void *user, fathom_log_level level, const char *text);

/* The surface's corners, for looking at. */
typedef struct {
    fathom_vertex *vertices;
    size_t count, capacity;
    int calls, stop_after; /* 0: never stops */
} synthetic_mesh;
int synthetic_triangles(void *user, const fathom_vertex *vertices, size_t triangle_count);

/* Runs this program again with one argument and, where not NULL, an environment variable NAME=VALUE. Its output is
 * kept in text. Returns its exit status, or -1. */
int synthetic_child(const char *argument, const char *variable, char *text, size_t size);

#endif
