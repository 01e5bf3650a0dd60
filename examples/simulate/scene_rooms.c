/* The furniture of the scenes `room` and `desk`. Sizes and positions that vary with the seed come from scene_random. */
#include "simulate/scene.h"

#include <math.h>

/* In the room this box stays free at any seed: hand-held paths in x -0.6..0.9, y -1.35..0.45, z 1.2..2.05
 * pass through it in any direction, and a sensor sees nothing within 0.4 m. x -1.2..1.5, y -1.95..1.05, z
 * 0.6..2.65 */

/* Uprights, boards and what stands on them, against the wall at x = back, reaching `depth` into the room. */
static void bookcase(struct scene *s, double back, double depth, double from_y, double to_y, double height,
                     uint64_t place) {
    const double x = back + depth / 2, y = (from_y + to_y) / 2, wide = to_y - from_y;
    const int boards = 6;
    uint64_t draw = 0;
    scene_box(s, back + 0.01, y, height / 2, 0.02, wide, height, 0, 0); /* the back panel */
    for (int i = 0; i < 3; i++) {
        const double at = from_y + wide * i / 2;
        scene_box(s, x, at, height / 2, depth, 0.03, height, 0, 0.002);
    }
    for (int i = 0; i <= boards; i++) {
        const double z = 0.06 + (height - 0.08) * i / boards;
        scene_box(s, x, y, z, depth, wide, 0.025, 0, 0.002);
        if (i == boards) break;
        const double room = (height - 0.08) / boards - 0.03;
        for (double at = from_y + 0.05; at < to_y - 0.20;) {
            const double pick = scene_random(s, place, draw++, 0, 1);
            const double tall = room * scene_random(s, place, draw++, 0.55, 0.95);
            const double thick = scene_random(s, place, draw++, 0.05, 0.17);
            const double deep = depth * scene_random(s, place, draw++, 0.55, 0.9);
            const double base = z + 0.0125;
            if (fabs(at + thick / 2 - y) < thick / 2 + 0.025) { /* the middle upright */
                at = y + 0.03;
                continue;
            }
            if (pick < 0.62)
                scene_box(s, back + 0.02 + deep / 2, at + thick / 2, base + tall / 2, deep, thick - 0.006,
                          tall, 0, 0.003);
            else if (pick < 0.74)
                scene_tilted_box(s, back + 0.03 + deep / 2, at + thick / 2, base + tall / 2, deep, 0.04,
                                 tall * 0.9, 0, 0, 0.22, 0.003);
            else if (pick < 0.84)
                scene_cylinder(s, x, at + thick / 2, base + tall / 3, thick * 0.45, tall * 0.66, AXIS_Z,
                               0.004);
            else if (pick < 0.93)
                scene_sphere(s, x, at + thick / 2, base + thick * 0.45, thick * 0.45);
            at += thick + (pick > 0.7 ? 0.04 : 0.004);
        }
    }
}

/* A board on four legs. */
static void table(struct scene *s, double x, double y, double size_x, double size_y, double height,
                  double leg) {
    scene_box(s, x, y, height - 0.02, size_x, size_y, 0.04, 0, 0.006);
    for (int i = 0; i < 4; i++)
        scene_box(s, x + (i & 1 ? 1 : -1) * (size_x / 2 - leg), y + (i & 2 ? 1 : -1) * (size_y / 2 - leg),
                  (height - 0.03) / 2, leg, leg, height - 0.03, 0, 0.004);
}

/* Four bars and a sheet standing proud of a wall; `along` is the wall's direction, `wall` where it stands. */
static void picture(struct scene *s, int along, double a, double wall, double z, double wide, double tall) {
    const double deep = 0.035, bar = 0.04;
    for (int i = 0; i < 5; i++) {
        const double w = i < 2 ? wide + 2 * bar : (i < 4 ? bar : wide);
        const double h = i < 2 ? bar : tall;
        const double da = i == 2 ? -(wide + bar) / 2 : (i == 3 ? (wide + bar) / 2 : 0);
        const double dz = i == 0 ? -(tall + bar) / 2 : (i == 1 ? (tall + bar) / 2 : 0);
        const double d = i == 4 ? 0.02 : 2 * deep;
        if (along == AXIS_X)
            scene_box(s, a + da, wall, z + dz, w, d, h, 0, 0.004);
        else
            scene_box(s, wall, a + da, z + dz, d, w, h, 0, 0.004);
    }
}

