/* The absolute trajectory error against reference poses. */
#ifndef FATHOM_CLI_EVALUATE_H
#define FATHOM_CLI_EVALUATE_H

#include "fathom_drivers.h"
#include "fathom/replay/path.h"

/* The root mean square distance between two sets of points after the rigid alignment of the first that minimises it
 * (Horn 1987, "Closed-form solution of absolute orientation using unit quaternions"; no scale). NAN below three points,
 * which can nearly always be aligned. */
double evaluate_rmse(const double (*estimate)[3], const double (*truth)[3], int count);

/* The same over all poses of the path that the recording has a reference pose for. NAN without any. */
double evaluate_ate(const fathom_recording *recording, const struct path *path);

#endif
