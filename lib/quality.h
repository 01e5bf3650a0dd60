/* The verdict "tracking" of Section 2, last paragraph: is an alignment to be trusted? */
#ifndef FATHOM_QUALITY_H
#define FATHOM_QUALITY_H

#include "align.h"

/* innovation: the distance from seed to result in units of the seed's sigma. */
fathom_verdict judge(const fathom_config *config, const alignment *a, double innovation);

#endif
