/* The furniture of the scenes `wall` and `corridor`. */
#include "simulate/scene.h"

#include <math.h>

/* ---- A long bare wall, furnished left and right of it ---- */

/* Objects on and in front of the wall at y = SCENE_WALL_Y, from x = from outwards (side +1 or -1). */
static void wall_side(struct scene *s, int side, uint64_t place) {
    const double from = SCENE_WALL_BARE, y = SCENE_WALL_Y;
    uint64_t draw = 0;
    /* A pilaster marks the end of the bare part, then a rack of boards with objects on them. */
    scene_box(s, side * (from + 0.1), y - 0.05, 1.3, 0.2, 0.22, 2.6, 0, 0.008);
    scene_box(s, side * (from + 0.1), y - 0.08, 1.6, 0.26, 0.24, 0.07, 0, 0.008);
    scene_cylinder(s, side * (from + 0.32), y - 0.06, 1.3, 0.05, 2.6, AXIS_Z, 0);
    for (int board = 0; board < 6; board++) {
        const double z = 0.35 + 0.33 * board;
        scene_box(s, side * (from + 1.2), y - 0.15, z, 1.5, 0.3, 0.025, 0, 0.003);
        for (int i = 0; i < 9; i++) {
            const double x = side * (from + 0.52 + 0.165 * i);
            const double pick = scene_random(s, place, draw++, 0, 1),
                         tall = scene_random(s, place, draw++, 0.1, 0.28);
            const double wide = scene_random(s, place, draw++, 0.07, 0.14),
                         deep = scene_random(s, place, draw++, 0.12, 0.25);
            if (pick < 0.5)
                scene_box(s, x, y - deep / 2, z + 0.012 + tall / 2, wide, deep, tall, 0, 0.003);
            else if (pick < 0.7)
                scene_cylinder(s, x, y - 0.15, z + 0.012 + tall / 2, wide / 2, tall, AXIS_Z, 0.004);
            else if (pick < 0.85)
                scene_sphere(s, x, y - 0.15, z + 0.012 + wide / 2, wide / 2);
        }
    }
    for (int i = 0; i < 3; i++)
        scene_box(s, side * (from + 0.46 + 0.74 * i), y - 0.15, 1.15, 0.025, 0.3, 2.3, 0, 0.003);
    scene_box(s, side * (from + 0.75), y - 0.3, 0.14, 0.4, 0.35, 0.28, 0.2 * side, 0.006);
    scene_cone(s, side * (from + 1.5), y - 0.35, 0.2, 0.12, 0.17, 0.4);
    scene_sphere(s, side * (from + 1.5), y - 0.35, 0.55, 0.2);
}

void scene_furnish_wall(struct scene *s) {
    wall_side(s, -1, 70);
    wall_side(s, 1, 71);
    /* The ends of the room and its other side, for views that turn away. */
    for (int i = 0; i < 5; i++) {
        const double tall = scene_random(s, 72, (uint64_t)i, 0.5, 1.7);
        scene_box(s, -3.4, -1.6 + 0.5 * i, tall / 2, 0.4, 0.36, tall, 0, 0.008);
        scene_box(s, 3.4, -1.6 + 0.5 * i, 1.1 - tall / 3, 0.4, 0.36, 2.2 - tall / 1.5, 0, 0.008);
    }
    for (int i = 0; i < 8; i++) {
        const double x = -3.0 + 0.86 * i + scene_random(s, 73, (uint64_t)i, -0.1, 0.1);
        if (i % 2)
            scene_cylinder(s, x, -1.8, 1.3, 0.12, 2.6, AXIS_Z, 0);
        else
            scene_box(s, x, -1.75, 0.5, 0.5, 0.5, scene_random(s, 74, (uint64_t)i, 0.7, 1.5), 0.1, 0.01);
    }
}

/* ---- A corridor of any length, never the same twice ---- */