static void west_side(struct scene *s) {
    bookcase(s, -2.4, 0.34, -1.75, 0.55, 2.15, 10);
    for (int i = 0; i < 6; i++) { /* boxes and a ball on top of it */
        const double tall = scene_random(s, 11, (uint64_t)i, 0.12, 0.38);
        if (i == 3)
            scene_sphere(s, -2.2, -1.5 + 0.36 * i, 2.16 + 0.15, 0.15);
        else
            scene_box(s, -2.2, -1.5 + 0.36 * i, 2.14 + tall / 2, 0.26, 0.27, tall,
                      scene_random(s, 12, (uint64_t)i, -0.3, 0.3), 0.004);
    }
    /* A lamp in the corner, an armchair in the other. */
    scene_cylinder(s, -1.95, -2.3, 0.02, 0.16, 0.04, AXIS_Z, 0.008);
    scene_cylinder(s, -1.95, -2.3, 0.75, 0.018, 1.5, AXIS_Z, 0);
    scene_cone(s, -1.95, -2.3, 1.6, 0.22, 0.12, 0.32);
    const double turn = scene_random(s, 13, 0, -0.5, -0.15);
    scene_box(s, -1.75, 1.25, 0.22, 0.7, 0.65, 0.44, turn, 0.04);
    scene_box(s, -2.03, 1.42, 0.6, 0.16, 0.65, 0.75, turn, 0.05);
    scene_box(s, -1.62, 1.56, 0.42, 0.6, 0.14, 0.34, turn, 0.04);
    scene_cylinder(s, -2.2, 1.6, 1.4, 0.06, 2.8, AXIS_Z, 0); /* a pipe, floor to ceiling */
    scene_cylinder(s, -2.32, 1.1, 2.5, 0.05, 1.5, AXIS_Y, 0);
    picture(s, AXIS_Y, 1.1, -2.4, 1.6, 0.45, 0.55);
}

static void east_side(struct scene *s) {
    table(s, 2.3, -0.35, 0.75, 1.7, 0.74, 0.06);
    scene_box(s, 2.45, -0.35, 0.76, 0.18, 0.26, 0.02, 0, 0.006); /* a screen on its foot */
    scene_cylinder(s, 2.47, -0.35, 0.86, 0.02, 0.22, AXIS_Z, 0);
    scene_tilted_box(s, 2.44, -0.35, 1.13, 0.035, 0.62, 0.38, 0.1, 0.08, 0, 0.006);
    scene_box(s, 2.12, -0.35, 0.755, 0.14, 0.44, 0.03, 0.05, 0.006);
    for (int i = 0; i < 7; i++) { /* a pile of books, each turned a little */
        const double turn = scene_random(s, 20, (uint64_t)i, -0.35, 0.35);
        scene_box(s, 2.35, 0.25, 0.755 + 0.035 * i, 0.2, 0.27, 0.034, turn, 0.003);
    }
    scene_cylinder(s, 2.15, -0.85, 0.79, 0.042, 0.1, AXIS_Z, 0.004);
    scene_sphere(s, 2.45, -1.0, 0.74 + 0.14, 0.14);
    scene_cylinder(s, 2.1, 0.05, 0.80, 0.035, 0.12, AXIS_Z, 0.004);
    /* A window: frame, cross, sill, and curtains of hanging folds. */
    for (int i = 0; i < 3; i++) {
        scene_box(s, 2.68, -0.35 + (i - 1) * 0.6, 1.8, 0.1, 0.06, 1.1, 0, 0.006);
        scene_box(s, 2.68, -0.35, 1.8 + (i - 1) * 0.55, 0.1, 1.26, 0.06, 0, 0.006);
    }
    scene_box(s, 2.6, -0.35, 1.21, 0.24, 1.4, 0.03, 0, 0.006);
    scene_cylinder(s, 2.55, -0.35, 2.48, 0.015, 2.3, AXIS_Y, 0);
    for (int i = 0; i < 7; i++) {
        const double fold = scene_random(s, 21, (uint64_t)i, 0.035, 0.06);
        scene_cylinder(s, 2.55, -1.05 - 0.085 * i, 1.4, fold, 2.1, AXIS_Z, 0);
        scene_cylinder(s, 2.55, 0.36 + 0.085 * i, 1.4, scene_random(s, 22, (uint64_t)i, 0.035, 0.06), 2.1,
                       AXIS_Z, 0);
    }
    scene_cylinder(s, 2.45, 1.5, 1.4, 0.16, 2.8, AXIS_Z, 0); /* a pillar with foot and head */
    scene_box(s, 2.45, 1.5, 0.1, 0.42, 0.42, 0.2, 0, 0.01);
    scene_box(s, 2.45, 1.5, 2.72, 0.42, 0.42, 0.16, 0, 0.01);
    /* A plant in its pot. */
    scene_cone(s, 2.35, -2.3, 0.2, 0.14, 0.2, 0.4);
    scene_cylinder(s, 2.35, -2.3, 0.7, 0.03, 0.7, AXIS_Z, 0);
    for (int i = 0; i < 9; i++)
        scene_sphere(s, 2.35 + scene_random(s, 23, (uint64_t)i, -0.2, 0.2),
                     -2.3 + scene_random(s, 24, (uint64_t)i, -0.2, 0.2),
                     1.0 + scene_random(s, 25, (uint64_t)i, 0, 0.7),
                     scene_random(s, 26, (uint64_t)i, 0.08, 0.17));
}

