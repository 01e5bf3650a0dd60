/* The arguments of `fathom simulate`. */
#ifndef FATHOM_SIMULATE_OPTIONS_H
#define FATHOM_SIMULATE_OPTIONS_H

#include "fathom/shell/option_values.h"
#include "fathom/shell/options.h"
#include "simulate/exposure.h"
#include "simulate/imu_model.h"
#include "simulate/sensor.h"

#define SIMULATE_MOST_FRAMES 1000000 /* nine hours */

struct simulate_options {
    const char *scene, *folder;
    const char *motion; /* another recording's folder, or NULL */
    enum scene_kind kind;
    const struct imu_grade *grade;
    struct imu_mounting mounting;
    const struct sensor *sensor;
    struct exposure exposure;
    double length, speed, turn, still, imu_rate, rate; /* samples, frames a second */
    long seed, frames, threads;                        /* frames 0: the scene's usual number */
    struct option_size size;                           /* of the depth */
    bool clean, blur, force, progress;
};

extern const struct option_group simulate_groups[];

/* As options_read, from the defaults on; also checks that options agree with each other. */
int simulate_options_read(struct simulate_options *options, const struct command *command, int argc,
                          char **argv);

#endif
