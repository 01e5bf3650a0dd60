/* Views of the surface, and the projection of points into them. */
#ifndef FATHOM_CLI_VIEW_H
#define FATHOM_CLI_VIEW_H

#include "fathom.h"

/* A view of that size with the focal length in multiples of its width and the identity pose. */
fathom_view view_of(int width, int height, double focal_widths);

/* Pixel and depth of a point of the world; false when it is behind the view. */
bool view_project(const fathom_view *view, const float world[3], float out[3]);

#endif
