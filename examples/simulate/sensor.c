#include "simulate/sensor.h"

#include <stddef.h>
#include <string.h>

const struct sensor *sensor_of(const char *name) {
    static const struct sensor *const all[] = {&sensor_kinect, &sensor_lidar, &sensor_tof};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        if (!strcmp(all[i]->name, name)) return all[i];
    return NULL;
}

/* A pixel's centre has whole coordinates, so its edges lie at halves. */
struct render_camera sensor_camera(const struct sensor *sensor, int width, int height) {
    const struct render_camera *c = &sensor->camera;
    const double x = width / (double)c->width, y = height / (double)c->height;
    return (struct render_camera){
        width, height, c->fx * x, c->fy * y, (c->cx + 0.5) * x - 0.5, (c->cy + 0.5) * y - 0.5};
}