static void north_side(struct scene *s) {
    /* A door: two jambs, a lintel, a leaf with four panels and a handle. */
    for (int i = 0; i < 2; i++) scene_box(s, 1.1 + (i ? 0.48 : -0.48), 1.78, 1.05, 0.09, 0.16, 2.1, 0, 0.006);
    scene_box(s, 1.1, 1.78, 2.13, 1.05, 0.16, 0.1, 0, 0.006);
    scene_box(s, 1.1, 1.8, 1.03, 0.88, 0.06, 2.06, 0, 0);
    for (int i = 0; i < 4; i++)
        scene_box(s, 1.1 + (i & 1 ? 0.2 : -0.2), 1.765, i & 2 ? 1.5 : 0.55, 0.28, 0.04, i & 2 ? 0.9 : 0.7, 0,
                  0.008);
    scene_sphere(s, 0.74, 1.72, 1.03, 0.035);
    /* A cabinet with doors, and vases on it. */
    scene_box(s, -0.45, 1.57, 0.46, 1.5, 0.46, 0.8, 0, 0.006);
    for (int i = 0; i < 3; i++) scene_box(s, -0.93 + 0.48 * i, 1.335, 0.46, 0.44, 0.03, 0.7, 0, 0.004);
    scene_box(s, -0.45, 1.56, 0.88, 1.56, 0.5, 0.04, 0, 0.006);
    for (int i = 0; i < 6; i++) {
        const double x = -1.05 + 0.24 * i, wide = scene_random(s, 30, (uint64_t)i, 0.05, 0.1);
        const double tall = scene_random(s, 31, (uint64_t)i, 0.12, 0.36);
        if (i % 3 == 0)
            scene_cone(s, x, 1.55, 0.9 + tall / 2, wide, wide * 0.5, tall);
        else if (i % 3 == 1)
            scene_cylinder(s, x, 1.5, 0.9 + tall / 2, wide, tall, AXIS_Z, 0.01);
        else
            scene_sphere(s, x, 1.55, 0.9 + wide, wide);
    }
    picture(s, AXIS_X, -0.85, 1.8, 1.75, 0.5, 0.65);
    picture(s, AXIS_X, 0.05, 1.8, 1.65, 0.6, 0.42);
    scene_box(s, -1.55, 1.72, 1.9, 0.5, 0.2, 0.03, 0, 0.004);
    scene_cone(s, -1.5, 1.7, 2.04, 0.07, 0.04, 0.24);
    scene_box(s, 0.0, 1.74, 2.3, 1.0, 0.16, 0.12, 0, 0.02); /* a duct */
    scene_cylinder(s, 1.75, 1.72, 1.35, 0.05, 2.7, AXIS_Z, 0);
    for (int i = 0; i < 3; i++) scene_box(s, 2.0, 1.76, 1.1 + 0.25 * i, 0.18, 0.1, 0.14, 0, 0.01);
}