/* A door in its frame; side is +1 for the wall at y = 1. */
static void corridor_door(struct scene *s, double x, double side, double open) {
    for (int i = 0; i < 2; i++)
        scene_box(s, x + (i ? 0.45 : -0.45), side * 0.98, 1.03, 0.1, 0.2, 2.06, 0, 0.006);
    scene_box(s, x, side * 0.98, 2.1, 1.0, 0.2, 0.1, 0, 0.006);
    scene_box(s, x, side * (1.0 - 0.02 - 0.03 * open), 1.02, 0.8, 0.05, 2.04, 0, 0.004);
    for (int i = 0; i < 2; i++)
        scene_box(s, x, side * (0.965 - 0.03 * open), 0.55 + 0.95 * i, 0.56, 0.03, 0.7, 0, 0.006);
    scene_sphere(s, x + 0.33, side * 0.91, 1.05, 0.032);
}

static void corridor_radiator(struct scene *s, double x, double side) {
    for (int i = 0; i < 9; i++)
        scene_cylinder(s, x - 0.32 + 0.08 * i, side * 0.93, 0.45, 0.032, 0.6, AXIS_Z, 0.01);
    scene_cylinder(s, x, side * 0.93, 0.2, 0.02, 0.9, AXIS_X, 0);
    scene_box(s, x, side * 0.93, 0.95, 0.85, 0.16, 0.03, 0, 0.004);
    scene_box(s, x, side * 0.99, 1.6, 0.5, 0.07, 0.38, 0, 0.006);
}

static void corridor_bench(struct scene *s, double x, double side, double high) {
    scene_box(s, x, side * 0.83, 0.44, 0.9, 0.32, 0.05, 0, 0.008);
    for (int i = 0; i < 2; i++)
        scene_box(s, x + (i ? 0.36 : -0.36), side * 0.83, 0.21, 0.06, 0.28, 0.42, 0, 0.004);
    scene_box(s, x - 0.15, side * 0.85, 0.47 + high / 2, 0.26, 0.2, high, 0.3, 0.01);
    scene_sphere(s, x + 0.22, side * 0.84, 0.58, 0.11);
    for (int i = 0; i < 4; i++)
        scene_cylinder(s, x - 0.3 + 0.2 * i, side * 0.94, 1.65, 0.018, 0.12, AXIS_Y, 0.006);
    scene_box(s, x, side * 0.99, 1.65, 0.8, 0.05, 0.1, 0, 0.004);
}

static void corridor_plant(struct scene *s, double x, double side, uint64_t place) {
    scene_cone(s, x, side * 0.8, 0.19, 0.11, 0.16, 0.38);
    scene_cylinder(s, x, side * 0.8, 0.6, 0.02, 0.5, AXIS_Z, 0);
    for (uint64_t i = 0; i < 7; i++)
        scene_sphere(s, x + scene_random(s, place, 20 + i, -0.16, 0.16),
                     side * (0.82 + scene_random(s, place, 30 + i, -0.12, 0.1)),
                     0.8 + scene_random(s, place, 40 + i, 0, 0.6),
                     scene_random(s, place, 50 + i, 0.06, 0.12));
}

static void corridor_shelf(struct scene *s, double x, double side, uint64_t place) {
    for (int board = 0; board < 4; board++) {
        const double z = 0.3 + 0.42 * board;
        scene_box(s, x, side * 0.87, z, 0.8, 0.26, 0.025, 0, 0.003);
        for (int i = 0; i < 5; i++) {
            const uint64_t k = (uint64_t)(60 + 8 * board + i);
            const double tall = scene_random(s, place, k, 0.12, 0.36),
                         wide = scene_random(s, place, k + 40, 0.06, 0.13);
            scene_box(s, x - 0.3 + 0.15 * i, side * 0.88, z + 0.012 + tall / 2, wide, 0.2, tall, 0, 0.003);
        }
    }
    for (int i = 0; i < 2; i++)
        scene_box(s, x + (i ? 0.4 : -0.4), side * 0.87, 0.9, 0.025, 0.26, 1.8, 0, 0.003);
}

