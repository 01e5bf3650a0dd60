/* The depth cameras that can be simulated: what is known of each, and the errors it makes. */
#ifndef FATHOM_SENSOR_H
#define FATHOM_SENSOR_H

#include <stdbool.h>
#include <stdint.h>

#include "simulate/render.h"

/* A frame, width x height of its camera. */
struct sensor_frame {
    const struct render_camera *camera;
    /* true depth in, measured depth out: metres along the optical axis, 0 where there is none */
    float *depth;
    const float *cosine; /* of the angle between ray and normal, as render_depth gives it */
    uint8_t *confidence; /* out, higher is surer; used by sensors with a min_confidence only */
    uint64_t seed;
    long number;    /* 0, 1, ... */
    double seconds; /* since the first frame */
};

struct sensor {
    const char *name;
    struct render_camera camera; /* at its usual size */
    double rate_hz;
    double exposure_s, rolling_s; /* usual ones, with --blur */
    bool has_shadow;              /* a projector beside the camera casts one */
    int min_confidence;           /* the least that counts; 0: the sensor says nothing of confidence */

    /* Puts the sensor's errors into a frame. The result depends on the frame's fields only. False when out of memory.
     */
    bool (*measure)(const struct sensor_frame *frame);
};

extern const struct sensor sensor_kinect, sensor_lidar, sensor_tof;

/* By its name; NULL for an unknown one. */
const struct sensor *sensor_of(const char *name);

/* Its camera at another size: the same view, stretched to it. */
struct render_camera sensor_camera(const struct sensor *sensor, int width, int height);

#endif
