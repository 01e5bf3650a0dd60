/* The trajectory of the simulated camera: smooth functions of time, or a measured trajectory from a file. */
#ifndef FATHOM_CAMERA_PATH_H
#define FATHOM_CAMERA_PATH_H

#include "simulate/render.h"

/* A measured pose: TUM line, quaternion x y z w, of unit length and with the sign of its neighbours. */
struct path_sample {
    double t;
    double position[3];
    double quaternion[4];
};

struct camera_path {
    enum scene_kind kind;
    double length; /* corridor */
    double still_s, speed, turn;
    double phase[12];            /* of the swings, by the seed */
    struct path_sample *samples; /* measured path, else NULL */
    size_t count;
};

/* A hand-held path through the scene: it stands still for still_s seconds, then moves at `speed` times its
 * usual pace (0.3 to 0.5 m/s) and turns at `turn` times the usual (25 degrees/s). Position and orientation
 * have continuous derivatives up to the third, and hand tremor on top. */
void camera_path_make(struct camera_path *path, const struct scene *scene, double still_s, double speed,
                      double turn);

/* Reads a TUM trajectory (t tx ty tz qx qy qz qw, camera to world). 0, or -1 with one line in error. */
int camera_path_read(struct camera_path *path, const char *file, char *error, size_t error_size);
void camera_path_free(struct camera_path *path);

/* Camera to world at time t (seconds). A measured path is interpolated (position linearly, orientation by
 * slerp) and held at its ends. */
void camera_path_pose(const struct camera_path *path, double t, struct camera_pose *pose);

/* Angular velocity of a frame fixed to the camera, rad/s in camera axes, by fourth-order differences. */
void camera_path_rate(const struct camera_path *path, double t, double rate[3]);

/* Acceleration in the world, m/s^2, of the point that lies at `lever` in camera axes, by fourth-order
 * differences. */
void camera_path_acceleration(const struct camera_path *path, double t, const double lever[3],
                              double acceleration[3]);

/* Seconds until the path reaches the scene's other end (corridor, wall). */
double camera_path_seconds(const struct camera_path *path);

/* Quaternion x y z w of a rotation matrix, w >= 0. */
void quaternion_of(const double rotation[9], double quaternion[4]);

/* Rotation vector (radians) to matrix, and back. */
void rotation_of_vector(const double vector[3], double rotation[9]);
void vector_of_rotation(const double rotation[9], double vector[3]);

#endif