static void south_side(struct scene *s) {
    /* A sofa with cushions. */
    scene_box(s, 0.25, -2.33, 0.22, 2.1, 0.7, 0.36, 0, 0.03);
    scene_box(s, 0.25, -2.6, 0.55, 2.1, 0.2, 0.6, 0, 0.05);
    for (int i = 0; i < 2; i++)
        scene_box(s, 0.25 + (i ? 1.06 : -1.06), -2.34, 0.33, 0.18, 0.72, 0.56, 0, 0.05);
    for (int i = 0; i < 4; i++)
        scene_tilted_box(s, -0.5 + 0.5 * i, -2.42, 0.58, 0.42, 0.13, 0.4,
                         scene_random(s, 40, (uint64_t)i, -0.4, 0.4), 0, -0.3, 0.05);
    picture(s, AXIS_X, -0.45, -2.7, 1.6, 0.55, 0.4);
    picture(s, AXIS_X, 0.85, -2.7, 1.75, 0.4, 0.6);
    /* A wall shelf with things on it. */
    scene_box(s, 0.3, -2.58, 2.12, 2.2, 0.24, 0.035, 0, 0.004);
    for (int i = 0; i < 9; i++) {
        const double x = -0.65 + 0.24 * i, wide = scene_random(s, 41, (uint64_t)i, 0.08, 0.18);
        const double tall = scene_random(s, 42, (uint64_t)i, 0.1, 0.34);
        if (i % 4 == 1)
            scene_sphere(s, x, -2.58, 2.137 + wide / 2, wide / 2);
        else if (i % 4 == 3)
            scene_cylinder(s, x, -2.58, 2.137 + tall / 2, wide / 2, tall, AXIS_Z, 0.006);
        else
            scene_box(s, x, -2.58, 2.137 + tall / 2, wide, 0.18, tall, 0, 0.004);
    }
    scene_box(s, -1.2, -2.62, 1.4, 0.24, 0.3, 2.8, 0, 0.008); /* a pilaster */
    scene_box(s, 1.75, -2.64, 1.4, 0.2, 0.24, 2.8, 0, 0.008);
    scene_box(s, 1.75, -2.55, 1.2, 0.3, 0.3, 0.08, 0, 0.008);
}

