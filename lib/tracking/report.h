/* The fields of fathom_result that describe a frame's alignment. */
#ifndef FATHOM_REPORT_H
#define FATHOM_REPORT_H

#include "tracking/track.h"

void report_alignment(const attempt *a, const tracking_cost *cost, fathom_result *r);

#endif
