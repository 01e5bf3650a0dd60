/* Chooses a viewpoint for a scan. */
#ifndef FATHOM_CLI_OVERVIEW_H
#define FATHOM_CLI_OVERVIEW_H

#include "fathom/replay/path.h"

/* Sets the view's pose and depths; its size and intrinsics are the caller's. Returns FATHOM_OK or an error of the
 * library's; FATHOM_ERROR_NO_DATA when the scan is empty. */
int overview_choose(fathom *context, const struct path *path, fathom_view *view);

#endif