static void floor_and_ceiling(struct scene *s) {
    /* On the floor nothing rises above 0.58 m within the free box. */
    scene_box(s, 0.15, -0.5, 0.008, 2.2, 1.5, 0.024, scene_random(s, 50, 0, -0.1, 0.1), 0.004);
    table(s, 0.2, -0.45, 1.0, 0.6, 0.4, 0.05);
    scene_box(s, 0.0, -0.4, 0.42, 0.3, 0.21, 0.05, scene_random(s, 50, 1, -0.6, 0.6), 0.003);
    scene_box(s, 0.0, -0.4, 0.46, 0.25, 0.18, 0.04, scene_random(s, 50, 2, -0.6, 0.6), 0.003);
    scene_sphere(s, 0.42, -0.5, 0.48, 0.09);
    scene_cylinder(s, 0.25, -0.25, 0.45, 0.045, 0.1, AXIS_Z, 0.004);
    scene_cylinder(s, -0.75, 0.45, 0.22, 0.2, 0.44, AXIS_Z, 0.02); /* stools, boxes, balls */
    scene_cylinder(s, 1.2, -1.25, 0.2, 0.17, 0.4, AXIS_Z, 0.02);
    scene_box(s, 1.2, 0.65, 0.16, 0.4, 0.3, 0.34, scene_random(s, 50, 3, -0.8, 0.8), 0.004);
    scene_box(s, 1.22, 0.62, 0.4, 0.28, 0.22, 0.16, scene_random(s, 50, 4, -0.8, 0.8), 0.004);
    scene_box(s, -0.95, -1.35, 0.14, 0.36, 0.46, 0.3, scene_random(s, 50, 5, -0.8, 0.8), 0.004);
    scene_sphere(s, -0.3, 0.75, 0.14, 0.14);
    scene_sphere(s, 0.35, 0.6, 0.1, 0.1);
    scene_sphere(s, -1.3, -0.6, 0.16, 0.16);
    scene_box(s, 0.5, -1.5, 0.05, 0.5, 0.3, 0.12, scene_random(s, 50, 6, -0.5, 0.5), 0.03);
    /* Skirting along each wall. */
    scene_box(s, 0.15, 1.8, 0.05, 5.1, 0.04, 0.12, 0, 0.004);
    scene_box(s, 0.15, -2.7, 0.05, 5.1, 0.04, 0.12, 0, 0.004);
    scene_box(s, -2.4, -0.45, 0.05, 0.04, 4.5, 0.12, 0, 0.004);
    scene_box(s, 2.7, -0.45, 0.05, 0.04, 4.5, 0.12, 0, 0.004);
    /* Beams, each of its own width, no two gaps the same; lamps and a smoke detector between them. */
    for (int i = 0; i < 5; i++) {
        const double x = -1.95 + 0.98 * i + scene_random(s, 51, (uint64_t)i, -0.12, 0.12);
        scene_box(s, x, -0.45, 2.76, scene_random(s, 52, (uint64_t)i, 0.08, 0.16), 4.5, 0.16, 0, 0.006);
    }
    scene_box(s, 0.15, -1.35 + scene_random(s, 53, 0, -0.15, 0.15), 2.77, 5.1, 0.11, 0.15, 0, 0.006);
    scene_box(s, 0.15, 0.35 + scene_random(s, 53, 1, -0.15, 0.15), 2.78, 5.1, 0.09, 0.1, 0, 0.006);
    scene_cylinder(s, -0.45, -0.5, 2.76, 0.17, 0.14, AXIS_Z, 0.02);
    scene_cylinder(s, 0.6, -0.75, 2.77, 0.11, 0.1, AXIS_Z, 0.02);
    scene_sphere(s, 0.55, 0.75, 2.84, 0.16);
    scene_sphere(s, -0.5, 0.95, 2.83, 0.14);
    scene_sphere(s, -0.4, -1.75, 2.83, 0.15);
    scene_box(s, 1.05, -0.35, 2.79, 0.5, 0.3, 0.12, 0.3, 0.01);
    scene_box(s, 0.6, -1.9, 2.79, 0.35, 0.35, 0.1, 0.6, 0.01);
    scene_box(s, -1.4, 0.8, 2.75, 0.4, 0.3, 0.2, 0, 0.01);
}

void scene_furnish_room(struct scene *s) {
    west_side(s);
    east_side(s);
    north_side(s);
    south_side(s);
    floor_and_ceiling(s);
}

/* ---- The desk top ---- */

