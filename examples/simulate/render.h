/* Exact depth images of a scene. */
#ifndef FATHOM_RENDER_H
#define FATHOM_RENDER_H

#include "simulate/scene.h"

/* A pinhole camera without distortion; a pixel's centre has whole coordinates. */
struct render_camera {
    int width, height;
    double fx, fy, cx, cy;
};

/* Camera to world: p_world = rotation p_camera + position; camera axes x right, y down, z forward. Row-major.
 */
struct camera_pose {
    double rotation[9];
    double position[3];
};

/* Renders depth along the optical axis, metres (width x height; 0 beyond far_m), and, unless cosine is NULL, the cosine
 * of the angle between each pixel's ray and the surface's normal. A hit lies within 0.002 mm of the surface. threads: 1
 * or more; the image is the same to the last bit for any number. False when out of memory. */
bool render_depth(const struct scene *scene, const struct render_camera *camera,
                  const struct camera_pose *pose, double far_m, int threads, float *depth, float *cosine);

/* The same with a pose for each row, as with a rolling shutter. */
bool render_rolling(const struct scene *scene, const struct render_camera *camera,
                    const struct camera_pose *rows, double far_m, int threads, float *depth, float *cosine);

#endif
