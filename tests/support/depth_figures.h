/* Figures of a depth camera's errors that hardly depend on the scene, so that a recording and a simulation of another
 * scene can be compared. */
#ifndef FATHOM_DEPTH_FIGURES_H
#define FATHOM_DEPTH_FIGURES_H

#include <stdint.h>

#include "simulate/render.h"

/* A depth frame. */
struct depth_view {
    const struct render_camera *camera;
    struct camera_pose pose;   /* camera to world */
    const float *depth;        /* metres, 0 where there is none */
    const uint8_t *confidence; /* pixels below 2 don't count, save for edges; NULL: all count */
    const float *truth;        /* edges count where they are sharp in it; NULL: everywhere */
};

#define FIGURE_DEPTHS 4 /* from 0.5, 1, 2 and 3 to 4 m */
extern const double figure_depths[FIGURE_DEPTHS + 1];
enum { FACING, SLANTED, FIGURE_ANGLES }; /* below 25 degrees of incidence, 45 to 75 */
#define FIGURE_STEPS 3                   /* of 0.15, 0.3 and 0.6 to 2 times the near side's depth */
#define FIGURE_CHANGES 2000

struct depth_figures {
    long changes[FIGURE_ANGLES][FIGURE_DEPTHS][FIGURE_CHANGES + 1]; /* how many of each size, in 1e-5 */
    double second_sum[FIGURE_DEPTHS];
    long second_count[FIGURE_DEPTHS];
    double width_sum[FIGURE_DEPTHS][FIGURE_STEPS];
    long width_count[FIGURE_DEPTHS][FIGURE_STEPS];
};

/* Flicker: how a surface's depth changes from one frame to another, apart from what the poses say. */
void depth_figures_pair(struct depth_figures *figures, const struct depth_view *before,
                        const struct depth_view *after);

/* Second differences along rows and columns. */
void depth_figures_second(struct depth_figures *figures, const struct depth_view *view);

/* Smear: over how many pixels a step of depth goes from 10 to 90 %, where both sides are flat. */
void depth_figures_edges(struct depth_figures *figures, const struct depth_view *view);

/* The median of |change| / depth; NAN with few pixels. */
double depth_figures_flicker(const struct depth_figures *figures, int angle, int depth);

/* The mean of |z[i-1] - 2 z[i] + z[i+1]|, each counted as at most 0.3 % of the depth, metres; NAN with few pixels. */
double depth_figures_second_difference(const struct depth_figures *figures, int depth);

/* The mean width, pixels, of steps by their near side's depth, as if there were as many of each height as `like` has.
 * Heights are left out of which either has few; NAN when all are. */
double depth_figures_width(const struct depth_figures *figures, int depth, const struct depth_figures *like);

#endif
