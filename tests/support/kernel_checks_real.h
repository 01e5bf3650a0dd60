/* A further kernel check: every kernel on a frame of a real recording. Skipped where ../shared/data/kitchen isn't there. */
#ifndef KERNEL_CHECKS_REAL_H
#define KERNEL_CHECKS_REAL_H

#include "selftest/kernel_checks.h"

fathom_check check_real_frame(device *d, bool small, char *why, size_t size);

#endif
