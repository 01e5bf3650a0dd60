/* Chooses where to look at a scan from. */
#ifndef FATHOM_CLI_OVERVIEW_H
#define FATHOM_CLI_OVERVIEW_H

#include "fathom/replay/path.h"

/* Sets the view's pose and depths; its size and intrinsics are the caller's. Returns FATHOM_OK or an error of
 * the library's; FATHOM_ERROR_NO_DATA when there is nothing to look at. */
int overview_choose(fathom *context, const struct path *path, fathom_view *view);

#endif
