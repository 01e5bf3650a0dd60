/* The verdict "tracking" of Section 2, last paragraph: is an alignment to be trusted? */
#ifndef FATHOM_QUALITY_H
#define FATHOM_QUALITY_H

#include "align/align.h"
#include "tracking/predicted_view.h"

/* Fewer pairs are too few, of a map with so many pixels. */
int least_pairs(const fathom_config *config, int pixels);

/* innovation: the distance from seed to result in units of the seed's sigma. */
fathom_verdict judge(const fathom_config *config, const alignment *a, double innovation);

/* The same of what the surface should look like from the found pose. */
fathom_verdict judge_view(const fathom_config *config, const comparison *k);

/* And of the found pose's covariance, rotation then translation. */
fathom_verdict judge_certainty(const fathom_config *config, const double covariance[36]);

#endif
