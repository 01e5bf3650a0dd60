/* The picture of a scan: the surface, shaded, seen from above and behind the camera's path, with the path in it. */
#ifndef FATHOM_CLI_PICTURE_H
#define FATHOM_CLI_PICTURE_H

#include <stdbool.h>

#include "fathom/replay/path.h"

/* Writes the PNG; false after an error message (then there is no file). */
bool picture_write(fathom *context, const struct path *path, const char *file);

#endif