static void corridor_wall_things(struct scene *s, double x, double side, uint64_t place) {
    scene_cylinder(s, x - 0.3, side * 0.91, 0.85, 0.07, 0.45, AXIS_Z, 0.03); /* an extinguisher */
    scene_box(s, x - 0.3, side * 0.98, 0.95, 0.06, 0.1, 0.3, 0, 0.004);
    const double wide = scene_random(s, place, 9, 0.35, 0.6), tall = scene_random(s, place, 10, 0.3, 0.7);
    scene_box(s, x + 0.2, side * 0.99, 1.5, wide, 0.06, tall, 0, 0.006);
    scene_box(s, x + 0.2, side * 0.975, 1.5, wide - 0.1, 0.06, tall - 0.1, 0, 0.006);
    scene_box(s, x + 0.15, side * 0.98, 1.05, 0.12, 0.07, 0.12, 0, 0.004);
}

void scene_furnish_corridor(struct scene *s) {
    uint64_t place = 1000;
    for (int i = 0; i < 2; i++) {
        const double side = i ? 1.0 : -1.0;
        for (double x = 0.5 + 0.35 * i; x < s->length - 0.5; place++) {
            const double pick = scene_random(s, place, 0, 0, 1);
            if (pick < 0.2)
                corridor_door(s, x, side, scene_random(s, place, 1, 0, 1));
            else if (pick < 0.34)
                corridor_radiator(s, x, side);
            else if (pick < 0.5)
                corridor_bench(s, x, side, scene_random(s, place, 2, 0.1, 0.4));
            else if (pick < 0.64)
                corridor_plant(s, x, side, place);
            else if (pick < 0.82)
                corridor_shelf(s, x, side, place);
            else
                corridor_wall_things(s, x, side, place);
            const double wide =
                scene_random(s, place, 3, 0.12, 0.3); /* a pilaster between one thing and the next */
            scene_box(s, x + 0.62, side, 1.25, wide, scene_random(s, place, 4, 0.12, 0.3), 2.5, 0, 0.008);
            x += scene_random(s, place, 5, 1.15, 1.75);
        }
    }
    for (double x = 0.4; x < s->length; place++) { /* beams, lamps and pipes overhead */
        if (scene_random(s, place, 0, 0, 1) < 0.5) {
            scene_box(s, x, 0, 2.46, scene_random(s, place, 1, 0.08, 0.25), 2.0, 0.16, 0, 0.006);
        } else {
            scene_cylinder(s, x, scene_random(s, place, 2, -0.4, 0.4), 2.48, 0.13, 0.12, AXIS_Z, 0.02);
            scene_cylinder(s, x, 0.75, 2.38, 0.05, 0.9, AXIS_X, 0.004);
        }
        x += scene_random(s, place, 3, 0.55, 1.5);
    }
    for (double x = 0.0; x < s->length; place++) { /* mats of their own size, skirting in pieces */
        const double piece = scene_random(s, place, 0, 0.7, 1.6);
        for (int i = 0; i < 2; i++)
            scene_box(s, x + piece / 2, i ? 1.0 : -1.0, 0.05, piece - 0.02, 0.04, 0.12, 0, 0.004);
        scene_box(s, x + piece / 2, scene_random(s, place, 1, -0.2, 0.2), 0.006, piece * 0.6, 0.7, 0.024,
                  scene_random(s, place, 2, -0.1, 0.1), 0.004);
        x += piece;
    }
    /* The ends of the passage. */
    scene_box(s, 0.05, 0.2, 0.9, 0.3, 0.7, 1.8, 0, 0.01);
    scene_box(s, s->length - 0.05, -0.2, 0.9, 0.3, 0.7, 1.8, 0, 0.01);
    scene_box(s, s->length, 0.55, 1.5, 0.08, 0.5, 0.7, 0, 0.01);
    scene_sphere(s, s->length - 0.2, 0.6, 0.3, 0.25);
}