static void desk_things(struct scene *s, double top) {
    for (int row = 0; row < 4; row++) /* a keyboard, key by key */
        for (int key = 0; key < 13; key++)
            scene_box(s, -0.17 + 0.028 * key + 0.006 * row, -0.24 + 0.028 * row, top + 0.022, 0.022, 0.022,
                      0.014, 0, 0.003);
    scene_box(s, 0.01, -0.198, top + 0.006, 0.42, 0.14, 0.018, 0, 0.004);
    scene_box(s, 0.32, -0.2, top + 0.015, 0.062, 0.105, 0.034, 0.15, 0.014);
    for (int i = 0; i < 6; i++) {
        const double turn = scene_random(s, 60, (uint64_t)i, -0.3, 0.3);
        scene_box(s, -0.48, 0.1, top + 0.017 + 0.033 * i, 0.17, 0.24, 0.032, turn, 0.003);
    }
    scene_sphere(s, -0.47, 0.1, top + 0.2 + 0.05, 0.055);
    scene_cylinder(s, 0.42, 0.02, top + 0.048, 0.041, 0.1, AXIS_Z, 0.004); /* a mug and its handle */
    scene_box(s, 0.475, 0.02, top + 0.05, 0.05, 0.012, 0.055, 0, 0.005);
    scene_cylinder(s, 0.6, 0.22, top + 0.06, 0.045, 0.12, AXIS_Z, 0.004); /* pens in a pot */
    for (int i = 0; i < 5; i++)
        scene_tilted_box(s, 0.6 + 0.012 * (i - 2), 0.22 + 0.01 * (i % 2), top + 0.13, 0.008, 0.008, 0.15, 0,
                         0.12 * (i - 2), 0.1 * (i % 3 - 1), 0.003);
    scene_cylinder(s, 0.0, 0.24, top + 0.01, 0.11, 0.02, AXIS_Z, 0.004); /* a screen */
    scene_box(s, 0.0, 0.27, top + 0.12, 0.05, 0.025, 0.22, 0, 0.004);
    scene_tilted_box(s, 0.0, 0.25, top + 0.32, 0.58, 0.03, 0.34, 0, 0, 0.08, 0.006);
    scene_cylinder(s, -0.68, 0.3, top + 0.012, 0.09, 0.024, AXIS_Z, 0.004); /* a lamp */
    scene_tilted_box(s, -0.66, 0.28, top + 0.2, 0.02, 0.02, 0.4, 0, 0.12, 0.1, 0.004);
    scene_cone(s, -0.6, 0.24, top + 0.42, 0.1, 0.045, 0.11);
    for (int i = 0; i < 14; i++) { /* small things, strewn */
        const double x = scene_random(s, 61, (uint64_t)i, -0.72, 0.72),
                     y = scene_random(s, 62, (uint64_t)i, -0.38, 0.15);
        const double r = scene_random(s, 63, (uint64_t)i, 0.015, 0.035);
        if (fabs(x) < 0.28 && y < -0.05) continue; /* not on the keyboard */
        if (i % 3 == 0)
            scene_sphere(s, x, y, top + r, r);
        else if (i % 3 == 1)
            scene_cylinder(s, x, y, top + r, r, 2 * r, AXIS_Z, 0.003);
        else
            scene_box(s, x, y, top + r, 3 * r, 2 * r, 2 * r, 7 * x, 0.004);
    }
    scene_tilted_box(s, 0.62, -0.12, top + 0.05, 0.2, 0.15, 0.09, 0.5, 0, 0, 0.004);
    scene_cylinder(s, 0.62, -0.12, top + 0.115, 0.05, 0.04, AXIS_Z, 0.01);
    scene_tilted_box(s, -0.42, -0.2, top + 0.02, 0.21, 0.297, 0.022, -0.3, 0.06, 0, 0.002);
    scene_cone(s, 0.24, 0.1, top + 0.05, 0.05, 0.02, 0.1);
}

void scene_furnish_desk(struct scene *s) {
    const double top = 0.75;
    table(s, 0.0, 0.0, 1.6, 0.9, top, 0.06);
    desk_things(s, top);
    /* The background, for the rays that pass over the desk. */
    bookcase(s, -2.0, 0.3, -1.2, 0.9, 1.9, 64);
    picture(s, AXIS_X, -0.55, 1.3, 1.5, 0.6, 0.45);
    picture(s, AXIS_X, 0.6, 1.3, 1.45, 0.45, 0.6);
    scene_box(s, 0.1, 1.18, 1.05, 1.8, 0.24, 0.03, 0, 0.004);
    for (int i = 0; i < 6; i++)
        scene_box(s, -0.6 + 0.27 * i, 1.2, 1.065 + 0.1, 0.08 + 0.02 * (i % 3), 0.16, 0.2, 0, 0.004);
    scene_cylinder(s, 1.6, 0.9, 1.25, 0.12, 2.5, AXIS_Z, 0);
    scene_box(s, 1.7, -0.4, 0.35, 0.45, 0.9, 0.7, 0, 0.01);
    scene_box(s, 0.9, 0.75, 0.25, 0.4, 0.5, 0.5, 0.3, 0.01);
    scene_box(s, -0.8, 0.8, 0.2, 0.5, 0.4, 0.4, -0.2, 0.01);
    scene_box(s, 0.0, -0.3, 0.01, 2.6, 1.7, 0.03, 0, 0.004);
}
