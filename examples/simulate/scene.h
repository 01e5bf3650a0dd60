/* The simulated scenes: unions of convex solids inside a closed box, as signed distances known in closed
 * form, so that the error of a reconstructed surface is simply |scene_distance| at its vertices. World axes:
 * metres, z up, floor z=0. */
#ifndef FATHOM_SCENE_H
#define FATHOM_SCENE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum scene_kind { SCENE_ROOM, SCENE_WALL, SCENE_DESK, SCENE_CORRIDOR };

/* The solids. In its own axes each is centred on the origin; all are convex, which the renderer relies on:
 * along a ray the distance to a convex solid is a convex function (it is the distance to a convex set). */
enum solid_kind {
    SOLID_BOX, /* half sizes a, b, c along x, y, z, edges rounded with radius `round` (within the half sizes)
                */
    SOLID_SPHERE,   /* radius a */
    SOLID_CYLINDER, /* radius a, half length c along z, rim rounded with radius `round` */
    SOLID_CONE      /* frustum along z, radius a at -c and b at +c */
};

struct solid {
    enum solid_kind kind;
    double a, b, c, round;
    double centre[3];
    double axes[9]; /* row-major; rows are the solid's axes in the world, so local = axes (world - centre) */
    double bound;   /* radius of a sphere about the centre that holds the solid */
    double low_x, high_x; /* reach along the world's x */
};

struct scene {
    enum scene_kind kind;
    uint64_t seed;
    double low[3], high[3]; /* the closed box: inside of the floor, ceiling and walls */
    double length;          /* corridor only, metres; else 0 */
    struct solid *solids;   /* sorted by low_x */
    size_t count, capacity;
    double widest; /* largest high_x - low_x of all solids */
    bool failed;   /* out of memory while building */
};

/* The kind called `name` ("room", "wall", "desk", "corridor"); false when there is none. */
bool scene_kind_of(const char *name, enum scene_kind *kind);
const char *scene_name(enum scene_kind kind);

/* Builds a scene. The seed moves and sizes its furniture; length (metres, minimum 4) is the corridor's, ignored for
 * other scenes. False when out of memory. scene_free releases it. */
bool scene_make(struct scene *scene, enum scene_kind kind, uint64_t seed, double length);
void scene_free(struct scene *scene);

/* Signed distance in metres to the nearest surface, positive in the free space. Exact in the free space (a
 * minimum of exact distances); inside solids exact wherever they don't overlap. */
double scene_distance(const struct scene *scene, double x, double y, double z);

/* Unit gradient of scene_distance: on a surface, its normal towards the free space. By central differences.
 */
void scene_normal(const struct scene *scene, double x, double y, double z, double normal[3]);

/* Distance from a point in the solid's own axes to the solid. */
double solid_distance(const struct solid *solid, double x, double y, double z);

/* For the builders (scene_*.c): each adds a solid; a failure only sets scene->failed. */
enum { AXIS_X, AXIS_Y, AXIS_Z };
void scene_box(struct scene *scene, double x, double y, double z, double size_x, double size_y, double size_z,
               double yaw, double round);
void scene_tilted_box(struct scene *scene, double x, double y, double z, double size_x, double size_y,
                      double size_z, double yaw, double pitch, double roll, double round);
void scene_sphere(struct scene *scene, double x, double y, double z, double radius);
void scene_cylinder(struct scene *scene, double x, double y, double z, double radius, double length, int axis,
                    double round);
void scene_cone(struct scene *scene, double x, double y, double z, double low_radius, double high_radius,
                double height);

/* A uniform number in [low, high) that depends on the scene's seed and the two indices only. */
double scene_random(const struct scene *scene, uint64_t place, uint64_t index, double low, double high);

/* Furnish the box: scene_rooms.c (room, desk), scene_passages.c (wall, corridor). */
void scene_furnish_room(struct scene *scene);
void scene_furnish_desk(struct scene *scene);
void scene_furnish_wall(struct scene *scene);
void scene_furnish_corridor(struct scene *scene);

/* Half the length, along the world's x about 0, that the wall scene leaves bare, metres; and the y of that
 * wall. */
#define SCENE_WALL_BARE 1.2
#define SCENE_WALL_Y 1.2

#endif
